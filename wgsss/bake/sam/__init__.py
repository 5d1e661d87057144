"""Spatial Adjacency Maps (Maisch & Ropinski 2017): for each vertex, the senders that contribute to its M_back.

The selections choose a few senders for each vertex: `top` and `coarse` as the paper describes (published/), `fit` by a
least-squares fit (fit/). Meshes that deform can have a tree over all vertices instead (full_tree). All maps are cached.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from wgsss.bake.rays import Caster
from wgsss.bake.sam.fan_quadrature import Fans
from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.fit.batched_nnls import batched_nnls
from wgsss.bake.sam.fit.candidates import candidates
from wgsss.bake.sam.fit.neighbour_mixture import neighbour_mixture
from wgsss.bake.sam.fit.omp import omp
from wgsss.bake.sam.fit.refit import refit
from wgsss.bake.sam.fit.select import RECEIVERS_PER_SECOND_ROW, select_fit
from wgsss.bake.sam.fit.smoothed_means import smoothed_means
from wgsss.bake.sam.fit.training import training_lights
from wgsss.bake.sam.form_factors import FormFactors
from wgsss.bake.sam.full_tree import full_tree
from wgsss.bake.sam.mesh_checks import topology_warning
from wgsss.bake.sam.patch_form_factors import PatchFormFactors
from wgsss.bake.sam.point_tree import point_tree
from wgsss.bake.sam.published.blocks import Blocks, Bounds
from wgsss.bake.sam.published.coarse import select_coarse
from wgsss.bake.sam.published.top import largest_form_factors, select_top
from wgsss.bake.sam.receiver_patches import ReceiverPatches
from wgsss.bake.sam.sender_map import ENTRY_BYTES, MIXTURE_BYTES, SenderMap
from wgsss.bake.sam.sender_tree import sender_tree
from wgsss.cache import Arrays, KeyPart, cached
from wgsss.errors import InputError, Note, unknown
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

__all__ = ["SELECTIONS", "SenderMap", "full_sender_tree", "spatial_adjacency_map"]

SELECTIONS: dict[str, Callable[[Gpu, Mesh, Profile, int], SenderMap]] = {
    "top": select_top,
    "coarse": select_coarse,
    "fit": select_fit,
}
"""The functions that choose the senders and weights, by the name of the selection."""

MAX_BYTES = 1 << 30
"""largest size of a map"""
_PROBES = np.geomspace(1e-4, 1e3, 512)  # mm: distances at which R_d is part of the cache key
_TOP = (
    SenderMap,
    fan_areas,
    Fans,
    FormFactors,
    Blocks,
    Bounds,
    point_tree,
    largest_form_factors,
    "sam/form_factors",
    "sam/top",
)
_PATCHES = (
    SenderMap,
    fan_areas,
    Fans,
    FormFactors,
    PatchFormFactors,
    ReceiverPatches,
    sender_tree,
    point_tree,
    "sam/form_factors",
)
_CODE: dict[str, tuple[Any, ...]] = {
    "top": _TOP,
    "coarse": _TOP,
    "fit": (
        *_PATCHES,
        candidates,
        smoothed_means,
        neighbour_mixture,
        batched_nnls,
        omp,
        refit,
        training_lights,
        Caster,
        "sam/blends",
        "sam/mix",
    ),
    "full_tree": (*_PATCHES, select_fit),
}
"""Functions and classes whose modules, and WGSL modules, on which each kind of map depends."""


def spatial_adjacency_map(gpu: Gpu, mesh: Mesh, profile: Profile, entries_per_vertex: int, select: str) -> SenderMap:
    """Return the map of a mesh, from the cache if it is there, by one of SELECTIONS.

    Warns of flaws of the mesh that make the split into front and back sides unreliable (see `topology_warning`).

    Raises InputError for an unknown selection, fewer than one entry per vertex, and a map of more than MAX_BYTES.
    """
    if select not in SELECTIONS:
        raise unknown("selection", select, SELECTIONS)
    if entries_per_vertex < 1:
        raise InputError(
            f"{mesh.name}: samples, the number of entries per vertex, must be at least 1, not {entries_per_vertex}"
        )
    V, is_fit = len(mesh.positions), select == "fit"
    rows = V + -(-V // RECEIVERS_PER_SECOND_ROW) * is_fit
    size = ENTRY_BYTES * entries_per_vertex * rows + MIXTURE_BYTES * V * is_fit
    if size > MAX_BYTES:
        raise InputError(
            f"{mesh.name}: {entries_per_vertex} entries for each of {V} vertices take {size} bytes, "
            f"but a spatial adjacency map may have at most {MAX_BYTES}"
        )
    return _cached(select, SELECTIONS[select], gpu, mesh, profile, entries_per_vertex)


def full_sender_tree(gpu: Gpu, mesh: Mesh, profile: Profile) -> SenderMap:
    """Return the map of a mesh that deforms, from the cache if it is there (see `full_tree`). Warns as above."""
    return _cached("full_tree", full_tree, gpu, mesh, profile)


def _cached(
    name: str, choose: Callable[..., SenderMap], gpu: Gpu, mesh: Mesh, profile: Profile, *count: int
) -> SenderMap:
    """Return the map of `choose(gpu, mesh, profile, *count)` from the cache, and warn of flaws of the mesh.

    The warning is stored with the map, so that a cached map warns as well.
    """

    def make() -> Arrays:
        note = topology_warning(mesh)
        return {**choose(gpu, mesh, profile, *count).arrays(), "note": np.array(note)}

    key: list[KeyPart] = [mesh.positions, mesh.faces, profile.total, profile.reflectance(_PROBES), *count]
    arrays = cached("sam", [*key, name, gpu.name], make, code=(choose, topology_warning, *_CODE[name]))
    if note := str(arrays["note"]):
        warnings.warn(f"{mesh.name}: {note}", Note, stacklevel=3)
    return SenderMap.from_arrays(arrays)
