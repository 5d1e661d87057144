"""Translucent materials in real time, measured against references.

    import wgsss

    scene = wgsss.load_scene("ear")
    image = wgsss.render(scene, method="deon07", size=(512, 512))
    wgsss.save(image, "ear.png")

Names are imported when first used, so that `import wgsss` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wgsss.errors import InputError, Note, RenderError
    from wgsss.output import save
    from wgsss.registry import METHODS
    from wgsss.rendering import AOVS, Image, Renderer, render
    from wgsss.scene import (
        MATERIALS,
        DirectionalLight,
        EnvironmentLight,
        Maps,
        Material,
        Mesh,
        Object,
        OrthographicCamera,
        PerspectiveCamera,
        PointLight,
        RectLight,
        Scene,
        SphereLight,
        load_material,
        load_mesh,
        load_scene,
        material,
    )

__version__ = "0.1.0"

__all__ = [
    "AOVS",
    "MATERIALS",
    "METHODS",
    "DirectionalLight",
    "EnvironmentLight",
    "Image",
    "InputError",
    "Maps",
    "Material",
    "Mesh",
    "Note",
    "Object",
    "OrthographicCamera",
    "PerspectiveCamera",
    "PointLight",
    "RectLight",
    "RenderError",
    "Renderer",
    "Scene",
    "SphereLight",
    "load_material",
    "load_mesh",
    "load_scene",
    "material",
    "render",
    "save",
]

_HOMES = {
    "wgsss.errors": {"InputError", "Note", "RenderError"},
    "wgsss.registry": {"METHODS"},
    "wgsss.output": {"save"},
    "wgsss.rendering": {"AOVS", "Image", "Renderer", "render"},
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'wgsss' has no attribute '{name}'")
    home = next((module for module, names in _HOMES.items() if name in names), "wgsss.scene")
    value = getattr(import_module(home), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
