"""Controls for the material of all objects: a preset, its coefficients, and the diffusion profile that they give."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from imgui_bundle import imgui, implot

from wgsss.bake.layer_profile import diffusion_profile
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene import MATERIALS, Material
from wgsss.scene.tables import Table
from wgsss.viewer.panels.widgets import LOGARITHMIC, choice, rounded
from wgsss.viewer.session import Session

COEFFICIENTS = {"sigma_a": (1e-5, 10.0), "sigma_s_prime": (1e-2, 100.0)}
"""range of the sliders, 1/mm"""
CHANNELS = {"red": (1.0, 0.35, 0.3, 1.0), "green": (0.35, 0.85, 0.35, 1.0), "blue": (0.45, 0.6, 1.0, 1.0)}
"""colours of the curves"""
MAX_DISTANCE = 30.0
"""mm, at the right end of the plot of the profile"""
UNCHANGED_FIELDS = ("eta", "roughness", "specular", "base_color", "color_after")
"""fields of a material that keep their values when a coefficient changes"""


def declare_material(session: Session) -> None:
    """Declare the controls, which show the material of the first object."""
    material = session.scene.objects[0].material
    chosen = choice("preset", material.name, MATERIALS)
    if chosen != material.name:
        session.attempt(lambda: session.set_material(chosen))
    _declare_profile(_profile(session.painter.gpu, material))
    if material.sigma_a is not None and material.sigma_s_prime is not None:
        changes = _declare_coefficients(material)
        changed, roughness = imgui.slider_float("roughness", material.roughness, 0.05, 1.0, "%.2f")
        changes |= {"roughness": rounded(roughness)} if changed else {}
        if changes:
            session.attempt(lambda: session.set_material(changed_table(material, changes)))


def _declare_coefficients(material: Material) -> dict[str, Any]:
    """Declare a slider for each coefficient and channel. Return the coefficients that changed."""
    changes: dict[str, Any] = {}
    for name, (low, high) in COEFFICIENTS.items():
        values = list(getattr(material, name))
        imgui.text_disabled(f"{name}, 1/mm")
        for i, channel in enumerate(CHANNELS):
            changed, value = imgui.slider_float(f"{channel}##{name}", values[i], low, high, "%.4g", LOGARITHMIC)
            if changed:
                values[i] = rounded(value)
                changes = {name: values}
    return changes


def changed_table(material: Material, changes: dict[str, Any]) -> Table:
    """Return a homogeneous material with other values of some fields, as the table of a scene file."""
    values = {name: getattr(material, name) for name in (*COEFFICIENTS, *UNCHANGED_FIELDS)}
    if material.base_color == (1.0, 1.0, 1.0):
        del values["base_color"]  # in a table it would replace a texture
    plain = {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}
    return {"name": "custom", **plain, **changes}


@lru_cache(maxsize=1)
def _profile(gpu: Gpu, material: Material) -> Profile:
    """Return the profile of a material. It is not computed again for each frame."""
    return diffusion_profile(gpu, material)


def _declare_profile(profile: Profile) -> None:
    """Declare a plot of R_d over the distance r, with a curve for each channel."""
    r = np.geomspace(0.01, MAX_DISTANCE, 96)
    curves = np.maximum(profile.reflectance(r), 1e-12)
    top = int(np.ceil(np.log10(curves.max())))
    if implot.begin_plot("##profile", (-1, 150), implot.Flags_.no_legend | implot.Flags_.no_inputs):
        implot.setup_axes("r, mm", "R_d, 1/mm²")
        for axis in (implot.ImAxis_.x1, implot.ImAxis_.y1):
            implot.setup_axis_scale(axis, implot.Scale_.log10)
        decades = range(top - 8, top + 1, 2)
        implot.setup_axes_limits(0.01, MAX_DISTANCE, 10.0 ** decades[0], 10.0**top, implot.Cond_.always)
        implot.setup_axis_ticks(implot.ImAxis_.y1, [10.0**n for n in decades], [f"1e{n}" for n in decades])
        for (name, colour), curve in zip(CHANNELS.items(), curves.T, strict=True):
            spec = implot.Spec()
            spec.line_color, spec.line_weight = imgui.ImVec4(*colour), 1.5
            implot.plot_line(name, r, np.ascontiguousarray(curve), spec)
        implot.end_plot()
