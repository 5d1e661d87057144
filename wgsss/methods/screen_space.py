"""jimenez15's surface: separable diffusion in screen space (Jimenez et al. 2015, Separable Subsurface Scattering).

The irradiance at the pixels is blurred along two directions that are at right angles on the surface, by a kernel per
material whose reach in pixels follows the surface's distance and slope. Unlike the shipped demonstration of 2012 the
kernel is not scaled by taste: it has the profile's total and, along the directions of the blurs, its response to edges.

A tap reads one pixel for all that it stands for. Where a kernel spans hundreds of pixels, as milk's does on a large
picture, edges of light and of what is in front come out as faint copies, a tap apart: 33 taps leave a few of them, 65
next to none.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from wgsss import frame as shared
from wgsss import wgsl
from wgsss.errors import InputError, unknown
from wgsss.frame import Frame, rectangle
from wgsss.gpu import Gpu
from wgsss.graph import Handle
from wgsss.methods.method import Diffused
from wgsss.optics.separable import KERNELS, Term
from wgsss.stage import Body, Stage

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ScreenSpace:
    """M_front as a separable kernel over the pixels of each object; M_back is not estimated."""

    taps: int = field(default=17, metadata={"unit": "", "range": (5, 65), "help": "lookups per direction, odd"})
    kernel: str = field(
        default="line-spread",
        metadata={"unit": "", "choices": tuple(KERNELS), "help": "how a profile becomes two passes"},
    )

    source: ClassVar[str] = "Jimenez et al. 2015, Separable Subsurface Scattering"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = tuple({"taps": n} for n in (9, 17, 33, 65))

    def __post_init__(self) -> None:
        if self.taps % 2 == 0:
            raise InputError(f"taps must be odd, not {self.taps}")
        if self.kernel not in KERNELS:
            raise unknown("kernel", self.kernel, tuple(KERNELS))

    def bake(self, stage: Stage) -> None:
        """The taps of each material's kernel."""
        for body in stage.bodies:
            self.weights(body)

    def weights(self, body: Body) -> list[tuple[Taps, Any]]:
        """The kernel of a body's material, a term and its buffer for each pair of passes."""

        def make() -> list[tuple[Taps, Any]]:
            terms = KERNELS[self.kernel](body.material.profile)
            taps = [Taps(term, terms[0], self.taps // 2) for term in terms]
            return [(t, t.upload(body.stage.gpu)) for t in taps]

        return body.stage.shared(("separable", id(body.material), self.kernel, self.taps), make)

    def passes(self, frame: Frame) -> Diffused:
        return Diffused(frame.once(self, lambda: self._M_front(frame)))

    def _M_front(self, frame: Frame) -> Handle:
        irradiance = shared.irradiance_pixels(frame)
        M_front: Any = None
        for body in frame.stage.bodies:
            M_front = self.diffuse(frame, body, irradiance, M_front)
        return M_front

    def diffuse(self, frame: Frame, body: Body, irradiance: Handle, into: Handle | None) -> Handle:
        """M_front of one body, drawn onto `into`."""
        graph = frame.graph
        where = {"clip_to_world": frame.view.clip_to_world, "rectangle": rectangle(frame, body)}
        entered = graph.draw(
            "screen_space/enter",
            size=frame.size,
            count=6,
            surface=body.surface,
            params=where,
            irradiance=irradiance,
            **frame.seen("where_seen", "normal", "base_color", "depth"),
        )
        terms = self.weights(body)
        M: Any = frame.stage.gpu.black
        for i, (taps, buffer) in enumerate(terms):
            before, M = M, entered.entering
            for direction in (0, 1):
                M = graph.draw(
                    "screen_space/blur",
                    size=frame.size,
                    count=6,
                    into=into if direction == 1 and i == len(terms) - 1 else None,
                    label="xy"[direction],
                    params={
                        "scale": taps.scale,
                        "coarsest": taps.pixels_per_mm[0],
                        **where,
                    },
                    constants={"DIRECTION": direction},
                    surface=body.surface,
                    taps=buffer,
                    source=M,
                    slope=entered.slope,
                    before=before,
                    **frame.seen("base_color"),
                )
        return M


class Taps:
    """A term of a kernel as weights of whole pixels, for any number of pixels per mm.

    Attributes:
        weight: (levels, 1 + sides, 3) of each of the two pixels that a tap reads, the one in the middle first. The
            weights of a level sum to the term's integral.
        offset: (levels, 1 + sides) pixels to either side.
        pixels_per_mm: (levels,) ascending; at the first the whole kernel is within one pixel.
        scale: (3,) what the result of the two passes is multiplied by.
    """

    def __init__(self, term: Term, placed_by: Term, sides: int) -> None:
        known = wgsl.load("screen_space/blur").constants
        levels = np.arange(known["LEVELS"]) / known["LEVELS_PER_OCTAVE"]
        self.pixels_per_mm = 0.5 / term.x[-1] * 2.0**levels
        edges, self.offset = place(placed_by, self.pixels_per_mm, sides)
        within = [np.interp(edges / self.pixels_per_mm[:, None], term.x, column) for column in term.within.T]
        self.weight = np.diff(np.stack(within, axis=-1), axis=1, prepend=0.0)
        self.weight[:, 1:] *= 0.5
        self.scale = term.scale

    def upload(self, gpu: Gpu) -> Any:
        """A buffer of array<Tap> of wgsl/screen_space/blur.wgsl, level by level."""
        value = {"weight": self.weight.reshape(-1, 3), "offset": self.offset.ravel()}
        return gpu.buffer(wgsl.load("screen_space/blur").layout("array<Tap>").pack(value))


def place(term: Term, pixels_per_mm: Array, sides: int) -> tuple[Array, Array]:
    """Which pixels `sides` taps to either side stand for, at each number of pixels per mm (L,).

    All are edges between pixels: a step in the irradiance is one as well. The pixel in the middle has a tap of its
    own; of what is beyond, each tap has an equal share, of the widest channel at each distance, or a single pixel.

    Returns:
        edges: (L, 1 + sides) pixels from the middle to where each tap ends; the last are at the kernel's range.
        offset: (L, 1 + sides) the pixel that each tap is read at: it halves the tap's share.
    """
    densest = np.diff(term.within, axis=0).max(axis=1)
    share = np.concatenate([[0.0], np.cumsum(densest)]) / densest.sum()
    kept = np.concatenate([[True], np.diff(share) > 0.0])
    x, share = term.x[kept], share[kept]
    reach = np.ceil(term.x[-1] * pixels_per_mm - 0.5) + 0.5
    edges, offsets = [np.full(pixels_per_mm.shape, 0.5)], [np.zeros(pixels_per_mm.shape)]
    for left in range(sides, 0, -1):
        start = edges[-1]
        done = np.interp(start / pixels_per_mm, x, share)
        end = np.round(np.interp(done + (1.0 - done) / left, share, x) * pixels_per_mm - 0.5) + 0.5
        end = np.maximum(end if left > 1 else reach, start + 1.0)
        half = 0.5 * (done + np.interp(end / pixels_per_mm, x, share))
        offsets.append(np.clip(np.round(np.interp(half, share, x) * pixels_per_mm), start + 0.5, end - 0.5))
        edges.append(end)
    return np.stack(edges, axis=1), np.stack(offsets, axis=1)
