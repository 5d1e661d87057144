"""The exceptions and the warning class whose messages users read."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LONGEST = 60  # characters of a name in a message


class InputError(ValueError):
    """Bad input. Its one-line message says what is wrong and where. Commands print it and exit with code 2."""


class RenderError(RuntimeError):
    """A fault of the renderer or the driver. Commands print its one-line message and exit with code 1."""


class Note(UserWarning):
    """A one-line warning for the user: something was left out, repaired, or interpreted differently than requested."""


def unknown(kind: str, name: str, known: Iterable[str]) -> InputError:
    """Build the error for an unknown name. It lists the known names and suggests the most similar one."""
    name = name if len(name) <= _LONGEST else f"{name[: _LONGEST - 3]}..."
    known = sorted(known)
    near = difflib.get_close_matches(name.lower(), [k.lower() for k in known], n=1, cutoff=0.5)
    hint = next((f"; did you mean '{k}'?" for k in known if near and k.lower() == near[0]), "")
    return InputError(f"unknown {kind} '{name}'{hint} (known: {', '.join(known) or 'none'})")
