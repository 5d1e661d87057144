"""Reader of the animations of a glTF file: their names, and their channels on demand (glTF 2.0, section 3.11)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.files.contents import NONE
from wgsss.scene.files.gltf.container import damaged
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import Item, printable
from wgsss.scene.files.gltf.notes import Notes
from wgsss.scene.keyframes import INTERPOLATIONS, PATHS, Channel
from wgsss.scene.rig import Pose

Array = npt.NDArray[Any]


def read_animations(
    path: Path, document: Document, rest: Pose, notes: Notes
) -> dict[str, Callable[[], tuple[Channel, ...]]]:
    """Return, for each animation, a function that reads its channels.

    The keys are the names of the animations. An animation without a name, or with the name of an earlier one, gets its
    number. Channels that cannot be used are left out and counted in notes. The functions raise InputError, naming the
    file, if the data are invalid.
    """
    animations: dict[str, Callable[[], tuple[Channel, ...]]] = {}
    for number, animation in enumerate(document.all("animation")):
        name = animation.get("name")
        if not isinstance(name, str) or not name or name == NONE or name in animations:
            name = str(number) if str(number) not in animations else f"animation {number}"
        for channel in animation.items("channels", "channel"):
            reason = _left_out(channel, rest)
            if reason:
                notes.add(f"left out of animations because {reason}:", "channel")
        animations[name] = partial(_read, path, document, animation, rest, f"animation {printable(name)}")
    return animations


def _left_out(channel: Item, rest: Pose) -> str:
    """Return the reason why a channel cannot be used, or ""."""
    target = channel.item("target")
    if target is None:
        return ""
    if target.extension("KHR_animation_pointer") is not None:
        return "they use KHR_animation_pointer"
    if not target.has("node"):
        return "they have no node"
    path = target.text("path")
    if path not in PATHS:
        return f"their path is unknown ({printable(path)})"
    node = target.get("node")
    if path == "weights" and isinstance(node, int) and 0 <= node < len(rest.weights) and not len(rest.weights[node]):
        return "their node has no morph targets"
    return ""


def _read(path: Path, document: Document, animation: Item, rest: Pose, location: str) -> tuple[Channel, ...]:
    """Read the channels of an animation that can be used."""
    with damaged(path):
        named = Item(animation.values, location)
        samplers = named.items("samplers", "sampler")
        channels = named.items("channels", "channel")
        return tuple(_channel(document, c, samplers, rest) for c in channels if not _left_out(c, rest))


def _channel(document: Document, channel: Item, samplers: list[Item], rest: Pose) -> Channel:
    target = channel.item("target")
    if target is None:
        raise channel.error("target is missing")
    document.at("node", target.get("node"), channel.location)
    node, path = target.whole("node"), target.text("path")
    number = channel.whole("sampler")
    if number >= len(samplers):
        raise channel.error(f"there is no sampler {number}")
    sampler = samplers[number]
    kind = Item(sampler.values, channel.location).text("interpolation", "LINEAR", tuple(INTERPOLATIONS))
    times = document.numbers(sampler.get("input"), "SCALAR", f"{channel.location}: times")[:, 0].astype(np.float64)
    if not len(times) or times[0] < 0 or (np.diff(times) < 0).any():
        raise channel.error("its times must be at least 0 and must not decrease")
    size = len(rest.weights[node]) if path == "weights" else getattr(rest, path).shape[1]
    rows = len(times) * INTERPOLATIONS[kind] * (size if path == "weights" else 1)
    values = document.numbers(sampler.get("output"), PATHS[path], f"{channel.location}: {path}", rows).astype(
        np.float64
    )
    values = values.reshape(len(times), INTERPOLATIONS[kind], size)
    if path == "rotation" and not values[:, INTERPOLATIONS[kind] // 2].any(axis=1).all():
        raise channel.error("a rotation is zero")
    return Channel(node, path, kind, times, values)
