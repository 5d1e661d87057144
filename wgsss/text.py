"""Formatting of text that comes from users: names and values may contain any character."""

from __future__ import annotations

import json
import unicodedata
from typing import Any

_HIDDEN = ("Cc", "Cf", "Cs", "Zl", "Zp")  # Unicode's categories of control, format, surrogate and separator
_LONGEST = 60  # characters of a value in a message
_JOINERS = "\u200c\u200d"  # between letters of some scripts, and in emoji


def escaped(text: object) -> str:
    """Replace invisible characters, line breaks and changes of the writing direction by escapes such as \\x1b."""
    return "".join(_escape(c) if c not in _JOINERS and unicodedata.category(c) in _HIDDEN else c for c in str(text))


def one_line(text: object) -> str:
    """Escape text, and replace each run of white space by one space."""
    return escaped(" ".join(str(text).split()))


def printable(text: str) -> str:
    """Escape each line of a text."""
    return "\n".join(escaped(line) for line in text.split("\n"))


def shortened(text: object, most: int) -> str:
    """Escape text on one line and cut it to at most `most` characters."""
    line = one_line(text)
    return line if len(line) <= most else line[: most - 1] + "…"


def figure_text(text: object, most: int = 80) -> str:
    """Escape a line of text for matplotlib.

    Matplotlib would read text between two $ as TeX, and would leave a label with a leading _ out of legends.
    """
    line = shortened(text, most).replace("$", r"\$")
    return f" {line}" if line.startswith("_") else line


def span(low: float, high: float, above: bool = False, unit: str = "") -> str:
    """Describe a range in words. `above` excludes its lower end."""
    ends = f"above {low:g} and at most {high:g}" if above else f"from {low:g} to {high:g}"
    return f"{ends} ({unit})" if unit else ends


def shown(value: Any) -> str:
    """Format a value for a message."""
    try:
        text = one_line(repr(value))
    except (ValueError, RecursionError):  # an integer of thousands of digits, a list in itself
        text = f"that {type(value).__name__}"
    return shortened(text, _LONGEST)


def script_json(value: Any) -> str:
    """Format a value as JSON that is safe inside a <script> element, whatever strings it contains."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False)
    return "".join(f"\\u{ord(c):04x}" if c in "<>&\u2028\u2029" or "\ud800" <= c <= "\udfff" else c for c in text)


def _escape(character: str) -> str:
    return character.encode("unicode_escape").decode()
