"""The contents of a mesh file of any format: parts, their materials, lights, cameras and animations.

Readers drop nothing silently: data of a file that these classes cannot hold are reported in `Contents.notes`.
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
"""the name that stands for no animation; no animation of a file gets this name"""


@dataclass(frozen=True)
class Texture:
    """An image and its placement over texture coordinates. Two textures are equal if image and placement are equal."""

    source: bytes | Path
    """the encoded image, or the path of its file"""
    name: str
    """name in messages, such as "image 2 (skin.png)" """
    channels: str = "RGB"
    """channels of the image that are used: "RGB", "L" (luminance) or "A" (alpha)"""
    coordinates: int = 0
    """number of the set of texture coordinates"""
    transform: tuple[Triple, Triple] | None = None
    """rows of a matrix (2, 3) that is multiplied with (u, v, 1) of the set, v down; None for the identity"""
    wrap: tuple[str, str] = ("repeat", "repeat")
    """continuation beyond 0 to 1 along u and along v, each one of material.WRAPS"""
    nearest: bool = False
    """whether lookups take the nearest texel and do not interpolate"""


@dataclass(frozen=True)
class Medium:
    """The coefficients of a medium below a surface, in 1 / the file's unit of length."""

    sigma_a: Triple
    """absorption"""
    sigma_s_prime: Triple
    """reduced scattering"""


@dataclass(frozen=True)
class Look:
    """The properties of a file's material that wgsss uses. None means that the file does not define a property."""

    name: str = ""
    base_color: Triple = (1.0, 1.0, 1.0)
    """linear RGB; multiplies the map"""
    base_color_map: Texture | None = None
    normal_map: Texture | None = None
    normal_scale: float = 1.0
    """factor of x and y of the normal map"""
    specular: float | None = None
    """scale of the specular lobe, 0 to 1; multiplies the map"""
    specular_map: Texture | None = None
    roughness: float | None = None
    """perceptual, 0 to 1"""
    eta: float | None = None
    """index of refraction"""
    alpha: float = 1.0
    """factor of the alpha of the base colour map; used only with `cutoff`"""
    cutoff: float | None = None
    """alpha below which there is no surface; None if alpha is ignored"""
    medium: Medium | None = None


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles with one look, as stored in the file and in the unit of the file."""

    name: str
    """name in messages, such as "mesh 0, primitive 1" or "material skin" """
    positions: Array
    """float64 (V, 3), in the space of the part"""
    faces: Array
    """int64 (F, 3)"""
    look: Look = Look()
    matrix: Array = field(default_factory=lambda: np.eye(4))
    """float64 (4, 4): transform from the space of the part to that of the file, at rest"""
    normals: Array | None = None
    """float64 (V, 3), in the space of the part, of any length; zero for a vertex without normal"""
    uvs: Mapping[int, Array] = field(default_factory=dict)
    """float64 (V, 2) for each number of a set, v down (0 at the top row of the image)"""
    colors: Array | None = None
    """float64 (V, 3), linear, 0 to 1"""


@dataclass(frozen=True)
class LightSource:
    """A light of the file, in the unit and space of the file."""

    name: str
    kind: str
    """ "directional" or "point" """
    position: Triple
    direction: Triple
    """direction in which the light travels; unused for point lights"""
    power: Triple
    """linear RGB: irradiance in W/m^2 on a facing surface (directional), or radiant intensity in W/sr (point)"""


@dataclass(frozen=True)
class CameraView:
    """A camera of the file, in the unit and space of the file. Either `fov` or `height` is None."""

    name: str
    eye: Triple
    forward: Triple
    """unit vector"""
    up: Triple
    fov: float | None
    """vertical field of view of a perspective camera, in degrees"""
    height: float | None
    """height of the view of an orthographic camera, in the unit of the file"""


@dataclass(frozen=True, eq=False)
class Contents:
    """The data of a file that wgsss uses, and notes on those that it does not use."""

    parts: tuple[Part, ...]
    """the parts with faces, at least one"""
    mm_per_unit: float = 1.0
    """millimetres per unit of length; 1 if the format defines no unit"""
    states_unit: bool = False
    """whether the format defines its unit"""
    splits: bool = False
    """whether vertices may be repeated on purpose: seams, hard edges, a format without indices"""
    lights: tuple[LightSource, ...] = ()
    cameras: tuple[CameraView, ...] = ()
    rig: Rig | None = None
    """the rig that moves the parts, its parts in the same order; None if nothing moves"""
    animations: Mapping[str, Callable[[], tuple[Channel, ...]]] = field(default_factory=dict)
    """functions that read the channels of an animation, by its name, or by its number if it has no name"""
    notes: tuple[str, ...] = ()
    """one line for each kind of data that was left out or changed"""
