"""The methods and the references by name.

A new method is a module in `methods/`, its shaders in `wgsl/`, a row of ROWS and its goldens. Each surface method can
also be combined with each translucency method that fits it: "screen+sam" names such a pair. The knob `surface` of a
pair replaces its surface method: "sam" with surface=screen is "screen+sam".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

from wgsss.errors import InputError, unknown
from wgsss.methods.depth_parallax import DepthParallax
from wgsss.methods.knobs import check_declaration, parsed
from wgsss.methods.lambert import Lambert
from wgsss.methods.local_thickness import LocalThickness
from wgsss.methods.method import Method
from wgsss.methods.pair import Pair, Translucency, pair
from wgsss.methods.point_cloud import PointCloud
from wgsss.methods.sam.method import SamTranslucency
from wgsss.methods.screen_space import ScreenSpace
from wgsss.methods.subsurface_texture_mapping import SubsurfaceTextureMapping
from wgsss.methods.texture_space import TextureSpace
from wgsss.methods.translucent_shadow_maps import TranslucentShadowMaps
from wgsss.methods.transmittance import Transmittance
from wgsss.methods.visible_texture_space import VisibleTextureSpace
from wgsss.reference.estimate import Reference
from wgsss.reference.integral import Integral
from wgsss.reference.layered import LayeredSingleScattering
from wgsss.reference.volume import Volume
from wgsss.scene import Scene

SURFACES: dict[str, type[Method]] = {"texture": TextureSpace, "screen": ScreenSpace, "none": Lambert}
"""The surface methods, which estimate M_front."""

TRANSLUCENCIES: dict[str, type[Translucency]] = {
    "tsm": TranslucentShadowMaps,
    "transmittance": Transmittance,
    "thickness": LocalThickness,
    "sam": SamTranslucency,
}
"""The translucency methods, which estimate M_back. The name "none" stands for no M_back."""

REFERENCES: dict[str, type[Reference]] = {"volume": Volume, "integral": Integral, "layers": LayeredSingleScattering}
"""The references that are available by name wherever a method is."""


@dataclass(frozen=True)
class Row:
    """A published method."""

    name: str
    kind: type[Method]
    place: int
    """Its place in the legends of charts, which chooses its colour and shape. It must never change."""
    sweep: tuple[dict[str, Any], ...] = ()
    """Settings for `wgsss bench`, if they are not those of its class."""


_SAM_SWEEP: tuple[dict[str, Any], ...] = (
    *({"surface": "screen", "samples": n} for n in (3, 8)),
    *({"surface": "texture", "samples": n} for n in (3, 8)),
    *({"surface": "texture", "select": select} for select in ("top", "coarse")),
)

ROWS = (
    Row("lambert", Lambert, place=0),
    Row("deon07", pair(TextureSpace, TranslucentShadowMaps), place=1),
    Row("jimenez08", VisibleTextureSpace, place=5),
    Row("jimenez15", pair(ScreenSpace, Transmittance), place=4),
    Row("barre11", pair(Lambert, LocalThickness), place=6),
    Row("jensen02", PointCloud, place=3),
    Row("sam", pair(TextureSpace, SamTranslucency), place=2, sweep=_SAM_SWEEP),
    Row("francois06", SubsurfaceTextureMapping, place=7),
    Row("oat06", DepthParallax, place=8),
)

PALETTE = (
    *("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442"),
    *("#882255", "#999933"),
)
"""The colours of methods in charts. People with any colour vision can distinguish the first eight (Okabe & Ito 2008).
The rest are of the muted scheme of Tol 2021."""
_SURFACE_ALONE, _UNKNOWN = "#C0C0C0", "#BBBBBB"
_SHADES = (0.8, 0.6, 0.4)  # of the colour of a pair, by its surface

METHODS: dict[str, type[Method]] = {row.name: row.kind for row in ROWS}
"""The published methods."""


def kind_of(name: str) -> type[Method]:
    """Return the class of a method, a pair SURFACE+TRANSLUCENCY or a reference.

    Raises InputError for an unknown name and for a pair whose parts do not fit.
    """
    surface, plus, translucency = name.partition("+")
    if not plus:
        kinds = {**METHODS, **REFERENCES}
        if name not in kinds:
            raise unknown("method", name, kinds)
        return kinds[name]
    if surface not in SURFACES:
        raise unknown("surface", surface, SURFACES)
    if translucency not in ("none", *TRANSLUCENCIES):
        raise unknown("translucency", translucency, ("none", *TRANSLUCENCIES))
    if translucency == "none":
        return SURFACES[surface]
    fitting = surfaces_for(translucency)
    if surface not in fitting:
        raise InputError(f"translucency {translucency} goes with surface {' or '.join(fitting)}, not with {surface}")
    return pair(SURFACES[surface], TRANSLUCENCIES[translucency])


def methods_for(scene: Scene) -> list[str]:
    """Return the names of the methods that can draw a scene. Some need the layers of all materials to be known."""
    are_known = all(item.material.stack is not None for item in scene.objects)
    return [name for name, kind in METHODS.items() if are_known or not getattr(kind, "needs_layers", False)]


def surfaces_for(translucency: str) -> list[str]:
    """Return the names of the surface methods that form a pair with a translucency method."""
    needed = TRANSLUCENCIES[translucency].beside
    return [name for name, kind in SURFACES.items() if issubclass(kind, needed)]


def make_method(name: str, knobs: Mapping[str, Any] | None = None) -> Method:
    """Return a method, a pair or a reference with its knobs set.

    The knob `surface` of a pair replaces its surface method: "sam" with surface=screen is "screen+sam".

    Raises InputError for an unknown name or knob, and for a value that the knob does not allow.
    """
    kind, values = kind_of(name), dict(knobs or {})
    pair_name = pair_of(kind)
    if pair_name is not None and "surface" in values:
        name = f"{values.pop('surface')}+{pair_name.partition('+')[2]}"
        kind = kind_of(name)
    return kind(**parsed(name, kind, values, () if pair_name is None else ("surface",)))


def sweep_of(name: str) -> tuple[dict[str, Any], ...]:
    """Return the settings at which `wgsss bench` measures a method or a pair: knobs for `make_method`."""
    return next((row.sweep for row in ROWS if row.name == name and row.sweep), kind_of(name).sweep)


def name_of(method: Method) -> str:
    """Return the name by which `make_method` makes a method, or the name of its class where there is none."""
    kind = type(method)
    for name, known in {**METHODS, **REFERENCES}.items():
        if known is kind:
            return name
    if (name_of_pair := pair_of(kind)) is not None:
        return name_of_pair
    return next((f"{name}+none" for name, surface in SURFACES.items() if surface is kind), kind.__name__)


def pair_of(kind: type[Method]) -> str | None:
    """Return the name SURFACE+TRANSLUCENCY of a pair, None for a method that is none."""
    if not issubclass(kind, Pair):
        return None
    surface, translucency = kind.parts
    names = [name for name, part in SURFACES.items() if part is surface]
    names += [name for name, part in TRANSLUCENCIES.items() if part is translucency]
    return "+".join(names) if len(names) == 2 else None


def place_of(name: str) -> int:
    """Return the place of a name in the legends of charts: first the methods, then the pairs, then unknown names."""
    places = {row.name: row.place for row in ROWS}
    for surface, translucency in product(SURFACES, ("none", *TRANSLUCENCIES)):
        places[f"{surface}+{translucency}"] = max(places.values()) + 1
    return places.get(name, max(places.values()) + 1)


def colour_of(name: str) -> str:
    """Return the colour of a name in charts, as "#RRGGBB".

    A pair has a darker shade of the colour of the method with the same translucency; its surface chooses the shade.
    """
    rows = {row.name: row for row in ROWS}
    if name in rows:
        return PALETTE[rows[name].place % len(PALETTE)]
    surface, _, translucency = name.partition("+")
    if surface not in SURFACES or translucency not in ("none", *TRANSLUCENCIES):
        return _UNKNOWN
    base = _SURFACE_ALONE
    for row in ROWS:
        if translucency == (pair_of(row.kind) or "").partition("+")[2]:
            base = colour_of(row.name)
    shade = _SHADES[list(SURFACES).index(surface)]
    return "#" + "".join(f"{round(shade * int(base[i : i + 2], 16)):02X}" for i in (1, 3, 5))


def _check() -> None:
    """Check all declarations, so that a mistake shows at import and not in the middle of a run."""
    rows = {row.place: row.name for row in ROWS[::-1]}
    for row in ROWS:
        if rows[row.place] != row.name:
            raise TypeError(f"method {row.name}: the place {row.place} is that of {rows[row.place]}")
    for kinds in (METHODS, REFERENCES, SURFACES, TRANSLUCENCIES):
        for name, kind in kinds.items():
            for part in kind.parts if issubclass(kind, Pair) else (kind,):
                check_declaration(name, part)
    for row in ROWS:
        for setting in row.sweep:
            make_method(row.name, setting)


_check()
