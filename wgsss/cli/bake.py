"""`wgsss bake`: fill the cache with what rendering a scene needs."""

from __future__ import annotations

import time
from typing import Any

from wgsss.cli import arguments
from wgsss.text import one_line


def declare(commands: Any) -> None:
    parser = arguments.command(commands, "bake", run, "precompute the data that rendering a scene needs")
    arguments.add_scene(parser)
    arguments.add_method(parser)


def run(args: Any) -> None:
    from wgsss import cache
    from wgsss.gpu import default_gpu
    from wgsss.stage import Stage

    method = arguments.make_method(args)
    scene = arguments.load_scene(args)
    folder = cache.folder()
    old_entries = cache.entries()
    start = time.perf_counter()
    stage = Stage(default_gpu(), scene)
    method.bake(stage)
    for body in stage.bodies:
        _ = body.environment
    seconds = time.perf_counter() - start
    new_entries = {file: size for file, size in sorted(cache.entries().items()) if file not in old_entries}
    entries = [{"file": str(file), "bytes": size} for file, size in new_entries.items()]
    lines = [f"{file.name}  {size / 1e6:.1f} MB" for file, size in new_entries.items()]
    lines.append(f"{len(new_entries) or 'no'} new entries in {one_line(folder)}, {seconds:.2f} s")
    arguments.emit(args, {"folder": str(folder), "made": entries, "seconds": round(seconds, 3)}, "\n".join(lines))
