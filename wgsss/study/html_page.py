"""Pages that need no network: a template in this folder, filled with its style, its script and its data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wgsss.text import script_json


def fill(name: str, data: Any) -> str:
    """Return the HTML of `name`.html with `name`.css, `name`.js and `data` inside. `data` may contain any text."""
    here = Path(__file__).parent
    text, style, script = ((here / f"{name}.{kind}").read_text(encoding="utf-8") for kind in ("html", "css", "js"))
    for slot, part in (("STYLE", style), ("SCRIPT", script), ("DATA", script_json(data))):  # data may look like a slot
        text = text.replace(f"/*{slot}*/", part)
    return text
