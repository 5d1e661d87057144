"""Reader of the materials of OBJ files (.mtl): colour, textures, roughness and index of refraction.

Sources: Wavefront's "MTL material format" (Ramey, Rose, Tyerman, 1995) and Clara.io's extension of it for
physically-based materials (norm, Pr, Pm). Colours are read as linear, as Blender writes them.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

from wgsss.errors import InputError
from wgsss.scene.files.contents import Look, Texture, Triple
from wgsss.scene.files.obj.mtl_texture import MapStatement
from wgsss.scene.files.text import decoded, file_bytes, printable, without_comment

# Statements that name an image and are not used, in addition to those that start with "map_".
_OTHER_MAPS = ("bump", "disp", "decal", "refl")
_HEIGHT_MAPS = ("bump", "map_bump")
# Numbers that are not used: their names in notes, and the values that change nothing.
_UNUSED = {
    "ke": ("emission (Ke)", 0.0),
    "tf": ("transmission filter (Tf)", 1.0),
    "pm": ("metallic (Pm)", 0.0),
    "pc": ("clearcoat (Pc)", 0.0),
    "ps": ("sheen (Ps)", 0.0),
}


def read_materials(path: Path) -> tuple[dict[str, Look], list[str]]:
    """Read the materials of a file, by name.

    Returns also notes on statements that are left out, including damaged lines. Raises InputError if the file cannot be
    read or is not text.
    """
    data = file_bytes(path)
    if b"\0" in data:
        raise InputError(f"{path}: damaged: it is not a text file")
    notes = _Notes()
    materials: dict[str, _Material] = {}
    current = _Material("", path.parent, notes)
    for line in re.split(r"\r\n|\r|\n", decoded(data).removeprefix("\ufeff")):
        keyword, *rest = line.split(maxsplit=1) or [""]
        value = rest[0].strip() if rest else ""
        if keyword.lower() == "newmtl":
            current = _Material(value, path.parent, notes)
            if materials.setdefault(value, current) is not current:
                notes.add(value, "it is defined more than once, and the first definition is used")
        elif keyword and not keyword.startswith("#"):
            current.statements[keyword.lower()] = value
    return {name: material.look() for name, material in materials.items()}, notes.lines()


class _Notes:
    """Notes on materials, collected so that equal notes of several materials become one line."""

    def __init__(self) -> None:
        self._materials: dict[str, dict[str, None]] = {}

    def add(self, material: str, note: str) -> None:
        self._materials.setdefault(note, {})[material] = None

    def lines(self) -> list[str]:
        return [f"{_listed(list(materials))}: {note}" for note, materials in self._materials.items()]


def _listed(materials: list[str]) -> str:
    more = f" and {len(materials) - 3} more" if len(materials) > 3 else ""
    return f"material{'s' * (len(materials) > 1)} {', '.join(map(printable, materials[:3]))}{more}"


@dataclass
class _Material:
    """The statements of one material."""

    name: str
    folder: Path
    notes: _Notes
    statements: dict[str, str] = field(default_factory=dict)
    """the text after each keyword, by keyword in lower case"""

    def look(self) -> Look:
        """Return the look of the material, and add notes on statements that are not used."""
        base_color_map = self._texture("map_kd")
        normal = "norm" if "norm" in self.statements else "map_kn"
        specular_map, normal_map = self._texture("map_ks", "L"), self._texture(normal)
        roughness, eta = self._numbers("pr", math.nan)[0], self._numbers("ni", math.nan)[0]
        cutoff = 0.5 if base_color_map and self._file("map_d") == base_color_map.source else None
        look = Look(
            self.name,
            base_color=self._base_color(base_color_map),
            base_color_map=base_color_map,
            normal_map=normal_map,
            normal_scale=MapStatement.parse(self.statements.get(normal, "")).number("bm", 1.0),
            specular_map=specular_map,
            roughness=roughness if 0 <= roughness <= 1 else None,
            eta=eta if 1 < eta <= 3 else None,
            cutoff=cutoff,
        )
        self._note_unused({"map_kd", "map_ks", normal} | ({"map_d"} if cutoff else set()))
        return look

    def _note(self, note: str) -> None:
        self.notes.add(self.name, note)

    def _numbers(self, keyword: str, default: float) -> Triple:
        """Return the three numbers of a statement. A single number is repeated."""
        words = without_comment(self.statements.get(keyword, "")).split()
        if words[:1] == ["-halo"]:  # an option of `d`: less opaque where the surface faces the camera
            del words[0]
        try:
            r, g, b = map(float, words * 3 if len(words) == 1 else words[:3])
            if math.isfinite(r + g + b):
                return r, g, b
        except ValueError:
            pass
        if keyword in self.statements:
            self._note(f"'{keyword} {printable(self.statements[keyword])}' is not understood and is left out")
        return default, default, default

    def _base_color(self, texture: Texture | None) -> Triple:
        color = self._numbers("kd", 1.0)
        r, g, b = (min(max(value, 0.0), 1.0) for value in color)
        if (r, g, b) != color:
            self._note("Kd is outside 0 to 1 and is clipped")
        if texture and r == g == b == 0:
            self._note("Kd 0 0 0 would make its texture black and is replaced by 1 1 1")
            return 1.0, 1.0, 1.0
        return r, g, b

    def _file(self, keyword: str) -> Path | None:
        return MapStatement.parse(self.statements[keyword]).locate(self.folder) if keyword in self.statements else None

    def _texture(self, keyword: str, channels: str = "RGB") -> Texture | None:
        if keyword not in self.statements:
            return None
        statement = MapStatement.parse(self.statements[keyword])
        file = statement.locate(self.folder)
        if file is None:
            self._note(f"the texture '{printable(statement.name)}' ({keyword}) does not exist and is left out")
            return None
        for option in statement.unused():
            self._note(f"the option {printable(option)} of {keyword} is ignored")
        return statement.texture(file, channels)

    def _note_unused(self, used_maps: set[str]) -> None:
        if "map_d" not in used_maps and (self._numbers("d", 1.0)[0] < 1 or self._numbers("tr", 0.0)[0] > 0):
            self._note("transparency (d, Tr) is left out: the material is drawn opaque")
        if any(self._numbers("ks", 0.0)):
            self._note("Phong highlights (Ks, Ns) are left out")
        for keyword, (name, neutral) in _UNUSED.items():
            if self._numbers(keyword, neutral) != (neutral,) * 3:
                self._note(f"{name} is left out")
        for keyword, value in self.statements.items():
            if keyword in used_maps or not (keyword.startswith("map_") or keyword in _OTHER_MAPS):
                continue
            if keyword == "map_ka" and self._file("map_ka") == self._file("map_kd"):
                continue  # most programs repeat the diffuse map as the ambient map, which is not used
            file = f"'{printable(MapStatement.parse(value).name)}' ({keyword})"
            if keyword in _HEIGHT_MAPS:
                self._note(f"the height map {file} is left out (if it holds normals, name it by 'norm')")
            else:
                self._note(f"the texture {file} is left out")
