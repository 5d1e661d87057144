"""The panel beside the pictures. What it offers is read from methods, materials and lights: nothing is listed twice."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wgsss.methods import METHODS, SURFACES, TRANSLUCENCIES, make_method, name_of
from wgsss.reference import REFERENCES
from wgsss.scene import MATERIALS
from wgsss.scene.scenefile import LIGHTS
from wgsss.study.light_types import light_types
from wgsss.viewer.pictures import LAYERS
from wgsss.viewer.state import COMPARISONS

if TYPE_CHECKING:
    from wgsss.viewer.window import Window

PANEL_WIDTH = 330
"""logical pixels"""
KEYS = """drag  orbit     shift or right drag  pan
ctrl drag  light     wheel, + -  zoom
double click, F  look there     R  reset
1 2 3 4  split, left, right, error     Tab  flicker
X  swap sides     L  next layer
E  senders of the vertex under the pointer
space  play     .  step
S  screenshot     C  copy as command     Q  close"""
_SIDES = "left", "right"
OPEN = {*_SIDES, "passes"}
"""panels that are open the first time"""
_COEFFICIENTS = ("sigma_a", "sigma_s_prime")


def panels(window: Window) -> None:
    """Declare the panel for this frame."""
    from imgui_bundle import imgui

    _, height = window.canvas.get_logical_size()
    imgui.set_next_window_pos((0, 0))
    imgui.set_next_window_size((window.region[0], height))
    flags = imgui.WindowFlags_
    imgui.begin("wgsss", None, flags.no_move | flags.no_resize | flags.no_collapse | flags.no_title_bar)
    imgui.push_item_width(-110)
    _compared(window)
    for side, name in enumerate(_SIDES):
        if _panel(window, name, f"{name}: {name_of(window.state.methods[side])}"):
            imgui.push_id(side)
            _method(window, side)
            imgui.pop_id()
    for name, declare in _MORE.items():
        if _panel(window, name, name):
            imgui.push_id(name)
            declare(window)
            imgui.pop_id()
    for note in window.state.notes:
        imgui.text_wrapped(note)
    imgui.pop_item_width()
    imgui.end()


def _panel(window: Window, name: str, title: str) -> bool:
    """A heading, and whether what is under it is to be declared."""
    from imgui_bundle import imgui

    imgui.set_next_item_open(name in window.open_panels, imgui.Cond_.once)
    is_open: bool = imgui.collapsing_header(f"{title}###{name}")
    (window.open_panels.add if is_open else window.open_panels.discard)(name)
    return is_open


def _choice(label: str, value: str, choices: Any) -> str:
    """A drop-down list."""
    from imgui_bundle import imgui

    names = list(choices)
    changed, index = imgui.combo(label, names.index(value) if value in names else -1, names)
    return names[index] if changed else value


def _compared(window: Window) -> None:
    from imgui_bundle import imgui

    state = window.state
    state.comparison = _choice("show", state.comparison, COMPARISONS)
    state.layer = _choice("layer", state.layer, LAYERS)
    for name, low, high in (("exposure", -6.0, 6.0), ("bloom", 0.0, 1.0)):
        changed, value = imgui.slider_float(name, getattr(state.scene, name), low, high)
        if changed:
            shown: Any = {name: float(np.clip(value, low, high))}
            state.scene = replace(state.scene, **shown)
    for label, act in (
        ("reset", state.reset),
        ("screenshot", window.screenshot),
        ("copy as command", window.copy_command),
    ):
        if imgui.button(label):
            window.attempt(act)
        imgui.same_line()
    imgui.new_line()


def _method(window: Window, side: int) -> None:
    """A method and all its knobs."""
    method = window.state.methods[side]
    name = name_of(method)
    pairs = [f"{surface}+{part}" for surface in SURFACES for part in ("none", *TRANSLUCENCIES)]
    chosen = _choice("method", name, dict.fromkeys([*METHODS, *REFERENCES, *pairs]))
    values = dict(vars(method)) if chosen == name else {}
    for knob in fields(method) if chosen == name else ():  # type: ignore[arg-type]
        values[knob.name] = _knob(knob, values[knob.name])
    if chosen != name or values != vars(method):
        window.attempt(lambda: window.change_method(side, make_method(chosen, values)))


def _knob(knob: Any, value: Any) -> Any:
    """A control for a knob of a method, by its type and range."""
    from imgui_bundle import imgui

    if "choices" in knob.metadata:
        return _choice(knob.name, value, knob.metadata["choices"])
    if isinstance(value, bool):
        return imgui.checkbox(knob.name, value)[1]
    low, high = knob.metadata["range"]
    if isinstance(value, int):
        new = imgui.input_int(knob.name, value, 1 if high < 300 else max(value // 2, 1))[1]
        return int(np.clip(new, low, high))
    wide = imgui.SliderFlags_.logarithmic if low > 0 and high / low > 100 else 0
    return imgui.slider_float(knob.name, value, low, high, "%.3g", wide)[1]


def _light(window: Window) -> None:
    """The first light: its type, its power, and where it shines from."""
    from imgui_bundle import imgui

    state = window.state
    first: Any
    first, *others = state.scene.lights
    shown = next(name for name, kind in LIGHTS.items() if kind is type(first))
    chosen = _choice("type", shown, dict.fromkeys([shown, *(name for name in LIGHTS if name != "sphere")]))
    if chosen != shown:  # one as bright, from behind and aside
        offered = [scene.lights[0] for scene in light_types(state.scene, state.time_s).values()]
        first = next(light for light in offered if type(light) is LIGHTS[chosen])
    power = next(f.name for f in fields(first) if f.name in ("irradiance", "intensity", "radiance"))
    value = getattr(first, power)
    strength = max(*value, 1e-6)
    changed, new = imgui.drag_float(power, strength, 0.01 * strength, 0.0, 1e9, "%.4g")
    if changed and new > 0.0:
        first = replace(first, **{power: tuple(x * new / strength for x in value)})
    _, tint = imgui.color_edit3("colour", [x / strength for x in value])
    if changed is False and max(abs(a - b / strength) for a, b in zip(tint, value, strict=True)) > 1e-6:
        first = replace(first, **{power: tuple(float(x) * strength for x in tint)})
    if first is not state.scene.lights[0]:
        state.scene = replace(state.scene, lights=(first, *others))
    imgui.text_disabled(f"the first of {len(others) + 1}; ctrl drag turns it")


def _material(window: Window) -> None:
    """A preset, and the medium's coefficients."""
    from imgui_bundle import imgui, implot

    state = window.state
    material = state.scene.objects[0].material
    chosen = _choice("preset", material.name, MATERIALS)
    if chosen != material.name:
        window.attempt(lambda: state.wear(chosen))
    if material.sigma_a is not None and material.sigma_s_prime is not None:
        table: dict[str, Any] = {name: list(getattr(material, name)) for name in _COEFFICIENTS}
        changed = False
        for name in _COEFFICIENTS:
            moved, table[name] = imgui.drag_float3(name, table[name], 0.002, 0.0, 100.0, "%.4g")
            changed |= moved
        moved, roughness = imgui.slider_float("roughness", material.roughness, 0.05, 1.0)
        if changed or moved:
            kept = {"eta": material.eta, "roughness": float(roughness), "specular": material.specular}
            window.attempt(lambda: state.wear({"name": "custom", **table, **kept}))
    r = np.geomspace(0.01, 30.0, 96)
    curves = np.maximum(material.profile.reflectance(r), 1e-12)
    if implot.begin_plot("R_d, 1/mm^2, over r, mm", (-1, 150), implot.Flags_.no_legend | implot.Flags_.no_inputs):
        implot.setup_axes("", "", 0, 0)
        implot.setup_axis_scale(implot.ImAxis_.x1, implot.Scale_.log10)
        implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
        implot.setup_axes_limits(0.01, 30.0, 1e-7, 10.0)
        for name, curve in zip(("red", "green", "blue"), curves.T, strict=True):
            implot.plot_line(name, r, np.ascontiguousarray(curve))
        implot.end_plot()


def _time(window: Window) -> None:
    from imgui_bundle import imgui

    state = window.state
    state.playing = imgui.checkbox("play", state.playing)[1]
    state.time_s = max(imgui.drag_float("seconds", state.time_s, 0.02, 0.0, 1e4, "%.2f")[1], 0.0)


def _errors(window: Window) -> None:
    """How far each side is from the reference at this view, beside what it costs."""
    from imgui_bundle import imgui, implot

    state, measured = window.state, window.painter.measured
    state.is_measured = imgui.checkbox("against the integral, in the background", state.is_measured)[1]
    if window.painter.truth.fault:
        imgui.text_wrapped(window.painter.truth.fault)
    if measured is None or not any(measured.errors):
        if state.is_measured:
            imgui.text_disabled("refining" if window.painter.truth.is_refining else "when nothing moves")
        return
    imgui.text_disabled(f"reference at {window.painter.truth.share:.3g} of the size")
    dots = []
    for side, name, found in zip((0, 1), _SIDES, measured.errors, strict=True):
        if found is not None and found.rel_rmse is not None:
            psnr = "" if found.psnr is None else f", {found.psnr:.1f} dB"
            imgui.text(f"{name}: {100 * found.rel_rmse:.2f} %{psnr}")
            dots.append((name, max(milliseconds(window, side), 1e-3), max(100 * found.rel_rmse, 1e-3)))
    if dots and implot.begin_plot("error, %, over ms", (-1, 150), implot.Flags_.no_inputs):
        implot.setup_axis_scale(implot.ImAxis_.x1, implot.Scale_.log10)
        implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
        implot.setup_axes_limits(1.0, 10_000.0, 0.1, 100.0, implot.Cond_.always)
        for name, ms, error in dots:
            implot.plot_scatter(name, np.array([ms]), np.array([error]))
        implot.end_plot()


def milliseconds(window: Window, side: int) -> float:
    """That the passes of a side's picture took, shared ones among them."""
    picture = window.painter.sides[side]
    if window.painter.drawing is None or picture is None:
        return 0.0
    return sum(window.painter.drawing.graph.times.get(name, 0.0) for name in picture.passes)


def _passes(window: Window) -> None:
    """What the passes of the last picture cost, as bars."""
    from imgui_bundle import imgui

    if window.painter.drawing is None:
        return
    graph = window.painter.drawing.graph
    width, height = window.full_size
    imgui.text_disabled(f"{window.painter.seconds * 1e3:.0f} ms, {window.painter.scale:.3g} of {width} x {height}")
    imgui.text_disabled(graph.clock)
    most = max(graph.times.values(), default=1.0)
    for side, (name, picture) in enumerate(zip(_SIDES, window.painter.sides, strict=True)):
        if picture is None:
            continue
        imgui.text(f"{name}: {milliseconds(window, side):.1f} ms")
        mine = {passed: graph.times.get(passed, 0.0) for passed in picture.passes}
        for passed, ms in sorted(mine.items(), key=lambda item: -item[1])[:6]:
            imgui.progress_bar(ms / most, (-1, 0), f"{passed}  {ms:.2f}")


def _keys(window: Window) -> None:
    from imgui_bundle import imgui

    imgui.text(KEYS)


_MORE = {"light": _light, "material": _material, "time": _time, "errors": _errors, "passes": _passes, "keys": _keys}
