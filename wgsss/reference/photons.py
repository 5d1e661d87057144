"""How light spreads in flat layers, by following photons: the truth that diffusion models are measured against."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wgsss import wgsl
from wgsss.console import progress_bar
from wgsss.errors import InputError
from wgsss.gpu import Gpu, default_gpu
from wgsss.graph import Graph
from wgsss.optics import Layer, Photons
from wgsss.optics.fresnel import diffuse_fresnel
from wgsss.optics.medium import check_index, stack

Array = NDArray[np.float64]

_MODULE = "reference/photons"
_NEAREST = 1 / 256  # the least radius told apart, of the shortest mean free path
_ENDLESS = 1e20  # mm; still finite in float32 once divided by the flattest direction's cosine
_CLEAR = 1e-4  # share of sigma_t' that may be absorption where photons leap
_BATCH = 1024  # photons at most, so that tallies do not overflow
_BATCHES = 64  # at least, where there are so many photons, for an error to be told from their spread
_ROUND = 8192  # batches tallied before they are read: 24 MiB


def trace(
    layers: Sequence[Layer],
    photons: int = 1_000_000,
    *,
    seed: int = 0,
    eta_below: float = 1.0,
    sky: bool = False,
    gpu: Gpu | None = None,
    label: str = "",
) -> Photons:
    """Follow photons through a stack of layers, from the top down: the method of Wang, Jacques and Zheng 1995 (MCML).

    Equal arguments give equal bits on one adapter. Where next to nothing absorbs, light deep inside of a layer moves by
    diffusion in leaps, far from its boundaries: `wgsl/reference/photons.wgsl` says how.

    Args:
        photons: to follow in each channel.
        seed: at least 0; another one gives other random numbers.
        eta_below: refractive index of what lies below the last layer. Above the first one is air.
        sky: light comes evenly from everywhere above, not at a right angle. Obliquely, less of it reaches deep.
        gpu: where to run; by default the device that the commands share.
        label: of the progress bar, which shows on a terminal only.

    Raises:
        InputError: for what is not a stack, less than one photon or 2^31 and more, a negative seed.
    """
    layers = stack(layers)
    if not (isinstance(photons, int | np.integer) and 1 <= photons < 2**31):
        raise InputError(f"photons must be a whole number from 1 to {2**31 - 1}, not {photons}")
    if not (isinstance(seed, int | np.integer) and seed >= 0):
        raise InputError(f"seed must be a whole number of at least 0, not {seed}")
    check_index("eta_below", eta_below)
    shortest = 1.0 / max(layer.sigma_t_prime.max() for layer in layers)
    innermost = int(np.float32((_NEAREST * shortest) ** 2).view(np.uint32) >> 20)
    with progress_bar(total=3 * photons, desc=label, unit=" photons", unit_scale=True) as bar:
        tracer = _Tracer(gpu or default_gpu(), int(photons), innermost, sky, bar)
        keys = [np.random.SeedSequence([seed, channel]).generate_state(2) for channel in range(3)]
        counts = [tracer.follow(_packed(layers, eta_below, channel), key) for channel, key in enumerate(keys)]
    share = np.stack([count.share for count in counts], axis=-1)
    error = np.stack([count.error for count in counts], axis=-1)

    rings = tracer.rings
    squares = ((innermost + 1 + np.arange(rings - 1, dtype=np.uint32)) << 20).view(
        np.float32
    )  # as `ring` of the module
    edges = np.sqrt(np.concatenate([[0.0], squares], dtype=np.float64))
    area = np.pi * np.diff(np.square(edges))[:, None]
    eta = float(layers[0].eta)
    return Photons(
        edges=edges,
        R=share[: rings - 1] / area,
        R_error=error[: rings - 1] / area,
        T=share[rings : 2 * rings - 1] / area,
        T_error=error[rings : 2 * rings - 1] / area,
        R_outside=share[rings - 1],
        T_outside=share[2 * rings - 1],
        total_error=error[-2],
        total_transmittance_error=error[-1],
        absorbed=share[2 * rings],
        specular=diffuse_fresnel(1.0 / eta) if sky else ((eta - 1.0) / (eta + 1.0)) ** 2,
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
            "transport": layer.mean_free_path[channel] if layer.albedo[channel] >= 1.0 - _CLEAR else _ENDLESS,
            "sigma_tr": max(layer.sigma_tr[channel], 1.0 / _ENDLESS),
            "thickness": min(layer.thickness, _ENDLESS),
            "above": layer.eta / indices[i],
            "below": layer.eta / indices[i + 2],
        }
        for i, layer in enumerate(layers)
    ]


class _Count:
    """Sums over batches of what was tallied."""

    def __init__(self) -> None:
        self.photons = self.batches = self.squared_sizes = 0
        self.sum: Any = 0.0
        self.squares: Any = 0.0
        self.products: Any = 0.0

    def add(self, tallies: Array, sizes: NDArray[np.int64]) -> None:
        """Tallies (batches, n), and how many photons each batch had."""
        self.photons += int(sizes.sum())
        self.batches += len(sizes)
        self.squared_sizes += int(np.square(sizes).sum())
        self.sum += tallies.sum(axis=0)
        self.squares += np.square(tallies).sum(axis=0)
        self.products += sizes @ tallies

    @property
    def share(self) -> Array:
        """Mean over photons (n,)."""
        return self.sum / self.photons

    @property
    def error(self) -> Array:
        """Standard error of `share` (n,): the spread of batches about what they would hold if they were all alike."""
        if self.batches == 1:
            return np.full_like(self.sum, np.inf)
        spread = self.squares - 2.0 * self.share * self.products + np.square(self.share) * self.squared_sizes
        return np.sqrt(np.maximum(spread, 0.0) * self.batches / (self.batches - 1.0)) / self.photons


class _Tracer:
    """Follows one channel's photons after another's."""

    def __init__(self, gpu: Gpu, photons: int, innermost: int, sky: bool, bar: Any) -> None:
        self.gpu, self.photons, self.innermost, self.sky, self.bar = gpu, photons, innermost, sky, bar
        self.batch = min(_BATCH, -(-photons // _BATCHES))
        module = wgsl.load(_MODULE)
        self.rings, self.slots = module.constants["RINGS"], module.constants["TALLIES"]
        # Enough to occupy the device, and few enough that a dispatch takes a moment.
        self.lanes = module.constants["LANES"] * (32 if gpu.is_cpu else 2048)
        self.idle = bytes(module.layout("Work").size + module.layout("Photon").size * (self.lanes - 1))

    def follow(self, layers: list[dict[str, float]], key: NDArray[Any]) -> _Count:
        """Photons through `layers` with the random numbers of `key`: each ring, what was absorbed, and both totals."""
        count = _Count()
        for first in range(0, self.photons, _ROUND * self.batch):
            end = min(first + _ROUND * self.batch, self.photons)
            sizes = np.diff(np.append(np.arange(first, end, self.batch), end))
            params = {"key": key, "first": first, "end": end, "batch": self.batch, "innermost": self.innermost}
            tallies = self._round(len(sizes), end - first, layers=layers, params=params)
            totals = [tallies[:, i : i + self.rings].sum(axis=1) for i in (0, self.rings)]
            count.add(np.column_stack([tallies, *totals]), sizes)
        return count

    def _round(self, batches: int, photons: int, **bindings: Any) -> Array:
        """Tallies (batches, slots) of photons of full weight."""
        work, tallies = self.gpu.buffer(self.idle), self.gpu.buffer(bytes(4 * batches * self.slots))
        constants = {"LEAPS": any(layer["transport"] < _ENDLESS for layer in bindings["layers"]), "SKY": self.sky}
        ended, on_their_way = 0, photons
        while on_their_way:
            graph = Graph(self.gpu)
            busy = graph.dispatch(_MODULE, size=self.lanes, work=work, tallies=tallies, constants=constants, **bindings)
            graph.run(busy)
            on_their_way = int(graph.read(busy).sum())
            taken = int(np.frombuffer(self.gpu.queue.read_buffer(work, 0, 4), np.uint32)[0])
            self.bar.update(min(taken, photons) - on_their_way - ended)
            ended = min(taken, photons) - on_their_way
        counted = np.frombuffer(self.gpu.queue.read_buffer(tallies), np.uint32)
        return counted.reshape(batches, self.slots) / 2.0**21
