"""Animations of glTF files as motions: skins, morph targets and moving nodes."""

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
_NOTHING = 1e-6  # share of its modelled size up to which a part is scaled to nothing
_MOST_KEYS = 64  # at which a part is looked for that is hidden at rest


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation as a file has it, of all its parts or of some."""

    name: str
    rig: Rig
    channels: tuple[Channel, ...]
    """those that move the rig's vertices, at least one"""
    duration_s: float
    """seconds from time 0 to the animation's last key, whatever that moves: all parts begin anew together"""

    def of(self, rig: Rig) -> Clip | None:
        """The same for some of the parts; None where they do not move."""
        movers, morphed = rig.movers(), {part.node for part in rig.parts}
        used = tuple(c for c in self.channels if c.node in (morphed if c.path == "weights" else movers))
        return replace(self, rig=rig, channels=used) if used else None

    def positions(self, time_s: float) -> Array:
        """float64 (V, 3): all vertices of the rig, in the file's unit, at a time from 0 to the last key."""
        pose = self.rig.nodes.rest.copy()
        for channel in self.channels:
            channel.put(pose, time_s)
        return self.rig.positions(pose)


@dataclass(frozen=True, eq=False)
class Animation:
    """The motion of a mesh by a clip, over and over.

    It knows where the V vertices are at any time, and uses nothing of the positions at rest but their number.
    """

    clip: Clip
    vertices: Blend
    """where each of the V is among the clip's vertices"""
    mm_per_unit: float
    centre: Array
    """float64 (3,), mm: the mesh's origin, in the file's space"""

    @property
    def period_s(self) -> float:
        """Seconds from time 0 to the clip's last key."""
        return self.clip.duration_s

    def apply(self, positions: npt.ArrayLike, time_s: float) -> npt.NDArray[np.float32]:
        """Positions (V, 3), mm, at a time in seconds. Raises InputError for other positions than (V, 3)."""
        count = len(self.vertices.index)
        if np.shape(positions) != (count, 3):
            raise InputError(f"animation {self.clip.name}: it moves {count} vertices, and no others")
        moved = self.vertices.of(self.clip.positions(time_s % self.period_s if self.period_s else 0.0))
        with np.errstate(over="ignore"):  # beyond what float32 holds: the mesh refuses it
            return (moved * self.mm_per_unit - self.centre).astype(np.float32)


def choose_clip(contents: Contents, name: str | None, say: Callable[[str], None]) -> Clip | None:
    """One of a file's animations, with those of its channels that move vertices; None where nothing moves.

    `name` is the animation's, or its number from 0; None stands for the first one, and NONE for none. What does not
    play, though nobody chose, is said, and how many channels move nothing.
    Raises InputError where there is no such animation.
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
    found = whole.of(contents.rig)
    idle = len(channels) - (0 if found is None else len(found.channels))
    if idle:
        say(f"animation {name}: {counted(idle, 'channel')} {'moves' if idle == 1 else 'move'} nothing that is drawn")
    return found


def unfolded(placed: Sequence[Array], clip: Clip) -> list[Array]:
    """Positions (V, 3) of each part at rest; where it is scaled to nothing then, those at the key of its largest size:
    they show which of its faces meet."""
    found = list(placed)
    modelled = [np.ptp(part.positions, axis=0).max() for part in clip.rig.parts]
    size = [np.ptp(at, axis=0).max() for at in placed]
    hidden = [n for n in range(len(found)) if size[n] <= _NOTHING * modelled[n]]
    if not hidden:
        return found
    ends = np.cumsum([len(part.positions) for part in clip.rig.parts])[:-1]
    times = np.unique(np.concatenate([channel.times for channel in clip.channels]))
    for time_s in times[np.unique(np.linspace(0, len(times) - 1, _MOST_KEYS).astype(int))]:
        for number, at in enumerate(np.split(clip.positions(float(time_s)), ends)):
            length = np.ptp(at, axis=0).max()
            if number in hidden and size[number] < length < np.inf:
                found[number], size[number] = at, length
    return found


def first_of_equal(rig: Rig) -> Array:
    """int (V,): for each vertex the first one of its node that is at the same place.

    What is one point of the surface where it was modelled stays one: neither rounding nor weights open a seam.
    """
    nodes = np.repeat([part.node for part in rig.parts], [len(part.positions) for part in rig.parts])
    modelled = np.concatenate([part.positions for part in rig.parts]).astype(np.float32)
    first = np.arange(len(nodes))
    for node in np.unique(nodes):
        own = np.flatnonzero(nodes == node)
        welded = weld(modelled[own])[1]
        first[own] = own[np.unique(welded, return_index=True)[1][welded]]
    return first
