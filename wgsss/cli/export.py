"""`wgsss export`: write a scene for other programs."""

from __future__ import annotations

from typing import Any

from wgsss.cli import arguments
from wgsss.errors import InputError
from wgsss.text import one_line


def declare(commands: Any) -> None:
    parser = arguments.command(commands, "export", run, "write a scene for Mitsuba 3 or as glTF")
    arguments.add_scene(parser)
    add = parser.add_argument
    add("--mitsuba", metavar="DIR", type=arguments.output, help="folder for scene.xml and its files")
    add("--gltf", metavar="FILE.glb", type=arguments.output, help="glTF file to write")
    add("--size", metavar="WxH", type=arguments.size, default=(512, 512), help="size in pixels (default: 512x512)")
    add("--time", metavar="S", type=arguments.seconds, default=0.0, help="time in seconds (default: 0)")


def run(args: Any) -> None:
    from wgsss import output_gltf
    from wgsss.output import check_output
    from wgsss.reference import mitsuba_scene

    if args.mitsuba is None and args.gltf is None:
        raise InputError("nothing to write: give --mitsuba DIR, --gltf FILE.glb, or both")
    if args.gltf is not None:
        check_output(args.gltf, output_gltf.FORMATS)
    scene = arguments.load_scene(args).at(args.time)
    written, lines = [], []
    if args.mitsuba is not None:
        files = mitsuba_scene.export(scene, args.mitsuba, args.size)
        written += files
        what = f"{files[0]}: {scene.name}, {len(files)} files; render it with 'mitsuba {files[0]}'"
        lines.append(one_line(what))
    if args.gltf is not None:
        written.append(output_gltf.export(scene, args.gltf, args.size[0] / args.size[1]))
        lines.append(one_line(f"{args.gltf}: {scene.name}, glTF"))
    result = {"files": [str(file) for file in written], "scene": scene.name, "size": args.size, "time": args.time}
    arguments.emit(args, result, "\n".join(lines))
