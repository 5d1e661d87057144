"""The textures of a glTF file: where their images are, and how they lie over a surface. Images are not decoded."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from wgsss.errors import InputError
from wgsss.scene.files.contents import Texture, Triple
from wgsss.scene.files.gltf.container import data_of, file_of
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import Item, plain
from wgsss.scene.files.gltf.notes import Notes

TRANSFORM = "KHR_texture_transform"
IMAGES = ("EXT_texture_webp", "EXT_texture_avif")
"""extensions that put an image in a format of their own in place of a texture's source"""

WRAPS = {"repeat": 10497, "clamp": 33071, "mirror": 33648}
NEAREST, LINEAR = 9728, 9729
"""the codes of samplers"""


class Textures:
    """The textures of a document. An image that is not there is noted, once, and left out."""

    def __init__(self, document: Document, notes: Notes) -> None:
        self._document, self._notes = document, notes
        self._images: dict[int, bytes | Path | None] = {}

    def read(self, owner: Item, key: str, channels: str = "RGB") -> Texture | None:
        """The texture that a material names; None where it names none, or one whose image is not there.

        Raises InputError for one that the file does not have, and for fields of a wrong kind.
        """
        info = owner.item(key)
        if info is None:
            return None
        texture = self._document.at("texture", info.get("index"), info.where)
        image = self._image_of(texture)
        source = None if image is None else self._source(image)
        if image is None or source is None:
            return None
        transform = info.extension(TRANSFORM)
        coordinates = info.whole("texCoord", 0)
        if transform is not None:
            coordinates = transform.whole("texCoord", coordinates)
        wrap, nearest = self._sampling(texture)
        name = self._name(image)
        return Texture(source, name, channels, coordinates, _rows(transform), wrap, nearest)

    def _image_of(self, texture: Item) -> int | None:
        """The number of the image that can be read; None, noted, where there is none."""
        found = self._document.link(texture, "source", "image")
        for name in IMAGES:
            extension = texture.extension(name)
            if found is None and extension is not None:
                found = self._document.link(extension, "source", "image")
        if found is None:
            why = f" (it is of {plain(', '.join(texture.extensions()))})" if texture.extensions() else ""
            self._notes.add(f"{texture.where} left out: it has no image that can be read{why}")
        return found

    def _source(self, number: int) -> bytes | Path | None:
        if number not in self._images:
            item = self._document.all("image")[number]
            try:
                self._images[number] = self._load(item)
            except InputError as error:
                self._notes.add(f"{self._name(number)} left out: {str(error).removeprefix(f'{item.where}: ')}")
                self._images[number] = None
        return self._images[number]

    def _load(self, item: Item) -> bytes | Path:
        if item.has("uri"):
            uri = item.text("uri")
            data = data_of(uri)
            return file_of(self._document.folder, uri) if data is None else data
        if not item.has("bufferView"):
            raise InputError("it has no data")
        return bytes(self._document.view(item.get("bufferView"), item.where)[0])

    def _name(self, number: int) -> str:
        item = self._document.all("image")[number]
        uri: Any = item.get("uri")
        name = plain(uri) if isinstance(uri, str) and not uri.startswith("data:") else item.name
        return f"image {number} ({name})" if name else f"image {number}"

    def _sampling(self, texture: Item) -> tuple[tuple[str, str], bool]:
        number = self._document.link(texture, "sampler", "sampler")
        sampler = Item({}) if number is None else self._document.all("sampler")[number]
        wrap = (_wrap(sampler, "wrapS"), _wrap(sampler, "wrapT"))
        return wrap, sampler.whole("magFilter", LINEAR) == NEAREST


def _wrap(sampler: Item, key: str) -> str:
    code = sampler.whole(key, WRAPS["repeat"])
    for name, known in WRAPS.items():
        if code == known:
            return name
    raise sampler.error(f"there is no {key} {code}")


def _rows(transform: Item | None) -> tuple[Triple, Triple] | None:
    """The matrix of KHR_texture_transform: scaled, turned counter-clockwise as v points down, and moved."""
    if transform is None:
        return None
    (u, v), (width, height) = transform.numbers("offset", 2, (0.0, 0.0)), transform.numbers("scale", 2, (1.0, 1.0))
    angle = transform.number("rotation", 0.0)
    cos, sin = math.cos(angle), math.sin(angle)
    return (cos * width, sin * height, u), (-sin * width, cos * height, v)
