"""`wgsss scenes`, `methods` and `materials`: lists of what is built in."""

from __future__ import annotations

from typing import Any

from wgsss.cli import arguments


def declare(commands: Any) -> None:
    arguments.command(commands, "scenes", scenes, "list the built-in scenes")
    arguments.command(commands, "methods", methods, "list the methods, their sources and their knobs")
    arguments.command(commands, "materials", materials, "list the measured materials")


def scenes(args: Any) -> None:
    from wgsss.scene.builtin import SCENES

    rows = [{"name": name, "about": (make.__doc__ or "").strip().split("\n")[0]} for name, make in SCENES.items()]
    arguments.emit(args, {"scenes": rows}, arguments.table([[row["name"], row["about"]] for row in rows]))


def methods(args: Any) -> None:
    from wgsss.registry import METHODS, REFERENCES, SURFACES, TRANSLUCENCIES

    result = {"methods": _described(METHODS), "references": _described(REFERENCES)}
    rows: list[list[str]] = []
    for kind, entries in result.items():
        for entry in entries:
            note = " (a reference)" if kind == "references" else f" (the pair {entry['pair']})" if entry["pair"] else ""
            rows.append([entry["name"], entry["source"] + note])
            for knob in entry["knobs"]:
                rows.append(["", f"--set {knob['name']}={_word(knob['default'])}  {knob['help']}, {_values(knob)}"])
    pairs = {"surface": list(SURFACES), "translucency": ["none", *TRANSLUCENCIES]}
    lines = [f"--{part} one of {', '.join(names)}" for part, names in pairs.items()]
    pair = ["or a surface method and a translucency method:", *(f"  {line}" for line in lines)]
    text = "\n".join([arguments.table(rows), "", *pair])
    arguments.emit(args, {**result, "pairs": pairs}, text)


def _values(knob: dict[str, Any]) -> str:
    """Describe the values that a knob may have."""
    if "choices" in knob:
        return "one of " + ", ".join(knob["choices"])
    if isinstance(knob["default"], bool):
        return "on or off"
    low, high = knob["range"]
    return f"{low:g} to {high:.10g}" + (f" {knob['unit']}" if knob["unit"] else "")


def _word(value: Any) -> str:
    """Format the value of a knob as `--set` takes it."""
    return ("on" if value else "off") if isinstance(value, bool) else str(value)


def _described(kinds: Any) -> list[dict[str, Any]]:
    from wgsss.registry import pair_of

    return [
        {"name": name, "source": kind.source, "pair": pair_of(kind), "knobs": _knobs(kind)}
        for name, kind in kinds.items()
    ]


def _knobs(kind: Any) -> list[dict[str, Any]]:
    from dataclasses import fields

    from wgsss.registry import pair_of, surfaces_for

    knobs = [{"name": knob.name, "default": knob.default, **knob.metadata} for knob in fields(kind)]
    surface, _, translucency = (pair_of(kind) or "").partition("+")
    if surface and len(surfaces := surfaces_for(translucency)) > 1:
        about = "surface method of the pair"
        knobs.append({"name": "surface", "default": surface, "choices": surfaces, "help": about, "unit": ""})
    return knobs


def materials(args: Any) -> None:
    from wgsss.scene import MATERIALS

    entries = []
    for name, medium in MATERIALS.items():
        entry: dict[str, Any] = {"name": name, "eta": medium.eta, "base_color": medium.base_color}
        if medium.gaussians is None:
            entry |= {"sigma_s_prime": medium.sigma_s_prime, "sigma_a": medium.sigma_a}
        else:
            entry |= {"variances": medium.gaussians.variances.tolist(), "weights": medium.gaussians.weights.tolist()}
        entries.append(entry)
    rows = [[m["name"], _medium(m), f"eta {m['eta']:g}"] for m in entries]
    arguments.emit(args, {"materials": entries}, arguments.table(rows))


def _medium(entry: dict[str, Any]) -> str:
    if "sigma_a" not in entry:
        return f"{len(entry['variances'])} Gaussians, variances {_numbers(entry['variances'])} mm^2"
    return f"sigma_s' {_numbers(entry['sigma_s_prime'])}, sigma_a {_numbers(entry['sigma_a'])} 1/mm"


def _numbers(values: Any) -> str:
    return " ".join(f"{v:.3g}" for v in values)
