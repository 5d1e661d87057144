"""Measure the error that separable kernels make at a straight edge, by the angle between the edge and the passes.

python studies/screen_space_angles.py -o screen_space_angles.png

The error is the largest difference from the profile's own response to an edge, in the red channel, relative to full
scale. The skin is the sum of six Gaussians of d'Eon & Luebke 2007, with and without its narrowest Gaussian. Errors of
the kernels themselves come from quadrature; errors as drawn come from pictures of a painted edge on a plane. The last
table gives the time of the passes by the number of taps.
"""

import argparse
import statistics
from dataclasses import replace
from pathlib import Path

import numpy as np

from wgsss.gpu import default_gpu
from wgsss.optics import SKIN_GAUSSIANS, SumOfGaussians
from wgsss.optics.separable import KERNELS
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import DirectionalLight, Mesh, Object, OrthographicCamera, Scene, material
from wgsss.scene.material import Maps

COLOURS = {"line-spread": "#0072B2", "svd": "#009E73", "radial": "#D55E00"}
SKINS = {
    "all six Gaussians": SKIN_GAUSSIANS,
    "without the narrowest": SumOfGaussians(SKIN_GAUSSIANS.variances[1:], SKIN_GAUSSIANS.weights[1:]),
}
TAPS = (9, 17, 33, 65)


def error_of_kernel(kernel: str, skin: SumOfGaussians, degrees: float) -> float:
    """Compute the error of the kernel's response to an edge by quadrature, without pixels."""
    t = np.linspace(-8.0, 8.0, 801)[:, None]
    a = np.radians(max(degrees, 90.0 - degrees))  # same error, and fewer steps are needed
    response = np.zeros(len(t))
    for term in KERNELS[kernel](skin):
        x, within = term.x, term.within[:, 0]
        u = np.concatenate([-x[:0:-1], x])
        side = np.concatenate([-within[:0:-1], within]) / 2
        middles, mass = 0.5 * (u[1:] + u[:-1]), np.diff(side)
        beside = (t - middles * np.cos(a)) / np.sin(a)
        response += term.scale[0] * (within[-1] / 2 + np.interp(beside, u, side)) @ mass
    return float(np.abs(response - skin.step_response(t[:, 0])[:, 0]).max())


def floor(skin: SumOfGaussians, pixels_per_mm: float, side: float = 60.0) -> Object:
    """Return a square that faces up: white where x > 0, black elsewhere, with a ramp of one pixel between."""
    t = side / 2
    corners = np.array([[-t, 0, t], [t, 0, t], [t, 0, -t], [-t, 0, -t]], np.float32)
    faces, uvs = np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    half = round(t * pixels_per_mm)
    paint = np.zeros((1, 2 * half, 3), np.uint8)
    paint[:, half:] = 255
    medium = replace(
        material("skin"),
        gaussians=skin,
        base_color=(1.0, 1.0, 1.0),
        specular=0.0,
        color_after=0.0,
        maps=Maps(base_color=paint),
    )
    return Object(Mesh(corners, faces, corner_uvs=uvs[faces]), medium)


def scene(skin: SumOfGaussians, degrees: float, pixels_per_mm: float, size: int) -> Scene:
    """Return a scene that shows the floor from above, turned by an angle."""
    up = (np.sin(np.radians(degrees)), 0, -np.cos(np.radians(degrees)))
    camera = OrthographicCamera((0, 50, 0), (0, 0, 0), up=up, height=size / pixels_per_mm)
    return Scene("edge", (floor(skin, pixels_per_mm),), (DirectionalLight((0, -1, 0), (1, 1, 1)),), camera)


def error_of_picture(kernel: str, skin: SumOfGaussians, degrees: float, pixels_per_mm: float, size: int) -> float:
    """Render the edge and return the largest error in the middle of the picture."""
    where = scene(skin, degrees, pixels_per_mm, size)
    method = make_method("screen+none", {"kernel": kernel, "taps": 17})
    image = Renderer(where, method, (size, size)).frame(aovs=["M_front"], timed=False)
    t = (np.arange(size) + 0.5 - size / 2) / pixels_per_mm
    a = np.radians(degrees)
    x = t * np.cos(a) - t[:, None] * np.sin(a)
    error = np.abs(image.aovs["M_front"][..., 0] - skin.step_response(x)[..., 0])
    margin = size // 4
    return float(error[margin:-margin, margin:-margin].max())


def costs(size: int, rounds: int) -> list[tuple[int, float]]:
    """Measure the median time of both blurs, in ms, for each number of taps."""
    gpu = default_gpu()
    where = scene(SKIN_GAUSSIANS, 0.0, 16.0, size)
    renderers = {n: Renderer(where, make_method("screen+none", {"taps": n}), (size, size), gpu) for n in TAPS}
    times: dict[int, list[float]] = {n: [] for n in TAPS}
    for number in range(rounds + 1):
        for n, renderer in renderers.items():
            passes = renderer.frame().graph.times
            if number:  # the first round compiles shaders
                times[n].append(sum(ms for name, ms in passes.items() if name.startswith("screen_space/blur")))
    return [(n, statistics.median(runs)) for n, runs in times.items()]


def plot(angles: list[float], exact: dict, drawn: dict, path: Path) -> None:
    """Plot errors over the angle: kernels as lines, pictures as dots."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 3.8), layout="constrained")
    axes = figure.subplots(1, len(SKINS), sharey=True)
    for axis, name in zip(axes, SKINS, strict=True):
        for kernel, colour in COLOURS.items():
            axis.semilogy(angles, exact[name, kernel], "-", color=colour, label=kernel)
            axis.semilogy(angles, drawn[name, kernel], "o", color=colour, ms=4)
        axis.axhline(0.02, color="0.6", lw=0.8, ls=":")
        axis.set(xlabel="edge to passes, degrees", title=f"skin, red: {name}", ylim=(8e-4, 0.5))
        axis.set_xticks(np.arange(0, 91, 22.5))
        axis.grid(alpha=0.25)
    axes[0].set_ylabel("largest error of an edge")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    figure.savefig(path, dpi=90)


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    add = parser.add_argument
    add("--angles", nargs="+", type=float, default=[11.25 * i for i in range(9)], help="degrees")
    add("--pixels-per-mm", type=float, default=8.0)
    add("--size", type=int, default=192, help="side of the pictures, pixels")
    add("--rounds", type=int, default=9, help="number of time measurements")
    add("-o", "--output", type=Path, default=Path("screen_space_angles.png"))
    args = parser.parse_args(argv)

    exact: dict[tuple[str, str], list[float]] = {}
    drawn: dict[tuple[str, str], list[float]] = {}
    for name, skin in SKINS.items():
        print(f"{name}; in brackets as drawn, 17 taps at {args.pixels_per_mm:g} pixels per mm")
        print("degrees", *(f"{kernel:>14}" for kernel in KERNELS))
        for angle in args.angles:
            cells = []
            for kernel in KERNELS:
                exact.setdefault((name, kernel), []).append(error_of_kernel(kernel, skin, angle))
                picture = error_of_picture(kernel, skin, angle, args.pixels_per_mm, args.size)
                drawn.setdefault((name, kernel), []).append(picture)
                cells.append(f" {exact[name, kernel][-1]:.3f} ({picture:.3f})")
            print(f"{angle:7.1f}", *cells, flush=True)
    print("taps  ms of both passes  per tap")
    for n, ms in costs(2 * args.size, args.rounds):
        print(f"{n:4}  {ms:17.2f}  {ms / n:7.3f}", flush=True)
    plot(args.angles, exact, drawn, args.output)


if __name__ == "__main__":
    main()
