"""The layers of a material at points below its surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene import Material
from wgsss.scene.layermaps import levels
from wgsss.text import shortened

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Coefficients:
    """The coefficients of J layers at N points, 1/mm: (N, J, 3) each."""

    sigma_s: Array
    sigma_t: Array


class LayeredMedium:
    """The J layers of a material by texture coordinates. A homogeneous medium is one infinite layer.

    Raises InputError for a material of which only the profile is known.
    """

    def __init__(self, material: Material) -> None:
        if material.stack is None:
            name = shortened(material.name, 60)
            raise InputError(f"material '{name}': single scattering needs coefficients or layers, not a profile")
        self.layers = material.stack
        self.g = np.array([layer.g for layer in self.layers])
        self._maps = material.maps
        self.is_uniform = len(self.layers) == 1 and not self._maps.layers

    def interfaces(self, uv: Array) -> Array:
        """Return the depth below the surface of each interface between layers, mm: (N, J - 1) at `uv` (N, 2)."""
        thickness = np.empty((len(uv), len(self.layers) - 1))
        for number, layer in enumerate(self.layers[:-1]):
            thickness[:, number] = layer.thickness * self._share(number, "thickness", uv)
        return np.cumsum(thickness, axis=1)

    def coefficients(self, uv: Array) -> Coefficients:
        """Return the coefficients of all layers at texture coordinates (N, 2)."""
        sigma_s = np.empty((len(uv), len(self.layers), 3))
        sigma_t = np.empty_like(sigma_s)
        for number, layer in enumerate(self.layers):
            present = np.reshape(self._share(number, "opacity", uv), (-1, 1))
            color = self._share(number, "color", uv)
            sigma_s[:, number] = present * layer.sigma_s * color
            sigma_t[:, number] = sigma_s[:, number] + present * layer.sigma_a
        return Coefficients(sigma_s, sigma_t)

    def _share(self, layer: int, name: str, uv: Array) -> Any:
        """Return the linear value of a map of a layer, 0 to 1, or 1 where there is none."""
        image = getattr(self._maps.layers[layer], name) if self._maps.layers else None
        if image is None:
            return 1.0
        return sample_image(levels(image), uv, self._maps.wrap, self._maps.nearest)


def sample_image(image: Array, uv: Array, wrap: tuple[str, str], nearest: bool) -> Array:
    """Return the values of an image (H, W[, 3]) at texture coordinates (N, 2), as wgsl/mesh.wgsl samples maps."""
    size = np.array(image.shape[1::-1])
    at = np.column_stack([_wrapped(uv[:, axis], wrap[axis]) for axis in (0, 1)]) * size
    if nearest:
        column, row = np.minimum(np.floor(at).astype(np.int64), size - 1).T
        return image[row, column]
    low = np.floor(at - 0.5)
    weight = at - 0.5 - low
    corners = [
        np.where(np.array(wrap) == "repeat", (low + step).astype(np.int64) % size, np.clip(low + step, 0, size - 1))
        for step in (0, 1)
    ]
    (left, top), (right, bottom) = (corner.astype(np.int64).T for corner in corners)
    across, down = (weight[:, axis].reshape(-1, *[1] * (image.ndim - 2)) for axis in (0, 1))
    above = (1 - across) * image[top, left] + across * image[top, right]
    below = (1 - across) * image[bottom, left] + across * image[bottom, right]
    result: Array = (1 - down) * above + down * below
    return result


def _wrapped(values: Array, wrap: str) -> Array:
    """Return texture coordinates along one axis, moved to 0 to 1."""
    if wrap == "repeat":
        return values - np.floor(values)
    if wrap == "mirror":
        folded = values - 2.0 * np.floor(values / 2.0)
        return np.minimum(folded, 2.0 - folded)
    return np.clip(values, 0.0, 1.0)
