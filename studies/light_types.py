"""Tabulate the error of M of each method under one light of each type, as tables coloured by error.

for scene in ear leaf milk; do wgsss compare $scene --lights all; done
python studies/light_types.py ear-compare leaf-compare milk-compare -o light_types.png

The tables hold the relative RMSE of M against the reference in per cent, read from the metrics.json of each folder.
The first column is measured under the scene's own lights. The last row is the error of the reference itself.
"""

import argparse
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

OWN = "own"
LEAST, MOST = 1.0, 100.0  # range of the colours, per cent


class Table(NamedTuple):
    """The errors of one comparison: rel_rmse in per cent (R, C), for R methods and C lights."""

    title: str
    rows: list[str]
    columns: list[str]
    errors: Any


def read(folder: Path) -> Table:
    """Read the table of a report. Exit if it was made without --lights all."""
    metrics = json.loads((folder / "metrics.json").read_text())
    if "lights" not in metrics:
        raise SystemExit(f"{folder}: compared without --lights all")
    columns = {OWN: metrics["methods"], **metrics["lights"]}
    errors = [[method["error"]["rel_rmse"] for method in methods] for methods in columns.values()]
    floors = [methods[0]["error"]["floor"] for methods in columns.values()]
    rows = [*(method["name"] for method in metrics["methods"]), f"({metrics['reference']})"]
    return Table(metrics["scene"], rows, list(columns), 100.0 * np.vstack([np.transpose(errors), floors]))


def draw(tables: list[Table], path: Path) -> None:
    """Draw the tables, three in a row. A darker cell is a larger error."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    across = min(len(tables), 3)
    down = -(-len(tables) // across)
    high = 0.27 * max(len(table.rows) for table in tables) + 0.9
    figure = Figure(figsize=(3.4 * across + 1.4, high * down), layout="constrained")
    figure.supxlabel("relative RMSE of M, %", fontsize=9)
    grid = list(figure.subplots(down, across, squeeze=False).flat)
    for place, (axis, (title, rows, columns, errors)) in enumerate(zip(grid, tables, strict=False)):
        axis.imshow(errors, norm=LogNorm(LEAST, MOST, clip=True), cmap="YlOrRd", aspect="auto")
        axis.set_title(title, loc="left", weight="bold")
        axis.set_xticks(range(len(columns)), columns, fontsize=8)
        repeated = place % across > 0 and rows == tables[place - 1].rows
        axis.set_yticks(range(len(rows)), [""] * len(rows) if repeated else rows, fontsize=9)
        axis.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
        axis.spines[:].set_visible(False)
        for (row, column), error in np.ndenumerate(errors):
            text = f"{error:.1f}" if error < 10.0 else f"{error:.0f}"
            color = "white" if error > 40.0 else "black"
            axis.text(column, row, text, ha="center", va="center", fontsize=9, color=color)
    for axis in grid[len(tables) :]:
        axis.set_axis_off()
    figure.savefig(path, dpi=110)


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path, help="reports by `wgsss compare SCENE --lights all`")
    parser.add_argument("-o", "--output", type=Path, default=Path("light_types.png"))
    args = parser.parse_args(argv)
    draw([read(folder) for folder in args.folders], args.output)
    print(args.output)


if __name__ == "__main__":
    main()
