"""The pixels of Radiance .hdr files: RGBE bytes, flat or in one of two run-length encodings."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]


def decoded(data: bytes, lines: int, length: int) -> Array:
    """uint8 (lines, length, 4) from all that follows the header. Raises InputError where it is damaged.

    Lines in the new encoding begin with 2, 2 and their length, which a flat line may do, too: what cannot be decoded in
    the new way, and in the old way has exactly the size that it should have, is taken to be that.
    """
    if not (8 <= length < 32768 and data[:2] == b"\2\2" and data[2:3] < b"\x80"):
        return _old(data, lines, length, exactly=False)
    try:
        return _new(data, lines, length)
    except InputError:
        try:
            return _old(data, lines, length, exactly=True)
        except InputError:
            pass
        raise


def _new(data: bytes, lines: int, length: int) -> Array:
    """Each line: a marker, then its four channels, each as runs (128 + n, value) and literals (n, n values)."""
    marker = b"\2\2" + length.to_bytes(2, "big")
    planes = np.empty((lines, 4, length), np.uint8)
    at = 0
    for i in range(lines):
        damaged = InputError(f"damaged or truncated in row {i} of {lines}")
        if data[at : at + 4] != marker:
            raise damaged
        at += 4
        line = bytearray()
        while len(line) < 4 * length:
            count = data[at] if at < len(data) else 0
            if count > 128:
                line += data[at + 1 : at + 2] * (count - 128)
                at += 2
            else:
                line += data[at + 1 : at + 1 + count]
                at += 1 + count
            if not count or at > len(data):
                raise damaged
        if len(line) > 4 * length:
            raise damaged
        planes[i] = np.frombuffer(line, np.uint8).reshape(4, length)
    return planes.transpose(0, 2, 1)


def _old(data: bytes, lines: int, length: int, exactly: bool) -> Array:
    """Flat pixels, among them runs: 1, 1, 1, n repeats the pixel before n times; of runs that follow each other, n of
    each next one counts 256 times as much. Not `exactly`, bytes may follow."""
    total = lines * length
    pixels = np.frombuffer(data, np.uint8, len(data) // 4 * 4).reshape(-1, 4)
    run = (pixels[:, :3] == 1).all(axis=1)
    if not run[:total].any():
        counts = None
        wanted = len(pixels) == total if exactly else len(pixels) >= total
    else:
        index = np.arange(len(pixels))
        before = np.maximum.accumulate(np.where(run, -1, index))  # the pixel that a run repeats
        digit = np.minimum(index - before - 1, 4)
        counts = np.where(run, pixels[:, 3].astype(np.int64) << (8 * digit), 1)
        ends = np.minimum(counts, total + 1).cumsum()
        last = int(np.searchsorted(ends, total))
        wanted = not run[0] and last < len(pixels) and ends[last] == total and (not exactly or last == len(pixels) - 1)
        pixels, counts = pixels[before[: last + 1]], counts[: last + 1]
    if not wanted or (exactly and len(data) % 4):
        raise InputError(f"damaged or truncated: there are not the {total} pixels that its header tells of")
    if counts is None:
        return pixels[:total].reshape(lines, length, 4)
    return np.repeat(pixels, counts, axis=0).reshape(lines, length, 4)
