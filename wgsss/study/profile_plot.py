"""A plot of profiles: R and r R over the distance r, logarithmic and linear, as in Mikkelsen 2009, figures 6 and 7."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from wgsss.optics import Photons, Profile
from wgsss.optics.medium import CHANNELS
from wgsss.output import replacing
from wgsss.text import figure_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[Any]

# The colours of Okabe and Ito, which people with any colour vision can tell apart.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#999999", "#F0E442")
_MEASURED = "#000000"
_ROWS = (
    ("R, 1/mm²", "log", False),
    ("R, 1/mm²", "linear", False),
    ("r R, 1/mm", "log", True),
    ("r R, 1/mm", "linear", True),
)


def plot(profiles: dict[str, Profile], title: str, path: Path) -> None:
    """Write a .png or .svg of profiles by name, with a column for each channel. T, if there is one, is dashed.

    Raises InputError if the file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 14.0), layout="constrained")
    axes = figure.subplots(len(_ROWS), 3)
    far = np.max([profile.range(0.01) for profile in profiles.values()], axis=0)
    near = np.min([profile.range(0.5) for profile in profiles.values()], axis=0)
    for channel, name in enumerate(CHANNELS):
        reach = far[channel] or 1.0
        for (label, scale, weighted), axis in zip(_ROWS, axes[:, channel], strict=True):
            limit = reach if scale == "log" else reach / 3.0
            r = np.linspace(limit / 2000.0, limit, 600)
            curves = _draw_curves(axis, profiles, r, channel, weighted)
            axis.set_xlim(0.0, limit)
            _set_limits(axis, curves, r, near[channel], scale)
            axis.set_ylabel(label if channel == 0 else "")
            axis.grid(alpha=0.25)
        axes[0, channel].set_title(name)
        axes[-1, channel].set_xlabel("r, mm")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(handles))
    figure.suptitle(figure_text(title), x=0.02, ha="left")
    with replacing(path) as (file,):
        figure.savefig(file, dpi=110, metadata={"Date": None} if path.suffix.lower() == ".svg" else None)


def _draw_curves(axis: Axes, profiles: dict[str, Profile], r: Array, channel: int, weighted: bool) -> list[Array]:
    """Draw the profiles at distances r (n,), and return their values (n,)."""
    curves = []
    scale = r if weighted else 1.0
    for number, (name, profile) in enumerate(profiles.items()):
        R = scale * profile.reflectance(r)[:, channel]
        if isinstance(profile, Photons):
            _draw_bins(axis, name, profile, channel, weighted)
        else:
            width = max(2.8 - 0.5 * number, 1.0)  # later curves are thinner, so that none hides another
            axis.plot(r, R, color=_COLOURS[number % len(_COLOURS)], lw=width, label=name)
        if profile.total_transmittance[channel] > 0.0:
            colour = _MEASURED if isinstance(profile, Photons) else _COLOURS[number % len(_COLOURS)]
            axis.plot(r, scale * profile.transmittance(r)[:, channel], "--", color=colour, lw=1.0)
        curves.append(R)
    return curves


def _draw_bins(axis: Axes, name: str, profile: Photons, channel: int, weighted: bool) -> None:
    """Draw the bins of a measured profile with their standard errors, except bins with large errors."""
    inner, outer = profile.edges[:-1], profile.edges[1:]
    r = np.sqrt(0.5 * (np.square(inner) + np.square(outer)))
    R, error = profile.R[:, channel], profile.R_error[:, channel]
    is_clear = (R > 0.0) & (error < 0.3 * R) & np.isfinite(r)
    scale = r[is_clear] if weighted else 1.0
    axis.errorbar(
        r[is_clear],
        scale * R[is_clear],
        scale * error[is_clear],
        fmt=".",
        ms=2.5,
        lw=0.7,
        color=_MEASURED,
        label=name,
        zorder=0,
    )


def _set_limits(axis: Axes, curves: list[Array], r: Array, near: float, scale: str) -> None:
    """Set a range of values that shows the curves.

    Values close to r = 0 are left out, because some profiles are unbounded there.
    """
    values = np.array(curves)[:, r > 0.1 * near]
    top = values.max(initial=0.0)
    if top <= 0.0:
        return
    if scale == "log":
        axis.set_yscale("log")
        least = np.array([curve[curve > 0.0].min(initial=top) for curve in values]).max()
        axis.set_ylim(0.3 * least, 3.0 * top)
    else:
        axis.set_ylim(0.0, 1.1 * top)
