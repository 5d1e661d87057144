"""`wgsss bake`: fill the cache with what rendering a scene needs."""

from __future__ import annotations

import time
from typing import Any

from wgsss.cli import arguments


def declare(commands: Any) -> None:
    parser = arguments.command(commands, "bake", run, "precompute what rendering a scene needs")
    arguments.add_scene(parser)
    arguments.add_method(parser)


def run(args: Any) -> None:
    from wgsss.bake import cache
    from wgsss.gpu import default_gpu
    from wgsss.stage import Stage

    method = arguments.make_method(args)
    scene = arguments.load_scene(args)
    folder = cache.folder()
    before = set(folder.glob("*.npz"))
    start = time.perf_counter()
    stage = Stage(default_gpu(), scene)
    method.bake(stage)
    for body in stage.bodies:
        _ = body.environment
    seconds = time.perf_counter() - start
    made = sorted(set(folder.glob("*.npz")) - before)
    entries = [{"file": str(file), "bytes": file.stat().st_size} for file in made]
    lines = [f"{file.name}  {file.stat().st_size / 1e6:.1f} MB" for file in made]
    lines.append(f"{len(made) or 'no'} new entries in {folder}, {seconds:.2f} s")
    arguments.tell(args, {"folder": str(folder), "made": entries, "seconds": round(seconds, 3)}, "\n".join(lines))
