"""One scene by several methods, side by side.

python examples/side_by_side.py ear lambert deon07 -o side_by_side.png
"""

import argparse

import numpy as np
from PIL import Image

import wgsss


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("methods", nargs="+")
    parser.add_argument("--side", type=int, default=400, help="pixels a side of each picture")
    parser.add_argument("-o", "--output", default="side_by_side.png")
    args = parser.parse_args(argv)

    scene = wgsss.load_scene(args.scene)
    # A pixel is one sample, which measuring wants; for smooth outlines, four are averaged to one below.
    images = [wgsss.render(scene, method=method, size=(2 * args.side, 2 * args.side)) for method in args.methods]

    # `pixels` is linear radiance, for measuring; `display` is what a screen shows, for looking at.
    for method, image in zip(args.methods, images, strict=True):
        seen = image.pixels[..., 3] > 0
        print(f"{method}: mean radiance {image.pixels[seen, :3].mean(axis=0)} W/(m^2 sr)")
    pair = Image.fromarray(np.concatenate([image.display for image in images], axis=1))
    pair.reduce(2).save(args.output)


if __name__ == "__main__":
    main()
