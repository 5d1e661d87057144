"""Numbers that users give: what counts as one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt


def is_number(value: Any) -> bool:
    """Whether this is a finite number: no text, no truth value, no integer beyond what a float holds."""
    try:
        return isinstance(value, int | float | np.number) and not isinstance(value, bool) and math.isfinite(value)
    except (TypeError, OverflowError):  # a complex number, an integer of hundreds of digits
        return False


def array_of(values: Any) -> npt.NDArray[np.float64]:
    """Numbers in nested lists, or an array of them, as float64. Raises ValueError where there is anything else."""
    if isinstance(values, np.ndarray) and values.dtype.kind in "iuf":
        return values.astype(np.float64)
    found = np.array(values, dtype=object)
    if not all(map(_is_float, found.ravel())):
        raise ValueError
    return found.astype(np.float64)


def _is_float(value: Any) -> bool:
    return is_number(value) or isinstance(value, float | np.floating)  # NaN and infinity too: callers name their place
