"""A comparison as a folder: a page that needs no network, the contact sheet, the numbers and the images themselves."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.folders import atomic_folder
from wgsss.output import save
from wgsss.rendering import Image
from wgsss.study import contact_sheet, error_maps, tables
from wgsss.study import page as pages
from wgsss.study.causes import CAUSES, MEANINGS
from wgsss.study.compare import Comparison

Array = npt.NDArray[Any]

OWN = "as in the scene"
"""the lights that are the scene's own"""
_PACKAGES = ("wgpu", "numpy", "flip-evaluator", "mitsuba")


def write_report(comparison: Comparison, folder: Path) -> list[Path]:
    """Write `report.html`, `contact_sheet.png`, `metrics.json` and, for `reference` and each method, its picture
    (.png), its linear M with irradiance and depth (.exr) and, for methods, its error map (.error.png); give back the
    files.

    All appear at once, when all are written; files of other names that are in the folder stay.
    Raises InputError where the folder cannot be written.
    """
    with atomic_folder(folder) as place:
        numbers = {**comparison.json(), "versions": versions()}
        (place / "metrics.json").write_text(json.dumps(numbers, indent=2, allow_nan=False) + "\n")
        (place / "report.html").write_text(page(comparison), encoding="utf-8")
        contact_sheet.draw(comparison, place / "contact_sheet.png")
        end = error_maps.top(comparison)
        found = error_maps.maps(comparison)
        for name, image in _named_images(comparison):
            for ending in (".png", ".exr"):
                save(image, place / f"{name}{ending}")
        for name, values in found.items():
            pixels = error_maps.coloured(values, comparison.seen, end)
            (place / f"{_file(name)}.error.png").write_bytes(_png(pixels))
        names = sorted(file.name for file in place.iterdir())
    return [folder / name for name in names]


def check_folder(folder: Path) -> Path:
    """The folder, if a report can be written there; to be asked before anything that takes long. Raises InputError."""
    with atomic_folder(folder):
        return folder


def page(comparison: Comparison) -> str:
    """The page as HTML, with everything that it shows inside."""
    return pages.page("report", _data(comparison))


def versions() -> dict[str, str]:
    """Of wgsss and of what the numbers depend on."""
    from importlib.metadata import PackageNotFoundError, version

    from wgsss import __version__

    found = {"wgsss": __version__}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:  # of those that can be done without
            found[package] = "not installed"
    return found


def _data(comparison: Comparison) -> dict[str, Any]:
    """What the page shows."""
    everything = {OWN: comparison, **comparison.lights}
    width, height = comparison.size
    return {
        "title": f"{comparison.scene} against {comparison.reference}",
        "about": f"{width} x {height} pixels · {comparison.adapter}",
        "versions": " · ".join(f"{name} {number}" for name, number in versions().items()),
        "size": [width, height],
        "bar": _uri(error_maps.bar()),
        "lights": [_light(name, other) for name, other in everything.items()],
        "by_light": tables.by_light(comparison) if comparison.lights else [],
        "causes": _causes(comparison) if comparison.causes else None,
    }


def _light(name: str, comparison: Comparison) -> dict[str, Any]:
    truth, end = comparison.reference, error_maps.top(comparison)
    shown = [(truth, "reference", comparison.image.display, error_maps.own(comparison))]
    found = error_maps.maps(comparison)
    for run in comparison.runs:
        shown.append((run.name, tables.percent(run.errors.rel_rmse), run.image.display, found[run.name]))
    images = [{"title": title, "note": note, "source": _uri(display)} for title, note, display, _ in shown]
    for i, (title, note, _, error) in enumerate(shown):
        title += ": error" if i else ": its own error"
        source = _uri(error_maps.coloured(error, comparison.seen, end))
        images.append({"title": title, "note": note, "source": source})
    return {
        "name": name,
        "images": images,
        "ticks": error_maps.ticks(end),
        "figures": tables.by_method(comparison),
        "floor": tables.floor(comparison),
    }


def _causes(comparison: Comparison) -> dict[str, Any]:
    rows = [
        {"name": name, "total": found.total, "parts": [found.part[cause] for cause in CAUSES]}
        for name, found in comparison.causes.items()
    ]
    meanings = [MEANINGS[cause] for cause in CAUSES]
    return {"names": CAUSES, "meanings": meanings, "rows": rows, "table": tables.by_cause(comparison)}


def _named_images(comparison: Comparison) -> Iterator[tuple[str, Image]]:
    yield "reference", comparison.image
    for run in comparison.runs:
        yield _file(run.name), run.image


def _file(name: str) -> str:
    return name.replace(" ", "_")


def _png(pixels: Array) -> bytes:
    from PIL import Image as Picture

    stream = io.BytesIO()
    Picture.fromarray(np.ascontiguousarray(pixels)).save(stream, format="png", optimize=True)
    return stream.getvalue()


def _uri(pixels: Array) -> str:
    return f"data:image/png;base64,{base64.b64encode(_png(pixels)).decode()}"
