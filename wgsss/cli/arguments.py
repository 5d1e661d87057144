"""Arguments that several commands share, their parsing, and the output of results."""

from __future__ import annotations

import argparse
import math
import re
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from wgsss import console
from wgsss.errors import InputError
from wgsss.text import escaped, printable, shown, span

if TYPE_CHECKING:
    from wgsss.methods import Method
    from wgsss.scene import Scene

DEFAULT_METHOD = "deon07"
_SCENE = "a built-in scene (see 'wgsss scenes'), a scene file (.toml) or a mesh (.ply .obj .stl .off .glb .gltf)"
_MATERIAL = """material of all objects: a measured one (see 'wgsss materials'), a material file (.toml), or a table with
the keys of such a file, as in '{preset = "marble", roughness = 0.5}'"""
_CAMERA = """camera in place of the scene's own: a table with the keys of a scene file, as in '{kind = "perspective",
eye = [0, 0, 300], target = [0, 0, 0]}'"""
_LIGHT = """light in place of the scene's own: a table with the keys of a scene file, as in '{kind = "point",
position = [0, 0, 300], intensity = [1, 1, 1]}'; repeat the option for more lights"""
_SURFACE = "in place of a method: the surface method, which estimates the light from the near side (default: none)"
_TRANSLUCENCY = (
    "in place of a method: the translucency method, which estimates the light from the far side (default: none)"
)
_SET = "set a knob of the method; repeat the option for more knobs"


class Parser(argparse.ArgumentParser):
    """An argument parser that raises InputError with a one-line message."""

    def __init__(self, **rest: Any) -> None:
        super().__init__(**rest, allow_abbrev=False)
        self._negative_number_matcher = re.compile(r"-(\d|\.|inf|nan)", re.IGNORECASE)  # -1e-1 is a value, no option

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see '{self.prog} --help')")

    def _print_message(self, message: str, file: Any = None) -> None:
        (console.print_message if file is sys.stderr else console.print_result)(message.rstrip("\n"))

    @property
    def options(self) -> list[str]:
        """The names of all long options."""
        return [name for action in self._actions for name in action.option_strings if name.startswith("--")]


def command(commands: Any, name: str, run: Any, summary: str, **rest: Any) -> Parser:
    """Declare a command. `run` is called with the parsed arguments."""
    parser: Parser = commands.add_parser(name, help=summary, description=f"{summary[0].upper()}{summary[1:]}.", **rest)
    parser.set_defaults(run=run)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    return parser


def add_scene(parser: Parser) -> None:
    """Add the argument SCENE and the options that change it."""
    parser.add_argument("scene", metavar="SCENE", help=_SCENE)
    add_scene_choices(parser)


def add_scene_choices(parser: Parser) -> None:
    """Add the options that replace parts of a scene."""
    add = parser.add_argument
    add("--material", metavar="NAME", type=name_or_table, help=_MATERIAL)
    add("--size-mm", metavar="X", type=length, help="scale a mesh file so that its longest side is X mm long")
    add("--animation", metavar="NAME", help="animation of a glTF file to play, or none (default: the first)")
    add("--simplify", metavar="N", type=count, help="reduce each part of a mesh file to at most N faces")
    add("--vertices", metavar="N", type=count, help="approximate number of vertices of a built-in scene")
    add("--camera", metavar="TABLE", type=table_of, help=_CAMERA)
    add("--light", metavar="TABLE", type=table_of, action="append", default=[], help=_LIGHT)
    add("--file-camera", action="store_true", help="use the first camera of a glTF file")
    add("--file-lights", action="store_true", help="use the lights of a glTF file")


def has_scene_choices(args: argparse.Namespace) -> bool:
    """Whether any option that changes a scene was given."""
    named = (args.material, args.size_mm, args.animation, args.simplify, args.vertices, args.camera)
    return any(value is not None for value in named) or bool(args.light or args.file_camera or args.file_lights)


def add_method(parser: Parser) -> None:
    """Add the options that choose a method and set its knobs."""
    add = parser.add_argument
    add("--method", metavar="NAME", help=f"method to render with (default: {DEFAULT_METHOD}; see 'wgsss methods')")
    add("--surface", metavar="NAME", help=_SURFACE)
    add("--translucency", metavar="NAME", help=_TRANSLUCENCY)
    add("--set", metavar="KNOB=VALUE", dest="knobs", type=assignment, action="append", default=[], help=_SET)


def load_scene(args: argparse.Namespace, name: str | None = None) -> Scene:
    """Load the scene `name`, by default that of the arguments, with the options that change it."""
    from wgsss.scene import load_scene

    return load_scene(
        args.scene if name is None else name,
        material=args.material,
        size_mm=args.size_mm,
        animation=args.animation,
        simplify=args.simplify,
        vertices=args.vertices,
        camera=args.camera,
        lights=args.light,
        file_camera=args.file_camera,
        file_lights=args.file_lights,
    )


def make_method(args: argparse.Namespace) -> Method:
    """Create the method that the arguments name, with its knobs set."""
    from wgsss.registry import make_method

    parts = args.surface, args.translucency
    if parts == (None, None):
        return make_method(DEFAULT_METHOD if args.method is None else args.method, dict(args.knobs))
    if args.method is not None:
        raise InputError(f"--method {shown(args.method)} has a surface and a translucency: name either it or those")
    return make_method("+".join("none" if part is None else part for part in parts), dict(args.knobs))


def emit(args: argparse.Namespace, result: dict[str, Any], text: str) -> None:
    """Print the result of a command: with --json as JSON, which includes the warnings, else as text."""
    console.print_result(console.json_text({**result, "warnings": args.warnings}) if args.json else printable(text))


def table(rows: list[list[str]]) -> str:
    """Format rows of text as a table with aligned columns, one row per line."""
    rows = [[escaped(cell) for cell in row] for row in rows]
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)


def size(text: str) -> tuple[int, int]:
    """Parse WIDTHxHEIGHT, in pixels."""
    from wgsss.scene.images.files import MAX_SIDE

    match = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", text)
    if not match:
        raise argparse.ArgumentTypeError(f"{shown(text)} is not WIDTHxHEIGHT, such as 512x512")
    sides = int(match[1]), int(match[2])
    if not all(1 <= side <= MAX_SIDE for side in sides):
        raise argparse.ArgumentTypeError(f"the image size must be 1 to {MAX_SIDE} pixels a side, not {text}")
    return sides


def count(text: str, most: int = 999_999_999) -> int:
    """Parse a whole number from 1 to `most`."""
    if not re.fullmatch(r"[0-9]{1,9}", text) or not 1 <= int(text) <= most:
        raise argparse.ArgumentTypeError(f"{shown(text)} is not a whole number from 1 to {most}")
    return int(text)


def frames(text: str) -> int:
    """Parse a number of frames, at most about one hour of film."""
    return count(text, 100_000)


def number(text: str) -> float:
    """Parse a number."""
    return _within(text, -1e300, 1e300)


def length(text: str) -> float:
    """Parse a length in millimetres."""
    return _within(text, 1e-6, 1e13, "mm")


def seconds(text: str) -> float:
    """Parse a time in seconds."""
    return _within(text, -1e9, 1e9, "seconds")


def rate(text: str) -> float:
    """Parse a rate in frames per second."""
    return _within(text, 0.01, 1000)


def _within(text: str, low: float, high: float, unit: str = "") -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        wanted = "a number" if (low, high) == (-1e300, 1e300) else f"a number {span(low, high, unit=unit)}"
        raise argparse.ArgumentTypeError(f"{shown(text)} is not {wanted}")
    return value


def output(text: str) -> Path:
    """Parse the path of a file or folder to write."""
    if not text.strip() or "\0" in text:
        raise argparse.ArgumentTypeError(f"{shown(text)} is not the name of a file or folder")
    return Path(text)


def assignment(text: str) -> tuple[str, str]:
    """Parse KNOB=VALUE."""
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f"{shown(text)} is not KNOB=VALUE, such as map_size=512")
    return name, value


def table_of(text: str) -> dict[str, Any]:
    """Parse an inline table of TOML."""
    try:
        value = tomllib.loads(f"table = {text}")["table"]
    except (ValueError, RecursionError):  # a syntax error, a number too long, nested too deep
        value = None
    if not isinstance(value, dict):
        raise argparse.ArgumentTypeError(
            f'{shown(text)} is not a table such as {{kind = "orthographic", height = 200}}'
        )
    return value


def name_or_table(text: str) -> str | dict[str, Any]:
    """Parse a name, or an inline table of TOML."""
    return table_of(text) if text.startswith("{") else text


def settings(text: str) -> list[tuple[str, dict[str, str]]]:
    """Parse NAME,NAME:KNOB=VALUE:… into names and their knobs. Duplicates are dropped."""
    methods = []
    for name in names(text):
        name, *knobs = (part.strip() for part in name.split(":"))
        methods.append((name, dict(assignment(knob) for knob in knobs)))
    return methods


def names(text: str) -> list[str]:
    """Parse NAME,NAME,… Duplicates are dropped."""
    parts = [name.strip() for name in text.split(",")]
    if not all(parts):
        raise argparse.ArgumentTypeError(f"{shown(text)} is not a list of names such as lambert,deon07")
    return list(dict.fromkeys(parts))
