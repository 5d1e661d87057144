"""Mesh files as bodies: parts of one look joined, cut by their mask, scaled, welded and repaired."""

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
from wgsss.scene.surface import device_vertices, surface
from wgsss.scene.textures import TextureReader, coordinates, first_texture, shared, usable_look

Array = npt.NDArray[Any]

MOST_VERTICES = 2_796_202
"""What a storage binding of 128 MiB, WebGPU's default limit, holds of the 48 bytes of a vertex."""


@dataclass(frozen=True, eq=False)
class LoadedMesh:
    """One body of a mesh file: a surface, its textures, how it moves, and what the file says of its material."""

    mesh: Mesh
    maps: Maps = field(default_factory=Maps)
    motion: Animation | None = None
    look: Look = field(default_factory=Look)
    """as the file has it"""
    mm_per_unit: float = 1.0
    """millimetres per unit of the file's lengths, as it was scaled"""
    translate: Triple = (0.0, 0.0, 0.0)
    """where the mesh's origin lies in the file's space, mm: not zero only for what is far from the file's origin"""


@dataclass(frozen=True, eq=False)
class LoadedFile:
    """All bodies of a mesh file, and its own lights and cameras."""

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

    Where its materials differ, only what they share is kept; a warning says what is not.
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
    """Read a .ply, .obj, .stl, .off, .glb or .gltf file: one body for each look that its materials have.

    `mm_per_unit` is the length of the file's unit; without it, 1000 for glTF, whose unit is the metre, and 1 for the
    others. `size_mm` scales the longest side of the bounding box, at rest, to a length, whatever the unit. `animation`
    is the name of the glTF animation that becomes the motion, or its number: without it the first one, and none where
    it is "none". `simplify` is the greatest number of faces of a body: one with more is simplified, and loses texture
    coordinates, normals, vertex colours and motion.

    Normals are kept where they are not smooth. Degenerate and duplicate faces and unused vertices are dropped, faces
    wound inwards turned over and holes counted, in one warning for each body. What the file has and wgsss does not use
    is a warning each.

    Raises InputError, naming the file, where it is missing, not what its extension says, empty, without an area, larger
    than the device can hold, or holds positions that are not finite, for a skin, morph targets or an animation that do
    not fit it, and for a scale that is not positive.
    """
    file = _File(Path(path), mm_per_unit, size_mm, animation, simplify)
    looks = [usable_look(part, file.say) for part in file.contents.parts]
    alike: dict[Any, list[int]] = {}
    for number, (part, look) in enumerate(zip(file.contents.parts, looks, strict=True)):
        alike.setdefault((replace(look, name=""), coordinates(part, look) is None), []).append(number)
    groups = [(looks[numbers[0]], near) for numbers in alike.values() for near in file.near_each_other(numbers)]
    return LoadedFile(file.bodies(groups), file.contents.lights, file.contents.cameras)


class _File:
    """A file that was read, on its way to bodies."""

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
        """Warn of something, once."""
        if note not in self._said:
            self._said.add(note)
            warnings.warn(f"{self.path.name}: {note}", Note, stacklevel=2)

    def near_each_other(self, numbers: list[int]) -> list[list[int]]:
        """Parts by number, in groups that can each be one body: what is very far apart cannot."""
        label = clusters(self._boxes[numbers])
        return [np.asarray(numbers)[label == one].tolist() for one in np.unique(label)]

    def bodies(self, groups: Sequence[tuple[Look, list[int]]]) -> tuple[LoadedMesh, ...]:
        """A body for each look and the numbers of the parts that have it."""
        found, why = [], "all faces are degenerate"
        for look, numbers in groups:
            name = look.name if len(groups) > 1 else ""
            soup, rig = self._soup(look, numbers)
            mask = self._textures.mask(look)
            if mask is not None:
                soup = soup.cut(mask)
            if not len(soup.faces):
                self.say(f"{_named(name)}nothing is drawn where alpha is below {look.cutoff:g}, which is everywhere")
                why = "its alpha mask leaves nothing"
                continue
            body = self._body(look, name, soup, rig, self._splits(numbers))
            if body is not None:
                found.append(body)
            elif len(groups) > 1:
                self.say(f"{_named(name)}left out: it has no area")
        if not found:
            count = sum(len(part.faces) for part in self.contents.parts)
            why = f"all {count} faces are degenerate" if why.startswith("all") else why
            raise InputError(f"{self.path}: the mesh has no area: {why}")
        return tuple(found)

    def _soup(self, look: Look, numbers: Sequence[int]) -> tuple[Soup, Rig | None]:
        contents = self.contents
        rig = None if contents.rig is None else contents.rig.of(numbers)
        parts = [contents.parts[number] for number in numbers]
        soup = joined(parts, [self._placed[number] for number in numbers], look, rig, self.say)
        if rig is not None:
            soup = replace(soup, positions=soup.positions[first_of_equal(rig)])
        return soup, rig

    def _splits(self, numbers: Sequence[int]) -> bool:
        """Whether vertices may be repeated for a reason: seams, hard edges, several parts, a format without indices."""
        parts = [self.contents.parts[number] for number in numbers]
        return self.contents.splits or len(parts) > 1 or any(part.uvs or part.normals is not None for part in parts)

    def _body(self, look: Look, name: str, soup: Soup, rig: Rig | None, splits: bool) -> LoadedMesh | None:
        """A soup as a mesh with its textures and its motion; None where no face has an area, or nothing a size."""
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

        mesh = surface(soup, fixed, f"{self.path.stem} {name}".strip())
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
