"""The export of a scene to Mitsuba 3: what Mitsuba can represent, and the files."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, Note
from wgsss.folders import atomic_folder, created_folder
from wgsss.reference.mitsuba_grids import VOXELS, box, has_grids, write_grids
from wgsss.reference.mitsuba_xml import SMOOTH, environment_file, environments, scene_xml
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    Mesh,
    Object,
    PointLight,
    RectLight,
    Scene,
    SphereLight,
    checks,
)

Array = npt.NDArray[Any]

_THICKEST = 80.0  # largest sigma_t times size of a grid of which Mitsuba traces paths quickly


def export(scene: Scene, folder: str | Path, size: tuple[int, int]) -> list[Path]:
    """Write `scene` as posed to `folder`, so that `mitsuba FOLDER/scene.xml` renders it. All files appear at once.

    One warning names everything that Mitsuba renders differently. The integrator is `volpathmis`, whose paths serve the
    three channels of a medium at the same time.

    Args:
        size: (width, height) in pixels.

    Raises:
        InputError: if Mitsuba cannot represent the scene (`check`), or if the folder cannot be written.
    """
    notes = check(scene)
    if any(thing.material.base_color != (1.0, 1.0, 1.0) for thing in scene.objects):
        notes.append("base colours are ignored")
    if len(scene.lights) > 1 and any(isinstance(light, RectLight | SphereLight) for light in scene.lights):
        notes.append("area and sphere lights hide objects and lights behind them")
    checks.image_size(size)
    folder = Path(folder)
    with created_folder(folder.parent), atomic_folder(folder) as place:
        files = [place / "scene.xml", *write_meshes(scene, place), *write_media(scene, place)]
        files += write_environment(scene, place)
        files[0].write_text(scene_xml(scene, size), encoding="utf-8")
    written = [folder / file.name for file in files]
    if notes:
        warnings.warn(f"{scene.name}: Mitsuba renders this scene differently: {'; '.join(notes)}", Note, stacklevel=2)
    return written


def check(scene: Scene) -> list[str]:
    """Return texts that say what Mitsuba renders differently.

    Raises InputError if Mitsuba cannot represent the scene: a material of which only the profile is known, a mesh with
    holes, a smooth boundary under a directional or point light, two environment images.
    """
    notes: dict[str, None] = {}
    sizeless = [light for light in scene.lights if isinstance(light, DirectionalLight | PointLight)]
    for number, thing in enumerate(scene.objects, start=1):
        material, where = thing.material, f"{scene.name}: object {number} ({thing.mesh.name})"
        if material.stack is None:
            defined_by = "gaussians" if material.gaussians is not None else "table"
            raise InputError(f"{where}: a volume needs coefficients or layers, not {defined_by} ('{material.name}')")
        if material.eta > 1 and material.roughness <= SMOOTH and sizeless:
            raise InputError(
                f"{where}: no path through the smooth boundary of '{material.name}' can hit a directional or"
                f" point light; use a light with a size, or a roughness above {SMOOTH:g}"
            )
        if not _closed(thing.mesh):
            raise InputError(f"{where}: the mesh has holes, so that it encloses no volume for a medium")
        if has_grids(material) and _thickness(thing) > _THICKEST:
            notes[f"the optical thickness of a layered medium is above {_THICKEST:g}, which makes paths slow"] = None
        if material.maps.base_color is not None:
            notes["base colour textures are ignored"] = None
        if material.maps.normal is not None:
            notes["normal maps are ignored"] = None
        if material.eta > 1 and material.roughness > SMOOTH:
            notes["a rough boundary loses light that is reflected by several facets"] = None
            if sizeless:
                notes["paths through a rough boundary rarely hit directional and point lights: it takes thousands"] = (
                    None
                )
        if material.eta > 1 and (material.specular < 1 or material.maps.specular is not None):
            notes["boundaries ignore the specular factor"] = None
    if len([light for light in scene.lights if isinstance(light, EnvironmentLight) and light.file]) > 1:
        raise InputError(f"{scene.name}: Mitsuba supports one environment image, not several")
    if len(scene.objects) > 1 or not _convex(scene.objects[0].mesh):
        notes["light also travels from part to part through the air"] = None
    return list(notes)


def write_environment(scene: Scene, folder: Path, channel: int | None = None) -> list[Path]:
    """Write the image of the environment, if there is one, with all channels or with one. Returns the files."""
    constant, image = environments(scene)
    if image is None:
        return []
    import OpenEXR

    pixels = image.pixels() + np.sum([e.radiance for e in constant], axis=0, dtype=np.float32)
    if channel is not None:
        pixels = np.repeat(pixels[..., channel : channel + 1], 3, axis=2)
    path = folder / environment_file(channel)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels, np.float32)}).write(str(path))
    return [path]


def write_media(scene: Scene, folder: Path, channel: int | None = None, voxels: int = VOXELS) -> list[Path]:
    """Write the grids of the layered media, with all channels or with one. Returns the files."""
    written = []
    for number, thing in enumerate(scene.objects, start=1):
        if has_grids(thing.material):
            written += write_grids(number, thing, folder, channel, voxels)
    return written


def write_meshes(scene: Scene, folder: Path) -> list[Path]:
    """Write the mesh of each object in world space, with shading normals, as binary `<number>.ply`."""
    written = []
    for number, thing in enumerate(scene.objects, start=1):
        mesh, turn = thing.mesh, thing.matrix[:3, :3]
        if mesh.corner_normals is None:
            positions, normals, faces = thing.placed, mesh.normals, mesh.faces
        else:
            positions, normals = thing.placed[mesh.faces.ravel()], mesh.corner_normals.reshape(-1, 3)
            faces = np.arange(len(positions)).reshape(-1, 3)
        path = folder / f"{number}.ply"
        path.write_bytes(_ply(positions, normals @ turn.T, faces))
        written.append(path)
    return written


def _ply(positions: Array, normals: Array, faces: Array) -> bytes:
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\n{names}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    corners = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", (3,))]))
    corners["count"], corners["corners"] = 3, faces
    return header.encode() + np.hstack([positions, normals]).astype("<f4").tobytes() + corners.tobytes()


def _thickness(thing: Object) -> float:
    """Return the largest sigma_t of the layers of an object times its size."""
    densest = max(float(np.max(layer.sigma_s + layer.sigma_a)) for layer in thing.material.stack or ())
    return densest * float(box(thing)[1].max())


def _closed(mesh: Mesh) -> bool:
    """Whether the faces use every edge equally often in both directions."""
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    there = np.sort(edges[:, 0] * len(mesh.positions) + edges[:, 1])
    back = np.sort(edges[:, 1] * len(mesh.positions) + edges[:, 0])
    return bool(np.array_equal(there, back))


def _convex(mesh: Mesh) -> bool:
    """Whether a mesh fills its convex hull, up to the error of flat triangles."""
    from scipy.spatial import ConvexHull, QhullError

    corners = mesh.positions.astype(np.float64)[mesh.faces]
    volume = np.linalg.det(corners).sum() / 6
    try:
        return bool(volume > 0.995 * ConvexHull(mesh.positions.astype(np.float64)).volume)
    except QhullError:  # flat
        return True
