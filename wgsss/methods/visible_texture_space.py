"""jimenez08: texture-space diffusion of what is seen (Jimenez & Gutierrez 2008, Faster rendering of human skin).

Three ways to do less, each with a switch: texels that face away are not lit, maps shrink with distance, and what is
beside the image is left out. Texels that are left out have an alpha of 0, and blurs pass over them by a depth test: on
the paper's hardware asking for alpha was a tenth faster, on a CPU it would save nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from wgsss.bake.normal_spread import normal_spread
from wgsss.frame import Frame, irradiance_texels
from wgsss.gpu import Buffer
from wgsss.graph import Handle
from wgsss.methods.texture_space import TextureSpace
from wgsss.scene import Mesh
from wgsss.stage import Body, Stage

Array = npt.NDArray[np.float64]

LEAST_COSINE = math.cos(math.radians(105.0))
"""105 degrees, and not the 90 of what can be seen, since light comes from what cannot (section 3)."""
TEXELS_PER_PIXEL = 1.5
"""At least, beyond the reference distance d_ref (eq. 3). With fewer, pixels are further from the mean over their area
than those of the full map, which has so many texels to a pixel that it flickers; the paper has about one."""
SMALLEST = 64
"""Texels. Smaller maps lose whole charts."""
REACH = 3.0
"""Standard deviations of the widest Gaussian, over which light spreads."""
_EDGE_TEXELS = 4.0  # what filters read around a texel


@dataclass(frozen=True)
class VisibleTextureSpace(TextureSpace):
    """M_front over the part of the atlas that is seen, at the size at which it is seen; M_back is not estimated."""

    culled: bool = field(default=True, metadata={"unit": "", "help": "leave out what faces away"})
    depth_based: bool = field(default=True, metadata={"unit": "", "help": "make maps smaller with distance"})
    clipped: bool = field(default=True, metadata={"unit": "", "help": "leave out what is beside the image"})

    source: ClassVar[str] = "Jimenez & Gutierrez 2008, Faster rendering of human skin"

    def bake(self, stage: Stage) -> None:
        """As TextureSpace, for all sizes that maps may have, so that no frame has to wait for one."""
        for size in self.steps() if self.depth_based else [self.map_size]:
            TextureSpace.bake(replace(self, map_size=size), stage)
        if self.culled:
            for body in stage.bodies:
                self.least_cosines(body)

    def steps(self) -> list[int]:
        """The sizes that maps may have, two to an octave, largest first: 1, 3/4, 1/2, 3/8 and so on. However the camera
        moves, all of them together take twice the memory of the largest."""
        octaves = range(int(math.log2(self.map_size)))
        sizes = [size for k in octaves for size in (self.map_size >> k, 3 * self.map_size >> (k + 2))]
        return [size for size in sizes if size == self.map_size or size >= SMALLEST]

    def maps(self, frame: Frame, body: Body) -> list[Handle]:
        size = self.size_seen(frame, body) if self.depth_based else self.map_size
        smaller = replace(self, map_size=size)
        planes = smaller.planes(frame, body) if self.clipped else np.zeros((6, 4))
        if (corners(frame, body) @ planes.T < 0.0).all(axis=0).any():
            return []
        culled = self.culled and hides_its_back(frame, body)
        if not culled and not self.clipped:
            return smaller.blurs(frame, body)
        least = self.least_cosines(body) if culled else None
        irradiance = irradiance_texels(frame, body, size, least_cosines=least, planes=planes)
        return smaller.blur(frame, body, irradiance)

    def size_seen(self, frame: Frame, body: Body) -> int:
        """The size of a body's map: s T_max (eq. 3, 4), or the next larger one of `steps`."""
        pixels_per_mm = pixels_at(frame, corners(frame, body))
        s = min(TEXELS_PER_PIXEL * pixels_per_mm / self.texels_per_mm(body), 1.0)
        return min(size for size in self.steps() if size >= s * self.map_size or size == self.map_size)

    def least_cosines(self, body: Body) -> Buffer:
        """A buffer of array<f32>: the cosine of the angle from the viewer, beyond which render vertices are not lit.

        That is 105 degrees, as in the paper, and more where the surface turns by more than 15 within the distance that
        light spreads over: its margin would be too small at edges and on thin things.
        """
        stage, distance = body.stage, self.spread(body)

        def make() -> Buffer:
            render_mesh = body.render_mesh
            spread = normal_spread(body.rest.mesh.positions[render_mesh.vertex], render_mesh.normals, distance)
            return stage.gpu.buffer(np.minimum(LEAST_COSINE, -np.sin(np.minimum(spread, np.pi / 2))).astype(np.float32))

        return stage.shared(("least cosines", id(body.rest.mesh), distance), make)

    def spread(self, body: Body) -> float:
        """How far light spreads along a body's surface, mm."""
        return REACH * math.sqrt(self.profile(body).variances[-1])

    def planes(self, frame: Frame, body: Body) -> Array:
        """(6, 4): the planes of what the camera sees (eq. 5, 6), in world space and mm, facing inwards, and moved
        outwards by as far as light spreads."""
        x, y, z, w = frame.view.world_to_clip
        planes = np.stack([w + x, w - x, w + y, w - y, z, w - z])
        planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
        planes[:, 3] += self.spread(body) + _EDGE_TEXELS / self.texels_per_mm(body)
        return planes


def corners(frame: Frame, body: Body) -> Array:
    """(8, 4): the corners of a body's bounding box as posed, in world space, mm, homogeneous."""
    posed = frame.stage.scene.objects[body.index]
    box = np.array(np.meshgrid(*posed.mesh.bounds.astype(np.float64).T, indexing="ij")).reshape(3, -1).T
    return np.column_stack([box, np.ones(8)]) @ posed.matrix.T


def pixels_at(frame: Frame, points: Array) -> float:
    """Pixels that 1 mm across the view takes in the image, at the nearest of homogeneous points (N, 4)."""
    _, y, _, w = frame.view.world_to_clip
    distance = float((points @ w).min())  # in perspective along the view, else 1
    return float(np.linalg.norm(y[:3])) * frame.size[1] / 2 / distance if distance > 0.0 else math.inf


def hides_its_back(frame: Frame, body: Body) -> bool:
    """Whether what faces away cannot be seen: the mesh encloses what is inside it, and the camera is not."""
    posed = frame.stage.scene.objects[body.index]
    eye = np.linalg.solve(posed.matrix, frame.view.eye)[:3]
    inside = frame.view.eye[3] == 1.0 and bool(((posed.mesh.bounds[0] <= eye) & (eye <= posed.mesh.bounds[1])).all())
    return not inside and body.stage.shared(("closed", id(body.rest.mesh)), lambda: is_closed(body.rest.mesh))


def is_closed(mesh: Mesh) -> bool:
    """Whether each edge is between two faces that run along it in opposite ways, and faces are outside."""
    ends = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    code = ends @ [len(mesh.positions), 1]
    back = ends @ [1, len(mesh.positions)]
    apart = mesh.positions[mesh.faces[:, 0]].astype(np.float64) - mesh.bounds.mean(axis=0)
    volume = np.einsum("ij,ij->", apart, mesh.face_normals)
    return len(np.unique(code)) == len(code) and np.array_equal(np.sort(code), np.sort(back)) and bool(volume > 0.0)
