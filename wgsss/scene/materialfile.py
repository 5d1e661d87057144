"""Loads materials by name, from TOML tables and from material files, and combines them with the textures of a mesh."""

from __future__ import annotations

import inspect
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from wgsss.errors import InputError
from wgsss.optics import Dipole, Layer, SumOfGaussians, Tabulated
from wgsss.scene import tables
from wgsss.scene.images import read_levels, read_map
from wgsss.scene.layermaps import LayerMaps
from wgsss.scene.material import IN_PLACE, MATERIALS, SLOTS, Maps, Material, material
from wgsss.text import shown
from wgsss.userfiles import path_from

_COEFFICIENTS = ("sigma_a", "sigma_s_prime")
_LAYER_MAPS = ("thickness_map", "color_map", "opacity_map")
_INVERTED = ("reflectance", "mean_free_path", "diffuse_mean_free_path")
"""Keys from which the coefficients are computed by inverting the dipole."""


@dataclass(frozen=True)
class Chosen:
    """A material that the user chose."""

    material: Material
    coloured: bool
    """whether the user also chose its base colour, which otherwise comes with a measured material"""

    def on(self, maps: Maps, coloured_vertices: bool = False) -> Material:
        """Return the material for a mesh with these textures. A texture of the material replaces that of the mesh.

        A colour that varies over the mesh, by a texture or by vertex colours, becomes the base colour and replaces the
        constant base colour of the material. If the user chose that colour, it tints the varying one instead. A
        constant colour of the mesh (`Maps.tint`) also becomes the base colour, unless the material has its own. The
        maps of layers are always those of the material.
        """
        own = self.material.maps
        both = replace(
            maps, layers=own.layers, **{slot: getattr(own, slot) for slot in SLOTS if getattr(own, slot) is not None}
        )
        if own.base_color is not None:
            both = replace(both, tint=(1.0, 1.0, 1.0))
        constant, varies = self.material.base_color, both.base_color is not None or coloured_vertices
        if not self.coloured and (varies or constant == (1.0, 1.0, 1.0)):
            constant = both.tint
        elif varies:
            red, green, blue = (c * t for c, t in zip(constant, both.tint, strict=True))
            constant = (red, green, blue)
        return replace(self.material, maps=both, base_color=constant)


def choose_material(value: Any, folder: Path, where: str = "") -> Chosen:
    """Load a material by its name, from a file relative to `folder`, or from a table. A Material is used as it is."""
    if isinstance(value, Material):
        return Chosen(value, coloured=value not in MATERIALS.values())
    if isinstance(value, dict):
        return _from_table(value, folder, where, "custom")
    if not isinstance(value, str | Path):
        raise InputError(f"material must be a name, a file or a table, not {shown(value)}")
    if not str(value).strip():
        raise InputError("the name of the material is empty")
    if not Path(value).suffix and os.sep not in str(value):
        return Chosen(material(str(value)), coloured=False)
    path = path_from(str(value), folder)
    if path.suffix.lower() != ".toml":
        raise InputError(f"{path}: the file extension of a material file must be .toml")
    return _from_table(tables.read_toml(path), path.parent, str(path), path.stem)


def _from_table(table: tables.Table, folder: Path, where: str, name: str) -> Chosen:
    parameters = {key: p for key, p in inspect.signature(Material).parameters.items() if key != "maps"}
    slots = {f"{slot}_map": slot for slot in SLOTS}
    tables.check_keys(table, [*parameters, *slots, *_INVERTED, "preset"], where)

    values: tables.Table = {"name": name}
    if "preset" in table:
        try:
            if not isinstance(table["preset"], str):
                raise InputError(f"must be the name of a material, not {shown(table['preset'])}")
            preset = material(table["preset"])
        except InputError as error:
            raise tables.at(f"{where}: preset", error) from None
        values = {key: getattr(preset, key) for key in parameters}
        if any(
            key in table for key in (*_COEFFICIENTS, *_INVERTED, *IN_PLACE)
        ):  # another medium takes the place of the preset's
            kept = _COEFFICIENTS if any(key in table for key in _COEFFICIENTS) else ()
            values |= dict.fromkeys({*_COEFFICIENTS, *IN_PLACE}.difference(kept))
    values |= {key: value for key, value in table.items() if key in parameters}
    if any(key in table for key in _INVERTED):
        values |= _inverted(table, values.get("eta", Material.eta), where)
    if isinstance(values.get("gaussians"), dict):
        values["gaussians"] = tables.call(SumOfGaussians, values["gaussians"], f"{where}: gaussians")
    if "layers" in table:
        if "eta" in table:
            raise InputError(f"{where}: eta is that of the first of the layers: give it there")
        pairs = [_layer(layer, at, folder) for layer, at in tables.each(table, "layers", where)]
        values["layers"] = [layer for layer, _ in pairs]
        if not all(maps.empty for _, maps in pairs):
            values["maps"] = Maps(layers=tuple(maps for _, maps in pairs))
    if "table" in table:
        values["table"] = Tabulated.read(tables.file_in(table, "table", where, folder))

    images = {}
    for key in slots.keys() & table.keys():
        path = tables.file_in(table, key, where, folder)
        images[slots[key]] = tables.call(
            read_map,
            {"source": path, "mode": "L" if key == "specular_map" else "RGB", "linear": key != "base_color_map"},
            f"{where}: {key}",
        )
    chosen = Chosen(tables.call(Material, values, where), coloured="base_color" in table)
    return replace(chosen, material=chosen.on(Maps(**images)))


def _layer(table: tables.Table, where: str, folder: Path) -> tuple[Layer, LayerMaps]:
    """Create one of the [[layers]] and its maps, whose files are relative to `folder`."""
    tables.check_keys(table, [*inspect.signature(Layer).parameters, *_LAYER_MAPS], where)
    images = {}
    for key in [key for key in _LAYER_MAPS if key in table]:
        values: tables.Table = {"source": tables.file_in(table, key, where, folder)}
        if key == "color_map":
            values["mode"] = "RGB"
        read = read_map if key == "color_map" else read_levels
        images[key.removesuffix("_map")] = tables.call(read, values, f"{where}: {key}")
    layer = tables.call(Layer, {key: value for key, value in table.items() if key not in _LAYER_MAPS}, where)
    return layer, LayerMaps(**images)


def _inverted(table: tables.Table, eta: Any, where: str) -> tables.Table:
    """Compute the coefficients of a medium from its total reflectance and mean free path by inverting the dipole."""
    if any(key in table for key in (*_COEFFICIENTS, *IN_PLACE)):
        raise InputError(
            f"{where}: reflectance and a mean free path stand in place of another medium: give one or the other"
        )
    if "reflectance" not in table:
        raise InputError(f"{where}: key 'reflectance' is missing")
    lengths = {key: table[key] for key in _INVERTED[1:] if key in table}
    try:
        medium = Dipole.from_reflectance(table["reflectance"], eta=eta, **lengths)
    except InputError as error:
        raise tables.at(where, error) from None
    return {name: tuple(getattr(medium, name).tolist()) for name in _COEFFICIENTS}
