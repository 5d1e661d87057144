"""jimenez08: diffusion in texture space of what is visible (Jimenez & Gutierrez 2008, Faster rendering of human skin).

The paper saves work in three ways, and each has a switch: texels that face away from the viewer are left out, distant
objects have smaller maps, and texels outside of the image are left out. Texels that are left out have an alpha of 0.
The blurs skip them by a depth test. Testing alpha instead was ten per cent faster on the paper's hardware; on CPUs it
would save nothing.
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
from wgsss.scene.geometry import is_closed
from wgsss.stage import Body, Stage

Array = npt.NDArray[np.float64]

LEAST_COSINE = math.cos(math.radians(105.0))
"""Of 105 degrees between normal and viewer: from 90 degrees on a point is invisible, but its light may be (section
3)."""
TEXELS_PER_PIXEL = 1.5
"""The least resolution of a map beyond the reference distance d_ref (eq. 3). With fewer texels, the error of pixels
against the mean over their area is larger than with the full map, which aliases. The paper has about one."""
SMALLEST = 64
"""The smallest size of a map, texels. Smaller maps lose whole charts."""
REACH = 3.0
"""The distance over which light spreads, in standard deviations of the widest Gaussian."""
_EDGE_TEXELS = 4.0  # radius of the filters that read a map


@dataclass(frozen=True)
class VisibleTextureSpace(TextureSpace):
    """M_front by diffusion over the visible part of the atlas, at a size for its size in the image; M_back is not
    estimated."""

    culled: bool = field(default=True, metadata={"unit": "", "help": "leave out texels that face away from the viewer"})
    depth_based: bool = field(default=True, metadata={"unit": "", "help": "make the maps of distant objects smaller"})
    clipped: bool = field(default=True, metadata={"unit": "", "help": "leave out texels outside of the image"})

    source: ClassVar[str] = "Jimenez & Gutierrez 2008, Faster rendering of human skin"

    def bake(self, stage: Stage) -> None:
        """Bake as TextureSpace does for all sizes that maps may have, so that no frame has to wait for one."""
        for size in self.steps() if self.depth_based else [self.map_size]:
            TextureSpace.bake(replace(self, map_size=size), stage)
        if self.culled:
            for body in stage.bodies:
                self.least_cosines(body)

    def steps(self) -> list[int]:
        """Return the sizes that maps may have, two per octave, largest first: factors of 1, 3/4, 1/2, 3/8 and so on.
        The charts of all of them together take about twice the memory of the largest."""
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
        """Return the size of a body's map: s T_max (eq. 3, 4), rounded up to one of `steps`."""
        pixels_per_mm = pixels_at(frame, corners(frame, body))
        s = min(TEXELS_PER_PIXEL * pixels_per_mm / self.texels_per_mm(body), 1.0)
        return min(size for size in self.steps() if size >= s * self.map_size or size == self.map_size)

    def least_cosines(self, body: Body) -> Buffer:
        """Return a buffer of f32 with the least cosine between normal and viewer at which each render vertex is lit.

        The angle is 105 degrees, as in the paper, and larger where the normals turn by more than 15 degrees within the
        distance over which light spreads: the paper's margin would be too small at edges and on thin parts.
        """
        stage, distance = body.stage, self.spread(body)

        def make() -> Buffer:
            render_mesh = body.render_mesh
            spread = normal_spread(body.rest.mesh.positions[render_mesh.vertex], render_mesh.normals, distance)
            return stage.gpu.buffer(np.minimum(LEAST_COSINE, -np.sin(np.minimum(spread, np.pi / 2))).astype(np.float32))

        return stage.shared(("least cosines", id(body.rest.mesh), distance), make)

    def spread(self, body: Body) -> float:
        """Return the distance over which light spreads along a body's surface, mm."""
        return REACH * math.sqrt(self.profile(body).variances[-1])

    def planes(self, frame: Frame, body: Body) -> Array:
        """Return the planes (6, 4) of the view frustum (eq. 5, 6), in world space, mm, with normals that face inwards.
        They are moved outwards by the distance over which light spreads."""
        x, y, z, w = frame.view.world_to_clip
        planes = np.stack([w + x, w - x, w + y, w - y, z, w - z])
        planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
        planes[:, 3] += self.spread(body) + _EDGE_TEXELS / self.texels_per_mm(body)
        return planes


def corners(frame: Frame, body: Body) -> Array:
    """Return the corners (8, 4) of a body's bounding box as posed, in world space, mm, in homogeneous coordinates."""
    posed = frame.stage.scene.objects[body.index]
    box = np.array(np.meshgrid(*posed.mesh.bounds.astype(np.float64).T, indexing="ij")).reshape(3, -1).T
    return np.column_stack([box, np.ones(8)]) @ posed.matrix.T


def pixels_at(frame: Frame, points: Array) -> float:
    """Return the pixels per mm across the view at the nearest of some points (N, 4), in homogeneous coordinates."""
    _, y, _, w = frame.view.world_to_clip
    distance = float((points @ w).min())  # along the view in perspective, otherwise 1
    return float(np.linalg.norm(y[:3])) * frame.size[1] / 2 / distance if distance > 0.0 else math.inf


def hides_its_back(frame: Frame, body: Body) -> bool:
    """Return whether faces that face away are invisible: the mesh is closed, and the camera is outside."""
    posed = frame.stage.scene.objects[body.index]
    eye = np.linalg.solve(posed.matrix, frame.view.eye)[:3]
    inside = frame.view.eye[3] == 1.0 and bool(((posed.mesh.bounds[0] <= eye) & (eye <= posed.mesh.bounds[1])).all())
    return not inside and body.stage.shared(("closed", id(body.rest.mesh)), lambda: is_closed(body.rest.mesh))
