"""How far an estimate of M is from a reference, in numbers."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, RenderError

Array = npt.NDArray[Any]

NO_FLIP = "flip-evaluator is not installed"
"""why there may be no FLIP: the package has no wheel for some machines and versions of Python"""
_ROUNDING = 2.0**-20  # of the peak: what differs by less, differs by how sums in float32 were rounded


@dataclass(frozen=True)
class Errors:
    """An estimate of M against a reference, over the pixels that show an object. None: the measure has no meaning."""

    rel_rmse: float | None
    """root mean square of the difference over that of the reference, of pixels and channels; None: it is black"""
    psnr: float | None
    """dB, by the reference's maximum, over the pixels that differ (000 section 5.2); inf: none does"""
    psnr_all: float | None
    """dB, the same over all pixels that show an object"""
    bias: float | None
    """mean of the estimate over that of the reference: below 1 it is too dark"""
    flip: float | None
    """mean FLIP of the tone-mapped images (Andersson et al. 2020), 0 to 1; None without images, and where `flip_reason`
    says why"""
    floor: float | None
    """the rel_rmse that the reference's own error accounts for"""
    flip_reason: str | None = None
    """why FLIP was asked for and is missing"""

    def json(self) -> dict[str, float | str | None]:
        """What JSON can hold: null for what is undefined or infinite, `flip_reason` only where there is one."""
        found = asdict(self)
        reason = found.pop("flip_reason")
        numbers = {key: value if value is not None and math.isfinite(value) else None for key, value in found.items()}
        return {**numbers, **({"flip_reason": reason} if reason else {})}


def errors(
    M: Array,
    reference: Array,
    seen: Array,
    *,
    error: Array | None = None,
    display: Array | None = None,
    reference_display: Array | None = None,
) -> Errors:
    """Measure `M` (H, W, 3) in W/m^2 against `reference`, where `seen` (H, W) is true.

    `error` (H, W, 3) is the reference's own, as of `Estimate`. `display` and `reference_display`, uint8 (H, W, 3) or
    with coverage (H, W, 4), are the tone-mapped images.

    Raises InputError where nothing is seen or shapes differ, RenderError where a number is not finite.
    """
    _check(M, reference, seen, error)
    a, b = np.asarray(M, np.float64)[seen], np.asarray(reference, np.float64)[seen]
    difference = a - b
    rms, peak = _rms(b), float(b.max())
    pictures = None if display is None or reference_display is None else (display, reference_display)
    with_flip = find_spec("flip_evaluator") is not None
    differ = (np.abs(difference) > _ROUNDING * np.abs(b).max()).any(axis=-1)
    return Errors(
        rel_rmse=_rms(difference) / rms if rms > 0.0 else None,
        psnr=_psnr(difference[differ], peak),
        psnr_all=_psnr(difference if differ.any() else difference[:0], peak),
        bias=float(a.mean() / b.mean()) if b.mean() > 0.0 else None,
        flip=_flip(*pictures, seen) if pictures and with_flip else None,
        flip_reason=NO_FLIP if pictures and not with_flip else None,
        floor=0.0 if error is None else _rms(np.asarray(error, np.float64)[seen]) / rms if rms > 0.0 else None,
    )


def error_map(M: Array, reference: Array, seen: Array) -> Array:
    """float64 (H, W): luminance of |M - reference| over the root mean square of the reference's; 0 where nothing is
    seen. Not divided where the reference is black."""
    scale = _rms(luminance(reference)[seen]) or 1.0
    return np.where(seen, luminance(np.abs(np.asarray(M, np.float64) - reference)) / scale, 0.0)


def luminance(rgb: Array) -> Array:
    """(...) of linear Rec. 709 (..., 3)."""
    return np.asarray(rgb, np.float64) @ (0.2126, 0.7152, 0.0722)


def over_black(display: Array) -> Array:
    """uint8 (H, W, 3) of an image with or without coverage in a fourth channel."""
    if display.shape[-1] == 3:
        return display
    return np.round(display[..., :3] * (display[..., 3:] / 255.0)).astype(np.uint8)


def _check(M: Array, reference: Array, seen: Array, error: Array | None) -> None:
    if not seen.any():
        raise InputError("no pixel shows an object, so there is nothing to compare")
    for name, values in (("M", M), ("M of the reference", reference), ("the reference's error", error)):
        if values is None:
            continue
        if values.shape != (*seen.shape, 3):
            raise InputError(f"{name} is of shape {values.shape}, not {(*seen.shape, 3)}")
        bad = ~np.isfinite(values[seen]).all(axis=-1)
        if bad.any():
            y, x = np.argwhere(seen)[bad][0]
            raise RenderError(f"{int(bad.sum())} pixels of {name} are not finite, the first at x {x}, y {y}")


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if values.size else 0.0


def _psnr(difference: Array, peak: float) -> float | None:
    """dB; inf of no differences at all."""
    if peak <= 0.0:
        return None
    return 20.0 * math.log10(peak / _rms(difference)) if difference.size else math.inf


def _flip(display: Array, reference: Array, seen: Array) -> float:
    import flip_evaluator

    pictures = [over_black(image).astype(np.float32) / 255.0 for image in (reference, display)]
    difference, _, _ = flip_evaluator.evaluate(*pictures, "LDR", applyMagma=False, computeMeanError=False)
    return float(np.mean(np.asarray(difference)[seen]))
