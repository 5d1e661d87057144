"""Checks of a mesh for which the split into a front and a back side is unreliable.

The split (Maisch & Ropinski 2017, section 3.3, eq. 13, 14) looks at positions and normals only. It is meaningful where
the mesh is one closed surface whose normals point outwards.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.geometry import face_components, signed_volume
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]


def topology_warning(mesh: Mesh) -> str:
    """Return one line that names the flaws of a mesh and what each does to M_back; empty where there are none.

    The flaws are open edges, edges between faces of inconsistent winding or of more than two faces, inverted normals of
    a closed mesh, and several connected components.
    """
    start, end = mesh.faces.ravel().astype(np.int64), np.roll(mesh.faces, -1, axis=1).ravel().astype(np.int64)
    low, high = np.minimum(start, end), np.maximum(start, end)
    edges, edge, count = np.unique(low * len(mesh.positions) + high, return_inverse=True, return_counts=True)
    forward = np.bincount(edge, start < end, len(edges))
    notes = []
    if open_edges := int((count == 1).sum()):
        notes.append(f"{_counted(open_edges, 'open edge')}: no light enters through the holes")
    inconsistent = int((count > 2).sum()) + int(((count == 2) & (forward != 1)).sum())
    if inconsistent:
        edge_count = _counted(inconsistent, "edge")
        notes.append(f"{edge_count} without exactly two faces of the same winding: some normals may point inwards")
    if not open_edges and signed_volume(mesh) < 0.0:
        notes.append("the normals point inwards: the outside of the object counts as its back side")
    if (components := int(face_components(mesh.faces).max()) + 1) > 1:
        notes.append(f"{components} separate components: light passes between them as if the gaps were filled")
    return "; ".join(notes)


def _counted(count: int, noun: str) -> str:
    """Return the count and the noun, in the plural for more than one."""
    return f"{count} {noun}{'s' if count > 1 else ''}"
