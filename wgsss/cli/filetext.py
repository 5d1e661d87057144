"""The text that `wgsss info FILE` prints about the contents of a file."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from wgsss.cli import arguments

MOST_BODIES = 40
"""Bodies listed in the text. JSON lists all."""

_SLOTS = {"base_color": "base colour", "normal": "normal", "specular": "specular"}
_HEAD = ["body", "faces", "vertices", "size, mm", "surface", "material", "light spreads", "has"]


def text_of(description: dict[str, Any]) -> str:
    """Format the result of `wgsss.scene.describe.describe`: lines about the file, a table of bodies, and notes."""
    rows = [["file", description["file"]], ["holds", description["kind"]]]
    if "pixels" in description:
        rows += _sky(description)
    if "size_mm" in description:
        rows.append(["size", f"{_lengths(description['size_mm'])} mm"])
    if "mm_per_unit" in description:
        unit = (
            f"{description['unit']}, as the format says"
            if description["unit"]
            else "not stated: taken for a millimetre"
        )
        rows.append(["unit", f"{unit} (--size-mm X makes the longest side X mm)"])
    if description.get("animations"):
        marked = [f"{name} (plays)" if name == description["plays"] else name for name in description["animations"]]
        rows.append(["animations", f"{', '.join(marked)} (--animation NAME plays another, or none)"])
    rows += _views(description)
    if "reach_mm" in description:
        rows.append(["light spreads", _reach(description)])
    blocks = [arguments.table(rows)]
    if "bodies" in description:
        blocks.append(_bodies(description["bodies"]))
    own = f"{Path(description['file']).name}: "  # what its lines would all begin with
    notes = [note.removeprefix(own) for note in description["notes"]] or ["all that it holds is used"]
    blocks.append(arguments.table([["notes" if number == 0 else "", note] for number, note in enumerate(notes)]))
    return "\n\n".join(blocks)


def _sky(description: dict[str, Any]) -> list[list[str]]:
    width, height = description["pixels"]
    mean = " ".join(f"{value:.3g}" for value in description["mean_radiance"])
    return [
        ["size", f"{width} x {height} pixels"],
        ["mean radiance", f"{mean} W/(m^2 sr), red green blue"],
        ["greatest", f"{description['greatest_radiance']:.4g} W/(m^2 sr)"],
    ]


def _views(description: dict[str, Any]) -> list[list[str]]:
    """Rows that count lights and cameras by kind, with the option that uses those of a mesh file."""
    rows = []
    for key, used in (("lights", "--file-lights uses them"), ("cameras", "--file-camera uses the first")):
        kinds = Counter(" ".join(filter(None, (thing["kind"], thing["file"]))) for thing in description.get(key, ()))
        if kinds:
            text = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
            rows.append([key, f"{text} ({used})" if "mm_per_unit" in description else text])
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
                ", ".join(_features(body)),
            ]
        )
    more = len(bodies) - MOST_BODIES
    return arguments.table(rows) + (f"\n… and {more} more (--json lists all)" if more > 0 else "")


def _features(body: dict[str, Any]) -> list[str]:
    """List the textures, colours and motion of a body."""
    features = [f"{_SLOTS[slot]} texture {width} x {height}" for slot, (width, height) in body["textures"].items()]
    if body["base_color"] != [1.0, 1.0, 1.0]:
        features.append(f"base colour {' '.join(f'{value:.3g}' for value in body['base_color'])}")
    if body["vertex_colors"]:
        features.append("vertex colours")
    if body["moves"]:
        features.append("a motion")
    return features


def _reach(thing: dict[str, Any]) -> str:
    return "-" if thing["reach_mm"] is None else f"{thing['reach_mm']:g} mm"


def _lengths(sides: list[float]) -> str:
    return " x ".join(f"{side:.4g}" if side < 1e4 else f"{side:.0f}" for side in sides)
