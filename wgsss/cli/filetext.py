"""What `wgsss info FILE` prints of what a file holds."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from wgsss.cli import arguments

MOST_BODIES = 40
"""that are listed; JSON has all"""

_SLOTS = {"base_color": "base colour", "normal": "normal", "specular": "specular"}
_HEAD = ["body", "faces", "vertices", "size, mm", "surface", "material", "light spreads", "has"]


def text_of(found: dict[str, Any]) -> str:
    """The text of what `wgsss.scene.describe.describe` found: lines on the whole, a table of bodies, and notes."""
    rows = [["file", found["file"]], ["holds", found["kind"]]]
    if "pixels" in found:
        rows += _sky(found)
    if "size_mm" in found:
        rows.append(["size", f"{_lengths(found['size_mm'])} mm"])
    if "mm_per_unit" in found:
        unit = f"{found['unit']}, as the format says" if found["unit"] else "not stated: taken for a millimetre"
        rows.append(["unit", f"{unit} (--size-mm X makes the longest side X mm)"])
    if found.get("animations"):
        marked = [f"{name} (plays)" if name == found["plays"] else name for name in found["animations"]]
        rows.append(["animations", f"{', '.join(marked)} (--animation NAME plays another, or none)"])
    rows += _views(found)
    if "reach_mm" in found:
        rows.append(["light spreads", _reach(found)])
    blocks = [arguments.table(rows)]
    if "bodies" in found:
        blocks.append(_bodies(found["bodies"]))
    own = f"{Path(found['file']).name}: "  # what its lines would all begin with
    notes = [note.removeprefix(own) for note in found["notes"]] or ["all that it holds is used"]
    blocks.append(arguments.table([["notes" if number == 0 else "", note] for number, note in enumerate(notes)]))
    return "\n\n".join(blocks)


def _sky(found: dict[str, Any]) -> list[list[str]]:
    width, height = found["pixels"]
    mean = " ".join(f"{value:.3g}" for value in found["mean_radiance"])
    return [
        ["size", f"{width} x {height} pixels"],
        ["mean radiance", f"{mean} W/(m^2 sr), red green blue"],
        ["greatest", f"{found['greatest_radiance']:.4g} W/(m^2 sr)"],
    ]


def _views(found: dict[str, Any]) -> list[list[str]]:
    """Lights and cameras: how many of which kinds, and what uses those of a mesh file."""
    rows = []
    for key, used in (("lights", "--file-lights uses them"), ("cameras", "--file-camera uses the first")):
        kinds = Counter(" ".join(filter(None, (thing["kind"], thing["file"]))) for thing in found.get(key, ()))
        if kinds:
            text = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
            rows.append([key, f"{text} ({used})" if "mm_per_unit" in found else text])
    return rows


def _bodies(bodies: list[dict[str, Any]]) -> str:
    rows = [_HEAD]
    for body in bodies[:MOST_BODIES]:
        rows.append(
            [
                body["name"],
                str(body["faces"]),
                str(body["vertices"]),
                _lengths(body["size_mm"]),
                "closed" if body["closed"] else "open",
                body["material"],
                _reach(body),
                ", ".join(_worn(body)),
            ]
        )
    more = len(bodies) - MOST_BODIES
    return arguments.table(rows) + (f"\n… and {more} more (--json lists all)" if more > 0 else "")


def _worn(body: dict[str, Any]) -> list[str]:
    """What a body has of its own beside its shape."""
    found = [f"{_SLOTS[slot]} texture {width} x {height}" for slot, (width, height) in body["textures"].items()]
    if body["base_color"] != [1.0, 1.0, 1.0]:
        found.append(f"base colour {' '.join(f'{value:.3g}' for value in body['base_color'])}")
    if body["vertex_colors"]:
        found.append("vertex colours")
    if body["moves"]:
        found.append("a motion")
    return found


def _reach(thing: dict[str, Any]) -> str:
    return "-" if thing["reach_mm"] is None else f"{thing['reach_mm']:g} mm"


def _lengths(sides: list[float]) -> str:
    return " x ".join(f"{side:.4g}" if side < 1e4 else f"{side:.0f}" for side in sides)
