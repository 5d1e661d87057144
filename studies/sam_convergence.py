"""Plot how spatial adjacency maps converge with the number of samples (Maisch & Ropinski 2017, figure 10).

python studies/sam_convergence.py happy_buddha.obj --material marble --size-mm 150 -o convergence.png

The error is the relative RMSE of M_back at random vertices. Its reference is the sum of form factor times L_d over all
vertices on the back side. The script reports the mean error under four directional lights with shadows, and the error
under a uniform sky. --integral also reports the error of that sum against the integral over the surface between the
vertices. `fit` ends at 20 samples because more samples take much longer to bake.
"""

import argparse
import sys
from pathlib import Path

from sam_errors import Errors

from wgsss.bake.sam import SELECTIONS
from wgsss.scene import load_scene

COLOURS = {"top": "#D55E00", "coarse": "#009E73", "fit": "#0072B2"}
MOST = {"top": 256, "coarse": 256, "fit": 20}


def plot(errors_by_select: dict[str, list[tuple[int, float, float]]], title: str, path: Path) -> None:
    """Plot errors over samples on logarithmic axes; errors under a sky are dashed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axis = figure.subplots()
    for select, rows in errors_by_select.items():
        n, suns, sky = zip(*rows, strict=True)
        axis.loglog(n, suns, "o-", color=COLOURS[select], label=f"{select}, suns")
        axis.loglog(n, sky, "o--", color=COLOURS[select], label=f"{select}, sky", ms=4, lw=1)
    ticks = sorted({n for rows in errors_by_select.values() for n, *_ in rows})
    axis.set_xticks(ticks, [str(n) for n in ticks])
    axis.set_xticks([], minor=True)
    axis.set(xlabel="samples of a vertex", ylabel="relative RMSE of M_back", title=title)
    axis.grid(alpha=0.25)
    figure.legend(loc="outside lower center", ncols=len(errors_by_select), frameon=False)
    figure.savefig(path, dpi=110)


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    add = parser.add_argument
    add("scene", nargs="?", default="statue", help="a built-in scene, a scene file or a mesh")
    add("--material")
    add("--size-mm", type=float, help="scale a mesh so that its longest side has this length")
    add("--vertices", type=int, help="approximate number of vertices of a built-in scene")
    add("--receivers", type=int, default=2000, help="number of vertices at which M_back is compared")
    add("--samples", nargs="+", type=int, default=[1, 2, 3, 5, 8, 13, 20, 30, 50])
    add("--select", nargs="+", choices=tuple(SELECTIONS), default=list(SELECTIONS))
    add("--integral", action="store_true")
    add("-o", "--output", type=Path, default=Path("sam_convergence.png"))
    args = parser.parse_args(argv)

    scene = load_scene(args.scene, material=args.material, size_mm=args.size_mm, vertices=args.vertices)
    errors = Errors(scene, args.receivers)
    errors_by_select: dict[str, list[tuple[int, float, float]]] = {}
    print("select  samples   suns    sky", flush=True)
    for select in args.select:
        for samples in [n for n in args.samples if n <= MOST[select]]:
            print(f"{select}, {samples} samples", file=sys.stderr)
            errors_by_select.setdefault(select, []).append((samples, *errors.of(select, samples)))
            print("{:6}  {:7}  {:.3f}  {:.3f}".format(select, *errors_by_select[select][-1]), flush=True)
    if args.integral:
        print("{:15}  {:.3f}  {:.3f}".format("all, integral", *errors.of_the_sum()))
    vertices = len(scene.objects[0].mesh.positions)
    plot(errors_by_select, f"{scene.name}, {vertices} vertices", args.output)


if __name__ == "__main__":
    main()
