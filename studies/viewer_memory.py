"""Measure how much memory the viewer holds while it is used.

python studies/viewer_memory.py ear --minutes 10      # needs a display, such as that of xvfb-run

The script orbits the camera and switches through all methods. One round shows every method and pair once, on the left,
next to the previous one on the right. Each is orbited and then left alone until it is drawn in full. The first round
bakes, compiles and draws at every resolution, since drivers compile shaders for each; growth is measured from its end.
"""

import argparse
import math
import time
from collections.abc import Iterator
from itertools import chain, product, repeat
from pathlib import Path

from rendercanvas.glfw import loop

from wgsss.errors import InputError
from wgsss.gpu import default_gpu
from wgsss.registry import METHODS, SURFACES, TRANSLUCENCIES, make_method
from wgsss.viewer.command import Source
from wgsss.viewer.painter import SCALES
from wgsss.viewer.session import Session
from wgsss.viewer.window import Window

NAMES = *METHODS, *(f"{surface}+{part}" for surface, part in product(SURFACES, ("none", *TRANSLUCENCIES)))
TICK_S = 1 / 60


def resident() -> float:
    """Return the resident memory of this process, MiB (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 2**20


def hand(window: Window, orbit_s: float, still_s: float) -> Iterator[str]:
    """Move the pointer by one step at a time; yield "round" after all methods have been shown."""
    session, painter, layout = window.session, window.session.painter, window.session.layout
    left, across, down = layout.panel_width, layout.picture_width, layout.picture_height
    number = 0

    def move() -> None:
        nonlocal number
        number += 1
        angle = 0.1 * number
        x, y = 0.25 + 0.2 * math.cos(angle), 0.5 + 0.1 * math.sin(angle)
        point(window, "pointer_move", left + x * across, y * down)

    for first in chain([True], repeat(False)):
        for name in NAMES:
            session.methods[1] = session.methods[0]
            try:
                session.set_method(0, make_method(name))
            except InputError:  # the two parts cannot be combined
                continue
            point(window, "pointer_down", left + 0.25 * across, 0.5 * down)
            for level, scale in enumerate(SCALES if first else ()):
                while painter.scale != scale:
                    painter.resolution.step = level
                    move()
                    yield ""
            start = time.perf_counter()
            while time.perf_counter() - start < orbit_s:
                move()
                yield ""
            point(window, "pointer_up", left + 0.25 * across, 0.5 * down)
            start = time.perf_counter()
            while time.perf_counter() - start < still_s or not painter.is_done(session.view):
                yield ""
        yield "round"


def point(window: Window, kind: str, x: float, y: float) -> None:
    window.canvas.submit_event({"event_type": kind, "x": x, "y": y, "button": 1, "buttons": (1,), "modifiers": ()})


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    add = parser.add_argument
    add("scene", nargs="?", default="ear", help="a built-in scene")
    add("--vertices", type=int)
    add("--minutes", type=float, default=10.0, help="minutes to run after the first round")
    add("--orbit", type=float, default=2.0, help="seconds for which each method is orbited")
    add("--still", type=float, default=0.5, help="seconds for which each method is left alone")
    add("--size", type=int, nargs=2, default=(960, 540), help="size of the window")
    args = parser.parse_args(argv)

    source, methods = Source(args.scene, vertices=args.vertices), [make_method("lambert"), make_method("lambert")]
    window = Window(Session.open(default_gpu(), source, methods), tuple(args.size))
    steps = hand(window, args.orbit, args.still)
    frames: list[str] = []
    rounds: list[tuple[float, float]] = []
    """seconds and MiB at the end of each round"""
    started = time.perf_counter()
    print("round  minutes  frames  MiB     grown")

    def step() -> None:
        now = time.perf_counter()
        if next(steps) == "round":
            rounds.append((now, resident()))
            minutes, held = (now - started) / 60.0, rounds[-1][1]
            grown = 100.0 * (held / rounds[0][1] - 1.0)
            print(f"{len(rounds):5}  {minutes:7.2f}  {len(frames):6}  {held:6.1f}  {grown:5.2f} %", flush=True)
        if rounds and now - rounds[0][0] > 60.0 * args.minutes:
            window.canvas.close()
        else:
            loop.call_later(TICK_S, step)

    window.canvas.add_event_handler(lambda event: frames.append(""), "before_draw")
    loop.call_later(TICK_S, step)
    window.run()


if __name__ == "__main__":
    main()
