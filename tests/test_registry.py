"""The registry checks what methods declare, and gives each name its place and colour in charts."""

from __future__ import annotations

from dataclasses import field, fields, make_dataclass
from itertools import product
from typing import Any

import pytest

from wgsss import registry
from wgsss.methods.knobs import check_declaration
from wgsss.methods.pair import Pair
from wgsss.registry import (
    METHODS,
    PALETTE,
    REFERENCES,
    ROWS,
    SURFACES,
    TRANSLUCENCIES,
    Row,
    colour_of,
    kind_of,
    pair_of,
    place_of,
)

DEFAULTS: dict[str, Any] = {"number": 0.5, "word": "near", "switch": True}
METADATA: dict[str, dict[str, Any]] = {
    "number": {"unit": "mm", "range": (0.0, 1.0), "help": "a distance"},
    "word": {"unit": "", "choices": ("near", "far"), "help": "a place"},
    "switch": {"unit": "", "help": "a state"},
}
ATTRIBUTES = {"__doc__": "A method.", "source": "a paper", "sweep": ({"number": 0.25}, {"word": "far"})}
PAIRS = [f"{surface}+{translucency}" for surface, translucency in product(SURFACES, ("none", *TRANSLUCENCIES))]


def method(**changes: Any) -> type:
    """Return a class of a method; `changes` replace an attribute, a default or, as `number_metadata`, metadata."""
    knobs = [
        (name, Any, field(default=changes.get(name, default), metadata=changes.get(f"{name}_metadata", METADATA[name])))
        for name, default in DEFAULTS.items()
    ]
    attributes = {name: changes.get(name, value) for name, value in ATTRIBUTES.items()}
    return make_dataclass("Method", knobs, frozen=True, namespace=attributes)


def without(metadata: dict[str, Any], entry: str) -> dict[str, Any]:
    return {name: value for name, value in metadata.items() if name != entry}


def test_a_complete_declaration_passes() -> None:
    check_declaration("mine", method())


BROKEN: list[tuple[dict[str, Any], str]] = [
    ({"source": None}, "method mine: `source` is missing"),
    ({"source": ""}, "method mine: `source` is missing"),
    ({"sweep": None}, "method mine: `sweep` is missing"),
    ({"__doc__": None}, "method mine: the docstring is missing"),
    *(
        ({f"{knob}_metadata": without(metadata, entry)}, f"method mine, knob {knob}: the metadata has no `{entry}`")
        for knob, metadata in METADATA.items()
        for entry in metadata
    ),
    ({"number_metadata": {**METADATA["number"], "help": ""}}, "method mine, knob number: `help` is empty"),
    ({"number": 2.0}, r"method mine, knob number: the default 2\.0 is not allowed"),
    ({"word": "here"}, "method mine, knob word: the default 'here' is not allowed"),
    ({"number": None}, "method mine, knob number: the default is missing"),
    ({"sweep": ({"size": 1},)}, "method mine: `sweep` sets size, which is not a knob"),
    ({"sweep": ({"number": 7},)}, "method mine, knob number: the value 7 of `sweep` is not allowed"),
]


@pytest.mark.parametrize(("change", "message"), BROKEN, ids=[message for _, message in BROKEN])
def test_a_broken_declaration_is_an_error_that_names_the_method_the_knob_and_the_fault(
    change: dict[str, Any], message: str
) -> None:
    with pytest.raises(TypeError, match=message):
        check_declaration("mine", method(**change))


@pytest.mark.parametrize("kinds", [SURFACES, TRANSLUCENCIES, REFERENCES, METHODS], ids=["S", "T", "R", "M"])
def test_every_part_is_checked_at_import(kinds: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    for kind in kinds.values():
        if issubclass(kind, Pair):
            continue
        monkeypatch.setattr(kind, "source", "")
        with pytest.raises(TypeError, match="`source` is missing"):
            registry._check()
        monkeypatch.undo()
        for knob in fields(kind):
            monkeypatch.setattr(knob, "metadata", {})
            with pytest.raises(TypeError, match=f"knob {knob.name}: the metadata has no `unit`"):
                registry._check()
            monkeypatch.undo()
    registry._check()


def test_two_methods_cannot_have_one_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "ROWS", (*ROWS, Row("mine", METHODS["lambert"], place=2)))
    with pytest.raises(TypeError, match="method mine: the place 2 is that of sam"):
        registry._check()


def test_places_and_colours_of_methods_stay() -> None:
    order = ["lambert", "deon07", "sam", "jensen02", "jimenez15", "jimenez08", "barre11", "francois06", "oat06"]
    assert sorted(METHODS, key=place_of) == order
    assert [colour_of(name) for name in order] == list(PALETTE[: len(order)])


def test_pairs_have_places_and_colours_of_their_own() -> None:
    assert sorted([*PAIRS, "unknown", *METHODS], key=place_of)[len(METHODS) :] == [*PAIRS, "unknown"]
    colours = [colour_of(name) for name in (*METHODS, *PAIRS, "unknown")]
    assert len(set(colours)) == len(colours)


@pytest.mark.parametrize("surface", SURFACES)
def test_a_pair_is_a_darker_shade_of_the_method_with_its_translucency(surface: str) -> None:
    for name, translucency in (("deon07", "tsm"), ("jimenez15", "transmittance"), ("sam", "sam")):
        pairs = zip(colour_of(name)[1:], colour_of(f"{surface}+{translucency}")[1:], strict=True)
        assert all(dark <= bright for bright, dark in list(pairs)[::2])


def test_published_methods_are_known_as_pairs() -> None:
    pairs = {
        "deon07": "texture+tsm",
        "jimenez15": "screen+transmittance",
        "barre11": "none+thickness",
        "sam": "texture+sam",
    }
    assert {name: pair_of(METHODS[name]) for name in pairs} == pairs
    for name in ("lambert", "jimenez08", "jensen02"):
        assert pair_of(METHODS[name]) is None
    assert all(kind_of(pair) is METHODS[name] for name, pair in pairs.items())
