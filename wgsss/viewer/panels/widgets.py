"""Widgets that several panels use."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from imgui_bundle import imgui

from wgsss.viewer.session import Session

DIGITS = 4
"""significant digits of a value that a slider sets, so that the copied command stays short"""
CLAMPED = imgui.SliderFlags_.always_clamp
LOGARITHMIC = imgui.SliderFlags_.logarithmic | CLAMPED


def rounded(value: float) -> float:
    """Round a value to DIGITS significant digits."""
    return float(f"{value:.{DIGITS}g}")


def choice(label: str, value: str, choices: Iterable[str]) -> str:
    """Declare a drop-down list, and return the chosen value."""
    names = list(choices)
    changed, index = imgui.combo(label, names.index(value) if value in names else -1, names)
    return names[index] if changed else value


def button_row(session: Session, actions: Mapping[str, Callable[[], object]]) -> None:
    """Declare buttons side by side, each with its label and its action."""
    for i, (label, action) in enumerate(actions.items()):
        if i:
            imgui.same_line()
        if imgui.button(label):
            session.attempt(action)


def bar(text: str, share: float) -> None:
    """Declare a bar that fills a share of the width, with a text that starts at the left edge, legible on any bar."""
    x, y = imgui.get_cursor_pos()
    imgui.push_style_color(imgui.Col_.plot_histogram, imgui.get_style_color_vec4(imgui.Col_.header))
    imgui.progress_bar(share, (-1, 0), "")
    imgui.pop_style_color()
    below = imgui.get_cursor_pos()
    padding = imgui.get_style().frame_padding
    imgui.set_cursor_pos((x + padding.x, y + padding.y))
    imgui.text(text)
    imgui.set_cursor_pos(below)
