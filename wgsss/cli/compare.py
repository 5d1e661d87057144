"""`wgsss compare`: render a scene by several methods, and measure their errors against a reference."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wgsss import console
from wgsss.cli import arguments
from wgsss.text import one_line

_OUTPUT = """folder for report.html, contact_sheet.png, metrics.json and the images (default: SCENE-compare); other
files in it are kept"""

_REFERENCE = """integral, layers or volume, which needs Mitsuba 3 (default: integral; in scenes with maps of layers,
layers for methods with multiple=off, else volume)"""

_LIGHTS = "all: compare also under one light of each type, each with the same mean irradiance"

_METHODS = "methods to compare, with knobs after colons: lambert,sam,sam:select=top:samples=8 (default: all that can)"


def declare(commands: Any) -> None:
    parser = arguments.command(commands, "compare", run, "compare methods with a reference: pictures, errors, costs")
    arguments.add_scene(parser)
    add = parser.add_argument
    add("--methods", metavar="A,B,…", type=arguments.settings, help=_METHODS)
    add("--reference", metavar="NAME", help=_REFERENCE)
    add("--size", metavar="WxH", type=arguments.size, default=(256, 256), help="size in pixels (default: 256x256)")
    add("--lights", choices=["all"], help=_LIGHTS)
    add("-o", "--output", metavar="DIR", type=arguments.output, help=_OUTPUT)


def run(args: Any) -> None:
    from dataclasses import replace

    from wgsss.registry import make_method, methods_for
    from wgsss.study import comparison_tables as tables
    from wgsss.study.compare import compare
    from wgsss.study.measurement import default_reference, make_reference
    from wgsss.study.report import check_folder, write_report

    folder = check_folder(args.output or Path(f"{Path(args.scene).stem}-compare"))
    reference = make_reference(args.reference) if args.reference else None
    scene = arguments.load_scene(args)
    chosen = args.methods or [(name, None) for name in methods_for(scene)]
    methods = [make_method(name, knobs) for name, knobs in chosen]
    if reference is None:
        name = default_reference(scene, methods)
        reference = make_reference(name)
        if name != "integral":
            console.print_message(f"{one_line(scene.name)}: the reference is {name}")
    comparison = compare(scene, methods, reference, args.size)
    if args.lights:
        from wgsss.study.light_types import light_types

        lit = light_types(scene).items()
        comparison = replace(
            comparison,
            lights={name: compare(other, methods, reference, args.size, by_cause=False) for name, other in lit},
        )
    written = write_report(comparison, folder)

    result = {**comparison.json(), "files": [str(file) for file in written]}
    parts = [tables.aligned(tables.by_method(comparison)), tables.floor(comparison)]
    if comparison.causes:
        parts.append(f"by cause: alone (and what it adds)\n{tables.aligned(tables.by_cause(comparison))}")
    if comparison.lights:
        parts.append(f"by type of light: rel RMSE\n{tables.aligned(tables.by_light(comparison))}")
    arguments.emit(args, result, "\n\n".join([*parts, one_line(folder / "report.html")]))
