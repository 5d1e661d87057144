"""Animations of glTF files as motions: skins, morph targets and moving nodes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, unknown
from wgsss.scene.gltf import Document, damaged, may_move, read_document
from wgsss.scene.keyframes import Channel, read_channels
from wgsss.scene.meshfile import Triangles
from wgsss.scene.repair import counted, weld
from wgsss.scene.rig import Rig
from wgsss.scene.rigfile import read_rig

Array = npt.NDArray[Any]

NONE = "none"  # in place of an animation's name


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation as a file has it."""

    name: str
    rig: Rig
    channels: tuple[Channel, ...]
    """at least one"""
    first: Array
    """int (V,): for each vertex the first one at the same place of the mesh as it was modelled"""

    def positions(self, time_s: float) -> Array:
        """float64 (V, 3): all vertices of the file, in its units, at a time from 0 to the last key."""
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
    vertices: Array
    """int (V,): which of the clip's vertices each one is"""
    mm_per_unit: float

    @property
    def period_s(self) -> float:
        """Seconds from time 0 to the clip's last key."""
        return max(float(channel.times[-1]) for channel in self.clip.channels)

    def apply(self, positions: npt.ArrayLike, time_s: float) -> npt.NDArray[np.float32]:
        """Positions (V, 3), mm, at a time in seconds. Raises InputError for other positions than (V, 3)."""
        if np.shape(positions) != (len(self.vertices), 3):
            raise InputError(f"animation {self.clip.name}: it moves {len(self.vertices)} vertices, and no others")
        moved = self.clip.positions(time_s % self.period_s if self.period_s else 0.0)[self.vertices]
        with np.errstate(over="ignore"):  # beyond what float32 holds: the mesh refuses it
            return (moved * self.mm_per_unit).astype(np.float32)


def animate(path: Path, file: Triangles, name: str | None) -> tuple[Triangles, Clip | None]:
    """The triangles of a mesh file as its skins and morph targets have them at rest, and one of its animations.

    `name` is the animation's, or its number from 0 where it has none; None stands for the first one, NONE for none.
    Raises InputError, naming the file, where there is no such animation, and for skins, morph targets or key frames
    that do not fit together.
    """
    if not may_move(path):
        if name not in (None, NONE):
            raise InputError(f"{path}: it has no animations, so none named '{name}'")
        return file, None
    with damaged(path):
        document = read_document(path)
        rig, bare = read_rig(document, file.parts)
        name, channels = _choose(document, rig, name)
    first = _first_of_equal(rig)
    file = _at_rest(file, rig, first)
    if bare:
        note = f"{counted(bare, 'vertex')} without joint weights carried by the skin's first joint"
        file = replace(file, notes=(*file.notes, note))
    return file, Clip(name, rig, channels, first) if channels else None


def _choose(document: Document, rig: Rig, name: str | None) -> tuple[str, tuple[Channel, ...]]:
    """The name of an animation, and those of its channels that move vertices."""
    animations: dict[str, Any] = {}
    for number, animation in enumerate(document.tree.animations):
        animations.setdefault(animation.name or str(number), animation)
    if name == NONE or (name is None and not animations):
        return NONE, ()
    if name is None:
        name = next(iter(animations))
    if name not in animations:
        raise unknown("animation", name, [*animations, NONE])
    movers, morphed = rig.movers(), {part.node for part in rig.parts}
    channels = read_channels(document, animations[name], rig.nodes.rest, f"animation {name}")
    return name, tuple(c for c in channels if c.node in (morphed if c.path == "weights" else movers))


def _first_of_equal(rig: Rig) -> Array:
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


def _at_rest(file: Triangles, rig: Rig, first: Array) -> Triangles:
    """The triangles as skins and morph targets have them where no animation plays."""
    rest, world = rig.nodes.rest, rig.nodes.world(rig.nodes.rest)
    positions, faces = file.positions.copy(), file.faces.copy()
    normals = None if file.normals is None else file.normals.copy()
    start = 0
    for part in rig.parts:
        stop = start + len(part.positions)
        if part.skin is not None or rest.weights[part.node].any():
            positions[start:stop] = part.posed(rest, world)
            if normals is not None:
                normals[start:stop] = 0
        if part.skin is not None and np.linalg.det(world[part.node][:3, :3]) < 0:
            # The mesh reader turned the faces of what its node mirrors, but that does not matter to a skin.
            own = (faces[:, 0] >= start) & (faces[:, 0] < stop)
            faces[own] = faces[own, ::-1]
        start = stop
    return replace(file, positions=positions[first], faces=faces, normals=normals)
