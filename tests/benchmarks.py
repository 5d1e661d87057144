"""Benchmarks that print medians and ratios: `make bench`. They are no tests, since times depend on the machine.

Every figure is a median over several runs, with its quartiles. The first runs, which compile shaders, are dropped.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np
from conftest import DATA

from wgsss.bake.photons import trace
from wgsss.frame import begin
from wgsss.gpu import Gpu, default_gpu
from wgsss.graph import Graph
from wgsss.optics import Layer
from wgsss.reference.integral import integral
from wgsss.registry import METHODS, make_method, sweep_of
from wgsss.rendering import Renderer
from wgsss.scene import load_scene
from wgsss.study.metrics import errors

SIZE = (512, 512)
PASSES = 12
ENOUGH_S = 15.0


@dataclass(frozen=True)
class Figure:
    """The times of several runs, in seconds."""

    runs: list[float]

    @property
    def median(self) -> float:
        return statistics.median(self.runs)

    def __str__(self) -> str:
        low, _, high = statistics.quantiles(self.runs, n=4) if len(self.runs) > 1 else self.runs * 3
        return f"{1e3 * self.median:9.2f} ms  ({1e3 * low:.2f} to {1e3 * high:.2f}, {len(self.runs)} runs)"


def measure(run: Callable[[], object], times: int, warm_up: int = 1) -> Figure:
    """Measure the wall-clock time of `run()`, up to `times` times and about ENOUGH_S seconds in total."""
    runs: list[float] = []
    while len(runs) < warm_up + times and (len(runs) < warm_up + 3 or sum(runs) < ENOUGH_S):
        start = time.perf_counter()
        run()
        runs.append(time.perf_counter() - start)
    return Figure(runs[warm_up:])


def command(*argv: str, cache: Path) -> Callable[[], object]:
    """Return a function that runs `wgsss` in its own process."""
    env = {**os.environ, "WGSSS_CACHE": str(cache)}
    return lambda: subprocess.run([sys.executable, "-m", "wgsss", *argv], env=env, check=True, capture_output=True)


def print_row(label: str, figure: Figure, goal_s: float = 0.0, against: Figure | None = None) -> None:
    """Print a row: the figure, and its ratio to a goal or to another figure."""
    ratio = f"{figure.median / goal_s:5.2f} of {1e3 * goal_s:g} ms" if goal_s else ""
    ratio = f"{figure.median / against.median:5.2f} x" if against else ratio
    print(f"{label:46}{figure}  {ratio}".rstrip(), flush=True)


def commands() -> None:
    """Measure commands from start to end, with a warm and a cold cache."""
    with tempfile.TemporaryDirectory() as folder:
        cache, picture = Path(folder, "cache"), str(Path(folder, "ear.png"))
        print_row("wgsss --help", measure(command("--help", cache=cache), 9), 0.3)
        render = command("render", "ear", "--size", f"{SIZE[0]}x{SIZE[1]}", "-o", picture, cache=cache)
        cold = measure(render, 1, warm_up=0)
        warm = measure(render, 7)
        print_row("wgsss render ear --size 512x512, warm cache", warm, 3.0)
        print_row("  the same, cold cache", cold, against=warm)


def encoding(gpu: Gpu) -> None:
    """Measure the cost of a graph in Python. The passes draw only two texels, so that the device is idle."""

    black = gpu.texture(np.zeros((1, 2, 4)), "rgba32float")

    def frame() -> None:
        graph = Graph(gpu)
        value = graph.draw("frame/tone_map", size=(2, 1), radiance=black, params={"scale": 1.0, "curve": 0})
        for _ in range(PASSES - 1):
            value = graph.draw("frame/tone_map", radiance=value, params={"scale": 1.0, "curve": 0})
        graph.draw("frame/tone_map", radiance=value, params={"scale": 1.0, "curve": 0})  # unused, so it is culled
        graph.run(value)
        assert (len(graph.ran), len(graph.culled)) == (PASSES, 1)

    runs = []
    for _ in range(60):
        runs += measure(frame, 1, warm_up=0).runs
        gpu.fence()  # not measured
    print_row(f"declare, cull and encode {PASSES} passes", Figure(runs[10:]), 2e-3)


def methods(gpu: Gpu) -> None:
    """Measure a frame of each method, over the sweep of its knobs, relative to lambert."""
    scene = load_scene("ear")
    plain = None
    for name in METHODS:
        for knobs in sweep_of(name):
            start = time.perf_counter()
            renderer = Renderer(scene, make_method(name, knobs), SIZE, gpu)
            baked = time.perf_counter() - start
            figure = measure(lambda renderer=renderer: renderer.frame(timed=False), 7, warm_up=2)  # type: ignore[misc]
            plain = plain or figure
            chosen = " ".join(f"{knob}={value}" for knob, value in knobs.items())
            print_row(f"frame of ear by {name} {chosen}".rstrip(), figure, against=plain)
            print(f"{'  prepared in':46}{1e3 * baked:9.2f} ms")


def octree(gpu: Gpu) -> None:
    """Compare jensen02 with the full sum over about as many samples. The goal is 50 times the speed."""
    scene, size = load_scene("ear"), (256, 256)
    method = make_method("jensen02", {"spacing": 1.24})
    renderer = Renderer(scene, method, size, gpu)
    stage = renderer.stage

    def estimate() -> np.ndarray:
        graph = Graph(gpu)
        layers = method.passes(begin(graph, stage, size))
        handles = layers.M_front, layers.M_back
        graph.run(*handles)
        return sum(graph.read(handle)[..., :3] for handle in handles)

    def turn() -> None:
        frames.extend(measure(lambda: renderer.frame(timed=False), 5, warm_up=2).runs)
        estimates.extend(measure(estimate, 5).runs)

    frames: list[float] = []
    estimates: list[float] = []
    turn()
    with tempfile.TemporaryDirectory() as cache, mock.patch.dict(os.environ, WGSSS_CACHE=cache):
        with warnings.catch_warnings(action="ignore"):  # there may be too few samples
            start = time.perf_counter()
            reference = integral(stage, size, samples=122_000).M
            summed = Figure([time.perf_counter() - start])
    turn()
    M = estimate()
    print_row("M of ear at 256x256 by integral", summed)
    for label, runs in (("M by jensen02", estimates), ("a frame by jensen02", frames)):
        figure = Figure(runs)
        print_row(f"  {label}", figure)
        print(f"{'    integral takes':46}{summed.median / figure.median:9.2f} times as long")
    error = errors(M, reference, reference.any(axis=2)).rel_rmse or 0.0
    print(f"{'  difference, relative RMSE':46}{100 * error:9.2f} %")


def screen_pairs(gpu: Gpu) -> None:
    """Compare frames of sam (surface=screen) and jimenez15, which both diffuse in screen space. The goal is 1.1."""
    head = DATA / "lee_perry_smith" / "LeePerrySmith.obj"
    scenes = {"ear": (load_scene("ear"), [(256, 256), SIZE])}
    if head.is_file():
        scenes["head"] = (load_scene(head, material="skin1", size_mm=430.0), [SIZE])
    for name, (scene, sizes) in scenes.items():
        for size in sizes:
            sam = Renderer(scene, make_method("sam", {"surface": "screen"}), size, gpu)
            jimenez = Renderer(scene, make_method("jimenez15"), size, gpu)
            runs: dict[Renderer, list[float]] = {sam: [], jimenez: []}
            for turn in range(27):
                for renderer in runs if turn % 2 else reversed(runs):
                    start = time.perf_counter()
                    renderer.frame(timed=False)
                    if turn >= 2:  # the first frames compile shaders
                        runs[renderer].append(time.perf_counter() - start)
            plain = Figure(runs[jimenez])
            print_row(f"frame of {name} at {size[0]}x{size[1]} by jimenez15", plain)
            print_row("  by sam, surface=screen", Figure(runs[sam]), against=plain)


def photons(gpu: Gpu) -> None:
    """Measure photons per second, of all channels together, relative to the goal of the reference."""
    slab = Layer((1, 1, 1), (2.25, 2.25, 2.25), 1.0, thickness=0.2, g=0.75)
    skin = Layer((0.032, 0.17, 0.48), (0.74, 0.88, 1.01), 1.3)
    for name, layer, number, goal in (("van de Hulst's slab", slab, 1_000_000, 3e6), ("Skin1", skin, 300_000, 0.4e6)):
        figure = measure(lambda layer=layer, number=number: trace([layer], number, gpu=gpu), 7)  # type: ignore[misc]
        rate = 3 * number / figure.median
        print_row(f"3 x {number:,} photons through {name}", figure)
        print(f"{'  per second':46}{rate / 1e6:9.2f} M   {rate / goal:.2f} of {goal / 1e6:g} M")


if __name__ == "__main__":
    device = default_gpu()
    print(f"{device.name}; {os.cpu_count()} cores\n")
    commands()
    encoding(device)
    methods(device)
    octree(device)
    screen_pairs(device)
    photons(device)
