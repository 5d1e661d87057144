"""Reader of the lights (KHR_lights_punctual) and cameras in the scene of a glTF file."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.files.contents import CameraView, LightSource, Triple
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import Item
from wgsss.scene.files.gltf.nodes import SceneNodes
from wgsss.scene.files.gltf.notes import Notes

Array = npt.NDArray[Any]

LIGHTS = "KHR_lights_punctual"


def read_lights(document: Document, scene: SceneNodes, notes: Notes) -> tuple[LightSource, ...]:
    """Read the lights of the scene. 1 lx is read as 1 W/m^2 and 1 cd as 1 W/sr, as glTF viewers do.

    Spot lights become point lights, with a note. Raises InputError for lights that are invalid or do not exist.
    """
    extension = document.root.extension(LIGHTS)
    items = [] if extension is None else Item(extension.values).items("lights", "light")
    lights = []
    for node in scene.shown:
        reference = scene.items[node].extension(LIGHTS)
        if reference is None:
            continue
        number = reference.whole("light")
        if number >= len(items):
            raise reference.error(f"there is no light {number}")
        light = _light(items[number], scene.place(node), notes)
        if light is not None:
            lights.append(light)
    return tuple(lights)


def _light(light: Item, world: Array, notes: Notes) -> LightSource | None:
    kind = light.text("type", choices=("directional", "point", "spot"))
    color = light.numbers("color", 3, (1.0, 1.0, 1.0))
    power = np.maximum(color, 0) * light.number("intensity", 1.0, low=0)
    if kind == "spot":
        notes.add("drawn as point lights, without their cones:", "spot light")
    if light.has("range"):
        notes.add("range left out: used by", "light")
    direction = _unit(-world[:3, 2])
    if direction is None and kind == "directional":
        notes.add("left out because it has no direction:", "light")
        return None
    name = f"{light.location} ({light.name})" if light.name else light.location
    kind = "directional" if kind == "directional" else "point"
    return LightSource(name, kind, _triple(world[:3, 3]), _triple(direction or (0, 0, -1)), _triple(power))


def read_cameras(document: Document, scene: SceneNodes, notes: Notes) -> tuple[CameraView, ...]:
    """Read the cameras of the scene, including those of hidden nodes. Raises InputError for invalid cameras."""
    cameras = []
    for node in (*scene.shown, *scene.hidden):
        number = document.link(scene.items[node], "camera", "camera")
        if number is not None:
            camera = _camera(document.all("camera")[number], scene.place(node), notes)
            if camera is not None:
                cameras.append(camera)
    return tuple(cameras)


def _camera(camera: Item, world: Array, notes: Notes) -> CameraView | None:
    kind = camera.text("type", choices=("perspective", "orthographic"))
    lens = camera.item(kind) or Item({}, f"{camera.location}: {kind}")
    fov = height = None
    if kind == "perspective":
        fov = math.degrees(lens.number("yfov", low=0))
    else:
        height = 2 * abs(lens.number("ymag"))
    forward, up = _unit(-world[:3, 2]), _unit(world[:3, 1])
    flat = forward is None or up is None or not np.linalg.norm(np.cross(forward, up)) > 1e-6
    if flat or height == 0 or (fov is not None and not 0 < fov < 180):
        notes.add("left out because they see nothing:", "camera")
        return None
    name = f"{camera.location} ({camera.name})" if camera.name else camera.location
    return CameraView(name, _triple(world[:3, 3]), _triple(forward), _triple(up), fov, height)


def _unit(vector: Array) -> tuple[float, ...] | None:
    """Normalise a vector (3,). Return None if its length is zero or not finite."""
    length = math.hypot(*vector)
    return tuple(float(v) / length for v in vector) if 1e-100 < length < math.inf else None


def _triple(values: Any) -> Triple:
    x, y, z = (float(v) for v in values)
    return x, y, z
