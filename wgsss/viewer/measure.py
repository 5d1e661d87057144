"""How far the pictures are off: numbers, and a map in colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from wgsss.study.error_maps import coloured
from wgsss.study.metrics import Errors, error_map, errors
from wgsss.viewer.pictures import Drawing, Picture
from wgsss.viewer.truth import Known

Array = npt.NDArray[Any]

WHOLE = 0.5
"""error at the end of the map's colours, over the RMS of what is right"""


@dataclass(frozen=True, eq=False)
class Measured:
    """Errors of each side against the reference, None where it is not known, and the map between the two sides."""

    errors: list[Errors | None]
    map: Array | None
    """uint8 (H, W, 4)"""


def measure(drawing: Drawing, sides: Sequence[Picture | None], known: Known | None) -> Measured | None:
    """Tell how far the pictures of the sides are off; None where nothing is seen."""
    seen = drawing.seen
    if not seen.any():
        return None
    M = [None if picture is None else drawing.M(picture) for picture in sides]
    found: list[Errors | None] = [None] * len(M)
    if known is not None:
        truth = known.estimate
        found = [None if m is None else errors(m, truth.M, seen, error=truth.error) for m in M]
    left, right = M
    if left is None or right is None:
        return Measured(found, None)
    return Measured(found, coloured(error_map(left, right, seen), seen, WHOLE))
