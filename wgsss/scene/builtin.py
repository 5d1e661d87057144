"""The built-in scenes, one function each. They stand for the objects that the source papers render.

Each function takes the approximate vertex count of its mesh, and raises InputError for a count out of range.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from wgsss.errors import InputError
from wgsss.scene import shapes
from wgsss.scene.camera import PerspectiveCamera
from wgsss.scene.defaults import framing
from wgsss.scene.layerscenes import organ_material, skin_material
from wgsss.scene.light import DirectionalLight, EnvironmentLight, PointLight, RectLight, SphereLight
from wgsss.scene.material import Material, material
from wgsss.scene.motion import BendAndSwell
from wgsss.scene.scene import Object, Scene

# Green leaf: as a half-space it reflects 10, 18 and 8 % of red, green and blue light by the dipole; 0.35 mm of it, by
# diffusion in a slab, transmit 3, 9 and 1 %.
LEAF = Material("leaf", sigma_a=(3.2, 1.4, 4.4), sigma_s_prime=(5.0, 5.2, 4.6), eta=1.42, roughness=0.45, specular=0.8)
# Honey-coloured wax. Scattering as of paraffin phantoms, about 1/mm; absorption chosen for a diffuse reflectance of
# 0.77, 0.63 and 0.46: a finger's breadth, 15 mm, still transmits 14, 6 and 1 % by diffusion in a slab.
WAX = Material("wax", sigma_a=(0.002, 0.008, 0.03), sigma_s_prime=(0.9, 1.0, 1.1), eta=1.44, roughness=0.4)


def _framed(objects: Sequence[Object], azimuth: float, elevation: float) -> PerspectiveCamera:
    """The camera of a built-in scene: a long lens, as for portraits of small things."""
    return framing(objects, azimuth=azimuth, elevation=elevation, fov=20.0)


def slab(vertices: int | None = None) -> Scene:
    """a flat plate of marble with hard edges, lit from one side"""
    plate = Object(shapes.slab(vertices=vertices), material("marble"))
    light = DirectionalLight(direction=(0.75, -0.2, -0.63), irradiance=(4.2, 4.1, 4.0))
    return Scene("slab", (plate,), (light,), _framed([plate], azimuth=52, elevation=16))


def sphere(vertices: int | None = None) -> Scene:
    """a ball of skin-like medium, half of it in the light"""
    ball = Object(shapes.sphere(vertices=vertices), material("skin1"))
    light = DirectionalLight(direction=(-0.9, -0.3, -0.3), irradiance=(5.0, 4.9, 4.7))
    return Scene("sphere", (ball,), (light,), _framed([ball], azimuth=0, elevation=0))


def ear(vertices: int | None = None) -> Scene:
    """a thin ear with a thick rim, lit from the front and strongly from behind"""
    auricle = Object(shapes.ear(vertices), material("skin"))
    key = RectLight((-150, 120, 260), (0.46, -0.37, -0.8), (0, 1, 0), 120, 120, radiance=(17, 16, 15.5), samples=6)
    back = SphereLight((70, 60, -190), 22, radiance=(330, 310, 290), samples=6)
    fill = EnvironmentLight((0.08, 0.09, 0.11))
    return Scene("ear", (auricle,), (key, back, fill), _framed([auricle], azimuth=-8, elevation=4))


def milk(vertices: int | None = None) -> Scene:
    """a splash of milk in many separate drops, under one white light and an environment"""
    splash = Object(shapes.milk(vertices), material("wholemilk"))
    light = PointLight((160, 190, -170), intensity=(0.30, 0.30, 0.30))
    sky = EnvironmentLight((0.20, 0.23, 0.28))
    return Scene("milk", (splash,), (light, sky), _framed([splash], azimuth=15, elevation=24))


def gyroid(vertices: int | None = None) -> Scene:
    """a thin marble gyroid full of its own shadows, between a green and a pink light"""
    shell = Object(shapes.gyroid(vertices), material("marble"))
    green = PointLight((-150, 60, 60), intensity=(0.015, 0.105, 0.030))
    pink = PointLight((140, 60, 10), intensity=(0.120, 0.030, 0.075))
    room = EnvironmentLight((0.08, 0.08, 0.09))
    return Scene("gyroid", (shell,), (green, pink, room), _framed([shell], azimuth=24, elevation=18))


def statue(vertices: int | None = None) -> Scene:
    """a carved marble figure, from 5000 to 500000 vertices at the same shape"""
    figure = Object(shapes.statue(vertices), material("marble"))
    window = RectLight((-330, 330, 280), (0.64, -0.49, -0.59), (0, 1, 0), 180, 240, radiance=(17, 16.5, 15.5))
    behind = DirectionalLight(direction=(-0.5, -0.35, 0.79), irradiance=(1.6, 1.7, 1.9))
    room = EnvironmentLight((0.09, 0.09, 0.10))
    return Scene("statue", (figure,), (window, behind, room), _framed([figure], azimuth=18, elevation=8))


def leaf(vertices: int | None = None) -> Scene:
    """a green leaf with veins against the sun"""
    blade = Object(shapes.leaf(vertices), LEAF, rotate=(0, 0, -24))
    sun = DirectionalLight(direction=(-0.25, -0.4, 0.88), irradiance=(9.0, 8.8, 8.2))
    shine = DirectionalLight(
        direction=(0.9, -0.35, -0.3), irradiance=(1.5, 1.6, 1.8)
    )  # from the side: the veins stand out
    sky = EnvironmentLight((0.25, 0.30, 0.38))
    return Scene("leaf", (blade,), (sun, shine, sky), _framed([blade], azimuth=20, elevation=5))


def wave(vertices: int | None = None) -> Scene:
    """a finger of wax that sways and swells over time, lit from behind"""
    finger = Object(shapes.capsule(vertices=vertices), WAX, motion=BendAndSwell())
    lamp = SphereLight((90, 70, -120), 15, radiance=(170, 165, 155))
    key = DirectionalLight(direction=(0.5, -0.5, -0.7), irradiance=(1.4, 1.45, 1.5))
    return Scene("wave", (finger,), (lamp, key), _framed([finger], azimuth=0, elevation=8))


def crowd(vertices: int | None = None, copies: int = 4) -> Scene:
    """1 to 16 heads of skin that share one mesh, in rows"""
    if not isinstance(copies, int) or not 1 <= copies <= 16:
        raise InputError(f"crowd: copies must be a whole number from 1 to 16, not {copies!r}")
    mesh, skin = shapes.head(vertices), material("skin")
    columns = math.ceil(math.sqrt(copies))
    rows = math.ceil(copies / columns)
    heads = []
    for index in range(copies):
        row, column = divmod(index, columns)
        here = min(columns, copies - row * columns)
        x = (column - (here - 1) / 2) * 240
        z = ((rows - 1) / 2 - row) * 300
        # Nobody looks quite the same way; each row stands a step higher than the one before it.
        heads.append(Object(mesh, skin, translate=(x, 115 + 130 * row, z), rotate=(0, (index * 37) % 50 - 22, 0)))
    key = DirectionalLight(direction=(0.55, -0.5, -0.67), irradiance=(3.4, 3.3, 3.1))
    rim = DirectionalLight(direction=(-0.75, -0.2, 0.63), irradiance=(2.4, 2.5, 2.8))
    room = EnvironmentLight((0.15, 0.15, 0.17))
    return Scene("crowd", tuple(heads), (key, rim, room), _framed(heads, azimuth=10, elevation=12))


def skin_patch(vertices: int | None = None) -> Scene:
    """a curved patch of thin skin over veins of two depths, in layers"""
    plate = Object(shapes.patch(vertices=vertices), skin_material())
    key = DirectionalLight(direction=(0.55, -0.5, -0.75), irradiance=(5.2, 5.0, 4.8))
    back = DirectionalLight(direction=(-0.5, -0.3, 0.8), irradiance=(1.2, 1.3, 1.5))
    room = EnvironmentLight((0.12, 0.12, 0.13))
    return Scene("skin-patch", (plate,), (key, back, room), _framed([plate], azimuth=14, elevation=18))


def organ(vertices: int | None = None) -> Scene:
    """blobs of fat over veins on a soft body that sways and swells over time, in layers"""
    body = Object(shapes.organ(vertices), organ_material(), motion=BendAndSwell(bend=40.0, swell=0.2))
    key = DirectionalLight(direction=(0.5, -0.5, -0.7), irradiance=(5.4, 5.2, 5.0))
    back = DirectionalLight(direction=(-0.7, -0.2, 0.6), irradiance=(2.0, 2.1, 2.4))
    room = EnvironmentLight((0.12, 0.12, 0.13))
    return Scene("organ", (body,), (key, back, room), _framed([body], azimuth=0, elevation=8))


SCENES: dict[str, Callable[[int | None], Scene]] = {
    "slab": slab,
    "sphere": sphere,
    "ear": ear,
    "milk": milk,
    "gyroid": gyroid,
    "statue": statue,
    "leaf": leaf,
    "wave": wave,
    "crowd": crowd,
    "skin-patch": skin_patch,
    "organ": organ,
}
"""Each scene by its name, as a function of the vertex count (None: the shape's default)."""
