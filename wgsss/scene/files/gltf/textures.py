"""Reader of the textures of a glTF file: their images, which are not decoded, and their placement on a surface."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from wgsss.errors import InputError
from wgsss.scene.files.contents import Texture, Triple
from wgsss.scene.files.gltf.container import data_of, file_of
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import Item, printable
from wgsss.scene.files.gltf.notes import Notes

TRANSFORM = "KHR_texture_transform"
IMAGES = ("EXT_texture_webp", "EXT_texture_avif")
"""extensions that replace the source of a texture by an image of another format"""

WRAPS = {"repeat": 10497, "clamp": 33071, "mirror": 33648}
NEAREST, LINEAR = 9728, 9729
"""filter codes of samplers"""


class Textures:
    """The textures of a document. An image that cannot be read is left out, with one note."""

    def __init__(self, document: Document, notes: Notes) -> None:
        self._document, self._notes = document, notes
        self._images: dict[int, bytes | Path | None] = {}

    def read(self, owner: Item, key: str, channels: str = "RGB") -> Texture | None:
        """Read the texture in a field of a material. Return None if the field is missing or the image cannot be read.

        Raises InputError if the texture does not exist, and for fields with invalid values.
        """
        info = owner.item(key)
        if info is None:
            return None
        texture = self._document.at("texture", info.get("index"), info.location)
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
        """Return the number of the image of a texture. Return None, with a note, if it has no readable image."""
        image = self._document.link(texture, "source", "image")
        for name in IMAGES:
            extension = texture.extension(name)
            if image is None and extension is not None:
                image = self._document.link(extension, "source", "image")
        if image is None:
            reason = f" (it uses {printable(', '.join(texture.extensions()))})" if texture.extensions() else ""
            self._notes.add(f"{texture.location} left out: it has no image that can be read{reason}")
        return image

    def _source(self, number: int) -> bytes | Path | None:
        if number not in self._images:
            item = self._document.all("image")[number]
            try:
                self._images[number] = self._load(item)
            except InputError as error:
                self._notes.add(f"{self._name(number)} left out: {str(error).removeprefix(f'{item.location}: ')}")
                self._images[number] = None
        return self._images[number]

    def _load(self, item: Item) -> bytes | Path:
        if item.has("uri"):
            uri = item.text("uri")
            data = data_of(uri)
            return file_of(self._document.folder, uri) if data is None else data
        if not item.has("bufferView"):
            raise InputError("it has no data")
        return bytes(self._document.view(item.get("bufferView"), item.location)[0])

    def _name(self, number: int) -> str:
        item = self._document.all("image")[number]
        uri: Any = item.get("uri")
        name = printable(uri) if isinstance(uri, str) and not uri.startswith("data:") else item.name
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
    """Return the matrix of KHR_texture_transform, by rows: scale, rotate counter-clockwise (v down), shift."""
    if transform is None:
        return None
    (u, v), (width, height) = transform.numbers("offset", 2, (0.0, 0.0)), transform.numbers("scale", 2, (1.0, 1.0))
    angle = transform.number("rotation", 0.0)
    cos, sin = math.cos(angle), math.sin(angle)
    return (cos * width, sin * height, u), (-sin * width, cos * height, v)
