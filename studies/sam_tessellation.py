"""Measure how the error of spatial adjacency maps changes when the same shape has more vertices.

python studies/sam_tessellation.py --vertices 5000 20000 80000

The error is the relative RMSE of M_back at random vertices, against the sum over all vertices on the back side. The
senders of `top` cover less of a finer mesh; the means of `fit` cover as much of it as before.
"""

import argparse

from sam_errors import Errors

from wgsss.scene import load_scene


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    add = parser.add_argument
    add("--scene", default="statue", help="a built-in scene")
    add("--vertices", nargs="+", type=int, default=[5000, 10_000, 20_000, 40_000, 80_000])
    add("--samples", type=int, default=3)
    add("--select", nargs="+", default=["top", "fit"])
    add("--receivers", type=int, default=1000, help="number of vertices at which M_back is compared")
    args = parser.parse_args(argv)

    print("vertices", *(f"{select + ', suns':>13}{'sky':>8}" for select in args.select), flush=True)
    for vertices in args.vertices:
        scene = load_scene(args.scene, vertices=vertices)
        errors = Errors(scene, args.receivers)
        pairs = [errors.of(select, args.samples) for select in args.select]
        V = len(scene.objects[0].mesh.positions)
        print(f"{V:8}", *(f"{suns:13.3f}{sky:8.3f}" for suns, sky in pairs), flush=True)


if __name__ == "__main__":
    main()
