"""Monte Carlo transport of photons in flat layers: the reference for diffusion models."""

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
_NEAREST = 1 / 256  # smallest resolved radius, in shortest mean free paths
_ENDLESS = 1e20  # mm; finite in float32 even after division by the smallest cosine
_CLEAR = 1e-4  # largest share of absorption in sigma_t' for which photons leap
_BATCH = 1024  # largest number of photons of a batch, so that tallies do not overflow
_BATCHES = 64  # smallest number of batches, if there are that many photons: the error is estimated from their spread
_ROUND = 8192  # batches per readback: 24 MiB


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
    """Trace photons through a stack of layers by the method of Wang, Jacques & Zheng 1995 (MCML).

    Equal arguments give equal bits on one adapter. If a medium hardly absorbs, photons far from the boundaries of a
    layer move in leaps by diffusion (see `wgsl/reference/photons.wgsl`).

    Args:
        layers: from the top down.
        photons: number of photons per channel.
        seed: of the random numbers, at least 0.
        eta_below: refractive index of the medium below the last layer. Above the first layer is air.
        sky: photons enter from all directions with equal radiance, and not at a right angle. Then fewer reach deep.
        gpu: the device to run on, by default the one that the commands share.
        label: label of the progress bar, which is shown on a terminal only.

    Raises:
        InputError: if the layers are not a stack, if photons is not from 1 to 2^31 - 1, or if the seed is negative.
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
        counts = [tracer.trace(_packed(layers, eta_below, channel), key) for channel, key in enumerate(keys)]
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
    """Return the layers as the shader reads them, for the photons of one channel."""
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
    """Sums of the tallies of batches."""

    def __init__(self) -> None:
        self.photons = self.batches = self.squared_sizes = 0
        self.sum: Any = 0.0
        self.squares: Any = 0.0
        self.products: Any = 0.0

    def add(self, tallies: Array, sizes: NDArray[np.int64]) -> None:
        """Add tallies (batches, n) of batches with `sizes` (batches,) photons."""
        self.photons += int(sizes.sum())
        self.batches += len(sizes)
        self.squared_sizes += int(np.square(sizes).sum())
        self.sum += tallies.sum(axis=0)
        self.squares += np.square(tallies).sum(axis=0)
        self.products += sizes @ tallies

    @property
    def share(self) -> Array:
        """Mean over the photons (n,)."""
        return self.sum / self.photons

    @property
    def error(self) -> Array:
        """Standard error of `share` (n,), from the spread of the batches about their expected tallies."""
        if self.batches == 1:
            return np.full_like(self.sum, np.inf)
        spread = self.squares - 2.0 * self.share * self.products + np.square(self.share) * self.squared_sizes
        return np.sqrt(np.maximum(spread, 0.0) * self.batches / (self.batches - 1.0)) / self.photons


class _Tracer:
    """Traces the photons of one channel after another on the GPU."""

    def __init__(self, gpu: Gpu, photons: int, innermost: int, sky: bool, bar: Any) -> None:
        self.gpu, self.photons, self.innermost, self.sky, self.bar = gpu, photons, innermost, sky, bar
        self.batch = min(_BATCH, -(-photons // _BATCHES))
        module = wgsl.load(_MODULE)
        self.rings, self.slots = module.constants["RINGS"], module.constants["TALLIES"]
        # Enough lanes to occupy the device, and few enough for a short dispatch.
        self.lanes = module.constants["LANES"] * (32 if gpu.is_cpu else 2048)
        self.idle = bytes(module.layout("Work").size + module.layout("Photon").size * (self.lanes - 1))

    def trace(self, layers: list[dict[str, float]], key: NDArray[Any]) -> _Count:
        """Trace photons through `layers` with the random numbers of `key`.

        Counts the photons of each ring, the absorbed ones, and the totals of both sides.
        """
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
        """Trace some batches, and return their tallies (batches, slots) in units of a photon of full weight."""
        work, tallies = self.gpu.buffer(self.idle), self.gpu.buffer(bytes(4 * batches * self.slots))
        constants = {"LEAPS": any(layer["transport"] < _ENDLESS for layer in bindings["layers"]), "SKY": self.sky}
        ended, active = 0, photons
        while active:
            graph = Graph(self.gpu)
            busy = graph.dispatch(_MODULE, size=self.lanes, work=work, tallies=tallies, constants=constants, **bindings)
            graph.run(busy)
            active = int(graph.read(busy).sum())
            taken = int(np.frombuffer(self.gpu.queue.read_buffer(work, 0, 4), np.uint32)[0])
            self.bar.update(min(taken, photons) - active - ended)
            ended = min(taken, photons) - active
        counted = np.frombuffer(self.gpu.queue.read_buffer(tallies), np.uint32)
        return counted.reshape(batches, self.slots) / 2.0**21
