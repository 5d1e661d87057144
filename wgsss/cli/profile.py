"""`wgsss profile`: compare models of the diffusion profile of a material."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from wgsss import console
from wgsss.cli import arguments
from wgsss.text import one_line, shown

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MATERIAL = "a measured material (see 'wgsss materials') or a material file (.toml); it may have layers"
_PLOT = "plot R and r R, log and linear, to a .png or .svg"
_MODEL = (
    "dipole, better-dipole, multipole, layers, burley, burley-diffuse, burley-dmfp, borshukov-lewis, gaussians, table \
or photons; repeat the option for more models (default: all that apply to the material)"
)


def declare(commands: Any) -> None:
    parser = arguments.command(commands, "profile", run, "compare models of a material's diffusion profile R")
    add = parser.add_argument
    add("material", metavar="MATERIAL", help=_MATERIAL)
    add("--model", metavar="M", dest="models", action="append", default=[], help=_MODEL)
    add("--k", metavar="K", type=gaussians, default=6, help="number of Gaussians in a fit, 1 to 6 (default: 6)")
    add("--thickness", metavar="MM", type=arguments.length, help="thickness of a slab in air (default: infinite)")
    add("--r", metavar="MM,MM,…", type=radii, help="distances at which to print R (default: 64 over its whole range)")
    add("--photons", metavar="N", type=arguments.count, help="trace N photons per channel, and add them as a model")
    add(
        "-o",
        "--output",
        metavar="FILE",
        type=arguments.output,
        help="plot R and r R, log and linear, to a .png or .svg",
    )
    add("--csv", action="store_true", help="print R as CSV, one row per distance")


def run(args: Any) -> None:
    import numpy as np

    from wgsss.errors import InputError
    from wgsss.output import check_output
    from wgsss.scene import load_material
    from wgsss.study import profiles

    if args.csv and args.json:
        raise InputError("--csv and --json exclude each other: give one of them")
    output = args.output and check_output(args.output, (".png", ".svg"))
    material = load_material(args.material)
    case = profiles.Case(material, args.thickness, args.k, args.photons or profiles.PHOTONS)
    models = list(dict.fromkeys(args.models or profiles.default_models(case)))
    if args.photons and "photons" not in models:
        models.append("photons")
    by_model = profiles.profiles(case, models)
    r = profiles.distances_for(by_model) if args.r is None else np.array(args.r)
    rows = [profiles.profile_json(name, profile, r, args.k) for name, profile in by_model.items()]
    if output:
        from wgsss.study.profile_plot import plot

        plot(by_model, _title(case), output)
    if args.csv:
        console.print_result(_csv(rows, r))
    else:
        text = "\n".join([*_about(case), "", _totals(rows, args.k), *(["", _values(rows, r)] if args.r else [])])
        arguments.emit(
            args, {"material": material.name, "models": rows}, text + (f"\n\n{one_line(output)}" if output else "")
        )


def gaussians(text: str) -> int:
    """Parse a number of Gaussians, 1 to 6."""
    return arguments.count(text, 6)


def radii(text: str) -> list[float]:
    """Parse distances in mm, separated by commas."""
    values = [arguments.number(part) for part in text.split(",")]
    if not 0 <= min(values) <= max(values) <= 1e12:
        raise argparse.ArgumentTypeError(f"{shown(text)} has a distance that is not from 0 to 1e12 (mm)")
    return values


def _title(case: Any) -> str:
    return one_line(case.material.name) + (f", {case.thickness:g} mm" if case.thickness else "")


def _about(case: Any) -> list[str]:
    """Lines about the medium: its coefficients, and the derived lengths that other programs use."""
    lines = []
    for number, layer in enumerate(case.stack if case.material.stack else [], start=1):
        depth = "without end" if layer.thickness == float("inf") else f"{layer.thickness:g} mm thick"
        place = f", layer {number}" if len(case.stack) > 1 else ""
        lines.append(f"{one_line(case.material.name)}{place}: eta {layer.eta:g}, {depth}")
        quantities = {
            "sigma_a": (layer.sigma_a, "1/mm"),
            "sigma_s'": (layer.sigma_s_prime, "1/mm"),
            "albedo": (layer.albedo, ""),
            "mean free path": (layer.mean_free_path, "mm"),
            "diffuse mean free path": (layer.diffuse_mean_free_path, "mm"),
        }
        lines += [f"  {name:23}{_numbers(values, 8)} {unit}".rstrip() for name, (values, unit) in quantities.items()]
    return lines or [f"{one_line(case.material.name)}: known by its profile"]


def _totals(rows: list[dict[str, Any]], k: int) -> str:
    transmits = any("T" in row for row in rows)
    head = ["model", "total R", *(["total T"] if transmits else []), "99 % within, mm", f"error of {k} Gaussians, %"]
    lines = [head]
    for row in rows:
        lines.append([row["model"], _numbers(row["total"], 8, "{:.4f}")])
        if transmits:
            lines[-1].append(_numbers(row["total_T"], 8, "{:.4f}") if "total_T" in row else "")
        errors = [100.0 * e for e in row["gaussians"]["error"]]
        lines[-1] += [_numbers(row["range_mm"], 8), _numbers(errors, 7, "{:.2f}")]
        if "total_error" in row:
            T = [_numbers(row.get("total_T_error", []), 8, "{:.1g}")] if transmits else []
            lines.append(["  standard error", _numbers(row["total_error"], 8, "{:.1g}"), *T, "", ""])
    return arguments.table(lines)


def _values(rows: list[dict[str, Any]], r: NDArray[np.float64]) -> str:
    lines = [["r, mm", *(f"{row['model']} {side}" for row in rows for side in "RT" if side in row)]]
    for i, distance in enumerate(r):
        values = [_numbers(row[side][i], 11, "{:.4e}") for row in rows for side in "RT" if side in row]
        lines.append([f"{distance:g}", *values])
    return arguments.table(lines)


def _csv(rows: list[dict[str, Any]], r: NDArray[np.float64]) -> str:
    columns = [(row, side) for row in rows for side in "RT" if side in row]
    channels = ("red", "green", "blue")
    lines = [["r_mm", *(f"{row['model']}_{side}_{channel}" for row, side in columns for channel in channels)]]
    for i, distance in enumerate(r):
        lines.append([f"{distance:.9g}", *(f"{value:.9g}" for row, side in columns for value in row[side][i])])
    return "\n".join(",".join(line) for line in lines)


def _numbers(values: Any, width: int, form: str = "{:.4g}") -> str:
    return " ".join(form.format(value).rjust(width) for value in values)
