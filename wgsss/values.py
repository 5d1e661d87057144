"""Checks on numbers that users give."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt


def is_number(value: Any) -> bool:
    """Whether a value is a finite number. Text, truth values and integers too large for a float are not."""
    try:
        return isinstance(value, int | float | np.number) and not isinstance(value, bool) and math.isfinite(value)
    except (TypeError, OverflowError):  # a complex number, an integer of hundreds of digits
        return False


def array_of(values: Any) -> npt.NDArray[np.float64]:
    """Convert nested lists of numbers, or an array, to float64. Raises ValueError for anything else."""
    if isinstance(values, np.ndarray) and values.dtype.kind in "iuf":
        return values.astype(np.float64)
    objects = np.array(values, dtype=object)
    if not all(map(_is_float, objects.ravel())):
        raise ValueError
    return objects.astype(np.float64)


def _is_float(value: Any) -> bool:
    return is_number(value) or isinstance(value, float | np.floating)  # NaN and infinity too: callers name their place
