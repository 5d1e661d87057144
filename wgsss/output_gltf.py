"""The export of a scene as a glTF file: meshes, materials with their media, lights and the camera.

Lengths become metres, the unit of glTF, and coefficients 1/m. Radiometry becomes the photometry of
KHR_lights_punctual one to one: 1 W/m^2 is written as 1 lx and 1 W/sr as 1 cd. The reader does the reverse.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import __version__
from wgsss.errors import Note
from wgsss.output import check_output, replacing
from wgsss.scene import DirectionalLight, Maps, Material, Mesh, OrthographicCamera, PointLight, Scene
from wgsss.scene.files.gltf.media import VOLUME, VOLUME_SCATTER, written
from wgsss.scene.files.gltf.textures import LINEAR, NEAREST, WRAPS
from wgsss.scene.files.gltf.writer import Writer
from wgsss.scene.light import Light
from wgsss.scene.material import SLOTS

Array = npt.NDArray[Any]

FORMATS = (".glb",)
_LIGHTS = "KHR_lights_punctual"
_PER_MM = 1e-3
"""Metres per millimetre."""


def export(scene: Scene, path: str | Path, aspect: float = 1.0) -> Path:
    """Write `scene` as posed to a .glb file, and return its path.

    `aspect` is the width of the image over its height, which glTF requires for an orthographic camera. One warning
    names everything that glTF cannot represent. Raises InputError if the file cannot be written.
    """
    path = check_output(path, FORMATS)
    data, notes = glb(scene, aspect)
    with replacing(path) as (file,):
        file.write_bytes(data)
    if notes:
        warnings.warn(f"{scene.name}: the glTF file differs from the scene: {'; '.join(notes)}", Note, stacklevel=2)
    return path


def glb(scene: Scene, aspect: float = 1.0) -> tuple[bytes, list[str]]:
    """Return the bytes of a .glb file, and notes about what glTF cannot represent."""
    writer, notes = Writer(f"wgsss {__version__}"), dict[str, None]()
    nodes = []
    for thing in scene.objects:
        if thing.mesh.shrunk:
            notes[f"{thing.mesh.name} is left out, because it has no size at this time"] = None
            continue
        material = writer.add("materials", _material(writer, thing.material, _depth(thing.mesh), notes))
        mesh = writer.add("meshes", {"name": thing.mesh.name, "primitives": [_primitive(writer, thing.mesh, material)]})
        nodes.append(writer.add("nodes", {"name": thing.mesh.name, "mesh": mesh, **_placed(thing.matrix)}))
    nodes += _lights(writer, scene.lights, notes)
    nodes.append(_camera(writer, scene, aspect))
    if scene.exposure or scene.bloom:
        notes["exposure and bloom are left out"] = None
    return writer.glb(nodes), list(notes)


def _placed(matrix: Array) -> dict[str, Any]:
    """Return the field of a node for a placement (4, 4) in mm."""
    matrix = matrix.copy()
    matrix[:3, 3] *= _PER_MM
    return {} if np.array_equal(matrix, np.eye(4)) else {"matrix": matrix.T.ravel().tolist()}


def _depth(mesh: Mesh) -> float:
    """Estimate the thickness of a mesh, m: its shortest side, but at least a hundredth of its longest side."""
    sides = np.ptp(mesh.bounds.astype(np.float64), axis=0)
    return float(max(sides.min(), sides.max() / 100)) * _PER_MM


def _primitive(writer: Writer, mesh: Mesh, material: int) -> dict[str, Any]:
    """Write the triangles of a mesh. Vertices are split where the normals or texture coordinates of corners differ."""
    vertex = mesh.faces.ravel()
    columns = [vertex.astype(np.uint64)]
    for values in (mesh.corner_uvs, mesh.corner_normals, mesh.corner_colors):
        if values is not None:
            columns += list(np.ascontiguousarray(values + np.float32(0)).view(np.uint32).reshape(len(vertex), -1).T)
    first, indices = _distinct(columns)
    at = vertex[first]
    attributes = {
        "POSITION": writer.rows((mesh.positions[at].astype(np.float64) * _PER_MM).astype(np.float32), bounds=True),
        "NORMAL": writer.rows(mesh.shading_normals.reshape(-1, 3)[first]),
    }
    if mesh.corner_uvs is not None:
        attributes["TEXCOORD_0"] = writer.rows(mesh.corner_uvs.reshape(-1, 2)[first])
    if mesh.corner_colors is not None:
        attributes["COLOR_0"] = writer.rows(mesh.corner_colors.reshape(-1, 3)[first])
    faces = writer.rows(indices.reshape(-1, 1).astype(np.uint32))
    return {"attributes": attributes, "indices": faces, "material": material}


def _distinct(columns: list[Array]) -> tuple[Array, Array]:
    """Find the distinct rows of integer columns (N,).

    Returns the index at which each of them occurs first, and for every row the number of its distinct row.
    """
    key = columns[0]
    for column in columns[1:]:
        other = np.unique(column, return_inverse=True)[1]
        key = np.unique(key, return_inverse=True)[1] * (other.max() + 1) + other
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    return first, which


def _material(writer: Writer, material: Material, depth: float, notes: dict[str, None]) -> dict[str, Any]:
    textures = _textures(writer, material.maps)
    color = {"Texture": textures["base_color"]} if "base_color" in textures else {}
    factor = list(material.base_color)
    extensions = writer.extended("KHR_materials_ior", {"ior": material.eta})
    if material.specular != 1 or "specular" in textures:
        map_ = {"specularTexture": textures["specular"]} if "specular" in textures else {}
        extensions |= writer.extended("KHR_materials_specular", {"specularFactor": material.specular, **map_})
    if material.sigma_a is None or material.sigma_s_prime is None:
        notes[f"'{material.name}' has no coefficients, so that it has no medium"] = None
    else:
        sigma_a, sigma_s = (np.array(sigma) / _PER_MM for sigma in (material.sigma_a, material.sigma_s_prime))
        volume, scatter = written(sigma_a, sigma_s)
        through = {"diffuseTransmissionFactor": 1.0, **_named("diffuseTransmissionColor", factor, color)}
        extensions |= writer.extended("KHR_materials_diffuse_transmission", through)
        extensions |= writer.extended(VOLUME, {"thicknessFactor": depth, **volume})
        extensions |= writer.extended(VOLUME_SCATTER, scatter)
    if material.color_after != 1 or material.transport is not None:
        notes["color_after and transport are left out"] = None
    pbr = {"metallicFactor": 0.0, "roughnessFactor": material.roughness, **_named("baseColor", [*factor, 1.0], color)}
    fields = {"name": material.name, "pbrMetallicRoughness": pbr, "extensions": extensions}
    if "normal" in textures:
        fields["normalTexture"] = {**textures["normal"], "scale": material.maps.normal_scale}
    return fields


def _textures(writer: Writer, maps: Maps) -> dict[str, dict[str, Any]]:
    """Write the textures of a material, and return them by slot. The specular map is the alpha of a white image."""
    images = {slot: getattr(maps, slot) for slot in SLOTS if getattr(maps, slot) is not None}
    if not images:
        return {}
    if "specular" in images:
        images["specular"] = np.dstack([np.full((*images["specular"].shape, 3), 255, np.uint8), images["specular"]])
    codes = {key: WRAPS[wrap] for key, wrap in zip(("wrapS", "wrapT"), maps.wrap, strict=True)}
    sampler = writer.add("samplers", {**codes, "magFilter": NEAREST if maps.nearest else LINEAR})
    return {slot: writer.texture(image, sampler) for slot, image in images.items()}


def _named(name: str, factor: list[float], texture: dict[str, Any]) -> dict[str, Any]:
    """Return a factor and its texture, if there is one, under their names in glTF."""
    return {f"{name}Factor": factor, **{f"{name}{key}": value for key, value in texture.items()}}


def _lights(writer: Writer, lights: tuple[Light, ...], notes: dict[str, None]) -> list[int]:
    """Write directional and point lights, and return their nodes. Other lights are noted."""
    entries, nodes = [], []
    for light in lights:
        matrix = np.eye(4)
        if isinstance(light, DirectionalLight):
            kind, power, matrix[:3, :3] = "directional", light.irradiance, _looking(np.array(light.direction))
        elif isinstance(light, PointLight):
            kind, power, matrix[:3, 3] = "point", light.intensity, light.position
        else:
            notes[f"{type(light).__name__} is left out"] = None
            continue
        intensity = max(power)
        color = [value / intensity for value in power] if intensity else [1.0, 1.0, 1.0]
        entries.append({"type": kind, "intensity": intensity, "color": color})
        extensions = writer.extended(_LIGHTS, {"light": len(entries) - 1})
        nodes.append(writer.add("nodes", {"extensions": extensions, **_placed(matrix)}))
    if entries:
        writer.put(_LIGHTS, {"lights": entries})
    return nodes


def _looking(direction: Array) -> Array:
    """Return a rotation (3, 3) that maps -z to a direction."""
    back = -direction / np.linalg.norm(direction)
    side = np.cross(np.eye(3)[np.argmin(np.abs(back))], back)
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(back, side), back], axis=1)


def _camera(writer: Writer, scene: Scene, aspect: float) -> int:
    """Write the camera, and return its node. The whole scene lies between its clipping planes."""
    camera = scene.camera
    matrix = np.linalg.inv(camera.view())
    size = float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    distance = float(np.linalg.norm(scene.bounds.mean(axis=0) - np.array(camera.eye)))
    far = 2 * (distance + size) * _PER_MM
    if isinstance(camera, OrthographicCamera):
        half = camera.height / 2 * _PER_MM
        lens = {"xmag": half * aspect, "ymag": half, "znear": 0.0, "zfar": far}
        kind = "orthographic"
    else:
        lens = {"yfov": math.radians(camera.fov), "znear": far / 1e4, "zfar": far}
        kind = "perspective"
    number = writer.add("cameras", {"type": kind, kind: lens})
    return writer.add("nodes", {"camera": number, **_placed(matrix)})
