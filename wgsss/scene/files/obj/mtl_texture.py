"""Texture statements of .mtl files, which consist of options and the name of an image file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from wgsss.scene.files.contents import Texture, Triple
from wgsss.scene.files.locate import locate
from wgsss.scene.files.text import without_comment

_NUMBER = r"[-+]?(?:\d{1,30}\.?\d{0,30}|\.\d{1,30})(?:[eE][-+]?\d{1,2})?(?!\S)"  # not too large for a float
# Options belong before the file name, but some programs write them after it.
_OPTION = re.compile(
    rf"(?<!\S)-(?:(?P<vector>o|s|t)(?P<numbers>(?:\s+{_NUMBER}){{1,3}})"
    rf"|(?P<pair>mm)(?P<two>\s+{_NUMBER}\s+{_NUMBER})"
    rf"|(?P<scalar>bm|boost|texres)(?P<one>\s+{_NUMBER})"
    r"|(?P<switch>blendu|blendv|cc|clamp|imfchan|type|colorspace)(?P<word>\s+\S+))",
    re.IGNORECASE,
)
# Options that change the picture and are not supported, with those of their values that change nothing.
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
    """A parsed texture statement."""

    name: str
    """name of the file as it is written"""
    options: dict[str, tuple[str, ...]]
    """arguments of each option, by its name without the dash"""

    @classmethod
    def parse(cls, text: str) -> MapStatement:
        """Split the text of a statement into options and the name of the file."""
        options: dict[str, tuple[str, ...]] = {}

        def take(match: re.Match[str]) -> str:
            name, words = (word for word in match.groups() if word is not None)
            options[name.lower()] = tuple(words.split())
            return " "

        return cls(_OPTION.sub(take, text).strip().strip('"'), options)

    def locate(self, folder: Path) -> Path | None:
        """Find the file. A '#' is first taken as part of its name, then as the start of a comment."""
        return locate(self.name, folder) or locate(without_comment(self.name).strip('"'), folder)

    def texture(self, file: Path, channels: str) -> Texture:
        """Return the texture of an image file, with the placement and the wrapping that the options define."""
        wrap = "clamp" if self.options.get("clamp") == ("on",) else "repeat"
        return Texture(file, file.name, channels, transform=self._transform(), wrap=(wrap, wrap))

    def number(self, option: str, default: float) -> float:
        """Return the first argument of an option, or the default if the option is missing."""
        return float(self.options[option][0]) if option in self.options else default

    def unused(self) -> Iterator[str]:
        """Yield the options that change the picture and are not supported, as they are written."""
        for name, words in self.options.items():
            if name in _UNUSED and " ".join(words).lower() not in _UNUSED[name]:
                yield f"-{name} {' '.join(words)}"

    def _transform(self) -> tuple[Triple, Triple] | None:
        """Return the matrix of the options -s (scale) and -o (offset), converted from v up to v down, or None."""
        if not {"s", "o"} & set(self.options):
            return None
        u_scale, v_scale = _pair(self.options.get("s", ()), 1.0)
        u_offset, v_offset = _pair(self.options.get("o", ()), 0.0)
        return (u_scale, 0.0, u_offset), (0.0, v_scale, 1.0 - v_scale - v_offset)


def _pair(words: tuple[str, ...], default: float) -> tuple[float, float]:
    u, v, *_ = [*map(float, words), default, default]
    return u, v
