"""Meshes with texture coordinates whose stretch and seams are known in closed form."""

from __future__ import annotations

import numpy as np

from wgsss.bake.unwrap import RenderMesh
from wgsss.scene import Mesh

TILTED = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
"""an orthonormal frame that is not aligned with the axes"""


def sheet(
    uv_per_mm: np.ndarray, *, side: float = 20.0, cells: int = 4, center: tuple[float, float] = (0.5, 0.5)
) -> Mesh:
    """Make a tilted square of `side` mm with uv = center + uv_per_mm (2, 2) @ (x, y), x and y in mm from the centre."""
    t = np.linspace(-side / 2, side / 2, cells + 1)
    x, y = np.meshgrid(t, t)
    plane = np.stack([x, y], axis=-1).reshape(-1, 2)
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    faces = np.concatenate([np.stack([a, a + 1, a + cells + 2], 1), np.stack([a, a + cells + 2, a + cells + 1], 1)])
    uvs = np.array(center) + plane @ np.asarray(uv_per_mm).T
    return Mesh(plane @ TILTED[:2], faces, corner_uvs=uvs[faces], name="sheet")


def box(seed: int = 0, side: float = 10.0, cells: int = 1) -> Mesh:
    """Make a cube. Each side is a chart with random size and rotation; every second one is mirrored."""
    rng = np.random.default_rng(seed)
    t = np.linspace(-0.5, 0.5, cells + 1)
    a, b = np.meshgrid(t, t)
    grid = np.stack([a, b], axis=-1).reshape(-1, 2)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    n = cells + 1
    two = np.concatenate(
        [np.stack([corner, corner + 1, corner + n + 1], 1), np.stack([corner, corner + n + 1, corner + n], 1)]
    )
    positions, uvs, faces = [], [], []
    for k in range(6):
        axis, sign = k // 2, 1 - 2 * (k % 2)
        place = np.zeros((len(grid), 3))
        place[:, axis] = 0.5 * sign
        place[:, (axis + 1) % 3], place[:, (axis + 2) % 3] = grid[:, 0] * sign, grid[:, 1]
        angle, scale = rng.uniform(0, 2 * np.pi), rng.uniform(0.16, 0.21)
        turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turn[:, 0] *= 1 - 2 * (k % 2)
        uvs.append(np.array([k % 3 + 0.5, 1.5 * (k // 3) + 0.75]) / 3 + grid @ turn.T)
        faces.append(two + len(grid) * k)
        positions.append(place)
    faces_all = np.concatenate(faces)
    welded, index = np.unique(np.round(np.concatenate(positions), 9), axis=0, return_inverse=True)
    return Mesh(side * welded, index.reshape(-1)[faces_all], corner_uvs=np.concatenate(uvs)[faces_all], name="box")


def cylinder(radius: float = 5.0, height: float = 20.0, sides: int = 48, rows: int = 12) -> Mesh:
    """Make an open cylinder about z: u is 0.1 to 0.9 around it, v is 0.2 at the top and 0.8 at the bottom."""
    around, along = np.meshgrid(np.arange(sides + 1), np.arange(rows + 1))
    angle = 2 * np.pi * (around % sides) / sides
    grid = np.stack([radius * np.cos(angle), radius * np.sin(angle), height * (0.5 - along / rows)], axis=-1).reshape(
        -1, 3
    )
    uvs = np.stack([0.1 + 0.8 * around / sides, 0.2 + 0.6 * along / rows], axis=-1).reshape(-1, 2)
    n = sides + 1
    a = (np.arange(rows)[:, None] * n + np.arange(sides)).reshape(-1)
    faces = np.concatenate([np.stack([a, a + n, a + n + 1], 1), np.stack([a, a + n + 1, a + 1], 1)])
    welded = np.arange(len(grid)).reshape(rows + 1, n)
    welded[:, -1] = welded[:, 0]
    distinct, index = np.unique(welded, return_inverse=True)
    return Mesh(grid[distinct], index.reshape(-1)[faces], corner_uvs=uvs[faces], name="cylinder")


def icosphere(radius: float, levels: int) -> Mesh:
    """Make a closed sphere without texture coordinates."""
    import trimesh

    sphere = trimesh.creation.icosphere(levels, radius)
    return Mesh(sphere.vertices, sphere.faces, name="sphere")


def locate(mesh: Mesh, render_mesh: RenderMesh, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute positions (N, 3), mm, of atlas points (N, 2), and the face (N,) that contains or is nearest to each."""
    corners = render_mesh.atlas.astype(float)[render_mesh.faces]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    local = np.einsum("fij,nfj->nfi", np.linalg.inv(edges), uv[:, None] - corners[None, :, 0])
    barycentric = np.concatenate([1 - local.sum(-1, keepdims=True), local], axis=-1)
    face = barycentric.min(axis=-1).argmax(axis=-1)
    weights = barycentric[np.arange(len(uv)), face]
    return np.einsum("nk,nkj->nj", weights, mesh.positions.astype(float)[mesh.faces[face]]), face
