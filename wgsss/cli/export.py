"""`wgsss export`: a scene for another renderer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wgsss.cli import arguments


def declare(commands: Any) -> None:
    parser = arguments.command(commands, "export", run, "write a scene for Mitsuba 3")
    arguments.add_scene(parser)
    add = parser.add_argument
    add("--mitsuba", metavar="DIR", type=Path, required=True, help="the folder to write scene.xml and its files to")
    add("--size", metavar="WxH", type=arguments.size, default=(512, 512), help="pixels (default: 512x512)")
    add("--time", metavar="S", type=arguments.number, default=0.0, help="of a moving scene, seconds (default: 0)")


def run(args: Any) -> None:
    from wgsss.reference.mitsuba_scene import export

    scene = arguments.load_scene(args).at(args.time)
    written = export(scene, args.mitsuba, args.size)
    result = {"files": [str(file) for file in written], "scene": scene.name, "size": args.size, "time": args.time}
    arguments.tell(
        args, result, f"{written[0]}: {scene.name}, {len(written)} files; render it with 'mitsuba {written[0]}'"
    )
