"""How long spatial adjacency maps take to bake, beside what their paper reports. Nothing comes from the cache.

python examples/sam_bake_times.py --vertices 5000 20000 --mesh dragon.obj marble 100

Wall seconds, and CPU seconds of all threads, which other work on the machine lengthens less. What shaders take to
compile is not counted.
"""

import argparse
import os
import sys
import tempfile
import time

from wgsss.bake.sam import SELECTIONS, spatial_adjacency_map
from wgsss.gpu import default_gpu
from wgsss.scene import Scene, load_scene

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
    add("--scene", default="statue", help="a built-in scene, to bake with each number of vertices")
    add("--vertices", nargs="*", type=int, default=[5000, 20_000, 80_000])
    add("--mesh", nargs=3, action="append", default=[], metavar=("FILE", "MATERIAL", "SIZE_MM"))
    add("--select", nargs="+", choices=tuple(SELECTIONS), default=list(SELECTIONS))
    add("--samples", type=int, default=3)
    args = parser.parse_args(argv)

    print("mesh                          vertices  select  wall s   cpu s  bytes a vertex", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["WGSSS_CACHE"] = folder
        for select in args.select:  # compiles
            bake(load_scene("sphere", vertices=300, material="marble"), args.samples, select)
        scenes = [load_scene(args.scene, vertices=vertices) for vertices in args.vertices]
        scenes += [load_scene(file, material=name, size_mm=float(size)) for file, name, size in args.mesh]
        for scene in scenes:
            body = scene.objects[0]
            name = f"{scene.name}, {body.material.name}"
            for select in args.select:
                print(f"{name}, {select}", file=sys.stderr)
                wall, cpu, size = bake(scene, args.samples, select)
                vertices = len(body.mesh.positions)
                print(f"{name:28}  {vertices:8}  {select:6}  {wall:6.2f}  {cpu:6.2f}  {size:14}", flush=True)
    print("\nthe paper:", ", ".join(f"{name} {took}" for name, took in PAPER.items()))


def bake(scene: Scene, samples: int, select: str) -> tuple[float, float, int]:
    """Seconds, seconds of all cores, and bytes of a vertex's entries."""
    body = scene.objects[0]
    _ = body.mesh.normals  # a part of loading
    gpu, wall, cpu = default_gpu(), time.perf_counter(), time.process_time()
    entries = spatial_adjacency_map(gpu, body.mesh, body.material.profile, samples, select)
    return time.perf_counter() - wall, time.process_time() - cpu, entries.bytes_per_vertex


if __name__ == "__main__":
    main()
