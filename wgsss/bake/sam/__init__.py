"""Spatial Adjacency Maps (Maisch & Ropinski 2017): what each vertex receives through the object, from a few senders."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from wgsss.bake.rays import Caster
from wgsss.bake.sam.fan_quadrature import Fans
from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.fit.batched_nnls import nonnegative
from wgsss.bake.sam.fit.neighbour_mixture import MIX_BYTES, mix
from wgsss.bake.sam.fit.omp import pursue
from wgsss.bake.sam.fit.patch_form_factors import QuickFormFactors
from wgsss.bake.sam.fit.receiver_patches import Patches
from wgsss.bake.sam.fit.refit import refit
from wgsss.bake.sam.fit.select import SECOND, select_fit
from wgsss.bake.sam.fit.smoothed_means import blend
from wgsss.bake.sam.fit.training import training
from wgsss.bake.sam.form_factors import FormFactors
from wgsss.bake.sam.full_tree import everything
from wgsss.bake.sam.mesh_checks import concerns
from wgsss.bake.sam.published.blocks import Blocks
from wgsss.bake.sam.published.bounds import Bounds
from wgsss.bake.sam.published.coarse import select_coarse
from wgsss.bake.sam.published.top import best, select_top
from wgsss.bake.sam.sender_map import BYTES, Entries
from wgsss.bake.sam.sender_tree import senders
from wgsss.bake.sam.tree import tree
from wgsss.cache import Arrays, KeyPart, cached
from wgsss.errors import InputError, Note, unknown
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

__all__ = ["SELECTIONS", "Entries", "map_of_everything", "spatial_adjacency_map"]

SELECTIONS: dict[str, Callable[[Gpu, Mesh, Profile, int], Entries]] = {
    "top": select_top,
    "coarse": select_coarse,
    "fit": select_fit,
}
"""Ways to choose the senders, by name."""

MOST_BYTES = 1 << 30
"""of the entries of a map"""
_PROBES = np.geomspace(1e-4, 1e3, 512)  # mm: where profiles are compared
_TOP = (Entries, fan_areas, Fans, FormFactors, Blocks, Bounds, tree, best, "sam/form_factors", "sam/top")
_QUICK = (Entries, fan_areas, Fans, FormFactors, QuickFormFactors, Patches, senders, tree, "sam/form_factors")
_CODE: dict[str, tuple[Any, ...]] = {
    "top": _TOP,
    "coarse": _TOP,
    "fit": (*_QUICK, blend, mix, nonnegative, pursue, refit, training, Caster, "sam/blends", "sam/mix"),
    "everything": (*_QUICK, select_fit),
}
"""What each depends on, beside the module that it is in."""


def spatial_adjacency_map(gpu: Gpu, mesh: Mesh, profile: Profile, samples: int, select: str) -> Entries:
    """The map of a mesh with `samples` entries for each vertex, chosen as `select` says; cached.

    Warns of what makes front and back sides (000 eq. 13, 14) mean less than they should: see `concerns`.

    Raises InputError for a selection that is not there, fewer than one sample, and a map of more than MOST_BYTES.
    """
    if select not in SELECTIONS:
        raise unknown("selection", select, SELECTIONS)
    if samples < 1:
        raise InputError(f"{mesh.name}: a spatial adjacency map needs at least one sample, not {samples}")
    V, is_fit = len(mesh.positions), select == "fit"
    size = BYTES * samples * (V + -(-V // SECOND) * is_fit) + MIX_BYTES * V * is_fit
    if size > MOST_BYTES:
        raise InputError(
            f"{mesh.name}: {samples} samples for each of {V} vertices take {size} bytes, "
            f"and a spatial adjacency map may have {MOST_BYTES}"
        )
    return _cached(select, SELECTIONS[select], gpu, mesh, profile, samples)


def map_of_everything(gpu: Gpu, mesh: Mesh, profile: Profile) -> Entries:
    """A tree over all vertices of a mesh, and who receives anything from behind; cached. Warns as above."""
    return _cached("everything", everything, gpu, mesh, profile)


def _cached(
    name: str, choose: Callable[..., Entries], gpu: Gpu, mesh: Mesh, profile: Profile, *samples: int
) -> Entries:
    def make() -> Arrays:
        note = concerns(mesh)
        return {**choose(gpu, mesh, profile, *samples).arrays(), "note": np.array(note)}

    key: list[KeyPart] = [mesh.positions, mesh.faces, profile.total, profile.reflectance(_PROBES), *samples]
    found = cached("sam", [*key, name, gpu.name], make, code=(choose, concerns, *_CODE[name]))
    if note := str(found["note"]):
        warnings.warn(f"{mesh.name}: {note}", Note, stacklevel=3)
    return Entries.of(found)
