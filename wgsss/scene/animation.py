"""Motions of meshes that play animations of glTF files: skins, morph targets and moving nodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, unknown
from wgsss.scene.blend import Blend
from wgsss.scene.files.contents import NONE, Contents
from wgsss.scene.keyframes import Channel
from wgsss.scene.repair import counted, weld
from wgsss.scene.rig import Rig

Array = npt.NDArray[Any]

_MOST_NAMES = 8  # of animations in a message
_NOTHING = 1e-6  # share of its modelled size up to which a part counts as scaled to nothing
_MOST_KEYS = 64  # keys at which a part that is hidden at rest is searched


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation of a file, for all of its parts or for some."""

    name: str
    rig: Rig
    channels: tuple[Channel, ...]
    """the channels that move vertices of the rig, at least one"""
    duration_s: float
    """seconds from time 0 to the last key of the whole animation, so that all parts repeat together"""

    def of(self, rig: Rig) -> Clip | None:
        """Restrict the clip to the parts of `rig`. Returns None if they do not move."""
        movers, morphed = rig.movers(), {part.node for part in rig.parts}
        used = tuple(c for c in self.channels if c.node in (morphed if c.path == "weights" else movers))
        return replace(self, rig=rig, channels=used) if used else None

    def positions(self, time_s: float) -> Array:
        """Compute the positions of all vertices of the rig at a time between 0 and the last key.

        Returns float64 (V, 3), in the unit of the file.
        """
        pose = self.rig.nodes.rest.copy()
        for channel in self.channels:
            channel.put(pose, time_s)
        return self.rig.positions(pose)


@dataclass(frozen=True, eq=False)
class Animation:
    """A motion of a mesh that repeats a clip.

    It computes the positions of the V vertices from the clip alone. Of the positions at rest it uses only their number.
    """

    clip: Clip
    vertices: Blend
    """the V vertices as weighted means of the vertices of the clip"""
    mm_per_unit: float
    centre: Array
    """float64 (3,), mm: the origin of the mesh in the space of the file"""

    @property
    def period_s(self) -> float:
        """Seconds from time 0 to the last key of the clip."""
        return self.clip.duration_s

    def apply(self, positions: npt.ArrayLike, time_s: float) -> npt.NDArray[np.float32]:
        """Return the positions (V, 3), mm, at a time in seconds. Raises InputError if `positions` is not (V, 3)."""
        count = len(self.vertices.index)
        if np.shape(positions) != (count, 3):
            raise InputError(f"animation {self.clip.name}: it moves {count} vertices, and no others")
        moved = self.vertices.of(self.clip.positions(time_s % self.period_s if self.period_s else 0.0))
        with np.errstate(over="ignore"):  # beyond what float32 holds: the mesh refuses it
            return (moved * self.mm_per_unit - self.centre).astype(np.float32)


def choose_clip(contents: Contents, name: str | None, say: Callable[[str], None]) -> Clip | None:
    """Choose an animation of a file, with the channels that move vertices. Returns None if nothing moves.

    `name` is the name of the animation or its number from 0. None stands for the first animation, NONE for no
    animation. `say` is called with a line that names the other animations if `name` is None, and with a line that
    counts the channels that move nothing. Raises InputError if there is no such animation.
    """
    names = list(contents.animations)
    if name is None and len(names) > 1:
        others = ", ".join(names[1:_MOST_NAMES]) + (", …" if len(names) > _MOST_NAMES else "")
        say(f"plays {names[0]}, the first of {len(names)} animations (--animation NAME plays another: {others})")
    name = name if name is not None else next(iter(names), NONE)
    if name == NONE:
        return None
    if name not in names and name.isdecimal() and int(name) < len(names):
        name = names[int(name)]
    if not names:
        raise InputError(f"it has no animations, so none named '{name}'")
    if name not in names:
        raise unknown("animation", name, [*names, NONE])
    channels = contents.animations[name]()
    if contents.rig is None or not channels:
        return None
    whole = Clip(name, contents.rig, channels, max(float(channel.times[-1]) for channel in channels))
    clip = whole.of(contents.rig)
    idle = len(channels) - (0 if clip is None else len(clip.channels))
    if idle:
        say(f"animation {name}: {counted(idle, 'channel')} {'moves' if idle == 1 else 'move'} nothing that is drawn")
    return clip


def unfolded(placed: Sequence[Array], clip: Clip) -> list[Array]:
    """Return positions (V, 3) for each part from which its topology can be read.

    These are the positions at rest, `placed`. A part that is scaled to nothing at rest, and so has all its vertices at
    one point, gets the positions at the key where it is largest.
    """
    shapes = list(placed)
    modelled = [np.ptp(part.positions, axis=0).max() for part in clip.rig.parts]
    size = [np.ptp(at, axis=0).max() for at in placed]
    hidden = [n for n in range(len(shapes)) if size[n] <= _NOTHING * modelled[n]]
    if not hidden:
        return shapes
    ends = np.cumsum([len(part.positions) for part in clip.rig.parts])[:-1]
    times = np.unique(np.concatenate([channel.times for channel in clip.channels]))
    for time_s in times[np.unique(np.linspace(0, len(times) - 1, _MOST_KEYS).astype(int))]:
        for number, at in enumerate(np.split(clip.positions(float(time_s)), ends)):
            length = np.ptp(at, axis=0).max()
            if number in hidden and size[number] < length < np.inf:
                shapes[number], size[number] = at, length
    return shapes


def first_of_equal(rig: Rig) -> Array:
    """For each vertex, return the index of the first vertex of its node with the same modelled position: int (V,).

    Vertices that coincide in the modelled shape then stay together when it moves: rounding cannot open a seam.
    """
    nodes = np.repeat([part.node for part in rig.parts], [len(part.positions) for part in rig.parts])
    modelled = np.concatenate([part.positions for part in rig.parts]).astype(np.float32)
    first = np.arange(len(nodes))
    for node in np.unique(nodes):
        own = np.flatnonzero(nodes == node)
        welded = weld(modelled[own])[1]
        first[own] = own[np.unique(welded, return_index=True)[1][welded]]
    return first
