"""The surface method of jimenez15: separable diffusion in screen space (Jimenez et al. 2015, Separable Subsurface
Scattering).

The irradiance at the pixels is blurred along two directions that are perpendicular on the surface, with a kernel for
each material. The kernel's width in pixels follows from the distance and slope of the surface. Unlike in the published
demonstration of 2012, its scale is not chosen by eye: it has the total reflectance of the profile and, along the two
directions, the profile's response to an edge.

A tap reads a single pixel for the whole interval to the next tap. Where a kernel spans hundreds of pixels, as milk's
does in a large picture, shadow edges and silhouettes therefore appear as faint copies, one tap apart. So the number of
taps per direction is 17 only where half of the light leaves within 8 pixels, 33 where it leaves within 16, and
otherwise 65, which leaves hardly any copies.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from wgsss import wgsl
from wgsss.errors import InputError, unknown
from wgsss.frame import Frame, irradiance_pixels
from wgsss.gpu import Buffer, Gpu
from wgsss.graph import Handle
from wgsss.methods.method import Diffused
from wgsss.optics.separable import KERNELS, Term
from wgsss.stage import Body, Stage

Array = NDArray[np.float64]

_HALVINGS = 16  # steps of the bisection that places taps


@dataclass(frozen=True)
class ScreenSpace:
    """M_front as a separable kernel over the pixels of each object; M_back is not estimated."""

    taps: int = field(
        default=0,
        metadata={
            "unit": "",
            "range": (0, 65),
            "help": "taps per direction, odd; 0: chosen by the width of the kernel in pixels",
        },
    )
    kernel: str = field(
        default="line-spread",
        metadata={"unit": "", "choices": tuple(KERNELS), "help": "how the separable kernel approximates the profile"},
    )

    source: ClassVar[str] = "Jimenez et al. 2015, Separable Subsurface Scattering"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = tuple({"taps": n} for n in (9, 17, 33, 65))

    def __post_init__(self) -> None:
        if self.taps and self.taps % 2 == 0:
            raise InputError(f"taps must be odd or 0, not {self.taps}")
        if self.kernel not in KERNELS:
            raise unknown("kernel", self.kernel, tuple(KERNELS))

    def bake(self, stage: Stage) -> None:
        """Compute each material's kernel. Its taps depend on the frame."""
        for body in stage.bodies:
            self._terms(body)

    def weights(self, body: Body, taps: int) -> list[tuple[Taps, Buffer]]:
        """Return the kernel of a body's material with `taps` taps per direction: for each of its terms, which takes two
        passes, the taps and their buffer."""

        def make() -> list[tuple[Taps, Buffer]]:
            terms = self._terms(body)
            placed = [Taps(term, terms[0], taps // 2) for term in terms]
            return [(of_term, of_term.upload(body.stage.gpu)) for of_term in placed]

        return body.stage.shared(("separable", id(body.material), self.kernel, taps), make)

    def _terms(self, body: Body) -> tuple[Term, ...]:
        key = ("terms", id(body.material), self.kernel)
        return body.stage.shared(key, lambda: KERNELS[self.kernel](body.profile))

    def passes(self, frame: Frame) -> Diffused:
        return Diffused(frame.once(self, lambda: self.diffuse(frame, irradiance_pixels(frame))))

    def diffuse(self, frame: Frame, irradiance: Handle, behind: Handle | None = None) -> Handle:
        """Return M, W/m^2, of the light that enters at the pixels, and of the light that arrives there from `behind`,
        which is blurred as if it entered."""
        M: Handle | None = None
        for body in frame.stage.bodies:
            M = self._diffuse(frame, body, irradiance, behind, M)
        assert M is not None, "a stage has a body"
        return M

    def _diffuse(
        self, frame: Frame, body: Body, irradiance: Handle, behind: Handle | None, into: Handle | None
    ) -> Handle:
        """Return M of one body, drawn onto `into`."""
        module = "screen_space/enter"
        entered = frame.graph.draw_outputs(
            module,
            size=frame.size,
            count=6,
            irradiance=irradiance,
            behind=behind or frame.stage.gpu.black,
            **frame.bindings(module, body),
        )
        M: Handle | None = None
        terms = self.weights(body, self.taps or taps_for(frame, body))
        for i, (taps, buffer) in enumerate(terms):
            before, source = M or frame.stage.gpu.black, entered.entering
            for direction in (0, 1):
                source = frame.draw_object(
                    "screen_space/blur",
                    body,
                    into=into if direction == 1 and i == len(terms) - 1 else None,
                    label="xy"[direction],
                    constants={"DIRECTION": direction},
                    params={"scale": taps.scale, "coarsest": taps.pixels_per_mm[0]},
                    taps=buffer,
                    source=source,
                    slope=entered.slope,
                    before=before,
                )
            M = source
        assert M is not None, "a kernel has a term"
        return M


def taps_for(frame: Frame, body: Body) -> int:
    """Return the number of taps per direction: at least as many to each side as the pixels within which half of the
    light leaves, but 32 at most."""
    half = body.stage.shared(("half", id(body.material)), lambda: float(body.profile.range(0.5).max()))
    posed = frame.stage.scene.objects[body.index]
    middle = posed.matrix @ np.array([*posed.mesh.bounds.mean(axis=0), 1.0])
    to_clip = frame.view.world_to_clip
    # The middle of an object around the camera may lie behind it.
    pixels_per_mm = 0.5 * frame.size[1] * np.linalg.norm(to_clip[1, :3]) / max(to_clip[3] @ middle, 1e-6)
    return next((taps for taps in (17, 33) if taps // 2 >= half * pixels_per_mm), 65)


class Taps:
    """The taps of one term of a kernel at several resolutions, the levels.

    Attributes:
        weight: (levels, 1 + sides, 3): weight of each of the two pixels that a tap reads, from the middle on. The sum
            over all pixels is the term's integral.
        offset: (levels, 1 + sides): distance of the pixels from the middle, to both sides.
        pixels_per_mm: (levels,): resolution, ascending; at the first level the whole kernel is within one pixel.
        scale: (3,): factor of the result of the two passes.
    """

    def __init__(self, term: Term, placed_by: Term, sides: int) -> None:
        known = wgsl.load("screen_space/blur").constants
        levels = np.arange(known["LEVELS"]) / known["LEVELS_PER_OCTAVE"]
        self.pixels_per_mm = 0.5 / term.x[-1] * 2.0**levels
        self.offset = place(placed_by, self.pixels_per_mm, sides)
        # The sum over the taps is the same for all edges between two neighbouring taps. Weights are chosen such that it
        # is the mean of the exact responses to edges directly after the one and directly before the other.
        first, last = self.offset + 0.5, np.full_like(self.offset, np.inf)
        last[:, :-1], first[:, -1] = self.offset[:, 1:] - 0.5, np.inf
        read = 0.5 * (_within(term, first, self.pixels_per_mm) + _within(term, last, self.pixels_per_mm))
        self.weight = np.diff(read, axis=1, prepend=0.0)
        self.weight[:, 1:] *= 0.5
        self.scale = term.scale

    def upload(self, gpu: Gpu) -> Buffer:
        """Return a buffer of array<Tap> (wgsl/screen_space/blur.wgsl), level by level."""
        value = {"weight": self.weight.reshape(-1, 3), "offset": self.offset.ravel()}
        return gpu.buffer(wgsl.load("screen_space/blur").layout("array<Tap>").pack(value))


def place(term: Term, pixels_per_mm: Array, sides: int) -> Array:
    """Return the pixels (L, 1 + sides) that taps read, from the middle on, for each resolution in pixels per mm (L,).

    The positions minimise the largest error of the response to an edge: in the channel where it is largest, all
    intervals between neighbouring taps have the same share of the term, and half of that share lies beyond the last
    tap.
    """
    least, most = np.zeros(pixels_per_mm.shape), np.full(pixels_per_mm.shape, 2.0)
    for _ in range(_HALVINGS):
        between = 0.5 * (least + most)
        enough = _placed(term, pixels_per_mm, sides, between)[:, 0] <= 0.0
        least, most = np.where(enough, least, between), np.where(enough, between, most)
    return np.maximum(_placed(term, pixels_per_mm, sides, most), np.arange(1 + sides))


def _placed(term: Term, pixels_per_mm: Array, sides: int, between: Array) -> Array:
    """Return positions of taps as `place` does, such that each interval has at most the share `between` (L,) of the
    term. They are placed from the outside in: the first column is where the middle tap would be, 0 or less if they
    suffice."""
    offset: list[Array] = []
    done = term.within[-1] - 0.5 * between[:, None]
    for _ in range(sides + 1):
        starts = [np.interp(d, w, term.x) for d, w in zip(done.T, term.within.T, strict=True)]
        offset.append(np.ceil(np.max(starts, axis=0) * pixels_per_mm - 0.5))
        ends = (offset[-1] - 0.5) / pixels_per_mm
        done = np.stack([np.interp(ends, term.x, w) for w in term.within.T], axis=1) - between[:, None]
    return np.stack(offset[::-1], axis=1)


def _within(term: Term, pixels: Array, pixels_per_mm: Array) -> Array:
    """Return the part (L, n, 3) of a term within some numbers of pixels (L, n) of the middle, on both sides."""
    return np.stack([np.interp(pixels / pixels_per_mm[:, None], term.x, w) for w in term.within.T], axis=-1)
