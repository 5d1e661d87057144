"""What the split into front and back sides means for meshes that are not one closed surface (000 §3.3)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]


def topology_warning(mesh: Mesh) -> str:
    """One line on what is open, non-manifold, inverted or in parts, and what comes of it; empty if nothing is."""
    start, end = mesh.faces.ravel().astype(np.int64), np.roll(mesh.faces, -1, axis=1).ravel().astype(np.int64)
    low, high = np.minimum(start, end), np.maximum(start, end)
    edges, each, count = np.unique(low * len(mesh.positions) + high, return_inverse=True, return_counts=True)
    forward = np.bincount(each, start < end, len(edges))
    notes = []
    if open_edges := int((count == 1).sum()):
        notes.append(f"{_counted(open_edges, 'open edge')}: where there is no surface, nothing arrives")
    crossing = int((count > 2).sum())
    if crossing := crossing + int(((count == 2) & (forward != 1)).sum()):
        notes.append(f"{_counted(crossing, 'edge')} not between two faces that agree: normals there may point inwards")
    if not open_edges and _volume(mesh) < 0.0:
        notes.append("wound inwards: what is outside counts as the back side")
    if (parts := _parts(mesh, low, high)) > 1:
        notes.append(f"{parts} parts: light passes from one to another as if the gaps between them were filled")
    return "; ".join(notes)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' if count > 1 else ''}"


def _volume(mesh: Mesh) -> float:
    """mm^3"""
    corner = mesh.positions[mesh.faces[:, 0]].astype(np.float64) - mesh.bounds.mean(axis=0)
    return float(np.einsum("ij,ij->", corner, mesh.face_normals) / 6.0)


def _parts(mesh: Mesh, start: Array, end: Array) -> int:
    """Connected parts, of those vertices that have faces."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(mesh.positions)
    graph = coo_array((np.ones(len(start), np.int8), (start, end)), shape=(count, count))
    return len(np.unique(connected_components(graph, directed=False)[1][mesh.faces[:, 0]]))
