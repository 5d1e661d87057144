"""A scene: objects, lights, a camera, and how its light becomes a picture."""

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
"""Distance of the point that the camera looks at from the origin, in distances from the camera, beyond which a scene is
moved to the origin to be rendered."""


class Motion(Protocol):
    """How an object's shape changes over time, over and over."""

    @property
    def period_s(self) -> float:
        """Seconds after which it begins anew."""

    def apply(self, positions: Array, time_s: float) -> Array:
        """Positions (V, 3) in mm, in the object's own space, as they are at a time in seconds."""


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
    """in the object's own space, before it is placed"""

    def __post_init__(self) -> None:
        checks.position(self, "translate")
        checks.triple(self, "rotate", -checks.ANGLE, checks.ANGLE, "degrees")

    @cached_property
    def matrix(self) -> npt.NDArray[np.float64]:
        """(4, 4): object space to world space, rigid."""
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
        """float64 (V, 3): the mesh's positions in world space, mm."""
        world: npt.NDArray[np.float64] = self.mesh.positions @ self.matrix[:3, :3].T + self.matrix[:3, 3]
        return world

    def at(self, time_s: float) -> Object:
        """The object as it is at a time in seconds, no longer moving. Raises InputError where that is no shape."""
        if self.motion is None:
            return self
        try:
            moved = self.mesh.deformed(self.motion.apply(self.mesh.positions, time_s))
        except InputError as error:
            raise InputError(f"{error}, {time_s:g} s into its motion") from None
        return replace(self, mesh=moved, motion=None)


@dataclass(frozen=True, eq=False)
class Scene:
    """What is rendered. Raises InputError naming the field that does not fit."""

    name: str
    objects: tuple[Object, ...]
    lights: tuple[Light, ...]
    camera: Camera
    exposure: float = 0.0
    """stops: radiance is multiplied by 2^exposure before tone mapping"""
    tone_map: str = "aces"
    """one of none, reinhard, aces"""
    bloom: float = 0.0
    """the share of the light that spreads over the pixels around, on a display: radiance stays as it is"""

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
        """(2, 3): the least and greatest coordinates of all objects, world mm."""
        points = np.concatenate([o.placed for o in self.objects])
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def near_origin(self) -> Scene:
        """The same scene moved so that what the camera looks at is at the origin, where that is far away:
        coordinates in single precision would be too coarse there."""
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
        """The scene as it is at a time in seconds: a still, in which nothing moves or turns.

        Raises InputError for times beyond 1e9 s either way.
        """
        checks.time(time_s)
        return replace(self, objects=tuple(o.at(time_s) for o in self.objects), camera=self.camera.at(time_s))
