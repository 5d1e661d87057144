"""Spatial Adjacency Maps (Maisch & Ropinski 2017): for each vertex, the senders that contribute to its M_back.

The selections choose a few senders for each vertex: `top` and `coarse` as the paper describes (published/), `fit` by a
least-squares fit (fit/). Meshes that deform can have a tree over all vertices instead (full_tree). All maps are cached.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from wgsss.bake.sam.fit.select import RECEIVERS_PER_SECOND_ROW, select_fit
from wgsss.bake.sam.full_tree import full_tree
from wgsss.bake.sam.mesh_checks import topology_warning
from wgsss.bake.sam.published.coarse import select_coarse
from wgsss.bake.sam.published.top import select_top
from wgsss.bake.sam.sender_map import ENTRY_BYTES, MIXTURE_BYTES, SenderMap
from wgsss.cache import Arrays, cached
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

    arrays = cached("sam", [mesh, profile, *count, name, gpu.name], make)
    if note := str(arrays["note"]):
        warnings.warn(f"{mesh.name}: {note}", Note, stacklevel=3)
    return SenderMap.from_arrays(arrays)
