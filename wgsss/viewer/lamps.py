"""Controls for the first light: its type, its power, and where it shines from."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from wgsss.scene import EnvironmentLight
from wgsss.scene.light import Light
from wgsss.scene.scenefile import LIGHTS
from wgsss.study.light_types import light_types
from wgsss.viewer import controls
from wgsss.viewer.knobs import choice, shortened

if TYPE_CHECKING:
    from wgsss.viewer.window import Window

BALL = 96.0
"""logical pixels across"""
POWERS = {"irradiance": "W/m²", "intensity": "W/sr", "radiance": "W/(m² sr)"}


def lamp(window: Window) -> None:
    """Declare them. Lights other than the first stay as they are."""
    from imgui_bundle import imgui

    state = window.state
    if not state.scene.lights:
        imgui.text_disabled("none")
        return
    first, *others = state.scene.lights
    shown = next(name for name, kind in LIGHTS.items() if kind is type(first))
    chosen = choice("type", shown, dict.fromkeys([shown, *(name for name in LIGHTS if name != "sphere")]))
    light: Any = first
    if chosen != shown:  # one as bright, from behind and aside
        offered = [scene.lights[0] for scene in light_types(state.scene, state.time_s).values()]
        light = next(light for light in offered if type(light) is LIGHTS[chosen])
    centre = state.scene.bounds.mean(axis=0)
    light = _aimed(_powered(light), centre)
    if not isinstance(light, EnvironmentLight):
        light = _dragged(light, state.camera, centre)
    if light is not first:
        state.scene = replace(state.scene, lights=(light, *others))
    imgui.text_disabled(f"the first light of {len(others) + 1}")


def _powered(light: Any) -> Any:
    """With another strength, that of its strongest channel, or colour."""
    from imgui_bundle import imgui

    power = next(f.name for f in fields(light) if f.name in POWERS)
    value = getattr(light, power)
    strength = max(*value, 1e-6)
    changed, new = imgui.drag_float(power, strength, 0.01 * strength, 0.0, 1e9, f"%.4g {POWERS[power]}")
    if changed and new > 0.0:
        return replace(light, **{power: tuple(shortened(x * new / strength) for x in value)})
    changed, tint = imgui.color_edit3("colour", [x / strength for x in value], imgui.ColorEditFlags_.float)
    if changed and max(tint) > 0.0:
        return replace(light, **{power: tuple(shortened(x * strength) for x in tint)})
    return light


def _aimed(light: Light, centre: Any) -> Light:
    """From another side."""
    from imgui_bundle import imgui

    clamped = imgui.SliderFlags_.always_clamp
    if isinstance(light, EnvironmentLight):
        changed, rotation = imgui.slider_float("rotation", light.rotation, 0.0, 360.0, "%.1f °", clamped)
        return replace(light, rotation=shortened(rotation)) if changed else light
    azimuth, elevation = controls.bearing(light, centre)
    turned, azimuth = imgui.slider_float("azimuth", azimuth, -180.0, 180.0, "%.1f °", clamped)
    raised, elevation = imgui.slider_float("elevation", elevation, -90.0, 90.0, "%.1f °", clamped)
    return controls.aim(light, centre, azimuth, elevation) if turned or raised else light


def _dragged(light: Light, camera: Any, centre: Any) -> Light:
    """From where it is dragged to on a ball, seen as the camera sees the scene; behind it a light is a ring."""
    from imgui_bundle import imgui

    middle = imgui.get_cursor_screen_pos() + imgui.ImVec2(BALL / 2, BALL / 2)
    imgui.invisible_button("ball", (BALL, BALL))
    moved = imgui.get_io().mouse_delta
    if imgui.is_item_active() and (moved.x or moved.y):
        light = controls.turn_light(light, camera, moved.x / BALL, -moved.y / BALL, centre)
    right, up, front = camera.view()[:3, :3] @ controls.towards(light, centre)
    place = middle + imgui.ImVec2(0.5 * BALL * right, -0.5 * BALL * up)
    canvas = imgui.get_window_draw_list()
    canvas.add_circle(middle, 0.5 * BALL, imgui.IM_COL32(255, 255, 255, 90))
    canvas.add_line(middle, place, imgui.IM_COL32(255, 255, 255, 60))
    draw = canvas.add_circle_filled if front > 0.0 else canvas.add_circle
    draw(place, 6.0, imgui.IM_COL32(255, 220, 120, 255))
    imgui.same_line()
    imgui.text_disabled(f"drag it, or ctrl drag\nthe picture: {'in front' if front > 0.0 else 'behind'}")
    return light
