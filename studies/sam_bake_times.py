"""Measure how long spatial adjacency maps take to bake, next to the times that their paper reports.

python studies/sam_bake_times.py --vertices 5000 20000 --mesh dragon.obj marble 100 -o times.png

Nothing is read from the cache. The table has wall time and the CPU time of all threads; other work on the machine
disturbs CPU time less. The time to compile shaders is not counted. The chart shows CPU time over the number of
vertices, and CPU time per vertex over the reach of light. The reach is the distance beyond which one per cent of the
light leaves, divided by the mesh's longest side.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from wgsss.bake.sam import SELECTIONS, spatial_adjacency_map
from wgsss.gpu import default_gpu
from wgsss.scene import Scene, load_scene

COLOURS = {"top": "#D55E00", "coarse": "#009E73", "fit": "#0072B2"}
PAPER = {  # Maisch & Ropinski 2017, section 5.3: 3 samples by `top`, on an i7-4790 with four cores
    "Animated": "0.165 s",
    "Head": "1.152 s",
    "Heptoroid": "13.17 s",
    "Milk": "138.5 s",
    "Happy Buddha": "20.16 min",
    "Chinese Dragon": "23.83 h",
}


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    add = parser.add_argument
    add("--scene", default="statue", help="a built-in scene to bake with each number of vertices")
    add("--vertices", nargs="*", type=int, default=[5000, 20_000, 80_000])
    add("--mesh", nargs=3, action="append", default=[], metavar=("FILE", "MATERIAL", "SIZE_MM"))
    add("--select", nargs="+", choices=tuple(SELECTIONS), default=list(SELECTIONS))
    add("--materials", nargs="*", default=["skin1", "ketchup", "wholemilk"], help="further materials, at 20k vertices")
    add("--samples", type=int, default=3)
    add("-o", "--output", type=Path, help="chart to write")
    args = parser.parse_args(argv)

    print("mesh                          vertices  select  wall s   cpu s  bytes a vertex", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["WGSSS_CACHE"] = folder
        for select in args.select:  # compile the shaders
            bake(load_scene("sphere", vertices=300, material="marble"), args.samples, select)
        scenes = [load_scene(args.scene, vertices=vertices) for vertices in args.vertices]
        scenes += [load_scene(file, material=name, size_mm=float(size)) for file, name, size in args.mesh]
        if args.output:
            scenes += [load_scene(args.scene, vertices=20_000, material=name) for name in args.materials]
        times: dict[str, list[tuple[int, float, float]]] = {}
        for scene in scenes:
            body = scene.objects[0]
            name = f"{scene.name}, {body.material.name}"
            for select in args.select:
                print(f"{name}, {select}", file=sys.stderr)
                wall, cpu, size = bake(scene, args.samples, select)
                vertices = len(body.mesh.positions)
                reach = body.material.profile.range(0.01).max() / np.ptp(body.mesh.bounds, axis=0).max()
                times.setdefault(select, []).append((vertices, float(reach), cpu))
                print(f"{name:28}  {vertices:8}  {select:6}  {wall:6.2f}  {cpu:6.2f}  {size:14}", flush=True)
    print("\nthe paper:", ", ".join(f"{name} {took}" for name, took in PAPER.items()))
    if args.output:
        plot(times, args.output)


def plot(times: dict[str, list[tuple[int, float, float]]], path: Path) -> None:
    """Plot CPU time over vertices, and CPU time per vertex over the reach of light."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    over_vertices, over_reach = figure.subplots(1, 2)
    for select, rows in times.items():
        vertices, reach, cpu = np.array(rows).T
        over_vertices.loglog(vertices, cpu, "o", color=COLOURS[select], label=select)
        over_reach.loglog(reach, 1e6 * cpu / vertices, "o", color=COLOURS[select])
    over_vertices.set(xlabel="vertices", ylabel="CPU seconds")
    over_reach.set(xlabel="reach of light over the mesh's size", ylabel="CPU microseconds a vertex")
    shares = [0.02, 0.05, 0.1, 0.2, 0.5]
    over_reach.set_xticks(shares, [f"{share:.0%}" for share in shares])
    over_reach.set_xticks([], minor=True)
    over_reach.yaxis.set_major_locator(LogLocator(10.0, (1.0, 2.0, 5.0)))
    over_reach.yaxis.set_major_formatter("{x:.0f}")
    over_reach.yaxis.set_minor_formatter("")
    for axis in (over_vertices, over_reach):
        axis.grid(alpha=0.25)
    figure.legend(loc="outside lower center", ncols=len(times), frameon=False)
    figure.savefig(path, dpi=110)


def bake(scene: Scene, samples: int, select: str) -> tuple[float, float, int]:
    """Bake a map; return the wall time and CPU time in seconds, and the bytes per vertex."""
    body = scene.objects[0]
    _ = body.mesh.normals  # computed when first used: counted as loading
    gpu, wall, cpu = default_gpu(), time.perf_counter(), time.process_time()
    entries = spatial_adjacency_map(gpu, body.mesh, body.material.profile, samples, select)
    return time.perf_counter() - wall, time.process_time() - cpu, entries.bytes // len(body.mesh.positions)


if __name__ == "__main__":
    main()
