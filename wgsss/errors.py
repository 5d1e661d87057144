"""The exceptions and the warning that users are meant to read."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LONGEST = 60  # characters of a name in a message


class InputError(ValueError):
    """Bad input. Its message is one line that says what is wrong and where; commands print it and exit with 2."""


class RenderError(RuntimeError):
    """A fault of the renderer or the driver, not of the input: one line; commands print it and exit with 1."""


class Note(UserWarning):
    """One line that tells the user what was left out, repaired or taken otherwise than asked for."""


def unknown(kind: str, name: str, known: Iterable[str]) -> InputError:
    """An error for a name that is not among those known, suggesting the nearest one."""
    name = name if len(name) <= _LONGEST else f"{name[: _LONGEST - 3]}..."
    known = sorted(known)
    near = difflib.get_close_matches(name.lower(), [k.lower() for k in known], n=1, cutoff=0.5)
    hint = next((f"; did you mean '{k}'?" for k in known if near and k.lower() == near[0]), "")
    return InputError(f"unknown {kind} '{name}'{hint} (known: {', '.join(known) or 'none'})")
