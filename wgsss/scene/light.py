"""Light sources. Radiometry is SI: irradiance W/m^2, radiance W/(m^2 sr), intensity W/sr; lengths are millimetres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene import checks
from wgsss.scene.checks import BRIGHTEST, Triple
from wgsss.scene.images import read_sky


@dataclass(frozen=True)
class DirectionalLight:
    """A source so far away that its light arrives in parallel."""

    direction: Triple
    """the direction in which light travels, of any nonzero length"""
    irradiance: Triple
    """RGB, W/m^2, on a surface facing the light"""

    def __post_init__(self) -> None:
        checks.direction(self, "direction")
        checks.triple(self, "irradiance", 0, BRIGHTEST, "W/m^2")


@dataclass(frozen=True)
class PointLight:
    """A point source. A surface that faces it at a distance of d metres receives intensity / d^2 W/m^2."""

    position: Triple
    """mm"""
    intensity: Triple
    """RGB, W/sr"""

    def __post_init__(self) -> None:
        checks.position(self, "position")
        checks.triple(self, "intensity", 0, checks.STRONGEST, "W/sr")


@dataclass(frozen=True)
class RectLight:
    """A rectangle that emits from one side."""

    position: Triple
    """its centre, mm"""
    direction: Triple
    """the normal of the emitting side, of any nonzero length"""
    up: Triple
    """the direction along which height is measured; its component along `direction` is ignored"""
    width: float
    """mm"""
    height: float
    """mm"""
    radiance: Triple
    """RGB, W/(m^2 sr)"""
    samples: int = 16
    """number of points on the rectangle from which light and shadows are computed"""

    def __post_init__(self) -> None:
        checks.position(self, "position")
        checks.direction(self, "direction")
        checks.direction(self, "up")
        checks.not_parallel(self.direction, self.up, "up must not be parallel to direction")
        checks.number(self, "width", checks.SMALLEST, checks.LENGTH, "mm")
        checks.number(self, "height", checks.SMALLEST, checks.LENGTH, "mm")
        checks.triple(self, "radiance", 0, BRIGHTEST, "W/(m^2 sr)")
        checks.integer(self, "samples", 1, 256)


@dataclass(frozen=True)
class SphereLight:
    """A sphere that emits outwards."""

    position: Triple
    """its centre, mm"""
    radius: float
    """mm"""
    radiance: Triple
    """RGB, W/(m^2 sr)"""
    samples: int = 16
    """number of points on the sphere from which light and shadows are computed"""

    def __post_init__(self) -> None:
        checks.position(self, "position")
        checks.number(self, "radius", checks.SMALLEST, checks.LENGTH, "mm")
        checks.triple(self, "radiance", 0, BRIGHTEST, "W/(m^2 sr)")
        checks.integer(self, "samples", 1, 256)


@dataclass(frozen=True)
class EnvironmentLight:
    """Light from all around, constant or from a latitude-longitude image.

    Small bright regions of an image become directional lights (`wgsss.bake.suns`).

    A direction (x, y, z) lies at u = 1/2 + atan2(x, -z) / 2 pi and v = acos(y) / pi: the middle of the image lies
    along -z, its top along +y, and +x to the right of the middle.
    """

    radiance: Triple = (1.0, 1.0, 1.0)
    """RGB, W/(m^2 sr); multiplies the image if there is one"""
    file: str | None = None
    """a .hdr or .exr image: latitude-longitude, or a cube map marked as one (`wgsss.scene.images.read_sky`)"""
    rotation: float = 0.0
    """degrees by which the environment is turned about +y, counter-clockwise seen from above"""

    def __post_init__(self) -> None:
        checks.triple(self, "radiance", 0, BRIGHTEST, "W/(m^2 sr)")
        checks.number(self, "rotation", -checks.ANGLE, checks.ANGLE, "degrees")
        if self.file is not None and not isinstance(self.file, str):
            raise InputError(f"file must be the path of a .hdr or .exr image, not {self.file!r}")

    def pixels(self) -> npt.NDArray[np.float32]:
        """Read the radiance by latitude (top row +y) and longitude, before `rotation`: float32 (H, W, 3).

        Without a file it is 1 x 1.

        Negative values are clamped to zero. Raises InputError for a file that is missing, damaged or holds NaN, and
        for radiance above BRIGHTEST.
        """
        pixels = np.ones((1, 1, 3), np.float32) if self.file is None else read_sky(self.file)
        with np.errstate(over="ignore"):
            pixels = pixels * np.asarray(self.radiance, np.float32)
        if pixels.max() > BRIGHTEST:
            of = "" if self.file is None else f"{self.file}: "
            raise InputError(f"{of}an environment has at most {BRIGHTEST:g} W/(m^2 sr), not {pixels.max():g}")
        return pixels


Light = DirectionalLight | PointLight | RectLight | SphereLight | EnvironmentLight
