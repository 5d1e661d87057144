"""`wgsss bench`: measure the time and the error of methods over their knobs, and chart them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from wgsss import console
from wgsss.cli import arguments
from wgsss.errors import InputError
from wgsss.text import one_line

if TYPE_CHECKING:
    from wgsss.study.run_record import Run

_SCENES = "built-in scenes, scene files or meshes; without any, the chart is drawn again from the runs in the folder"
_FOLDER = "folder for runs.jsonl, chart.svg, chart.png and chart.html (default: bench)"
_HEAD = [
    "scene",
    "method",
    "knobs",
    "bake, ms",
    "frame, ms",
    "middle half",
    "MB",
    "error, %",
    "PSNR, dB",
    "FLIP",
    "bias",
]
_REFERENCE = """reference for the errors (default: integral; in scenes with maps of layers, layers for methods with
multiple=off, else volume)"""
_TABLE = """speedup: in place of the chart, measure how much faster jimenez08 is than the same diffusion over the whole
surface, by the number of heads and their distance; needs the scene crowd and writes speedup.json"""
_SIZE = "size in pixels (default: 256x256; with --table 480x300)"
_SCHEDULER = "address of a Dask cluster on which to run (default: run on this machine)"


def declare(commands: Any) -> None:
    parser = arguments.command(commands, "bench", run, "chart speed against accuracy, for all methods over their knobs")
    add = parser.add_argument
    add("scenes", metavar="SCENE", nargs="*", help=_SCENES)
    arguments.add_scene_choices(parser)
    add("--methods", metavar="NAME,NAME,…", type=arguments.names, help="default: all (see 'wgsss methods')")
    add("--reference", metavar="NAME", help=_REFERENCE)
    add("--table", metavar="NAME", choices=TABLES, help=_TABLE)
    add("--size", metavar="WxH", type=arguments.size, help=_SIZE)
    add("--scheduler", metavar="ADDRESS", help=_SCHEDULER)
    add("-o", "--output", metavar="DIR", type=arguments.output, default=Path("bench"), help=_FOLDER)


def run(args: Any) -> None:
    if args.table:
        return TABLES[args.table](args)
    from wgsss.study.bench import bench
    from wgsss.study.chart import draw
    from wgsss.study.run_log import read_runs

    if args.scenes:
        scenes = [arguments.load_scene(args, name) for name in dict.fromkeys(args.scenes)]
        runs = bench(
            scenes,
            args.methods,
            args.output,
            args.size or (256, 256),
            reference=args.reference,
            scheduler=args.scheduler,
            on_run=_print_run,
        )
    else:
        if arguments.has_scene_choices(args):
            raise InputError("without a scene there is nothing to measure: --material and the like do not apply")
        runs = read_runs(args.output)
    files = [str(file) for file in draw(read_runs(args.output), args.output)]
    arguments.emit(
        args, {"runs": runs, "files": files}, "\n".join([arguments.table(_rows(runs)), "", *map(one_line, files)])
    )


def _speedup(args: Any) -> None:
    from wgsss.study.jimenez08_speedup import DEFAULT_SIZE, FILE, speedup

    if args.scenes != ["crowd"]:
        raise InputError("the table speedup is of the scene crowd: wgsss bench crowd --table speedup")
    if arguments.has_scene_choices(args):
        raise InputError("the table speedup is of the scene crowd as it is: --material and the like do not apply")
    if args.methods is not None or args.scheduler is not None:
        raise InputError("the table speedup is of two methods, measured here: --methods and --scheduler do not apply")
    table = speedup(args.output, args.size or DEFAULT_SIZE, on_cell=_print_cell)
    about = f"times faster than all of the surface, in brackets the paper's; {table.size[0]} x {table.size[1]} pixels"
    lines = [arguments.table(table.rows()), "", f"{about}, maps of {table.map_size}, {table.adapter}"]
    file = str(args.output / FILE)
    arguments.emit(args, {**table.json(), "files": [file]}, "\n".join([*lines, "", one_line(file)]))


TABLES = {"speedup": _speedup}


def _print_cell(cell: Any) -> None:
    """Print a line about a measured cell of the table, unless a progress bar is shown."""
    if not console.is_terminal():
        times = f"{cell.full_ms:.0f} ms to {cell.seen_ms:.0f} ms"
        console.print_message(f"{cell.heads} heads at {cell.distance:g}: {times}, {cell.speedup:.2f} times")


def _print_run(run: Run) -> None:
    """Print a line about a finished run, unless a progress bar is shown."""
    if not console.is_terminal():
        cells = dict(zip(_HEAD, _row(run), strict=True))
        setting = " ".join(filter(None, (cells["scene"], "by", cells["method"], cells["knobs"])))
        against = "" if run["reference"] == "integral" else f" from {run['reference']}"
        console.print_message(one_line(f"{setting}: {cells['frame, ms']} ms, error {cells['error, %']} %{against}"))


def _rows(runs: list[Run]) -> list[list[str]]:
    return [_HEAD, *(_row(run) for run in runs)]


def _row(run: Run) -> list[str]:
    low, high = run["frame_ms_quartiles"]
    error = run["error"]
    return [
        run["scene"],
        run["method"],
        " ".join(f"{knob}={value}" for knob, value in run["knobs"].items()),
        f"{run['bake_ms']:.0f}{'' if run['bake_cached'] else ' cold'}",
        f"{run['frame_ms']:.2f}",
        f"{low:.2f} to {high:.2f}",
        f"{run['bytes'] / 1e6:.1f}",
        _number(error["rel_rmse"], 100.0, "{:.3g}"),
        _number(error["psnr"], 1.0, "{:.1f}"),
        "not installed" if error.get("flip_reason") else _number(error["flip"], 1.0, "{:.4f}"),
        _number(error["bias"], 1.0, "{:.3f}"),
    ]


def _number(value: float | None, scale: float, form: str) -> str:
    return "" if value is None else form.format(scale * value)
