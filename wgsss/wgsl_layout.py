"""Memory layouts of WGSL types, and packing of values into them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wgsss.wgsl_imports import WgslError


def round_up(value: int, multiple: int) -> int:
    """Return the smallest multiple that is at least `value`."""
    return -(-value // multiple) * multiple


@dataclass(frozen=True)
class Layout:
    """The memory layout of a host-shareable type (WGSL specification, section 14.4) and the matching numpy dtype."""

    text: str
    """the type as WGSL"""
    size: int
    """bytes; of an array of runtime size, those of one element"""
    align: int
    """bytes"""
    dtype: np.dtype[Any]
    fields: tuple[tuple[str, Layout, int], ...] = ()
    """of a struct: name, layout and offset"""
    element: Layout | None = None
    """of an array"""
    count: int | None = 0
    """of an array's elements; None: of runtime size"""
    columns: int = 0
    """of a matrix"""

    def pack(self, value: Any) -> bytes:
        """Return `value` as bytes.

        Args:
            value: a number or array for a scalar, vector or matrix (rows, columns); a dict for a struct; a sequence for
                an array; for an array of structs also a structured array or a dict of arrays.

        Raises WgslError where names, shapes or counts do not match.
        """
        runtime_sized = self.element is not None and self.count is None
        if runtime_sized and _length(value, self.text) == 0:
            return bytes(self.size)  # a binding cannot be empty: one element of zeros
        out = np.zeros(_length(value, self.text) if runtime_sized else (), self.dtype)
        self._assign(out, value, self.text)
        return out.tobytes()

    def _assign(self, out: np.ndarray, value: Any, path: str) -> None:
        """Write values into `out`, an array of this layout's dtype or a view of it."""
        if self.fields:
            value = _columns(value, path)
            names = {name for name, _, _ in self.fields}
            if set(value) != names:
                raise WgslError(f"{path} has the fields {', '.join(sorted(names))}; got {', '.join(sorted(value))}")
            for name, layout, _ in self.fields:
                layout._assign(out[name], value[name], f"{path}.{name}")
        elif self.element is not None:
            padded = self.element.dtype.itemsize != round_up(self.element.size, self.element.align)
            self.element._assign(out["value"] if padded else out, value, path)
        else:
            values = np.asarray(value)
            if self.columns:  # a mathematical (rows, columns) matrix is stored by columns
                values = np.swapaxes(values, -1, -2) if values.ndim >= 2 else values
                out = out[..., : int(self.text[5])]
            if values.shape != out.shape:
                raise WgslError(f"{path}: expected shape {out.shape} for {self.text}, got {values.shape}")
            out[...] = values


def _columns(value: Any, path: str) -> Mapping[str, Any]:
    """Return the value of a struct, or of an array of structs, by field name."""
    if isinstance(value, np.ndarray) and value.dtype.names:
        return {name: value[name] for name in value.dtype.names}
    if isinstance(value, Sequence) and value and isinstance(value[0], Mapping):
        return {name: np.stack([np.asarray(v[name]) for v in value]) for name in value[0]}
    if isinstance(value, Mapping):
        return value
    raise WgslError(f"{path}: expected a dict, got {type(value).__name__}")


def _length(value: Any, path: str) -> int:
    if not isinstance(value, Mapping):
        return len(value)
    lengths = {len(v) for v in value.values()}
    if len(lengths) != 1:
        raise WgslError(f"{path}: the fields differ in length: {sorted(lengths)}")
    return lengths.pop()


def padded_dtype(layout: Layout, stride: int) -> np.dtype[Any]:
    """Return the dtype of an array's elements that are `stride` bytes apart."""
    if layout.dtype.itemsize == stride:
        return layout.dtype
    return np.dtype({"names": ["value"], "formats": [layout.dtype], "offsets": [0], "itemsize": stride})
