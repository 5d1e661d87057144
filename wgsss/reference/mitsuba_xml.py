"""The XML file of a scene for Mitsuba 3.

Lengths stay in millimetres, so that coefficients are in 1/mm. The intensity of a point light is multiplied by 10^6,
because irradiance is in W/m^2 and distances are in mm. The other radiometric quantities do not depend on the unit of
length.

A homogeneous medium scatters isotropically with its reduced coefficients. Layers are grids (`mitsuba_grids`). The
boundary of a medium is

- none if eta is 1: light enters and leaves without reflection;
- otherwise a GGX dielectric of alpha = roughness^2, the surface that our specular lobe and rho_dt assume;
- a smooth dielectric at the smallest roughness, for which the specular lobe is narrower than a pixel.

The camera does not see lights of finite size. When `volpath` renders one channel, such lights let other light through,
as in our renderer. `volpathmis`, which renders all three channels, would count the light behind them twice, so that
there they are black.
"""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree

import numpy as np

from wgsss.reference.mitsuba_grids import box, cosines, grid_file, has_grids
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    Material,
    Object,
    OrthographicCamera,
    PointLight,
    RectLight,
    Scene,
    SphereLight,
)
from wgsss.scene.light import Light

Element = ElementTree.Element

SMOOTH = 0.02  # largest roughness of a boundary that counts as smooth
CHANNELS = ("red", "green", "blue")
_MM2_PER_M2 = 1e6
_STEPS = (16, 4096)  # smallest and largest number of scattering events before Russian roulette


def scene_xml(
    scene: Scene, size: tuple[int, int], channel: int | None = None, scatters: bool = True, bounces: int = 0
) -> str:
    """Return the XML of a scene. Its meshes, its grids and its environment are files beside it.

    With a `channel`, all three channels of the rendering are this one. If `scatters` is false, the media absorb all the
    light that they would scatter. `bounces`: largest number of scattering events and refractions of a path, 0 for all.
    """
    root = ElementTree.Element("scene", version="3.0.0")
    several = "volpathmis" if channel is None else "volpath"
    _plugin(
        root,
        "integrator",
        several,
        max_depth=bounces + 1 if bounces else -1,
        rr_depth=_steps(scene),
        hide_emitters=True,
    )
    ElementTree.SubElement(root, "default", name="spp", value="256")
    root.append(_camera(scene, size))
    for number, thing in enumerate(scene.objects, start=1):
        shape = _plugin(root, "shape", "ply", filename=f"{number}.ply")
        shape.append(_boundary(thing.material))
        if has_grids(thing.material):
            shape.append(_grid_medium(number, thing, channel, scatters))
        else:
            shape.append(_medium(thing.material, channel, scatters))
    for light in scene.lights:
        if not isinstance(light, EnvironmentLight):
            _add_light(root, light, channel)
    _add_environment(root, scene, channel)
    ElementTree.indent(root, "    ")
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _plugin(parent: Element | None, tag: str, kind: str, name: str | None = None, **values: Any) -> Element:
    """Append an element with values of plain types to its parent, if it has one, and return the element."""
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
    """Return the number of scattering events before Russian roulette: those that leave 1 % of the light of a path.

    Earlier roulette would add noise.
    """
    albedo = max(float(np.max(layer.albedo)) for thing in scene.objects for layer in thing.material.stack or ())
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
    back = max(0.0, extent - float(depths.min())) if parallel else 0.0  # parallel rays may start inside the scene
    eye = eye - back * (target - eye) / np.linalg.norm(target - eye)
    far = float(depths.max()) + back + extent
    near = 1e-4 * far
    kind = "orthographic" if parallel else "perspective"
    sensor = _plugin(None, "sensor", kind, near_clip=near, far_clip=far)
    to_world = ElementTree.Element("transform", name="to_world")
    if isinstance(camera, OrthographicCamera):  # the width of its image spans -1 to 1
        half = _number(camera.height * size[0] / size[1] / 2)
        ElementTree.SubElement(to_world, "scale", x=half, y=half)
    else:
        ElementTree.SubElement(sensor, "float", name="fov", value=_number(camera.fov))
        ElementTree.SubElement(sensor, "string", name="fov_axis", value="y")
    sensor.append(to_world)
    ElementTree.SubElement(to_world, "lookat", origin=_numbers(eye), target=_numbers(target), up=_numbers(camera.up))
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
    scale = float(sigma_t.max())  # Mitsuba limits the colours of media to 0 to 1
    element = _plugin(None, "medium", "homogeneous", name="interior", scale=scale)
    _rgb(element, "sigma_t", sigma_t / scale, None)
    _rgb(element, "albedo", layer.albedo * scatters, channel)
    _plugin(element, "phase", "isotropic")
    return element


def _grid_medium(number: int, thing: Object, channel: int | None, scatters: bool) -> Element:
    element = _plugin(None, "medium", "heterogeneous", name="interior", scale=1.0)
    element.append(_grid("sigma_t", grid_file(number, "sigma_t", channel), thing))
    if scatters:
        element.append(_grid("albedo", grid_file(number, "albedo", channel), thing))
    else:
        _rgb(element, "albedo", (0.0, 0.0, 0.0), None)
    first, *others = [_plugin(None, "phase", "hg", g=float(g)) for g in cosines(thing.material)]
    phase = first
    for n, other in enumerate(others, start=1):
        blend = ElementTree.Element("phase", type="blendphase")
        blend.append(_grid("weight", grid_file(number, f"weight.{n}", channel), thing))
        blend.extend([phase, other])
        phase = blend
    element.append(phase)
    return element


def _grid(name: str, file: str, thing: Object) -> Element:
    element = _plugin(None, "volume", "gridvolume", name, filename=file, raw=True, filter_type="nearest")
    low, size = box(thing)
    to_world = ElementTree.SubElement(element, "transform", name="to_world")
    for kind, values in (("scale", size), ("translate", low)):
        ElementTree.SubElement(to_world, kind, {axis: _number(v) for axis, v in zip("xyz", values, strict=True)})
    return element


def _add_light(root: Element, light: Light, channel: int | None) -> None:
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
        to_world = ElementTree.SubElement(shape, "transform", name="to_world")
        if isinstance(light, RectLight):
            half = {"x": _number(light.width / 2), "y": _number(light.height / 2)}
            ahead = np.add(light.position, np.asarray(light.direction) / np.linalg.norm(light.direction))
            ElementTree.SubElement(to_world, "scale", half)
            look = {"origin": _numbers(light.position), "target": _numbers(ahead), "up": _numbers(light.up)}
            ElementTree.SubElement(to_world, "lookat", look)
        else:
            assert isinstance(light, SphereLight)
            ElementTree.SubElement(to_world, "scale", value=_number(light.radius))
            ElementTree.SubElement(to_world, "translate", value=_numbers(light.position))
        if channel is None:
            _rgb(_plugin(shape, "bsdf", "diffuse"), "reflectance", (0.0, 0.0, 0.0), None)
        else:
            _plugin(shape, "bsdf", "null")
        _rgb(_plugin(shape, "emitter", "area"), "radiance", light.radiance, channel)


def _add_environment(root: Element, scene: Scene, channel: int | None) -> None:
    """Add the sum of all environments as one, because Mitsuba supports one."""
    constant, image = environments(scene)
    if image is not None:
        emitter = _plugin(root, "emitter", "envmap", filename=environment_file(channel))
        to_world = ElementTree.SubElement(emitter, "transform", name="to_world")
        # The centre of Mitsuba's image is in the direction +z, the centre of ours in -z.
        ElementTree.SubElement(to_world, "rotate", y="1", angle=_number((180 + image.rotation) % 360))
    elif constant:
        total = np.sum([e.radiance for e in constant], axis=0)
        _rgb(_plugin(root, "emitter", "constant"), "radiance", total, channel)


def environments(scene: Scene) -> tuple[list[EnvironmentLight], EnvironmentLight | None]:
    """Return the environments without an image, and the one with an image."""
    skies = [light for light in scene.lights if isinstance(light, EnvironmentLight)]
    return [sky for sky in skies if sky.file is None], next((sky for sky in skies if sky.file is not None), None)


def environment_file(channel: int | None) -> str:
    """Return the file name of the environment's image, with all channels or with one."""
    return "environment.exr" if channel is None else f"environment.{CHANNELS[channel]}.exr"
