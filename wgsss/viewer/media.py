"""Controls for the material of all objects: a preset, its coefficients, and the profile that they make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wgsss.scene import MATERIALS
from wgsss.viewer.knobs import choice, shortened

if TYPE_CHECKING:
    from wgsss.scene import Material
    from wgsss.viewer.window import Window

COEFFICIENTS = {"sigma_a": (1e-5, 10.0), "sigma_s_prime": (1e-2, 100.0)}
"""1/mm, as far as sliders go"""
CHANNELS = "red", "green", "blue"
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
    _plot(material)
    if material.sigma_a is not None and material.sigma_s_prime is not None:
        edited = _coefficients(material)
        changed, roughness = imgui.slider_float("roughness", material.roughness, 0.05, 1.0, "%.2f")
        edited |= {"roughness": shortened(roughness)} if changed else {}
        if edited:
            window.attempt(lambda: state.wear(changed_table(material, edited)))


def _coefficients(material: Material) -> dict[str, Any]:
    """Those that sliders have changed."""
    from imgui_bundle import imgui

    wide = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp
    edited: dict[str, Any] = {}
    for name, (low, high) in COEFFICIENTS.items():
        values = list(getattr(material, name))
        imgui.text_disabled(f"{name}, 1/mm")
        for i, channel in enumerate(CHANNELS):
            changed, value = imgui.slider_float(f"{channel}##{name}", values[i], low, high, "%.4g", wide)
            if changed:
                values[i] = shortened(value)
                edited = {name: values}
    return edited


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
    top = int(np.ceil(np.log10(curves.max())))
    if implot.begin_plot("##profile", (-1, 150), implot.Flags_.no_legend | implot.Flags_.no_inputs):
        implot.setup_axes("r, mm", "R_d, 1/mm²")
        for axis in (implot.ImAxis_.x1, implot.ImAxis_.y1):
            implot.setup_axis_scale(axis, implot.Scale_.log10)
        decades = range(top - 8, top + 1, 2)
        implot.setup_axes_limits(0.01, FURTHEST, 10.0 ** decades[0], 10.0**top, implot.Cond_.always)
        implot.setup_axis_ticks(implot.ImAxis_.y1, [10.0**n for n in decades], [f"1e{n}" for n in decades])
        for name, curve, colour in zip(CHANNELS, curves.T, _COLOURS, strict=True):
            spec = implot.Spec()
            spec.line_color, spec.line_weight = imgui.ImVec4(*colour), 1.5
            implot.plot_line(name, r, np.ascontiguousarray(curve), spec)
        implot.end_plot()


_COLOURS = (1.0, 0.35, 0.3, 1.0), (0.35, 0.85, 0.35, 1.0), (0.45, 0.6, 1.0, 1.0)
