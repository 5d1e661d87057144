"""Controls for the first light: its type, its strength and colour, and the direction that it shines from."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy.typing as npt
from imgui_bundle import imgui

from wgsss.scene import Camera, EnvironmentLight, Light
from wgsss.scene.scenefile import LIGHTS
from wgsss.study.light_types import light_types
from wgsss.viewer.manipulation import aim_light, direction_to_light, light_angles, turn_light
from wgsss.viewer.panels.widgets import CLAMPED, choice, rounded
from wgsss.viewer.session import Session

BALL_SIZE = 96.0
"""diameter of the ball on which a light is dragged, logical pixels"""
POWER_UNITS = {"irradiance": "W/m²", "intensity": "W/sr", "radiance": "W/(m² sr)"}
"""units of the field that holds the power of a light"""


def declare_light(session: Session) -> None:
    """Declare the controls of the first light. Other lights stay as they are."""
    lights = session.scene.lights
    if not lights:
        imgui.text_disabled("none")
        return
    light = _declare_type(session, lights[0])
    centre = session.scene.bounds.mean(axis=0)
    light = _declare_angles(_declare_power(light), centre)
    if not isinstance(light, EnvironmentLight):
        light = _declare_ball(light, session.camera, centre)
    if light is not lights[0]:
        session.set_first_light(light)
    imgui.text_disabled(f"the first light of {len(lights)}")


def _declare_type(session: Session, light: Light) -> Light:
    """Declare the choice of a type. A light of another type is as bright as those of the scene, and behind it."""
    name = next(name for name, kind in LIGHTS.items() if kind is type(light))
    chosen = choice("type", name, dict.fromkeys([name, *(kind for kind in LIGHTS if kind != "sphere")]))
    if chosen == name:
        return light
    offered = [scene.lights[0] for scene in light_types(session.scene, session.time_s).values()]
    return next(light for light in offered if type(light) is LIGHTS[chosen])


def _declare_power(light: Light) -> Light:
    """Declare the power of the strongest channel, and the colour relative to it."""
    name = next(f.name for f in fields(light) if f.name in POWER_UNITS)
    power = getattr(light, name)
    strongest = max(*power, 1e-6)
    changed, new = imgui.drag_float(name, strongest, 0.01 * strongest, 0.0, 1e9, f"%.4g {POWER_UNITS[name]}")
    if changed and new > 0.0:
        return _with(light, name, tuple(rounded(x * new / strongest) for x in power))
    changed, colour = imgui.color_edit3("colour", [x / strongest for x in power], imgui.ColorEditFlags_.float)
    if changed and max(colour) > 0.0:
        return _with(light, name, tuple(rounded(x * strongest) for x in colour))
    return light


def _declare_angles(light: Light, centre: npt.ArrayLike) -> Light:
    """Declare azimuth and elevation as seen from a centre, or the rotation of an environment."""
    if isinstance(light, EnvironmentLight):
        changed, rotation = imgui.slider_float("rotation", light.rotation, 0.0, 360.0, "%.1f °", CLAMPED)
        return replace(light, rotation=rounded(rotation)) if changed else light
    azimuth, elevation = light_angles(light, centre)
    is_turned, azimuth = imgui.slider_float("azimuth", azimuth, -180.0, 180.0, "%.1f °", CLAMPED)
    is_raised, elevation = imgui.slider_float("elevation", elevation, -90.0, 90.0, "%.1f °", CLAMPED)
    return aim_light(light, centre, azimuth, elevation) if is_turned or is_raised else light


def _declare_ball(light: Light, camera: Camera, centre: npt.ArrayLike) -> Light:
    """Declare a ball seen as the camera sees the scene, on which a dot can be dragged to move the light.

    The dot is filled on the near side of the ball, and a ring on the far side.
    """
    middle = imgui.get_cursor_screen_pos() + imgui.ImVec2(BALL_SIZE / 2, BALL_SIZE / 2)
    imgui.invisible_button("ball", (BALL_SIZE, BALL_SIZE))
    moved = imgui.get_io().mouse_delta
    if imgui.is_item_active() and (moved.x or moved.y):
        light = turn_light(light, camera, moved.x / BALL_SIZE, -moved.y / BALL_SIZE, centre)
    right, up, front = camera.view()[:3, :3] @ direction_to_light(light, centre)
    dot = middle + imgui.ImVec2(0.5 * BALL_SIZE * right, -0.5 * BALL_SIZE * up)
    canvas = imgui.get_window_draw_list()
    canvas.add_circle(middle, 0.5 * BALL_SIZE, imgui.IM_COL32(255, 255, 255, 90))
    canvas.add_line(middle, dot, imgui.IM_COL32(255, 255, 255, 60))
    draw_dot = canvas.add_circle_filled if front > 0.0 else canvas.add_circle
    draw_dot(dot, 6.0, imgui.IM_COL32(255, 220, 120, 255))
    imgui.same_line()
    imgui.text_disabled(f"drag it, or ctrl drag\nthe picture: {'in front' if front > 0.0 else 'behind'}")
    return light


def _with(light: Light, name: str, power: tuple[float, ...]) -> Light:
    """Return the light with another power, in the field of that name."""
    change: dict[str, Any] = {name: power}
    return replace(light, **change)
