"""The methods by name. A new one is a file here, its modules in `wgsl/`, a row below and its goldens.

Any surface may be asked for with any translucency that makes sense beside it: "screen+sam" names a pair.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from wgsss.errors import InputError, unknown
from wgsss.methods.lambert import Lambert
from wgsss.methods.local_thickness import LocalThickness
from wgsss.methods.method import Diffused, Method
from wgsss.methods.pair import Pair, Translucency, pair
from wgsss.methods.point_cloud import PointCloud
from wgsss.methods.sam.method import SURFACES, Adjacency, SpatialAdjacencyMaps
from wgsss.methods.screen_space import ScreenSpace
from wgsss.methods.texture_space import TextureSpace
from wgsss.methods.translucent_shadow_maps import TranslucentShadowMaps
from wgsss.methods.transmittance import Transmittance
from wgsss.methods.visible_texture_space import VisibleTextureSpace
from wgsss.text import shown

TRANSLUCENCIES: dict[str, type[Translucency]] = {
    "tsm": TranslucentShadowMaps,
    "transmittance": Transmittance,
    "thickness": LocalThickness,
    "sam": Adjacency,
}
"""What estimates M_back. "none" leaves it black."""

METHODS: dict[str, type[Method]] = {
    "lambert": Lambert,
    "deon07": pair(TextureSpace, TranslucentShadowMaps),
    "jimenez08": VisibleTextureSpace,
    "jimenez15": pair(ScreenSpace, Transmittance),
    "barre11": pair(Lambert, LocalThickness),
    "jensen02": PointCloud,
    "sam": SpatialAdjacencyMaps,
}


def kind_of(name: str) -> type[Method]:
    """The method, the pair SURFACE+TRANSLUCENCY or the reference `name`.

    Raises InputError for a name that is not known and a pair that makes no sense.
    """
    from wgsss.reference import REFERENCES

    surface, plus, translucency = name.partition("+")
    if plus:
        if surface not in SURFACES:
            raise unknown("surface", surface, SURFACES)
        if translucency not in ("none", *TRANSLUCENCIES):
            raise unknown("translucency", translucency, ("none", *TRANSLUCENCIES))
        if translucency == "none":
            return SURFACES[surface]
        part = TRANSLUCENCIES[translucency]
        fitting = [name for name, kind in SURFACES.items() if issubclass(kind, part.beside)]
        if surface not in fitting:
            raise InputError(
                f"translucency {translucency} goes with surface {' or '.join(fitting)}, not with {surface}"
            )
        return pair(SURFACES[surface], part)
    kinds = {**METHODS, **REFERENCES}
    if name not in kinds:
        raise unknown("method", name, kinds)
    return kinds[name]


def make_method(name: str, knobs: dict[str, Any] | None = None) -> Method:
    """The method, the pair or the reference `name` with its knobs set.

    Raises InputError for a name or knob that is not known, or a value that is not of the knob's type and range, or not
    one of its choices.
    """
    kind = kind_of(name)
    known = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    values = {}
    for knob, value in (knobs or {}).items():
        if knob not in known:
            raise unknown(f"knob of {name}", knob, known)
        values[knob] = _parsed(f"{name}: {knob}", known[knob], value)
    return kind(**values)


def name_of(method: Method) -> str:
    """The name that a method, a pair or a reference goes by."""
    from wgsss.reference import REFERENCES

    for name, kind in {**METHODS, **REFERENCES}.items():
        if kind is type(method):
            return name
    surface, translucency = method.parts if isinstance(method, Pair) else (type(method), None)
    names = [
        *(name for name, kind in SURFACES.items() if kind is surface),
        *(name for name, part in TRANSLUCENCIES.items() if part is translucency),
    ]
    return "+".join([*names, "none"][:2]) if names else type(method).__name__


def _parsed(where: str, knob: Any, value: Any) -> Any:
    """A knob's value: one of its choices, or in the type of its default and within its range."""
    choices = knob.metadata.get("choices")
    if choices is not None:
        if value not in choices:
            raise InputError(f"{where} must be one of {', '.join(choices)}, not {shown(value)}")
        return value
    kind = type(knob.default)
    if kind is bool:
        return _switched(where, value)
    try:
        parsed = kind(float(value)) if kind is int and float(value).is_integer() else kind(value)
    except (TypeError, ValueError, OverflowError):
        wanted = "a whole number" if kind is int else "a number"
        raise InputError(f"{where} must be {wanted}, not {shown(value)}") from None
    low, high = knob.metadata["range"]
    if not low <= parsed <= high:
        unit = f" ({knob.metadata['unit']})" if knob.metadata["unit"] else ""
        raise InputError(f"{where} must lie between {low:g} and {high:g}{unit}, not {shown(parsed)}")
    return parsed


_SWITCHES = {"on": True, "true": True, "yes": True, "1": True, "off": False, "false": False, "no": False, "0": False}


def _switched(where: str, value: Any) -> bool:
    """Whether a switch is on."""
    found = _SWITCHES.get(str(value).lower())
    if found is None:
        raise InputError(f"{where} must be on or off, not {shown(value)}")
    return found


__all__ = ["METHODS", "SURFACES", "TRANSLUCENCIES", "Diffused", "Method", "kind_of", "make_method", "name_of"]
