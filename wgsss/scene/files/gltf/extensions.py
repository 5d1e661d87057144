"""Lists of the glTF extensions that are read or do not change the picture, and notes and errors for all others."""

from __future__ import annotations

from collections import Counter
from typing import Any

from wgsss.errors import InputError
from wgsss.scene.files.gltf.compression import DRACO, MESHOPT, PACKAGES, missing
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import json_text, printable
from wgsss.scene.files.gltf.notes import Notes

READ = {
    DRACO,
    *MESHOPT,
    "EXT_mesh_gpu_instancing",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_scatter",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_volume_scatter",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
}
HARMLESS = {
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "KHR_materials_emissive_strength",  # scales the emission, for which there is a note
    "KHR_materials_variants",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_lod",
}
"""extensions that do not change the picture of the file as it is first shown"""


def check_required(document: Document) -> None:
    """Raise InputError if the file requires extensions that cannot be read; the error names them."""
    unknown = []
    for value in document.root.array("extensionsRequired"):
        if not isinstance(value, str):
            raise InputError(f"extensionsRequired must be names, not {json_text(value)}")
        if value not in READ | HARMLESS:
            unknown.append(printable(value))
        elif value in PACKAGES and missing(value):
            raise InputError(missing(value))
    if unknown:
        raise InputError(f"it requires {', '.join(unknown)}, which cannot be read")


def note_unknown(document: Document, notes: Notes) -> None:
    """Add notes that count optional extensions that are not read. Those of materials and animations have own notes."""
    counts: Counter[str] = Counter()
    noted_elsewhere = ("materials", "textures", "animations")
    waiting: list[Any] = [{key: value for key, value in document.root.values.items() if key not in noted_elsewhere}]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            extensions = value.get("extensions")
            counts.update(list(extensions) if isinstance(extensions, dict) else ())
            waiting += [child for key, child in value.items() if key != "extras"]
        elif isinstance(value, list):
            waiting += value
    for name, count in sorted(counts.items()):
        if name not in READ | HARMLESS:
            notes.add(f"{printable(name)} left out: used in", "place", count)
