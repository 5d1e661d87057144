"""Texture statements of .mtl files: options, then the name of an image file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from wgsss.scene.files.contents import Texture, Triple
from wgsss.scene.files.locate import locate
from wgsss.scene.files.text import without_comment

_NUMBER = r"[-+]?(?:\d{1,30}\.?\d{0,30}|\.\d{1,30})(?:[eE][-+]?\d{1,2})?(?!\S)"  # not too large for a float
# Options stand before the file name, though some programs write them after it.
_OPTION = re.compile(
    rf"(?<!\S)-(?:(?P<vector>o|s|t)(?P<numbers>(?:\s+{_NUMBER}){{1,3}})"
    rf"|(?P<pair>mm)(?P<two>\s+{_NUMBER}\s+{_NUMBER})"
    rf"|(?P<scalar>bm|boost|texres)(?P<one>\s+{_NUMBER})"
    r"|(?P<switch>blendu|blendv|cc|clamp|imfchan|type|colorspace)(?P<word>\s+\S+))",
    re.IGNORECASE,
)
# Options that change the picture and are not used, and their values that change nothing.
_UNUSED = {
    "t": ("0", "0 0", "0 0 0"),
    "mm": ("0 1",),
    "cc": ("off",),
    "blendu": ("on",),
    "blendv": ("on",),
    "imfchan": ("l", "m"),
}


@dataclass(frozen=True)
class MapStatement:
    """A texture statement taken apart."""

    name: str
    """of the file, as it is written"""
    options: dict[str, tuple[str, ...]]
    """their words, by name without the dash"""

    @classmethod
    def parse(cls, text: str) -> MapStatement:
        options: dict[str, tuple[str, ...]] = {}

        def take(found: re.Match[str]) -> str:
            name, words = (word for word in found.groups() if word is not None)
            options[name.lower()] = tuple(words.split())
            return " "

        return cls(_OPTION.sub(take, text).strip().strip('"'), options)

    def locate(self, folder: Path) -> Path | None:
        """The file that is named; a '#' in its name is tried as such first, then as the start of a comment."""
        return locate(self.name, folder) or locate(without_comment(self.name).strip('"'), folder)

    def texture(self, file: Path, channels: str) -> Texture:
        """The texture of a file, with what the options say of where it lies."""
        wrap = "clamp" if self.options.get("clamp") == ("on",) else "repeat"
        return Texture(file, file.name, channels, transform=self._transform(), wrap=(wrap, wrap))

    def number(self, option: str, default: float) -> float:
        return float(self.options[option][0]) if option in self.options else default

    def unused(self) -> Iterator[str]:
        """Options that change the picture and are not used, as they are written."""
        for name, words in self.options.items():
            if name in _UNUSED and " ".join(words).lower() not in _UNUSED[name]:
                yield f"-{name} {' '.join(words)}"

    def _transform(self) -> tuple[Triple, Triple] | None:
        """With v up, coordinates are scaled by -s and shifted by -o; the same with v down, or None for neither."""
        if not {"s", "o"} & set(self.options):
            return None
        u_scale, v_scale = _pair(self.options.get("s", ()), 1.0)
        u_offset, v_offset = _pair(self.options.get("o", ()), 0.0)
        return (u_scale, 0.0, u_offset), (0.0, v_scale, 1.0 - v_scale - v_offset)


def _pair(words: tuple[str, ...], default: float) -> tuple[float, float]:
    u, v, *_ = [*map(float, words), default, default]
    return u, v
