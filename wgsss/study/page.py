"""Pages that need no network: a template of this folder with its style, its script and the data that it shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wgsss.text import script_json


def page(name: str, data: Any) -> str:
    """The HTML of `name`.html, .css and .js with `data` inside, whatever text that holds."""
    here = Path(__file__).parent
    text, style, script = ((here / f"{name}.{kind}").read_text(encoding="utf-8") for kind in ("html", "css", "js"))
    for slot, part in (("STYLE", style), ("SCRIPT", script), ("DATA", script_json(data))):  # data may look like a slot
        text = text.replace(f"/*{slot}*/", part)
    return text
