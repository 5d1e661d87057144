"""A comparison as a folder: a page that needs no network, a contact sheet, the numbers and the images."""

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
from wgsss.study import comparison_tables, contact_sheet, error_maps, html_page
from wgsss.study.causes import CAUSES, MEANINGS
from wgsss.study.compare import Comparison

Array = npt.NDArray[Any]

OWN_LIGHTS = "as in the scene"
"""Name of the scene's own lights among the types of light."""
_PACKAGES = ("wgpu", "numpy", "flip-evaluator", "mitsuba")


def write_report(comparison: Comparison, folder: Path) -> list[Path]:
    """Write a report into a folder, and return its files.

    It consists of `report.html`, `contact_sheet.png`, `metrics.json` and, for `reference` and each method, the picture
    (.png), the linear M with irradiance and depth (.exr) and, for methods, the error map (.error.png).

    All files appear at once when all are written. Other files in the folder stay. Raises InputError if the folder
    cannot be written.
    """
    with atomic_folder(folder) as temporary:
        numbers = {**comparison.json(), "versions": versions()}
        (temporary / "metrics.json").write_text(json.dumps(numbers, indent=2, allow_nan=False) + "\n")
        (temporary / "report.html").write_text(page(comparison), encoding="utf-8")
        contact_sheet.draw(comparison, temporary / "contact_sheet.png")
        end = error_maps.scale_end(comparison)
        for name, image in _named_images(comparison):
            for extension in (".png", ".exr"):
                save(image, temporary / f"{name}{extension}")
        for name, values in error_maps.maps(comparison).items():
            pixels = error_maps.coloured(values, comparison.mask, end)
            (temporary / f"{_file_name(name)}.error.png").write_bytes(_png(pixels))
        names = sorted(file.name for file in temporary.iterdir())
    return [folder / name for name in names]


def check_folder(folder: Path) -> Path:
    """Return the folder if a report can be written there. To be called before work that takes long.

    Raises InputError if it cannot be written.
    """
    with atomic_folder(folder):
        return folder


def page(comparison: Comparison) -> str:
    """Return the page as HTML, with all its data inside."""
    return html_page.fill("report", _data(comparison))


def versions() -> dict[str, str]:
    """Return the versions of wgsss and of the packages that the numbers depend on."""
    from importlib.metadata import PackageNotFoundError, version

    from wgsss import __version__

    numbers = {"wgsss": __version__}
    for package in _PACKAGES:
        try:
            numbers[package] = version(package)
        except PackageNotFoundError:  # an optional one
            numbers[package] = "not installed"
    return numbers


def _data(comparison: Comparison) -> dict[str, Any]:
    """Return the data that the page shows."""
    by_light = {OWN_LIGHTS: comparison, **comparison.lights}
    width, height = comparison.size
    return {
        "title": f"{comparison.scene} against {comparison.reference}",
        "about": f"{width} x {height} pixels · {comparison.adapter}",
        "versions": " · ".join(f"{name} {number}" for name, number in versions().items()),
        "size": [width, height],
        "bar": _uri(error_maps.colour_bar()),
        "lights": [_light(name, other) for name, other in by_light.items()],
        "by_light": comparison_tables.by_light(comparison) if comparison.lights else [],
        "causes": _causes(comparison) if comparison.causes else None,
    }


def _light(name: str, comparison: Comparison) -> dict[str, Any]:
    """Return the pictures, the error maps and the figures under one type of light."""
    reference, end = comparison.reference, error_maps.scale_end(comparison)
    entries = [(reference, "reference", comparison.image.display, error_maps.own(comparison))]
    maps = error_maps.maps(comparison)
    for run in comparison.runs:
        error = comparison_tables.percent(run.errors.rel_rmse)
        entries.append((run.name, error, run.image.display, maps[run.name]))
    images = [{"title": title, "note": note, "source": _uri(display)} for title, note, display, _ in entries]
    for i, (title, note, _, values) in enumerate(entries):
        title += ": error" if i else ": its own error"
        source = _uri(error_maps.coloured(values, comparison.mask, end))
        images.append({"title": title, "note": note, "source": source})
    return {
        "name": name,
        "images": images,
        "ticks": error_maps.ticks(end),
        "figures": comparison_tables.by_method(comparison),
        "floor": comparison_tables.floor(comparison),
    }


def _causes(comparison: Comparison) -> dict[str, Any]:
    rows = [
        {"name": name, "total": causes.total, "parts": [causes.part[cause] for cause in CAUSES]}
        for name, causes in comparison.causes.items()
    ]
    meanings = [MEANINGS[cause] for cause in CAUSES]
    return {"names": CAUSES, "meanings": meanings, "rows": rows, "table": comparison_tables.by_cause(comparison)}


def _named_images(comparison: Comparison) -> Iterator[tuple[str, Image]]:
    yield "reference", comparison.image
    for run in comparison.runs:
        yield _file_name(run.name), run.image


def _file_name(name: str) -> str:
    return name.replace(" ", "_")


def _png(pixels: Array) -> bytes:
    from PIL import Image as Picture

    stream = io.BytesIO()
    Picture.fromarray(np.ascontiguousarray(pixels)).save(stream, format="png", optimize=True)
    return stream.getvalue()


def _uri(pixels: Array) -> str:
    return f"data:image/png;base64,{base64.b64encode(_png(pixels)).decode()}"
