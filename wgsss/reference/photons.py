"""How light spreads in flat layers, by following photons: the truth that diffusion models are measured against."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError
from wgsss.gpu import Gpu, default_gpu
from wgsss.graph import Graph
from wgsss.optics.medium import Layer, stack
from wgsss.optics.profile import Profile, distances, shares
from wgsss.wgsl import load

Array = NDArray[np.float64]

_MODULE = "reference/photons"
_NEAREST = 1 / 256  # the least radius told apart, of the shortest mean free path
_ENDLESS = 1e20  # mm; still finite in float32 once divided by the flattest direction's cosine
_BATCH = 1024  # photons; as many as the tallies can hold
_BATCHES = 64  # at least, where there are so many photons, for an error to be told from them
_SUBMISSION_S = 0.25  # what a submission may take, so that a desktop on the same device stays alive


@dataclass(frozen=True, eq=False)
class Photons(Profile):
    """What became of photons that entered a stack of layers at one point, at a right angle.

    Everything but `specular` is per unit of flux that entered, as diffusion has it, and per RGB channel. Errors are
    standard errors, from the spread over batches; infinite for a single photon.

    `edges`: radii (n + 1,) in mm of rings about the point, from 0; the last ring, beyond the last edge, has no end.
    `reflected`, `transmitted`: share (n + 1, 3) that left through each ring on the side of entry, and on the far side.
    `reflected_error`, `transmitted_error`: their errors (n + 1, 3).
    `total_error`, `total_transmittance_error`: errors (3,) of the totals.
    `absorbed`: share (3,) that stayed inside.
    `specular`: share of the incident light that the top reflects without letting it in.
    `photons`: how many were followed in each channel.
    """

    edges: Array
    reflected: Array
    reflected_error: Array
    transmitted: Array
    transmitted_error: Array
    total_error: Array
    total_transmittance_error: Array
    absorbed: Array
    specular: float
    photons: int

    @property
    def total(self) -> Array:
        return self.reflected.sum(axis=0)

    @property
    def total_transmittance(self) -> Array:
        return self.transmitted.sum(axis=0)

    @property
    def balance(self) -> Array:
        """Reflected, transmitted and absorbed (3,) together: 1, but for the roulette that ends faint photons."""
        return self.total + self.total_transmittance + self.absorbed

    @cached_property
    def areas(self) -> Array:
        """Area (n, 1) of each ring in mm^2."""
        return np.pi * np.diff(np.square(self.edges))[:, None]

    @property
    def R(self) -> Array:
        """Mean of R (n, 3) over each ring, 1/mm^2."""
        return self.reflected[:-1] / self.areas

    @property
    def R_error(self) -> Array:
        """Standard error (n, 3) of `R`."""
        return self.reflected_error[:-1] / self.areas

    @property
    def T(self) -> Array:
        """Mean of T (n, 3) over each ring, 1/mm^2."""
        return self.transmitted[:-1] / self.areas

    @property
    def T_error(self) -> Array:
        """Standard error (n, 3) of `T`."""
        return self.transmitted_error[:-1] / self.areas

    def reflectance(self, r: ArrayLike) -> Array:
        """R(r) in 1/mm^2, (..., 3), at `r` (...) mm: linear in log r between the rings' means.

        Beyond the last edge what is left is taken to fall as 1/r^3, as it does where nothing absorbs.
        """
        return self._between(self.reflected, r)

    def transmittance(self, r: ArrayLike) -> Array:
        """T(r) in 1/mm^2, (..., 3), as `reflectance`."""
        return self._between(self.transmitted, r)

    def _between(self, parts: Array, r: ArrayLike) -> Array:
        r = distances(r)
        means = parts[:-1] / self.areas
        middle = np.log(np.sqrt(0.5 * (np.square(self.edges[1:]) + np.square(self.edges[:-1]))))
        x = np.log(np.clip(r, 0.1 * self.edges[1], None))
        inside = np.stack([np.interp(x, middle, means[:, c]) for c in range(3)], axis=-1)
        last = self.edges[-1]
        outside = parts[-1] * last / (2.0 * np.pi * np.maximum(r, last)[..., None] ** 3)
        return np.where(r[..., None] < last, inside, outside)

    def beyond(self, r: ArrayLike) -> Array:
        """Share (..., 3) of the total that leaves farther than `r` (...) mm away: exact at edges, even within rings."""
        r = distances(r)
        outside = np.cumsum(self.reflected[::-1], axis=0)[::-1]  # beyond each edge
        area = np.square(self.edges)
        found = np.stack([np.interp(np.square(r), area, outside[:, c]) for c in range(3)], axis=-1)
        return shares(found * (self.edges[-1] / np.maximum(r, self.edges[-1]))[..., None], self.total)

    def line_spread(self, x: ArrayLike) -> Array:
        """R integrated along a line at |x| (...) mm: (..., 3) in 1/mm, exact for the rings by their chords."""
        x = distances(np.abs(np.asarray(x, dtype=np.float64)))[..., None]
        half = np.sqrt(np.maximum(np.square(self.edges) - np.square(x), 0.0))
        last = self.edges[-1]
        # The last ring: 1/r^3 integrated along what of the line lies outside of the last edge.
        outside = 1.0 / (np.pi * last * (1.0 + half[..., -1:] / last))
        outside *= np.square(last / np.maximum(x, last))
        return 2.0 * np.diff(half, axis=-1) @ self.R + outside * self.reflected[-1]


def trace(
    layers: Sequence[Layer],
    photons: int = 1_000_000,
    *,
    seed: int = 0,
    eta_below: float = 1.0,
    gpu: Gpu | None = None,
    label: str = "",
) -> Photons:
    """Follow photons through a stack of layers, from the top down: the method of Wang, Jacques and Zheng 1995 (MCML).

    Equal arguments give equal bits on one adapter. Light that is still inside after 262,144 flights counts as absorbed:
    some of it in a half space that absorbs nothing, next to none elsewhere.

    Args:
        photons: to follow in each channel.
        seed: at least 0; another one gives other random numbers.
        eta_below: refractive index of what lies below the last layer. Above the first one is air.
        gpu: where to run; by default the device that the commands share.
        label: of the progress bar, which shows on a terminal only.

    Raises:
        InputError: for what is not a stack, fewer than one photon or more than 2^32 - 1, and a negative seed.
    """
    from tqdm import tqdm

    layers = stack(layers)
    if not (isinstance(photons, int | np.integer) and 1 <= photons < 2**32):
        raise InputError(f"photons must be a whole number from 1 to {2**32 - 1}, not {photons}")
    if not (isinstance(seed, int | np.integer) and seed >= 0):
        raise InputError(f"seed must be a whole number of at least 0, not {seed}")
    if not 1.0 <= eta_below < np.inf:
        raise InputError(f"eta_below must be a number of at least 1, not {eta_below}")
    gpu = gpu or default_gpu()
    shortest = 1.0 / max(layer.sigma_t_prime.max() for layer in layers)
    innermost = int(np.float32((_NEAREST * shortest) ** 2).view(np.uint32) >> 20)
    rings = load(_MODULE).constants["BINS"]
    edges = ((innermost + 1 + np.arange(rings - 1, dtype=np.uint32)) << 20).view(np.float32).astype(np.float64)

    with tqdm(total=3 * photons, desc=label, unit=" photons", unit_scale=True, file=sys.stderr, disable=None) as bar:
        tracer = _Tracer(gpu, photons, innermost, bar)
        counts = [tracer.follow(_packed(layers, eta_below, channel), seed, channel) for channel in range(3)]
    share = np.stack([count.share for count in counts], axis=-1)
    error = np.stack([count.error for count in counts], axis=-1)
    eta = float(layers[0].eta)
    return Photons(
        edges=np.sqrt(np.concatenate([[0.0], edges])),
        reflected=share[:rings],
        reflected_error=error[:rings],
        transmitted=share[rings : 2 * rings],
        transmitted_error=error[rings : 2 * rings],
        total_error=error[-3],
        total_transmittance_error=error[-2],
        absorbed=share[-1],
        specular=((eta - 1.0) / (eta + 1.0)) ** 2,
        photons=int(photons),
    )


def _packed(layers: Sequence[Layer], eta_below: float, channel: int) -> list[dict[str, float]]:
    """The stack as one channel's photons meet it."""
    indices = [1.0, *(layer.eta for layer in layers), eta_below]
    return [
        {
            "sigma_t": layer.sigma_a[channel] + layer.sigma_s[channel],
            "absorbed": layer.sigma_a[channel] / (layer.sigma_a[channel] + layer.sigma_s[channel]),
            "g": layer.g,
            "thickness": min(layer.thickness, _ENDLESS),
            "above": layer.eta / indices[i],
            "below": layer.eta / indices[i + 2],
        }
        for i, layer in enumerate(layers)
    ]


class _Count:
    """Sums over batches of what each was counted to: rings and totals of both sides, absorbed."""

    def __init__(self) -> None:
        self.photons = self.batches = self.squared_sizes = 0
        self.sum: Any = 0.0
        self.squares: Any = 0.0
        self.products: Any = 0.0

    def add(self, values: Array, sizes: NDArray[np.int64]) -> None:
        """Batches: their tallies (batches, n), and how many photons each had."""
        self.photons += int(sizes.sum())
        self.batches += len(sizes)
        self.squared_sizes += int(np.square(sizes).sum())
        self.sum += values.sum(axis=0)
        self.squares += np.square(values).sum(axis=0)
        self.products += sizes @ values

    @property
    def share(self) -> Array:
        """Mean over photons."""
        return self.sum / self.photons

    @property
    def error(self) -> Array:
        """Standard error of `share`: batches about what they would hold if they were all alike."""
        if self.batches == 1:
            return np.full_like(self.sum, np.inf)
        spread = self.squares - 2.0 * self.share * self.products + np.square(self.share) * self.squared_sizes
        return np.sqrt(np.maximum(spread, 0.0) * self.batches / (self.batches - 1.0)) / self.photons


class _Tracer:
    """Follows a channel's photons, as many at a time as the device gets done in a moment."""

    def __init__(self, gpu: Gpu, photons: int, innermost: int, bar: Any) -> None:
        self.gpu, self.photons, self.innermost, self.bar = gpu, photons, innermost, bar
        module = load(_MODULE)
        self.lanes, self.bins = module.constants["LANES"], module.constants["BINS"]
        self.batch = min(_BATCH, -(-photons // _BATCHES))

    def follow(self, layers: list[dict[str, float]], seed: int, channel: int) -> _Count:
        count = _Count()
        key = np.random.SeedSequence([seed, channel]).generate_state(2)
        first, batches = 0, 4
        while first < self.photons:
            end = min(first + batches * self.batch, self.photons)
            start = time.perf_counter()
            params = {"key": key, "first": first, "end": end, "batch": self.batch, "innermost": self.innermost}
            sizes = np.diff(np.append(np.arange(first, end, self.batch), end))
            count.add(self._run(len(sizes), layers, params), sizes)
            spent = time.perf_counter() - start
            self.bar.update(end - first)
            first = end
            batches = max(1, int(batches * min(4.0, _SUBMISSION_S / spent)))
            batches = min(batches, 16384)
        return count

    def _run(self, batches: int, layers: list[dict[str, float]], params: dict[str, Any]) -> Array:
        """Tallies (batches, 2 * bins + 3) of one dispatch, a photon counting 1."""
        graph = Graph(self.gpu)
        out = graph.dispatch(_MODULE, size=batches * self.lanes, layers=layers, params=params)
        graph.run(out.tallies, out.absorbed)
        rings = graph.read(out.tallies)
        reflected, transmitted = (rings[side].reshape(batches, self.bins) for side in ("reflected", "transmitted"))
        absorbed = graph.read(out.absorbed).reshape(batches, self.lanes).sum(axis=1, dtype=np.uint64)
        totals = [side.sum(axis=1, dtype=np.uint64) for side in (reflected, transmitted)]
        return np.column_stack([reflected, transmitted, *totals, absorbed]) / 2.0**21
