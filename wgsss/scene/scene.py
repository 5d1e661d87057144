"""A scene: objects, lights, a camera, and the settings of tone mapping."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, unknown
from wgsss.scene import checks
from wgsss.scene.camera import Camera
from wgsss.scene.checks import Triple
from wgsss.scene.light import Light, PointLight, RectLight, SphereLight
from wgsss.scene.material import Material
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

TONE_MAPS = ("none", "reinhard", "aces")
FAR = 16.0
"""A scene is moved to the origin for rendering if the target of its camera is farther from the origin than this number
times the distance between eye and target."""


class Motion(Protocol):
    """A periodic deformation of an object."""

    @property
    def period_s(self) -> float:
        """The period, seconds."""

    def apply(self, positions: Array, time_s: float) -> Array:
        """Deform positions (V, 3) at rest to those at a time in seconds. Both are in object space, mm."""


@dataclass(frozen=True, eq=False)
class Object:
    """A mesh of one material, placed in the world."""

    mesh: Mesh
    material: Material
    translate: Triple = (0.0, 0.0, 0.0)
    """mm, applied after the rotation"""
    rotate: Triple = (0.0, 0.0, 0.0)
    """degrees about the world's x, then y, then z axis, through the object's origin"""
    motion: Motion | None = None
    """a deformation in object space, applied before the object is placed"""

    def __post_init__(self) -> None:
        checks.position(self, "translate")
        checks.triple(self, "rotate", -checks.ANGLE, checks.ANGLE, "degrees")
        if self.material.maps.layers and self.mesh.corner_uvs is None:
            raise InputError(
                f"{self.mesh.name}: the mesh has no texture coordinates, which the maps of the layers of material "
                f"'{self.material.name}' need"
            )

    @cached_property
    def matrix(self) -> npt.NDArray[np.float64]:
        """The rigid matrix (4, 4) from object space to world space."""
        matrix = np.eye(4)
        for axis, degrees in enumerate(self.rotate):
            cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
            i, j = (axis + 1) % 3, (axis + 2) % 3
            turn = np.eye(4)
            turn[i, i], turn[i, j], turn[j, i], turn[j, j] = cos, -sin, sin, cos
            matrix = turn @ matrix
        matrix[:3, 3] = self.translate
        return matrix

    @cached_property
    def placed(self) -> npt.NDArray[np.float64]:
        """float64 (V, 3): the positions of the mesh in world space, mm."""
        world: npt.NDArray[np.float64] = self.mesh.positions @ self.matrix[:3, :3].T + self.matrix[:3, 3]
        return world

    def at(self, time_s: float) -> Object:
        """Return the object at a time in seconds, without motion. Raises InputError if its shape is invalid then."""
        if self.motion is None:
            return self
        try:
            moved = self.mesh.deformed(self.motion.apply(self.mesh.positions, time_s))
        except InputError as error:
            raise InputError(f"{error}, {time_s:g} s into its motion") from None
        return replace(self, mesh=moved, motion=None)


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects, lights and a camera. Raises InputError naming the field that is out of range."""

    name: str
    objects: tuple[Object, ...]
    lights: tuple[Light, ...]
    camera: Camera
    exposure: float = 0.0
    """stops: radiance is multiplied by 2^exposure before tone mapping"""
    tone_map: str = "aces"
    """one of none, reinhard, aces"""
    bloom: float = 0.0
    """share of the light that spreads over nearby pixels in the display image; the radiance is unchanged"""

    def __post_init__(self) -> None:
        object.__setattr__(self, "objects", tuple(self.objects))
        object.__setattr__(self, "lights", tuple(self.lights))
        checks.name(self)
        if not self.objects:
            raise InputError(f"{self.name}: the scene has no objects")
        checks.number(self, "exposure", -32, 32, "stops")
        checks.number(self, "bloom", 0, 1)
        if self.tone_map not in TONE_MAPS:
            raise unknown("tone_map", str(self.tone_map), TONE_MAPS)

    @cached_property
    def bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3): the least and greatest coordinates of all objects in world space, mm."""
        points = np.concatenate([o.placed for o in self.objects])
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def near_origin(self) -> Scene:
        """Move the scene so that the target of the camera is at the origin, if it is far away from it.

        Far from the origin, coordinates in single precision would be too coarse.
        """
        camera = self.camera
        if math.dist((0, 0, 0), camera.target) <= FAR * math.dist(camera.eye, camera.target):
            return self

        def moved(point: Triple) -> Triple:
            x, y, z = (float(p - t) for p, t in zip(point, camera.target, strict=True))
            return x, y, z

        return replace(
            self,
            objects=tuple(replace(o, translate=moved(o.translate)) for o in self.objects),
            lights=tuple(
                replace(light, position=moved(light.position))
                if isinstance(light, PointLight | RectLight | SphereLight)
                else light
                for light in self.lights
            ),
            camera=replace(camera, eye=moved(camera.eye), target=(0.0, 0.0, 0.0)),
        )

    def at(self, time_s: float) -> Scene:
        """Return the scene at a time in seconds, as one in which nothing moves.

        Raises InputError for times above 1e9 s or below -1e9 s.
        """
        checks.time(time_s)
        return replace(self, objects=tuple(o.at(time_s) for o in self.objects), camera=self.camera.at(time_s))
