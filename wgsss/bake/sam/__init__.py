"""Spatial Adjacency Maps (Maisch & Ropinski 2017): what each vertex receives through the object, from a few senders."""

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
from wgsss.bake.sam.fit.select import SECOND, select_fit
from wgsss.bake.sam.fit.smoothed_means import smoothed_means
from wgsss.bake.sam.fit.training import training
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
"""Ways to choose the senders, by name."""

MOST_BYTES = 1 << 30
"""of the entries of a map"""
_PROBES = np.geomspace(1e-4, 1e3, 512)  # mm: where profiles are compared
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
        training,
        Caster,
        "sam/blends",
        "sam/mix",
    ),
    "full_tree": (*_PATCHES, select_fit),
}
"""What each depends on, beside the module that it is in."""


def spatial_adjacency_map(gpu: Gpu, mesh: Mesh, profile: Profile, samples: int, select: str) -> SenderMap:
    """The map of a mesh with `samples` entries for each vertex, chosen as `select` says; cached.

    Warns of what makes front and back sides (000 eq. 13, 14) mean less than they should: see `topology_warning`.

    Raises InputError for a selection that is not there, fewer than one sample, and a map of more than MOST_BYTES.
    """
    if select not in SELECTIONS:
        raise unknown("selection", select, SELECTIONS)
    if samples < 1:
        raise InputError(f"{mesh.name}: a spatial adjacency map needs at least one sample, not {samples}")
    V, is_fit = len(mesh.positions), select == "fit"
    size = ENTRY_BYTES * samples * (V + -(-V // SECOND) * is_fit) + MIXTURE_BYTES * V * is_fit
    if size > MOST_BYTES:
        raise InputError(
            f"{mesh.name}: {samples} samples for each of {V} vertices take {size} bytes, "
            f"and a spatial adjacency map may have {MOST_BYTES}"
        )
    return _cached(select, SELECTIONS[select], gpu, mesh, profile, samples)


def full_sender_tree(gpu: Gpu, mesh: Mesh, profile: Profile) -> SenderMap:
    """A tree over all vertices of a mesh, and who receives anything from behind; cached. Warns as above."""
    return _cached("full_tree", full_tree, gpu, mesh, profile)


def _cached(
    name: str, choose: Callable[..., SenderMap], gpu: Gpu, mesh: Mesh, profile: Profile, *samples: int
) -> SenderMap:
    def make() -> Arrays:
        note = topology_warning(mesh)
        return {**choose(gpu, mesh, profile, *samples).arrays(), "note": np.array(note)}

    key: list[KeyPart] = [mesh.positions, mesh.faces, profile.total, profile.reflectance(_PROBES), *samples]
    found = cached("sam", [*key, name, gpu.name], make, code=(choose, topology_warning, *_CODE[name]))
    if note := str(found["note"]):
        warnings.warn(f"{mesh.name}: {note}", Note, stacklevel=3)
    return SenderMap.from_arrays(found)
