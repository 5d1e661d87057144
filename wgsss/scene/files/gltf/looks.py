"""Conversion of the materials of a glTF file to looks, with notes on visible properties that are not used."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wgsss.scene.files.contents import Look, Texture, Triple
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.extensions import HARMLESS
from wgsss.scene.files.gltf.fields import Item
from wgsss.scene.files.gltf.media import SCATTER, VOLUME, VOLUME_SCATTER, read_medium
from wgsss.scene.files.gltf.notes import Notes
from wgsss.scene.files.gltf.textures import Textures

IOR, SPECULAR, DIFFUSE = "KHR_materials_ior", "KHR_materials_specular", "KHR_materials_diffuse_transmission"
TRANSMISSION, GLOSSY = "KHR_materials_transmission", "KHR_materials_pbrSpecularGlossiness"

_READ = {IOR, SPECULAR, DIFFUSE, TRANSMISSION, GLOSSY, VOLUME, SCATTER, VOLUME_SCATTER}
_DEFAULT_ETA = 1.5  # the default of glTF
_MAX_ETA = 3.0


class Looks:
    """The looks of the materials of a document. Each material is read once, when a primitive first uses it."""

    def __init__(self, document: Document, notes: Notes) -> None:
        self._document, self._notes = document, notes
        self._textures = Textures(document, notes)
        self._looks: dict[int | None, Look] = {None: Look()}

    def of(self, primitive: Item, sets: Any) -> Look:
        """Return the look of a primitive that has the sets of texture coordinates `sets`.

        Textures that need another set are left out, with a note.
        """
        number = self._document.link(primitive, "material", "material")
        if number is not None and number not in self._looks:
            self._looks[number] = self._read(self._document.all("material")[number])
        look = self._looks[number]
        for field, texture in textures(look).items():
            if texture.coordinates not in sets:
                loss = f"{texture.name} left out because there is no TEXCOORD_{texture.coordinates}:"
                self._notes.add(loss, "primitive")
                removed: dict[str, Any] = {field: None}
                look = replace(look, **removed)
        return look

    def _read(self, material: Item) -> Look:
        pbr = material.item("pbrMetallicRoughness") or Item({}, material.location)
        normal = material.item("normalTexture") or Item({}, material.location)
        color, alpha, color_map = self._base(material, pbr)
        medium = read_medium(material, self._notes)
        self._note_losses(material, pbr, medium is not None)
        if medium is not None:
            color, color_map = self._boundary(material, color, color_map)
        masked = material.text("alphaMode", "OPAQUE", ("OPAQUE", "MASK", "BLEND")) == "MASK"
        specular, specular_map = self._specular(material)
        eta = self._eta(material)
        return Look(
            material.name,
            color,
            color_map,
            self._textures.read(material, "normalTexture"),
            normal.number("scale", 1.0),
            specular,
            specular_map,
            pbr.number("roughnessFactor", low=0, high=1) if pbr.has("roughnessFactor") else None,
            _DEFAULT_ETA if eta is None and medium is not None else eta,
            min(max(alpha, 0.0), 1.0) if masked else 1.0,
            material.number("alphaCutoff", 0.5, low=0) if masked else None,
            medium,
        )

    def _base(self, material: Item, pbr: Item) -> tuple[Triple, float, Texture | None]:
        """Read the base colour, its alpha and its map."""
        glossy = material.extension(GLOSSY)
        owner, factor, texture = (pbr, "baseColorFactor", "baseColorTexture")
        if glossy is not None:
            owner, factor, texture = glossy, "diffuseFactor", "diffuseTexture"
            self._notes.add(f"all but the diffuse colour of {GLOSSY} left out: used by", "material")
        *color, alpha = owner.numbers(factor, 4, (1.0, 1.0, 1.0, 1.0))
        return self._clipped(color), alpha, self._textures.read(owner, texture)

    def _boundary(self, material: Item, color: Triple, color_map: Texture | None) -> tuple[Triple, Texture | None]:
        """Return the colour of a surface through which light enters a medium, and its map.

        glTF reflects one share of the light with the base colour, and transmits the other share with the diffuse
        transmission colour. Here both leave the same surface. If both colours have the same map, they are mixed by
        their shares; otherwise the colour with the larger share is used.
        """
        diffuse = material.extension(DIFFUSE)
        if diffuse is None:
            return color, color_map
        if diffuse.has("diffuseTransmissionTexture"):
            self._notes.add(f"diffuseTransmissionTexture of {DIFFUSE} left out: used by", "material")
        share = diffuse.number("diffuseTransmissionFactor", 0.0, low=0, high=1)
        through = self._clipped(diffuse.numbers("diffuseTransmissionColorFactor", 3, (1.0, 1.0, 1.0)))
        through_map = self._textures.read(diffuse, "diffuseTransmissionColorTexture")
        if through_map == color_map:
            red, green, blue = ((1 - share) * a + share * b for a, b in zip(color, through, strict=True))
            return (red, green, blue), color_map
        if 0 < share < 1:
            self._notes.add(f"diffuseTransmissionFactor of {DIFFUSE} rounded to {round(share)}: used by", "material")
        return (through, through_map) if share >= 0.5 else (color, color_map)

    def _specular(self, material: Item) -> tuple[float | None, Texture | None]:
        extension = material.extension(SPECULAR)
        if extension is None:
            return None, None
        tinted = extension.numbers("specularColorFactor", 3, (1.0, 1.0, 1.0)) != (1.0, 1.0, 1.0)
        if tinted or extension.has("specularColorTexture"):
            self._notes.add(f"the colour of {SPECULAR} left out: used by", "material")
        share = extension.number("specularFactor", 1.0, low=0, high=1)
        return share, self._textures.read(extension, "specularTexture", "A")

    def _eta(self, material: Item) -> float | None:
        extension = material.extension(IOR)
        if extension is None:
            return None
        eta = extension.number("ior", _DEFAULT_ETA, low=0)
        if 1 <= eta <= _MAX_ETA:
            return eta
        self._notes.add(f"an index of refraction of {eta:g} left out: used by", "material")
        return None

    def _clipped(self, color: Any) -> Triple:
        red, green, blue = np.clip(color, 0, 1).tolist()
        if (red, green, blue) != tuple(color):
            self._notes.add("colours clipped to 0 to 1: used by", "material")
        return red, green, blue

    def _note_losses(self, material: Item, pbr: Item, medium: bool) -> None:
        """Add notes for visible properties that are not used. `medium` says whether the material has a medium."""
        blend = material.text("alphaMode", "OPAQUE") == "BLEND"
        lost = {
            "emission left out: used by": any(material.numbers("emissiveFactor", 3, (0.0, 0.0, 0.0))),
            "occlusion textures left out: used by": material.has("occlusionTexture"),
            "drawn opaque although alphaMode is BLEND:": blend,
            "metallic-roughness textures left out: used by": pbr.has("metallicRoughnessTexture"),
            "metal left out: used by": pbr.number("metallicFactor", 0.0) > 0,
        }
        extensions = set(material.extensions()) - HARMLESS - _READ
        if not medium:
            extensions |= {DIFFUSE, TRANSMISSION} & set(material.extensions())
        for loss, is_lost in (*lost.items(), *((f"{name} left out: used by", True) for name in sorted(extensions))):
            if is_lost:
                self._notes.add(loss, "material")


def textures(look: Look) -> dict[str, Texture]:
    """Return the textures of a look, by the names of its fields."""
    fields = {name: getattr(look, name) for name in ("base_color_map", "normal_map", "specular_map")}
    return {name: texture for name, texture in fields.items() if texture is not None}
