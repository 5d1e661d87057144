"""`wgsss info`: describe this machine for a bug report, or describe the contents of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wgsss.cli import arguments
from wgsss.errors import InputError

_PACKAGES = (
    *("wgpu", "numpy", "scipy", "scikit-image", "trimesh", "mapbox-earcut", "fast-simplification", "OpenEXR"),
    *("imageio", "pillow", "matplotlib", "embreex", "libigl", "xatlas", "uvunwrap", "flip-evaluator", "mitsuba"),
    *("imgui-bundle", "DracoPy", "meshopt"),
)
_FILE = "a mesh, a scene or material file (.toml) or an environment image (.hdr .exr)"


def declare(commands: Any) -> None:
    summary = "list adapters, limits and versions for a bug report; with FILE, list its contents and what is not used"
    parser = arguments.command(commands, "info", run, summary)
    parser.add_argument("file", metavar="FILE", nargs="?", type=Path, help=_FILE)


def run(args: Any) -> None:
    if args.file is None:
        _about_this_machine(args)
    else:
        from wgsss.cli.filetext import text_of
        from wgsss.scene.describe import describe

        description = describe(args.file)
        arguments.emit(args, description, text_of(description))


def _about_this_machine(args: Any) -> None:
    import platform
    from importlib.metadata import PackageNotFoundError, version

    from wgsss import __version__, cache
    from wgsss.gpu import LIMITS, adapters, default_gpu

    versions = {"wgsss": __version__, "python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed"
    devices = [{key: a.info[key] for key in ("device", "adapter_type", "description", "vendor")} for a in adapters()]
    sizes = cache.entries().values()
    result: dict[str, Any] = {
        "versions": versions,
        "platform": platform.platform(),
        "adapters": devices,
        "chosen": None,
        "cache": {"folder": str(cache.folder()), "entries": len(sizes), "bytes": sum(sizes)},
    }
    failure: InputError | None = None
    try:
        gpu = default_gpu()
        result["chosen"] = gpu.name
        result["clock"] = "gpu timestamps" if gpu.has_timestamps else "fenced wall clock"
        result["limits"] = {
            name: {"asked": asked, "adapter": gpu.adapter.limits[name]} for name, asked in LIMITS.items()
        }
    except InputError as error:  # the other lines are useful without a device
        failure = error
    arguments.emit(args, result, _text(result))
    if failure:
        raise failure


def _text(result: dict[str, Any]) -> str:
    cache = result["cache"]
    rows = [[name, text] for name, text in result["versions"].items()]
    rows.append(["platform", result["platform"]])
    rows += [["adapter", f"{a['device']} ({a['adapter_type']}), {a['description']}"] for a in result["adapters"]]
    rows += [] if result["adapters"] else [["adapter", "none"]]
    rows.append(["chosen", result["chosen"] or "none"])
    if "clock" in result:
        rows.append(["clock", result["clock"]])
    rows.append(["cache", f"{cache['folder']}: {cache['entries']} entries, {cache['bytes'] / 1e6:.1f} MB"])
    rows += [[name, f"{n['asked']} (adapter: {n['adapter']})"] for name, n in result.get("limits", {}).items()]
    return arguments.table(rows)
