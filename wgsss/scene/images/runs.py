"""Decoder of the pixels of Radiance .hdr files: RGBE bytes, flat or in one of two run-length encodings."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]


def decode(data: bytes, lines: int, length: int) -> Array:
    """Decode the data after the header: uint8 (lines, length, 4). Raises InputError if they are damaged.

    Lines in the new encoding begin with 2, 2 and their length. A flat line may begin with the same bytes. Data that
    cannot be decoded in the new encoding are therefore decoded in the old one, if they have exactly the right size.
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
    """Decode the new encoding: a line has a marker, then channels of runs (128 + n, value) and literals (n, values)."""
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
    """Decode the old encoding: flat pixels and runs. A run 1, 1, 1, n repeats the pixel before it n times.

    In a sequence of runs, the count of each further run has 256 times the weight of the one before. Unless `exactly` is
    set, more bytes may follow the pixels.
    """
    total = lines * length
    pixels = np.frombuffer(data, np.uint8, len(data) // 4 * 4).reshape(-1, 4)
    run = (pixels[:, :3] == 1).all(axis=1)
    if not run[:total].any():
        counts = None
        valid = len(pixels) == total if exactly else len(pixels) >= total
    else:
        index = np.arange(len(pixels))
        before = np.maximum.accumulate(np.where(run, -1, index))  # the pixel that a run repeats
        digit = np.minimum(index - before - 1, 4)
        counts = np.where(run, pixels[:, 3].astype(np.int64) << (8 * digit), 1)
        ends = np.minimum(counts, total + 1).cumsum()
        last = int(np.searchsorted(ends, total))
        valid = not run[0] and last < len(pixels) and ends[last] == total and (not exactly or last == len(pixels) - 1)
        pixels, counts = pixels[before[: last + 1]], counts[: last + 1]
    if not valid or (exactly and len(data) % 4):
        raise InputError(f"damaged or truncated: it does not contain the {total} pixels of its header")
    if counts is None:
        return pixels[:total].reshape(lines, length, 4)
    return np.repeat(pixels, counts, axis=0).reshape(lines, length, 4)
