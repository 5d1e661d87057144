"""Measures of the error of an estimate of M against a reference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, RenderError

Array = npt.NDArray[Any]

NO_FLIP = "flip-evaluator is not installed"
"""Why FLIP may be missing: the package has no wheel for some machines and versions of Python."""
_ROUNDING = 2.0**-20  # of the peak: smaller differences come from the rounding of float32 sums


@dataclass(frozen=True)
class Errors:
    """Errors of an estimate of M against a reference, over the pixels that show an object. None means undefined."""

    rel_rmse: float | None
    """Root mean square of the difference over that of the reference, of pixels and channels. None if the reference is
    black."""
    psnr: float | None
    """dB, with the reference's maximum as peak, over the pixels that differ (Maisch & Ropinski 2017, section 5.2).
    inf if no pixel differs."""
    psnr_all: float | None
    """dB, the same over all pixels that show an object."""
    bias: float | None
    """Mean of the estimate over the mean of the reference. Below 1, the estimate is too dark."""
    flip: float | None
    """Mean FLIP of the tone-mapped images (Andersson et al. 2020), 0 to 1. None without images, see `flip_reason`."""
    floor: float | None
    """The rel_rmse that the reference's own error accounts for."""
    flip_reason: str | None = None
    """Why FLIP was asked for and is missing."""

    def json(self) -> dict[str, float | str | None]:
        """Return the numbers for JSON: null if undefined or infinite, and `flip_reason` only if there is one."""
        names = ("rel_rmse", "psnr", "psnr_all", "bias", "flip", "floor")
        reason = {"flip_reason": self.flip_reason} if self.flip_reason else {}
        return {**{name: finite(getattr(self, name)) for name in names}, **reason}


def errors(
    M: Array,
    reference: Array,
    mask: Array,
    *,
    error: Array | None = None,
    display: Array | None = None,
    reference_display: Array | None = None,
) -> Errors:
    """Measure `M` (H, W, 3) in W/m^2 against `reference`, where `mask` (H, W) is true.

    Args:
        error: (H, W, 3), the reference's own error, as in `Estimate`.
        display, reference_display: the tone-mapped images, uint8 (H, W, 3), or (H, W, 4) with coverage.

    Raises InputError if the mask is empty or shapes differ, and RenderError if a number is not finite.
    """
    _check(M, reference, mask, error)
    a, b = np.asarray(M, np.float64)[mask], np.asarray(reference, np.float64)[mask]
    difference = a - b
    rms, peak = _rms(b), float(b.max())
    pictures = None if display is None or reference_display is None else (display, reference_display)
    has_flip = find_spec("flip_evaluator") is not None
    differ = (np.abs(difference) > _ROUNDING * np.abs(b).max()).any(axis=-1)
    return Errors(
        rel_rmse=_rms(difference) / rms if rms > 0.0 else None,
        psnr=_psnr(difference[differ], peak),
        psnr_all=_psnr(difference if differ.any() else difference[:0], peak),
        bias=float(a.mean() / b.mean()) if b.mean() > 0.0 else None,
        flip=_flip(*pictures, mask) if pictures and has_flip else None,
        flip_reason=NO_FLIP if pictures and not has_flip else None,
        floor=0.0 if error is None else _rms(np.asarray(error, np.float64)[mask]) / rms if rms > 0.0 else None,
    )


def error_map(M: Array, reference: Array, mask: Array) -> Array:
    """Return the luminance of |M - reference| over the root mean square of the reference's luminance, float64 (H, W).

    It is 0 outside the mask. If the reference is black, it is not divided.
    """
    scale = _rms(luminance(reference)[mask]) or 1.0
    return np.where(mask, luminance(np.abs(np.asarray(M, np.float64) - reference)) / scale, 0.0)


def finite(value: float | None) -> float | None:
    """Return a number, or None if it is undefined or infinite."""
    return value if value is not None and math.isfinite(value) else None


def luminance(rgb: Array) -> Array:
    """Return the luminance (...) of linear Rec. 709 colours (..., 3)."""
    return np.asarray(rgb, np.float64) @ (0.2126, 0.7152, 0.0722)


def over_black(display: Array) -> Array:
    """Composite an image over black: uint8 (H, W, 3) from an image with or without coverage in a fourth channel."""
    if display.shape[-1] == 3:
        return display
    return np.round(display[..., :3] * (display[..., 3:] / 255.0)).astype(np.uint8)


def _check(M: Array, reference: Array, mask: Array, error: Array | None) -> None:
    if not mask.any():
        raise InputError("no pixel shows an object, so there is nothing to compare")
    for name, values in (("M", M), ("M of the reference", reference), ("the reference's error", error)):
        if values is None:
            continue
        if values.shape != (*mask.shape, 3):
            raise InputError(f"{name} is of shape {values.shape}, not {(*mask.shape, 3)}")
        bad = ~np.isfinite(values[mask]).all(axis=-1)
        if bad.any():
            y, x = np.argwhere(mask)[bad][0]
            raise RenderError(f"{int(bad.sum())} pixels of {name} are not finite, the first at x {x}, y {y}")


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if values.size else 0.0


def _psnr(difference: Array, peak: float) -> float | None:
    """Return the PSNR in dB. It is inf if there are no differences."""
    if peak <= 0.0:
        return None
    return 20.0 * math.log10(peak / _rms(difference)) if difference.size else math.inf


def _flip(display: Array, reference: Array, mask: Array) -> float:
    import flip_evaluator

    pictures = [over_black(image).astype(np.float32) / 255.0 for image in (reference, display)]
    difference, _, _ = flip_evaluator.evaluate(*pictures, "LDR", applyMagma=False, computeMeanError=False)
    return float(np.mean(np.asarray(difference)[mask]))
