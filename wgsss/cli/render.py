"""`wgsss render`: render a scene to a picture or a film."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wgsss.cli import arguments
from wgsss.console import progress_bar
from wgsss.text import one_line

if TYPE_CHECKING:
    from wgsss.graph import Graph
    from wgsss.rendering import Image, Renderer

_OUTPUT = """file to write (default: SCENE.png): .png or .mp4 for a tone-mapped picture, .exr or .npy for linear values
and all extra outputs; several frames become one .mp4 or numbered files"""
_GRAPH = """render one more frame and print its passes, run or culled, with their times and memory (shaders are compiled
in the first frame)"""


def declare(commands: Any) -> None:
    parser = arguments.command(commands, "render", run, "render a scene to a picture")
    arguments.add_scene(parser)
    arguments.add_method(parser)
    add = parser.add_argument
    add("--size", metavar="WxH", type=arguments.size, default=(512, 512), help="size in pixels (default: 512x512)")
    add("--frames", metavar="N", type=arguments.frames, default=1, help="number of frames (default: 1)")
    add("--fps", metavar="F", type=arguments.rate, default=25.0, help="frames per second (default: 25)")
    add("--time", metavar="S", type=arguments.seconds, default=0.0, help="start time in seconds (default: 0)")
    add("--exposure", metavar="EV", type=arguments.number, help="stops, in place of the scene's own")
    add("--tone-map", metavar="NAME", help="none, reinhard or aces, in place of the scene's own")
    add("--bloom", metavar="SHARE", type=arguments.number, help="share of the light that bloom spreads, 0 to 1")
    add("-o", "--output", metavar="FILE", type=arguments.output, help=_OUTPUT)
    add("--graph", action="store_true", help=_GRAPH)
    add("--graph-out", metavar="FILE.dot", type=arguments.output, help="write the graph of one more frame for Graphviz")


def run(args: Any) -> None:
    from dataclasses import replace

    from wgsss.output import check_output, replacing, save, save_frames
    from wgsss.registry import name_of
    from wgsss.rendering import Renderer

    path = check_output(args.output or Path(f"{Path(args.scene).stem}.png"))
    dot = args.graph_out and check_output(args.graph_out, (".dot",))
    method = arguments.make_method(args)
    name = name_of(method)
    scene = arguments.load_scene(args)
    own = {"exposure": args.exposure, "tone_map": args.tone_map, "bloom": args.bloom}
    scene = replace(scene, **{key: value for key, value in own.items() if value is not None})

    start = time.perf_counter()
    renderer = Renderer(scene, method, args.size)
    ready = time.perf_counter()
    frames = _frames(renderer, args, path)
    written = save(next(frames), path) if args.frames == 1 else save_frames(frames, path, args.fps)
    done = time.perf_counter()

    result: dict[str, Any] = {
        "files": [str(file) for file in written],
        "scene": scene.name,
        "method": name,
        "knobs": vars(method),
        "size": args.size,
        "frames": args.frames,
        "adapter": renderer.gpu.name,
        "seconds": {"prepare": round(ready - start, 3), "frames": round(done - ready, 3)},
    }
    files = str(written[0]) if len(written) == 1 else f"{written[0]} … {written[-1].name}"
    what = one_line(f"{files}: {scene.name} by {name}")
    lines = [f"{what}, {args.size[0]} x {args.size[1]}, {done - start:.2f} s"]
    if args.graph or dot:
        graph = renderer.frame(_time(args, args.frames - 1), timed=True).graph
        if dot:
            with replacing(dot) as (file,):
                file.write_text(graph.dot())
            result["graph_file"] = str(dot)
        if args.graph:
            result["graph"] = _described(graph)
            lines.append(str(graph))
    arguments.emit(args, result, "\n".join(lines))


def _time(args: Any, number: int) -> float:
    """The time of a frame, in seconds."""
    return args.time + number / args.fps


def _frames(renderer: Renderer, args: Any, path: Path) -> Iterator[Image]:
    from wgsss.output import LINEAR_FORMATS
    from wgsss.rendering import AOVS

    aovs = AOVS if path.suffix.lower() in LINEAR_FORMATS else ()
    numbers: Any = range(args.frames)
    if args.frames > 1:
        numbers = progress_bar(numbers, desc=one_line(path.name), unit="frame")
    for number in numbers:
        yield renderer.frame(_time(args, number), aovs, timed=False)


def _described(graph: Graph) -> dict[str, Any]:
    passes = []
    for item in graph.passes:
        writes = {n: {"size": h.resource.size, "format": h.format or "buffer"} for n, h in item.writes.items()}
        ms, culled = graph.times.get(item.name), item in graph.culled
        passes.append({"pass": item.name, "culled": culled, "ms": ms, "reads": sorted(item.reads), "writes": writes})
    return {"clock": graph.clock, "peak_bytes": graph.peak_bytes, "passes": passes}
