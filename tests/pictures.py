"""Encoders of unusual image files: PNG of any depth and filter, uncompressed OpenEXR, Radiance."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

_ADAM7 = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))


def png(
    pixels: np.ndarray, *, depth: int = 0, palette: Any = None, trns: bytes = b"", interlaced: bool = False
) -> bytes:
    """Encode a PNG of uint8 or uint16 pixels (H, W, C), or of palette indices or grey of fewer bits.

    Its rows use all filters in turn.
    """
    pixels = pixels if pixels.ndim == 3 else pixels[..., None]
    height, width, channels = pixels.shape
    depth = depth or 8 * pixels.dtype.itemsize
    kind = 3 if palette is not None else {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    passes = [pixels[y0::dy, x0::dx] for x0, y0, dx, dy in _ADAM7] if interlaced else [pixels]
    data = b"".join(_filtered(part, depth) for part in passes if part.size)
    head = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, int(interlaced))
    chunks = [(b"IHDR", head)]
    if palette is not None:
        chunks.append((b"PLTE", np.asarray(palette, np.uint8).tobytes()))
    if trns:
        chunks.append((b"tRNS", trns))
    chunks += [(b"IDAT", zlib.compress(data)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(name, content) for name, content in chunks)


def chunk(name: bytes, content: bytes) -> bytes:
    """Make a chunk of a PNG file."""
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def _filtered(pixels: np.ndarray, depth: int) -> bytes:
    """Encode the rows of a PNG file, using all filters in turn."""
    height = len(pixels)
    if depth < 8:
        bits = np.unpackbits(pixels.reshape(height, -1, 1).astype(np.uint8), axis=2)[..., 8 - depth :]
        rows = np.packbits(bits.reshape(height, -1), axis=1)
    else:
        rows = np.frombuffer(pixels.astype(f">u{depth // 8}").tobytes(), np.uint8).reshape(height, -1)
    step = max(pixels.shape[2] * depth // 8, 1)
    out, above = b"", np.zeros(rows.shape[1], np.int32)
    for i, row in enumerate(rows.astype(np.int32)):
        left, corner = (np.concatenate([np.zeros(step, np.int32), a])[: len(a)] for a in (row, above))
        p = left + above - corner
        distances = np.abs(np.stack([p - left, p - above, p - corner]))
        paeth = np.choose(distances.argmin(axis=0), [left, above, corner])
        predicted = (0, left, above, (left + above) // 2, paeth)[i % 5]
        out += bytes([i % 5]) + ((row - predicted) % 256).astype(np.uint8).tobytes()
        above = row
    return out


def exr(
    channels: Mapping[str, np.ndarray],
    *,
    sampling: Mapping[str, int] | None = None,
    data: tuple[int, int, int, int] | None = None,
    display: tuple[int, int, int, int] | None = None,
    attributes: Mapping[str, tuple[str, bytes]] | None = None,
) -> bytes:
    """Encode an OpenEXR file without compression. Windows are (left, top, right, bottom), all inclusive."""
    sampling = sampling or {}
    names = sorted(channels)
    full = next(values for name, values in channels.items() if sampling.get(name, 1) == 1)
    data = data or (0, 0, full.shape[1] - 1, full.shape[0] - 1)
    types = {np.dtype(np.uint32): 0, np.dtype(np.float16): 1, np.dtype(np.float32): 2}
    listed = b""
    for name in names:
        step = sampling.get(name, 1)
        listed += name.encode() + b"\0" + struct.pack("<iB3xii", types[channels[name].dtype], 0, step, step)
    head = {
        "channels": ("chlist", listed + b"\0"),
        "compression": ("compression", b"\0"),
        "dataWindow": ("box2i", struct.pack("<4i", *data)),
        "displayWindow": ("box2i", struct.pack("<4i", *(display or data))),
        "lineOrder": ("lineOrder", b"\0"),
        "pixelAspectRatio": ("float", struct.pack("<f", 1.0)),
        "screenWindowCenter": ("v2f", bytes(8)),
        "screenWindowWidth": ("float", struct.pack("<f", 1.0)),
        **(attributes or {}),
    }
    out = struct.pack("<ii", 20000630, 2)
    for name, (kind, value) in head.items():
        out += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    out += b"\0"
    lines = []
    for y in range(data[1], data[3] + 1):
        line = b""
        for name in names:
            step = sampling.get(name, 1)
            if y % step == 0:
                line += channels[name][(y - data[1]) // step].astype(channels[name].dtype).tobytes()
        lines.append(struct.pack("<ii", y, len(line)) + line)
    at = len(out) + 8 * len(lines)
    offsets = np.cumsum([at, *map(len, lines[:-1])])
    return out + offsets.astype("<u8").tobytes() + b"".join(lines)


def chromaticities(*values: float) -> dict[str, tuple[str, bytes]]:
    """Return the attribute of an OpenEXR file for x and y of red, green, blue and white."""
    return {"chromaticities": ("chromaticities", struct.pack("<8f", *values))}


def hdr(data: bytes, head: str = "FORMAT=32-bit_rle_rgbe\n", size: str = "-Y 6 +X 12", end: str = "\n") -> bytes:
    """Make a Radiance file of encoded pixels."""
    return f"#?RADIANCE\n{head}\n{size}\n".replace("\n", end).encode() + data


def run_length(rgbe: np.ndarray) -> bytes:
    """Encode in the new way: per row a marker, then channels of runs (128 + n, value) and literals (n, n values)."""
    out = bytearray()
    for row in rgbe:
        out += bytes([2, 2, len(row) >> 8, len(row) & 255])
        for plane in row.T:
            if (plane == plane[0]).all():
                out += bytes([128 + len(plane), plane[0]])
            else:
                out += bytes([5, *plane[:5], len(plane) - 5, *plane[5:]])
    return bytes(out)
