"""The lights (KHR_lights_punctual) and cameras of a glTF file, where its scene places them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.files.contents import CameraView, LightSource, Triple
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import Item
from wgsss.scene.files.gltf.nodes import Stage
from wgsss.scene.files.gltf.notes import Notes

Array = npt.NDArray[Any]

LIGHTS = "KHR_lights_punctual"


def read_lights(document: Document, stage: Stage, notes: Notes) -> tuple[LightSource, ...]:
    """The lights of the scene. 1 lx is taken for 1 W/m^2 and 1 cd for 1 W/sr, as glTF viewers do.

    Spot lights become point lights, which is noted. Raises InputError for lights that are not there, and bad ones.
    """
    extension = document.root.extension(LIGHTS)
    lights = [] if extension is None else Item(extension.values).items("lights", "light")
    found = []
    for node in stage.shown:
        reference = stage.items[node].extension(LIGHTS)
        if reference is None:
            continue
        number = reference.whole("light")
        if number >= len(lights):
            raise reference.error(f"there is no light {number}")
        light = _light(lights[number], stage.place(node), notes)
        if light is not None:
            found.append(light)
    return tuple(found)


def _light(light: Item, world: Array, notes: Notes) -> LightSource | None:
    kind = light.text("type", choices=("directional", "point", "spot"))
    color = light.numbers("color", 3, (1.0, 1.0, 1.0))
    power = np.maximum(color, 0) * light.number("intensity", 1.0, low=0)
    if kind == "spot":
        notes.add("taken for point lights, their cones left out:", "spot light")
    if light.has("range"):
        notes.add("range left out: of", "light")
    direction = _unit(-world[:3, 2])
    if direction is None and kind == "directional":
        notes.add("left out, for it has no direction:", "light")
        return None
    name = f"{light.where} ({light.name})" if light.name else light.where
    kind = "directional" if kind == "directional" else "point"
    return LightSource(name, kind, _triple(world[:3, 3]), _triple(direction or (0, 0, -1)), _triple(power))


def read_cameras(document: Document, stage: Stage, notes: Notes) -> tuple[CameraView, ...]:
    """The cameras of the scene, also those on hidden nodes. Raises InputError for bad ones."""
    found = []
    for node in (*stage.shown, *stage.hidden):
        number = document.link(stage.items[node], "camera", "camera")
        if number is not None:
            camera = _camera(document.all("camera")[number], stage.place(node), notes)
            if camera is not None:
                found.append(camera)
    return tuple(found)


def _camera(camera: Item, world: Array, notes: Notes) -> CameraView | None:
    kind = camera.text("type", choices=("perspective", "orthographic"))
    lens = camera.item(kind) or Item({}, f"{camera.where}: {kind}")
    fov = height = None
    if kind == "perspective":
        fov = math.degrees(lens.number("yfov", low=0))
    else:
        height = 2 * abs(lens.number("ymag"))
    forward, up = _unit(-world[:3, 2]), _unit(world[:3, 1])
    flat = forward is None or up is None or not np.linalg.norm(np.cross(forward, up)) > 1e-6
    if flat or height == 0 or (fov is not None and not 0 < fov < 180):
        notes.add("left out, for they see nothing:", "camera")
        return None
    name = f"{camera.where} ({camera.name})" if camera.name else camera.where
    return CameraView(name, _triple(world[:3, 3]), _triple(forward), _triple(up), fov, height)


def _unit(vector: Array) -> tuple[float, ...] | None:
    """The vector of length 1 in a direction; None for one without length."""
    length = math.hypot(*vector)
    return tuple(float(v) / length for v in vector) if 1e-100 < length < math.inf else None


def _triple(values: Any) -> Triple:
    x, y, z = (float(v) for v in values)
    return x, y, z
