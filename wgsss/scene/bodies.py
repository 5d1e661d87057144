"""Mesh files as bodies: parts with the same material are joined, cut by their alpha mask, scaled, welded, repaired."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, Note
from wgsss.scene.animation import Animation, choose_clip, first_of_equal, unfolded
from wgsss.scene.blend import Blend
from wgsss.scene.build_mesh import build_mesh, device_vertices
from wgsss.scene.checks import Triple
from wgsss.scene.files import read_file
from wgsss.scene.files.contents import CameraView, LightSource, Look
from wgsss.scene.material import Maps
from wgsss.scene.mesh import MIN_SIZE, Mesh
from wgsss.scene.places import boxes, centred, clusters, scale
from wgsss.scene.repair import counted, repair
from wgsss.scene.rig import Rig
from wgsss.scene.simplify import simplified
from wgsss.scene.soup import Soup, joined, placed
from wgsss.scene.textures import TextureReader, coordinates, first_texture, shared, usable_look

Array = npt.NDArray[Any]

MOST_VERTICES = 2_796_202
"""Vertices of 48 bytes that fit in a storage binding of 128 MiB, the default limit of WebGPU."""


@dataclass(frozen=True, eq=False)
class LoadedMesh:
    """One body of a mesh file: a mesh, its textures, its motion and its material as the file describes it."""

    mesh: Mesh
    maps: Maps = field(default_factory=Maps)
    motion: Animation | None = None
    look: Look = field(default_factory=Look)
    """the material as the file describes it"""
    mm_per_unit: float = 1.0
    """millimetres per unit of length of the file, after scaling"""
    translate: Triple = (0.0, 0.0, 0.0)
    """mm: the origin of the mesh in the space of the file; not zero only for bodies far from the origin of the file"""


@dataclass(frozen=True, eq=False)
class LoadedFile:
    """All bodies, lights and cameras of a mesh file."""

    bodies: tuple[LoadedMesh, ...]
    lights: tuple[LightSource, ...]
    cameras: tuple[CameraView, ...]


def load_mesh(
    path: str | Path,
    *,
    mm_per_unit: float | None = None,
    size_mm: float | None = None,
    animation: str | None = None,
    simplify: int | None = None,
) -> LoadedMesh:
    """Read a mesh file as one body. Arguments, warnings and errors are those of `load_file`.

    Where its materials differ, only their common properties are kept. A warning lists the others.
    """
    file = _File(Path(path), mm_per_unit, size_mm, animation, simplify)
    looks = [usable_look(part, file.say) for part in file.contents.parts]
    return file.bodies([(shared(looks, file.say), list(range(len(looks))))])[0]


def load_file(
    path: str | Path,
    *,
    mm_per_unit: float | None = None,
    size_mm: float | None = None,
    animation: str | None = None,
    simplify: int | None = None,
) -> LoadedFile:
    """Read a .ply, .obj, .stl, .off, .glb or .gltf file: one body for each different material.

    Args:
        mm_per_unit: millimetres per unit of length of the file; by default 1000 for glTF, whose unit is the metre, and
            1 for the other formats.
        size_mm: length of the longest side of the bounding box at rest, mm, whatever the unit.
        animation: name or number of the glTF animation to play, by default the first; "none" plays none.
        simplify: largest number of faces of a body. A body with more is simplified, and loses its texture coordinates,
            normals, vertex colours and motion.

    Normals of the file are kept if they differ from smooth ones. Degenerate faces, duplicate faces and unused vertices
    are dropped, faces wound inwards are flipped, and holes are counted: one warning for each body lists all of that.
    Each thing in the file that wgsss does not use is one warning.

    Raises InputError, naming the file: if it is missing, empty, of another format than its extension says, without an
    area, or larger than the device can hold; if a position is not finite; if a skin, morph target or animation does not
    fit the mesh; and if a scale is not positive.
    """
    file = _File(Path(path), mm_per_unit, size_mm, animation, simplify)
    looks = [usable_look(part, file.say) for part in file.contents.parts]
    alike: dict[Any, list[int]] = {}
    for number, (part, look) in enumerate(zip(file.contents.parts, looks, strict=True)):
        alike.setdefault((replace(look, name=""), coordinates(part, look) is None), []).append(number)
    groups = [(looks[numbers[0]], near) for numbers in alike.values() for near in file.near_each_other(numbers)]
    return LoadedFile(file.bodies(groups), file.contents.lights, file.contents.cameras)


class _File:
    """Turns the contents of a mesh file into bodies."""

    def __init__(
        self,
        path: Path,
        mm_per_unit: float | None,
        size_mm: float | None,
        animation: str | None,
        simplify: int | None,
    ) -> None:
        for name, value in (("mm_per_unit", mm_per_unit), ("size_mm", size_mm)):
            if value is not None and not (_is_number(value) and 0 < value < math.inf):
                raise InputError(f"{path}: {name} must be a number above 0, not {value!r}")
        if simplify is not None and not (_is_number(simplify) and int(simplify) == simplify and simplify >= 4):
            raise InputError(f"{path}: simplify must be a whole number of faces from 4 up, not {simplify!r}")
        self.path, self.simplify = path, simplify
        self._said: set[str] = set()
        self.contents = read_file(path)
        try:
            self._clip = choose_clip(self.contents, animation, self.say)
            self._placed = placed(self.contents.parts, self.contents.rig)
        except InputError as error:
            raise error if str(error).startswith(str(path)) else InputError(f"{path}: {error}") from None
        bad = sum(int((~np.isfinite(positions)).any(axis=1).sum()) for positions in self._placed)
        if bad:
            raise InputError(f"{path}: {bad} of {sum(map(len, self._placed))} positions are not finite numbers")
        if self._clip is not None:
            self._placed = unfolded(self._placed, self._clip)
        self._boxes = boxes(self.contents.parts, self._placed)
        self.scale = scale(path, self._boxes, mm_per_unit or self.contents.mm_per_unit, size_mm)
        self._textures = TextureReader(self.say)
        for note in self.contents.notes:
            self.say(note)

    def say(self, note: str) -> None:
        """Warn with a note, unless the same note was given before."""
        if note not in self._said:
            self._said.add(note)
            warnings.warn(f"{self.path.name}: {note}", Note, stacklevel=2)

    def near_each_other(self, numbers: list[int]) -> list[list[int]]:
        """Group parts, by number, so that the parts of a group are near enough to each other for one body."""
        label = clusters(self._boxes[numbers])
        return [np.asarray(numbers)[label == one].tolist() for one in np.unique(label)]

    def bodies(self, groups: Sequence[tuple[Look, list[int]]]) -> tuple[LoadedMesh, ...]:
        """Build a body for each pair of a material and the numbers of the parts that have it."""
        usable, reason = [], "all faces are degenerate"
        for look, numbers in groups:
            name = look.name if len(groups) > 1 else ""
            soup, rig = self._soup(look, numbers)
            mask = self._textures.mask(look)
            if mask is not None:
                soup = soup.cut(mask)
            if not len(soup.faces):
                self.say(f"{_named(name)}nothing is drawn where alpha is below {look.cutoff:g}, which is everywhere")
                reason = "its alpha mask leaves nothing"
                continue
            body = self._body(look, name, soup, rig, self._splits(numbers))
            if body is not None:
                usable.append(body)
            elif len(groups) > 1:
                self.say(f"{_named(name)}left out: it has no area")
        if not usable:
            count = sum(len(part.faces) for part in self.contents.parts)
            reason = f"all {count} faces are degenerate" if reason.startswith("all") else reason
            raise InputError(f"{self.path}: the mesh has no area: {reason}")
        return tuple(usable)

    def _soup(self, look: Look, numbers: Sequence[int]) -> tuple[Soup, Rig | None]:
        contents = self.contents
        rig = None if contents.rig is None else contents.rig.of(numbers)
        parts = [contents.parts[number] for number in numbers]
        soup = joined(parts, [self._placed[number] for number in numbers], look, rig, self.say)
        if rig is not None:
            soup = replace(soup, positions=soup.positions[first_of_equal(rig)])
        return soup, rig

    def _splits(self, numbers: Sequence[int]) -> bool:
        """Whether duplicate vertices are expected: at seams, hard edges or part borders, or without an index list."""
        parts = [self.contents.parts[number] for number in numbers]
        return self.contents.splits or len(parts) > 1 or any(part.uvs or part.normals is not None for part in parts)

    def _body(self, look: Look, name: str, soup: Soup, rig: Rig | None, splits: bool) -> LoadedMesh | None:
        """Build the body of a soup. Returns None if no face has an area, or if the mesh is smaller than MIN_SIZE."""
        centre, positions = centred(soup.positions * self.scale, soup.faces)
        faces, notes = soup.faces, []
        clip = None if self._clip is None or rig is None else self._clip.of(rig)
        if self.simplify is not None and len(faces) > self.simplify:
            positions, faces = simplified(positions, faces, self.simplify)
            lost = {
                "textures": soup.uvs is not None and first_texture(look) is not None,
                "texture coordinates": soup.uvs is not None,
                "normals": soup.normals is not None,
                "vertex colours": soup.colors is not None,
                "motion": clip is not None,
            }
            without = ", ".join(what for what, had in lost.items() if had)
            notes.append(f"simplified to {len(faces)} of {len(soup.faces)} faces{without and f', without {without}'}")
            soup, clip = Soup(positions, faces, None, None, None), None
        self._check_count(len(faces), len(faces) // 2)
        fixed = repair(positions, faces)
        if not len(fixed.faces) or np.ptp(fixed.positions, axis=0).max() < MIN_SIZE:
            return None
        if fixed.welded and not splits:
            notes.append(f"{counted(fixed.welded, 'duplicate vertex')} welded")
        notes += fixed.notes
        if notes:
            self.say(f"{_named(name)}{'; '.join(notes)}")

        mesh = build_mesh(soup, fixed, f"{self.path.stem} {name}".strip())
        if 3 * len(faces) > MOST_VERTICES:  # as it may be where all corners differ
            self._check_count(len(faces), device_vertices(mesh))
        motion = None
        if clip is not None:
            sources, first = fixed.sources(faces), first_of_equal(clip.rig)
            where = Blend.same(sources) if soup.sources is None else soup.sources.at(sources)
            motion = Animation(clip, Blend(first[where.index], where.weight), self.scale, centre)
        maps = self._textures.maps(look)
        if mesh.corner_uvs is None:
            maps = replace(maps, base_color=None, normal=None, specular=None)
        return LoadedMesh(mesh, maps, motion, look, self.scale, tuple(centre.tolist()))

    def _check_count(self, faces: int, vertices: int) -> None:
        if vertices > MOST_VERTICES:
            raise InputError(
                f"{self.path}: {counted(faces, 'face')} are more than the device can hold:"
                f" reduce them with --simplify {min(MOST_VERTICES, faces // 2)}"
            )


def _named(name: str) -> str:
    return f"{name}: " if name else ""


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
