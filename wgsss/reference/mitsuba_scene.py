"""A scene as Mitsuba 3 reads it: an XML file, with meshes and the environment beside it.

Lengths stay millimetres, so coefficients are 1/mm and the intensity of a point light, whose metres they are not, is
multiplied by 10^6. All else is radiometry that a unit of length does not touch.

A medium scatters with its reduced coefficients and alike in all directions. Its boundary is

- none where eta is 1: light enters and leaves as if nothing were there;
- a GGX dielectric of alpha = roughness^2, the surface that our specular lobe and rho_dt are the reflection of;
- a smooth dielectric at the least roughness there is, where that lobe is narrower than a pixel.

Lights of a finite size are not seen. As here, they let other light through where `volpath` renders one channel;
`volpathmis`, which renders all three, would count twice what a path meets behind them, so that there they are black.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    Material,
    Mesh,
    OrthographicCamera,
    PointLight,
    RectLight,
    Scene,
    SphereLight,
)

Array = npt.NDArray[Any]
Element = ElementTree.Element

SMOOTH = 0.02  # the roughness at which, and below which, a boundary is smooth
_MM2_PER_M2 = 1e6
_NAMES = ("red", "green", "blue")
_STEPS = (16, 4096)  # scattering events, least and most, before paths may be ended by chance


def export(scene: Scene, folder: str | Path, size: tuple[int, int]) -> list[Path]:
    """Write `scene`, as it stands, to `folder`, which is made: `mitsuba FOLDER/scene.xml` renders it as is.

    What the two renderers do not share is told in one warning. The integrator is `volpathmis`, whose paths serve the
    three channels of a medium at once.

    Args:
        size: (width, height) in pixels.

    Raises:
        InputError: for what Mitsuba cannot have (`check`), and a folder that cannot be written.
    """
    notes = check(scene)
    if any(thing.material.base_color != (1.0, 1.0, 1.0) for thing in scene.objects):
        notes.append("base colours are left out")
    if len(scene.lights) > 1 and any(isinstance(light, RectLight | SphereLight) for light in scene.lights):
        notes.append("lamps hide what is behind them")
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        written = [folder / "scene.xml", *write_meshes(scene, folder), *write_environment(scene, folder)]
        written[0].write_text(described(scene, size))
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from None
    if notes:
        warnings.warn(f"{scene.name}: Mitsuba will differ: {'; '.join(notes)}", stacklevel=2)
    return written


def check(scene: Scene) -> list[str]:
    """What Mitsuba will show otherwise than we do, in words.

    Raises InputError for what it cannot have at all: a material without coefficients, a mesh with holes, a smooth
    boundary under a light without size, two environment images.
    """
    notes: dict[str, None] = {}
    sizeless = [light for light in scene.lights if isinstance(light, DirectionalLight | PointLight)]
    for number, thing in enumerate(scene.objects, start=1):
        material, where = thing.material, f"{scene.name}: object {number} ({thing.mesh.name})"
        if material.sigma_a is None:
            given = next(n for n in ("layers", "gaussians", "table") if getattr(material, n) is not None)
            raise InputError(f"{where}: a volume needs sigma_a and sigma_s_prime, not {given} ('{material.name}')")
        if material.eta > 1 and material.roughness <= SMOOTH and sizeless:
            raise InputError(
                f"{where}: through the smooth boundary of '{material.name}' no path finds a directional or point"
                f" light; use a finite light or a roughness above {SMOOTH:g}"
            )
        if not _closed(thing.mesh):
            raise InputError(f"{where}: the mesh has holes, and so no inside to fill with a medium")
        if material.maps.base_color is not None:
            notes["base colour textures are left out"] = None
        if material.maps.normal is not None:
            notes["normal maps are left out"] = None
        if material.eta > 1 and material.roughness > SMOOTH:
            notes["a rough boundary loses what its facets reflect twice"] = None
            if sizeless:
                notes["through it, paths find directional and point lights by chance: it takes thousands"] = None
        if material.eta > 1 and (material.specular < 1 or material.maps.specular is not None):
            notes["boundaries reflect in full, whatever specular says"] = None
    if len([light for light in scene.lights if isinstance(light, EnvironmentLight) and light.file]) > 1:
        raise InputError(f"{scene.name}: Mitsuba has one environment image, not several")
    if len(scene.objects) > 1 or not _convex(scene.objects[0].mesh):
        notes["light also goes from part to part through the air"] = None
    return list(notes)


def described(scene: Scene, size: tuple[int, int], channel: int | None = None, scatters: bool = True) -> str:
    """The XML of a scene whose meshes and environment lie beside it.

    Of one `channel`, all three channels of the rendering are that one. Where nothing `scatters`, the media absorb all
    that they would scatter.
    """
    root = ElementTree.Element("scene", version="3.0.0")
    several = "volpathmis" if channel is None else "volpath"
    _plugin(root, "integrator", several, max_depth=-1, rr_depth=_steps(scene), hide_emitters=True)
    ElementTree.SubElement(root, "default", name="spp", value="256")
    root.append(_camera(scene, size))
    for number, thing in enumerate(scene.objects, start=1):
        shape = _plugin(root, "shape", "ply", filename=f"{number}.ply")
        shape.append(_boundary(thing.material))
        shape.append(_medium(thing.material, channel, scatters))
    for light in scene.lights:
        if not isinstance(light, EnvironmentLight):
            _add_light(root, light, channel)
    _add_environment(root, scene, channel)
    ElementTree.indent(root, "    ")
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _plugin(parent: Element | None, tag: str, kind: str, name: str | None = None, **values: Any) -> Element:
    """An element with its plain values."""
    element = ElementTree.Element(tag, {"type": kind, **({"name": name} if name else {})})
    for key, value in values.items():
        names = {bool: "boolean", int: "integer", float: "float", str: "string"}
        text = str(value).lower() if isinstance(value, bool) else _number(value) if type(value) is float else str(value)
        ElementTree.SubElement(element, names[type(value)], name=key, value=text)
    if parent is not None:
        parent.append(element)
    return element


def _number(value: float) -> str:
    return f"{value:.9g}"


def _numbers(values: Any) -> str:
    return ", ".join(_number(float(v)) for v in values)


def _rgb(parent: Element, name: str, values: Any, channel: int | None) -> None:
    shown = [values[channel]] * 3 if channel is not None else values
    ElementTree.SubElement(parent, "rgb", name=name, value=_numbers(shown))


def _steps(scene: Scene) -> int:
    """Scattering events after which a path carries a hundredth of its light: to end it by chance before adds noise."""
    albedo = max(float(np.max(thing.material.stack[0].albedo)) for thing in scene.objects if thing.material.stack)
    fewest, most = _STEPS
    return max(fewest, min(most, math.ceil(math.log(0.01) / math.log(albedo)))) if albedo < 1 else most


def _camera(scene: Scene, size: tuple[int, int]) -> Element:
    camera = scene.camera
    corners = np.array(np.meshgrid(*scene.bounds.T, indexing="ij")).reshape(3, -1).T
    to_view = camera.view()
    depths = -(corners @ to_view[2, :3] + to_view[2, 3])
    eye, target = np.asarray(camera.eye), np.asarray(camera.target)
    extent = max(float(np.ptp(depths)), 1e-3)
    parallel = isinstance(camera, OrthographicCamera)
    back = max(0.0, extent - float(depths.min())) if parallel else 0.0  # parallel rays may begin behind the scene
    eye = eye - back * (target - eye) / np.linalg.norm(target - eye)
    far = float(depths.max()) + back + extent
    near = 1e-4 * far
    kind = "orthographic" if parallel else "perspective"
    sensor = _plugin(None, "sensor", kind, near_clip=near, far_clip=far)
    place = ElementTree.Element("transform", name="to_world")
    if isinstance(camera, OrthographicCamera):  # its image spans -1 to 1 from side to side
        half = _number(camera.height * size[0] / size[1] / 2)
        ElementTree.SubElement(place, "scale", x=half, y=half)
    else:
        ElementTree.SubElement(sensor, "float", name="fov", value=_number(camera.fov))
        ElementTree.SubElement(sensor, "string", name="fov_axis", value="y")
    sensor.append(place)
    ElementTree.SubElement(place, "lookat", origin=_numbers(eye), target=_numbers(target), up=_numbers(camera.up))
    _plugin(sensor, "sampler", "independent")
    ElementTree.SubElement(sensor[-1], "integer", name="sample_count", value="$spp")
    film = _plugin(sensor, "film", "hdrfilm", width=size[0], height=size[1], pixel_format="rgba")
    _plugin(film, "rfilter", "box")
    return sensor


def _boundary(material: Material) -> Element:
    if material.eta == 1:
        return _plugin(None, "bsdf", "null")
    indices: dict[str, Any] = {"int_ior": material.eta, "ext_ior": 1.0}
    if material.roughness <= SMOOTH:
        return _plugin(None, "bsdf", "dielectric", **indices)
    return _plugin(None, "bsdf", "roughdielectric", distribution="ggx", alpha=material.roughness**2, **indices)


def _medium(material: Material, channel: int | None, scatters: bool) -> Element:
    assert material.stack is not None
    layer = material.stack[0]
    sigma_t = layer.sigma_t_prime if channel is None else layer.sigma_t_prime[[channel] * 3]
    scale = float(sigma_t.max())  # Mitsuba takes colours of media from 0 to 1
    element = _plugin(None, "medium", "homogeneous", name="interior", scale=scale)
    _rgb(element, "sigma_t", sigma_t / scale, None)
    _rgb(element, "albedo", layer.albedo * scatters, channel)
    _plugin(element, "phase", "isotropic")
    return element


def _add_light(root: Element, light: Any, channel: int | None) -> None:
    if isinstance(light, DirectionalLight):
        emitter = _plugin(root, "emitter", "directional")
        ElementTree.SubElement(emitter, "vector", name="direction", value=_numbers(light.direction))
        _rgb(emitter, "irradiance", light.irradiance, channel)
    elif isinstance(light, PointLight):
        emitter = _plugin(root, "emitter", "point")
        ElementTree.SubElement(emitter, "point", name="position", value=_numbers(light.position))
        _rgb(emitter, "intensity", _MM2_PER_M2 * np.asarray(light.intensity), channel)
    else:
        shape = _plugin(root, "shape", "rectangle" if isinstance(light, RectLight) else "sphere")
        place = ElementTree.SubElement(shape, "transform", name="to_world")
        if isinstance(light, RectLight):
            half = {"x": _number(light.width / 2), "y": _number(light.height / 2)}
            ahead = np.add(light.position, np.asarray(light.direction) / np.linalg.norm(light.direction))
            ElementTree.SubElement(place, "scale", half)
            look = {"origin": _numbers(light.position), "target": _numbers(ahead), "up": _numbers(light.up)}
            ElementTree.SubElement(place, "lookat", look)
        else:
            assert isinstance(light, SphereLight)
            ElementTree.SubElement(place, "scale", value=_number(light.radius))
            ElementTree.SubElement(place, "translate", value=_numbers(light.position))
        if channel is None:
            _rgb(_plugin(shape, "bsdf", "diffuse"), "reflectance", (0.0, 0.0, 0.0), None)
        else:
            _plugin(shape, "bsdf", "null")
        _rgb(_plugin(shape, "emitter", "area"), "radiance", light.radiance, channel)


def _environments(scene: Scene) -> tuple[list[EnvironmentLight], EnvironmentLight | None]:
    """Those without an image, and the one with one."""
    found = [light for light in scene.lights if isinstance(light, EnvironmentLight)]
    return [e for e in found if e.file is None], next((e for e in found if e.file is not None), None)


def _add_environment(root: Element, scene: Scene, channel: int | None) -> None:
    """All environments in one, since Mitsuba has one at most."""
    constant, image = _environments(scene)
    if image is not None:
        name = "environment.exr" if channel is None else f"environment.{_NAMES[channel]}.exr"
        emitter = _plugin(root, "emitter", "envmap", filename=name)
        place = ElementTree.SubElement(emitter, "transform", name="to_world")
        # The middle of Mitsuba's image lies along +z, that of ours along -z.
        ElementTree.SubElement(place, "rotate", y="1", angle=_number((180 + image.rotation) % 360))
    elif constant:
        total = np.sum([e.radiance for e in constant], axis=0)
        _rgb(_plugin(root, "emitter", "constant"), "radiance", total, channel)


def write_environment(scene: Scene, folder: Path, channel: int | None = None) -> list[Path]:
    """The environment's image, if there is one, of all channels or of one."""
    constant, image = _environments(scene)
    if image is None:
        return []
    import OpenEXR

    pixels = image.pixels() + np.sum([e.radiance for e in constant], axis=0, dtype=np.float32)
    if channel is not None:
        pixels = np.repeat(pixels[..., channel : channel + 1], 3, axis=2)
    path = folder / ("environment.exr" if channel is None else f"environment.{_NAMES[channel]}.exr")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels, np.float32)}).write(str(path))
    return [path]


def write_meshes(scene: Scene, folder: Path) -> list[Path]:
    """Each object's mesh, placed in the world, as `<number>.ply`: binary, with the normals that it is shaded by."""
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


def _closed(mesh: Mesh) -> bool:
    """Whether every edge is gone along as often one way as the other."""
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    there = np.sort(edges[:, 0] * len(mesh.positions) + edges[:, 1])
    back = np.sort(edges[:, 1] * len(mesh.positions) + edges[:, 0])
    return bool(np.array_equal(there, back))


def _convex(mesh: Mesh) -> bool:
    """Whether a mesh fills its convex hull, as nearly as flat triangles do."""
    from scipy.spatial import ConvexHull, QhullError

    corners = mesh.positions.astype(np.float64)[mesh.faces]
    volume = np.linalg.det(corners).sum() / 6
    try:
        return bool(volume > 0.995 * ConvexHull(mesh.positions.astype(np.float64)).volume)
    except QhullError:  # flat
        return True
