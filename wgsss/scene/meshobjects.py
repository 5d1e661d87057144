"""Turns the bodies of a mesh file into objects of a scene, and checks that their size suits their material."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from wgsss.errors import InputError, Note
from wgsss.scene.bodies import LoadedFile, LoadedMesh
from wgsss.scene.checks import Triple
from wgsss.scene.defaults import DEFAULT_MATERIAL
from wgsss.scene.material import Material
from wgsss.scene.materialfile import Chosen
from wgsss.scene.scene import Motion, Object

# Sizes of a mesh over the distance that light spreads below its surface. Above GREATEST the mesh looks opaque, below
# LEAST it glows as a whole: both suggest a wrong unit. At FITTING diffusion is visible.
LEAST, GREATEST, FITTING = 0.1, 1000.0, 10.0
GLTF_ETA = 1.5
"""The index of refraction of a glTF material that names none (glTF 2.0, KHR_materials_ior)."""
_SMOOTHEST = 0.02  # roughness: less is refused by Material


def objects_of(
    file: LoadedFile,
    chosen: Chosen | None,
    where: str,
    *,
    translate: Triple = (0.0, 0.0, 0.0),
    rotate: Triple = (0.0, 0.0, 0.0),
    motion: Motion | None = None,
) -> tuple[Object, ...]:
    """Create an object for each body of a file, with the chosen material or, if it is None, with that of the file.

    Warns, naming `where`, if the mesh is very large or small compared with the distance that light spreads in it.
    """
    objects = []
    for body in file.bodies:
        material = own_material(body) if chosen is None else chosen.on(body.maps, body.mesh.corner_colors is not None)
        thing = Object(body.mesh, material, translate, rotate, motion or body.motion)
        if any(body.translate):
            moved = thing.matrix @ [*body.translate, 1.0]
            thing = replace(thing, translate=tuple(moved[:3].tolist()))
        objects.append(thing)
    _check_size(objects, file, chosen, where)
    return tuple(objects)


def own_material(body: LoadedMesh) -> Material:
    """Return the default material with the properties that the file gives for a body."""
    look, material = body.look, DEFAULT_MATERIAL
    values: dict[str, Any] = {}
    if look.roughness is not None:
        values["roughness"] = min(max(look.roughness, _SMOOTHEST), 1.0)
    if look.specular is not None:
        values["specular"] = min(max(look.specular, 0.0), 1.0)
    if look.eta is not None:
        values["eta"] = look.eta
    if look.medium is not None:
        try:
            material = Material(
                look.name or body.mesh.name,
                sigma_a=_per_mm(look.medium.sigma_a, body.mm_per_unit),
                sigma_s_prime=_per_mm(look.medium.sigma_s_prime, body.mm_per_unit),
                eta=GLTF_ETA,
            )
        except InputError as error:
            warnings.warn(f"{error}; {DEFAULT_MATERIAL.name} in its place", Note, stacklevel=2)
    return Chosen(replace(material, **values), coloured=False).on(body.maps, body.mesh.corner_colors is not None)


def _per_mm(sigma: Triple, mm_per_unit: float) -> Triple:
    red, green, blue = (value / mm_per_unit for value in sigma)
    return red, green, blue


def _check_size(objects: list[Object], file: LoadedFile, chosen: Chosen | None, where: str) -> None:
    """Warn about the first material for which the mesh is too large or too small to show diffusion."""
    points = np.concatenate([thing.placed for thing in objects])
    side = float(np.ptp(points, axis=0).max())
    for thing, body in zip(objects, file.bodies, strict=True):
        material = thing.material
        try:
            reach = float(material.profile.range(0.01).max())
        except InputError:  # of layers that are too thin for diffusion: methods say so when they need it
            continue
        if LEAST * reach <= side <= GREATEST * reach:
            continue
        effect = "looks as if opaque" if side > reach else "glows as a whole"
        fit = float(f"{FITTING * reach:.2g}")
        advice = f"; if its unit is another one, --size-mm {fit:g} would fit"
        if chosen is None and body.look.medium is not None:
            advice = ""  # the file's own medium is scaled with the mesh
        warnings.warn(
            f"{where}: the mesh is {side:.3g} mm long and light spreads {reach:.2g} mm in {material.name}, so it "
            f"{effect}{advice}",
            Note,
            stacklevel=3,
        )
        return
