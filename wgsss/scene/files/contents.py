"""What a mesh file holds, whatever its format: parts, what they look like, lights, cameras and animations.

A reader loses nothing in silence: what a file has and these classes cannot hold becomes one of `Contents.notes`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from wgsss.scene.keyframes import Channel
    from wgsss.scene.rig import Rig

Array = npt.NDArray[Any]
Triple = tuple[float, float, float]

NONE = "none"
"""stands for no animation, where one is asked for by its name: none is called so"""


@dataclass(frozen=True)
class Texture:
    """An image over texture coordinates. Two are equal where they show the same in the same place."""

    source: bytes | Path
    """the encoded image itself, or its file"""
    name: str
    """for messages: "image 2 (skin.png)" """
    channels: str = "RGB"
    """which of the image's channels count: "RGB", "L" (their luminance) or "A" (alpha)"""
    coordinates: int = 0
    """which set of the part's texture coordinates it lies over"""
    transform: tuple[Triple, Triple] | None = None
    """rows of a matrix (2, 3): its coordinates are that times (u, v, 1) of the set, v down"""
    wrap: tuple[str, str] = ("repeat", "repeat")
    """what is beyond 0 to 1, along u and v: one of material.WRAPS"""
    nearest: bool = False
    """whether it is not interpolated between its texels"""


@dataclass(frozen=True)
class Medium:
    """What is below a surface, in 1 / the file's unit of length."""

    sigma_a: Triple
    """absorption"""
    sigma_s_prime: Triple
    """reduced scattering"""


@dataclass(frozen=True)
class Look:
    """A file's material, as far as wgsss has a use for it; None where the file does not say."""

    name: str = ""
    base_color: Triple = (1.0, 1.0, 1.0)
    """linear; multiplies the map"""
    base_color_map: Texture | None = None
    normal_map: Texture | None = None
    normal_scale: float = 1.0
    """of the normal map's x and y"""
    specular: float | None = None
    """scale of the specular lobe, 0 to 1; multiplies the map"""
    specular_map: Texture | None = None
    roughness: float | None = None
    """perceptual, 0 to 1"""
    eta: float | None = None
    """index of refraction"""
    alpha: float = 1.0
    """multiplies the alpha of the base colour map, where `cutoff` asks for it"""
    cutoff: float | None = None
    """the alpha below which there is no surface; None where alpha does not matter"""
    medium: Medium | None = None


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one look, as the file has them, in its own unit."""

    name: str
    """for messages: "mesh 0, primitive 1", "group lid" """
    positions: Array
    """float64 (V, 3), in the part's own space"""
    faces: Array
    """int64 (F, 3)"""
    look: Look = Look()
    matrix: Array = field(default_factory=lambda: np.eye(4))
    """float64 (4, 4): from the part's own space to that of the file, at rest"""
    normals: Array | None = None
    """float64 (V, 3), in the part's own space, of any length; zero where a vertex has none"""
    uvs: Mapping[int, Array] = field(default_factory=dict)
    """float64 (V, 2) by number of the set, v down (0 at the image's top row)"""
    colors: Array | None = None
    """float64 (V, 3), linear, 0 to 1"""


@dataclass(frozen=True)
class LightSource:
    """A light of the file, in its unit and space."""

    name: str
    kind: str
    """ "directional" or "point" """
    position: Triple
    direction: Triple
    """in which the light travels; for a point light without meaning"""
    power: Triple
    """linear RGB: W/m^2 of a directional light on a surface facing it, W/sr of a point light"""


@dataclass(frozen=True)
class CameraView:
    """A camera of the file, in its unit and space. One of `fov` and `height` is None."""

    name: str
    eye: Triple
    forward: Triple
    """unit vector"""
    up: Triple
    fov: float | None
    """vertical, degrees, of a perspective camera"""
    height: float | None
    """of what an orthographic camera sees, the file's unit"""


@dataclass(frozen=True, eq=False)
class Contents:
    """All of a file that wgsss can use, and notes on what it cannot."""

    parts: tuple[Part, ...]
    """those with faces, at least one"""
    mm_per_unit: float = 1.0
    """millimetres per unit of length: what the format says, or 1 where it says nothing"""
    states_unit: bool = False
    """whether the format says what its unit is"""
    splits: bool = False
    """whether vertices may be repeated for a reason: seams, hard edges, a format without indices"""
    lights: tuple[LightSource, ...] = ()
    cameras: tuple[CameraView, ...] = ()
    rig: Rig | None = None
    """what moves the parts, its own parts in the same order; None where nothing does"""
    animations: Mapping[str, Callable[[], tuple[Channel, ...]]] = field(default_factory=dict)
    """by name, or number where there is none; each reads its channels when called"""
    notes: tuple[str, ...] = ()
    """what was left out or taken otherwise than the file says, one line each"""
