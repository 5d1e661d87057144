"""What the viewer remembers from one time to the next: the window's size, and which panels are open."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any


def file() -> Path:
    """Where it is kept."""
    from platformdirs import user_state_path

    return user_state_path("wgsss") / "viewer.json"


def recall() -> dict[str, Any]:
    """What was remembered; nothing where the file is missing or damaged."""
    with suppress(OSError, ValueError):
        found = json.loads(file().read_text())
        if isinstance(found, dict):
            return found
    return {}


def remember(values: dict[str, Any]) -> None:
    """Keep these values; a folder that cannot be written keeps nothing."""
    with suppress(OSError):
        file().parent.mkdir(parents=True, exist_ok=True)
        file().write_text(json.dumps(values))
