"""Text of users in messages, charts and pages."""

from __future__ import annotations

import json
import re

import pytest

from wgsss.text import escaped, figure_text, one_line, printable, script_json, shown, span

NASTY = "$\\frac{ ^_ <!--<script></script>]]>&\u2028\u2029\x1b[31m\u202e\ud800\n\t\0"


def test_invisible_characters_are_escaped_and_letters_are_kept() -> None:
    assert escaped("a\n\x1b\u202e\u2028\ud800b") == r"a\n\x1b\u202e\u2028\ud800b"
    plain = "bär 雪 \U0001f469\u200d\U0001f52c \u0645\u06cc\u200c\u062e"
    assert escaped(plain) == plain
    assert one_line("  a\n\t b\r\n ") == "a b"
    assert printable("a\x07\nb\t") == "a\\x07\nb\\t"


def test_json_in_a_script_does_not_end_the_script() -> None:
    text = script_json({NASTY: [NASTY, 1.5, None]})
    assert not re.search("[<>&\u2028\u2029\ud800-\udfff]", text)
    assert json.loads(text) == {NASTY: [NASTY, 1.5, None]}
    with pytest.raises(ValueError, match="JSON"):
        script_json(float("nan"))


@pytest.mark.parametrize("text", [NASTY, "$x$", "\\$", "$", "$$", "_hidden", "{", "x" * 10_000, ""])
def test_matplotlib_draws_any_text_literally(text: str) -> None:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(2, 1))
    label = figure_text(text)
    drawn = figure.text(0, 0, label)
    legend = figure.legend(handles=[Line2D([], [], label=label)])
    figure.draw_without_rendering()
    seen, is_math = drawn._preprocess_math(label)
    assert not is_math and len(seen) <= 100 and len(legend.get_texts()) == 1
    if len(text) < 50:
        assert seen.strip() == one_line(text)


def test_messages_format_values_and_ranges() -> None:
    assert shown("a\nb") == r"'a\nb'" and shown([1, "x"]) == "[1, 'x']"
    assert len(shown("x" * 9999)) == 60 and shown(10**5000) == "that int"
    assert span(0.05, 170, unit="degrees") == "from 0.05 to 170 (degrees)"
    assert span(0, 1, above=True) == "above 0 and at most 1"
