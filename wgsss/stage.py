"""A scene on the GPU: the buffers and textures that persist from frame to frame, uploaded at their first use."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.environment import Prefiltered, SplitEnvironment, prefilter, split_environments
from wgsss.bake.layer_profile import diffusion_profile
from wgsss.bake.samples import Samples
from wgsss.bake.sky import sky_visibility
from wgsss.bake.unwrap import RenderMesh, split, unwrap
from wgsss.gpu import Buffer, Gpu, Texture
from wgsss.optics import Profile
from wgsss.scene import EnvironmentLight, Material, Mesh, Object, Scene
from wgsss.scene.light import Light
from wgsss.scene.material import WRAPS

Array = npt.NDArray[Any]
T = TypeVar("T")


@dataclass(frozen=True)
class SurfacePoints:
    """Points of a posed surface in object space, float32."""

    position: Array
    """(N, 3) mm"""
    normal: Array
    """(N, 3) of length 1"""
    uv: Array
    """(N, 2)"""
    area: Array
    """(N,) mm^2"""


@dataclass(frozen=True)
class Maps:
    """A material's textures by binding name; a single neutral texel where the material has none."""

    base_color_map: Texture
    normal_map: Texture
    specular_map: Texture

    @property
    def bindings(self) -> dict[str, Texture]:
        names = ("base_color_map", "normal_map", "specular_map")
        return {name: getattr(self, name) for name in names}


class Stage:
    """A scene on a device, posed at a time.

    Attributes:
        gpu: the device.
        rest: the scene as given, moved near the origin.
        scene: the scene at `time_s`, with all motion applied.
        bodies: its objects on the device.
    """

    def __init__(self, gpu: Gpu, scene: Scene, time_s: float = 0.0) -> None:
        self.gpu = gpu
        self.rest = scene.near_origin()
        self.time_s = time_s
        self.scene = self.rest.at(time_s)
        self._shared: dict[Hashable, Any] = {}
        self.bodies = [Body(self, i) for i in range(len(scene.objects))]

    def pose(self, time_s: float) -> None:
        """Move to another time. Only objects with a motion are uploaded again."""
        self.time_s = time_s
        self.scene = self.rest.at(time_s)

    def shared(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what `make` returned the first time that it was called for this key: bodies and frames share it."""
        if key not in self._shared:
            self._shared[key] = make()
        value: T = self._shared[key]
        return value

    def image(self, pixels: Array, texture_format: str) -> Texture:
        """Return a texture of an image (height, width[, 3 or 4]). Colours without alpha become opaque."""

        def make() -> Texture:
            opaque = np.full((*pixels.shape[:2], 4), 255, np.uint8)
            if pixels.ndim == 3:
                opaque[..., :3] = pixels
            return self.gpu.texture(opaque if pixels.ndim == 3 else pixels, texture_format)

        return self.shared(("image", id(pixels), texture_format), make)

    def environments(self) -> list[EnvironmentLight]:
        """Return the environments that light the scene."""
        return [light for light in self.scene.lights if isinstance(light, EnvironmentLight)]

    @property
    def environment(self) -> SplitEnvironment:
        """The light of the environments: their suns, and the rest."""
        return self.shared("split environment", lambda: split_environments(self.environments()))

    @property
    def lights(self) -> list[Light]:
        """The scene's lights, followed by the suns of its environments."""
        return [*self.scene.lights, *self.environment.suns]

    @property
    def sky(self) -> float:
        """Mean radiance of the environments without their suns, W/(m^2 sr), of the brightest channel."""
        return float(self.environment.rest.mean(axis=(0, 1)).max())


class Body:
    """One object of a stage: its buffers and textures."""

    def __init__(self, stage: Stage, index: int) -> None:
        # Weak, since the buffers and textures of a cycle would stay on the device until the garbage collector runs.
        self._stage = weakref.ref(stage)
        self.index = index
        self._unwrapped = False
        self._posed: tuple[float, Buffer] | None = None

    @property
    def stage(self) -> Stage:
        stage = self._stage()
        assert stage is not None, "a body lives as long as its stage"
        return stage

    @property
    def rest(self) -> Object:
        """The object at rest, before any motion."""
        return self.stage.rest.objects[self.index]

    @property
    def material(self) -> Material:
        return self.rest.material

    @property
    def profile(self) -> Profile:
        """The diffusion profile of the material, which photons measure for layers with maps that are too thin."""
        material = self.material
        return self.stage.shared(("profile", id(material)), lambda: diffusion_profile(self.stage.gpu, material))

    def unwrap(self) -> RenderMesh:
        """Give the body an atlas, which passes in texture space need. This takes a while the first time."""
        self._unwrapped = True
        return self.render_mesh

    @property
    def render_mesh(self) -> RenderMesh:
        """The render mesh; with an atlas after `unwrap`."""
        mesh, gpu = self.rest.mesh, self.stage.gpu
        if self._unwrapped:
            return self.stage.shared(("unwrap", id(mesh)), lambda: unwrap(gpu, mesh))
        return self.stage.shared(("split", id(mesh)), lambda: split(mesh))

    @property
    def vertices(self) -> Buffer:
        """Buffer of array<Vertex> (wgsl/mesh.wgsl): the render vertices as posed."""
        if self.rest.motion is None:
            key = ("vertices", self.index, self._unwrapped)
            return self.stage.shared(key, lambda: self._upload(self.rest.mesh))
        if self._posed is None or self._posed[0] != self.stage.time_s:
            self._posed = (self.stage.time_s, self._upload(self.stage.scene.objects[self.index].mesh))
        return self._posed[1]

    def _upload(self, mesh: Mesh) -> Buffer:
        render_mesh = self.render_mesh
        value = {
            "position": mesh.positions[render_mesh.vertex],
            "u": render_mesh.uvs[:, 0],
            "normal": self._normals(mesh),
            "v": render_mesh.uvs[:, 1],
            "atlas": render_mesh.atlas,
            "welded": render_mesh.vertex,
            "sky": self.sky,
        }
        return self.stage.gpu.buffer(wgsl.load("mesh").layout("array<Vertex>").pack(value))

    @property
    def sky(self) -> Array:
        """(R,): the share of the environment's irradiance that reaches each render vertex, at rest."""
        lights, render_mesh = self.stage.environments(), self.render_mesh
        if not lights:
            return np.ones(len(render_mesh.vertex), np.float32)

        def make() -> Array:
            rotation, translation = self.rest.matrix[:3, :3], self.rest.matrix[:3, 3]
            positions = self.rest.mesh.positions[render_mesh.vertex] @ rotation.T + translation
            return sky_visibility(self.stage.rest, lights, positions, render_mesh.normals @ rotation.T)

        return self.stage.shared(("sky", self.index, self._unwrapped), make)

    def _normals(self, mesh: Mesh) -> Array:
        return self.render_mesh.normals if mesh is self.rest.mesh else mesh.normals[self.render_mesh.vertex]

    @property
    def mesh(self) -> Mesh:
        """The mesh as posed, in object space."""
        return self.stage.scene.objects[self.index].mesh

    def at(self, samples: Samples) -> SurfacePoints:
        """Return samples of the surface as posed."""
        mesh, render_mesh = self.mesh, self.render_mesh
        corners = mesh.positions[render_mesh.vertex][render_mesh.faces].astype(np.float64)
        area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        triangle = render_mesh.faces[samples.face]

        def interpolated(values: Array) -> Array:
            result: Array = np.einsum("nk,nkd->nd", samples.barycentric, values[triangle])
            return result

        normal = interpolated(self._normals(mesh))
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        return SurfacePoints(
            position=interpolated(mesh.positions[render_mesh.vertex]).astype(np.float32),
            normal=normal.astype(np.float32),
            uv=interpolated(render_mesh.uvs).astype(np.float32),
            area=(area[samples.face] * samples.share).astype(np.float32),
        )

    def points(self, samples: Samples) -> Buffer:
        """Return a buffer of array<Vertex>: samples of the surface as posed, for `frame.irradiance_points`."""
        at = self.at(samples)
        value = {
            "position": at.position,
            "u": at.uv[:, 0],
            "normal": at.normal,
            "v": at.uv[:, 1],
            "atlas": np.zeros_like(at.uv),
            "welded": np.zeros(len(at.uv), np.uint32),
            "sky": np.einsum("nk,nk->n", samples.barycentric, self.sky[self.render_mesh.faces[samples.face]]),
        }
        return self.stage.gpu.buffer(wgsl.load("mesh").layout("array<Vertex>").pack(value))

    @property
    def is_coloured(self) -> bool:
        """Whether the base colour varies over the body."""
        return self.material.maps.base_color is not None or self.rest.mesh.corner_colors is not None

    @property
    def colors(self) -> Buffer:
        """Buffer of vec4f: the colour of each render vertex, or one colour for all."""
        if self.rest.mesh.corner_colors is None:
            return self._white
        key = ("colors", self.index, self._unwrapped)
        return self.stage.shared(key, lambda: self._color_buffer(self.render_mesh.colors))

    def colors_at(self, samples: Samples) -> Buffer:
        """Return a buffer of vec4f: the colour of each sample of the surface, or one colour for all."""
        if self.rest.mesh.corner_colors is None:
            return self._white

        def make() -> tuple[Samples, Buffer]:
            at = self.render_mesh.colors[self.render_mesh.faces[samples.face]]
            return samples, self._color_buffer(np.einsum("nk,nkd->nd", samples.barycentric, at))

        # The key has the id of the samples. They are stored beside the buffer, so that no others can get the same id.
        return self.stage.shared(("colors", self.index, id(samples)), make)[1]

    def _color_buffer(self, colors: Array) -> Buffer:
        return self.stage.gpu.buffer(np.column_stack([colors, np.ones(len(colors))]).astype(np.float32))

    @property
    def _white(self) -> Buffer:
        return self.stage.shared("white", lambda: self.stage.gpu.buffer(np.ones(4, np.float32)))

    @property
    def indices(self) -> Buffer:
        """Index buffer, u32."""
        key = ("indices", id(self.rest.mesh), self._unwrapped)
        return self.stage.shared(key, lambda: self.stage.gpu.buffer(self.render_mesh.faces.astype(np.uint32)))

    @property
    def object_uniforms(self) -> dict[str, Any]:
        """The value of struct ObjectUniforms (wgsl/mesh.wgsl)."""
        material = self.material
        return {
            "object_to_world": self.rest.matrix,
            "base_color": material.base_color,
            "color_after": material.color_after,
            "specular": material.specular,
            "id": self.index + 1,
            "wrap": [WRAPS.index(wrap) for wrap in material.maps.wrap],
            "nearest": int(material.maps.nearest),
            "normal_scale": material.maps.normal_scale,
        }

    @cached_property
    def maps(self) -> Maps:
        """The material's textures."""
        image, maps = self.stage.image, self.material.maps
        return Maps(
            base_color_map=image(_WHITE if maps.base_color is None else maps.base_color, "rgba8unorm-srgb"),
            normal_map=image(_FLAT if maps.normal is None else maps.normal, "rgba8unorm"),
            specular_map=image(_FULL if maps.specular is None else maps.specular, "r8unorm"),
        )

    @cached_property
    def environment(self) -> Prefiltered:
        """The environments, prefiltered for this material."""
        material = self.material
        key = ("environment", material.roughness, material.eta, material.specular)
        return self.stage.shared(key, lambda: prefilter(self.stage.gpu, self.stage.environment.rest, material))


_WHITE = np.full((1, 1, 3), 255, np.uint8)
_FLAT = np.array([[[128, 128, 255]]], np.uint8)
_FULL = np.full((1, 1), 255, np.uint8)
