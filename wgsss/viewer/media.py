"""Controls for the material of all objects: a preset, its coefficients, and the profile that they make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wgsss.scene import MATERIALS
from wgsss.viewer.knobs import choice, shortened

if TYPE_CHECKING:
    from wgsss.scene import Material
    from wgsss.viewer.window import Window

COEFFICIENTS = ("sigma_a", "sigma_s_prime")
FURTHEST = 30.0
"""mm, of the plot"""
KEPT = ("eta", "roughness", "specular", "base_color", "color_after")
"""fields that stay when coefficients are set"""


def medium(window: Window) -> None:
    """Declare them, for the first object's material."""
    from imgui_bundle import imgui

    state = window.state
    material = state.scene.objects[0].material
    chosen = choice("preset", material.name, MATERIALS)
    if chosen != material.name:
        window.attempt(lambda: state.wear(chosen))
    elif material.sigma_a is not None and material.sigma_s_prime is not None:
        table = changed_table(material, {})
        edited: dict[str, Any] = {}
        for name in COEFFICIENTS:
            changed, values = imgui.drag_float3(name, table[name], 0.002, 0.0, 100.0, "%.4g")
            edited |= {name: [shortened(x) for x in values]} if changed else {}
        changed, roughness = imgui.slider_float("roughness", material.roughness, 0.05, 1.0, "%.2f")
        edited |= {"roughness": shortened(roughness)} if changed else {}
        imgui.text_disabled("coefficients in 1/mm: red, green, blue")
        if edited:
            window.attempt(lambda: state.wear(changed_table(material, edited)))
    _plot(material)


def changed_table(material: Material, edited: dict[str, Any]) -> dict[str, Any]:
    """A homogeneous material as a scene file has it, with other values for some of its fields."""
    kept = {name: getattr(material, name) for name in (*COEFFICIENTS, *KEPT)}
    if material.base_color == (1.0, 1.0, 1.0):
        del kept["base_color"]  # named, it would take the place of a texture
    plain = {name: list(value) if isinstance(value, tuple) else value for name, value in kept.items()}
    return {"name": "custom", **plain, **edited}


def _plot(material: Material) -> None:
    """R_d of the three channels."""
    from imgui_bundle import imgui, implot

    r = np.geomspace(0.01, FURTHEST, 96)
    curves = np.maximum(material.profile.reflectance(r), 1e-12)
    top = 10.0 ** np.ceil(np.log10(curves.max()))
    if implot.begin_plot("##profile", (-1, 190), implot.Flags_.no_legend | implot.Flags_.no_inputs):
        implot.setup_axes("r, mm", "R_d, 1/mm^2")
        for axis in (implot.ImAxis_.x1, implot.ImAxis_.y1):
            implot.setup_axis_scale(axis, implot.Scale_.log10)
        implot.setup_axes_limits(0.01, FURTHEST, 1e-8 * top, top, implot.Cond_.always)
        for name, curve, colour in zip(("red", "green", "blue"), curves.T, _COLOURS, strict=True):
            spec = implot.Spec()
            spec.line_color, spec.line_weight = imgui.ImVec4(*colour), 1.5
            implot.plot_line(name, r, np.ascontiguousarray(curve), spec)
        implot.end_plot()


_COLOURS = (1.0, 0.35, 0.3, 1.0), (0.35, 0.85, 0.35, 1.0), (0.45, 0.6, 1.0, 1.0)
