"""Read WGSL modules: resolve their imports, and find the bindings, outputs and memory layouts that they declare.

The WGSL text is the only declaration of these; Python repeats none of them.

Group 0 holds the bindings of the module that is compiled. Files that other modules import may own bindings too, in
group 1 (`wgsl/lights.wgsl`, `wgsl/per_object.wgsl`). A pass binds only those that its entry points use, since that is
all that a pipeline with an automatic layout has.

A render target's format is the type of the output, an alias (`@location(0) M_front: RGBA16Float`, `wgsl/targets.wgsl`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from wgsss.wgsl_imports import WgslError, resolve, strip_comments
from wgsss.wgsl_layout import Layout, padded_dtype, round_up

_PACKAGE = Path(__file__).parent
ROOT = _PACKAGE / "wgsl" if (_PACKAGE / "wgsl").is_dir() else _PACKAGE.parent / "wgsl"

_BINDING = re.compile(
    r"@group\((\d+)\)\s*@binding\((\d+)\)\s*var\s*(?:<\s*(\w+)\s*(?:,\s*(\w+)\s*)?>)?\s*(\w+)\s*:\s*([^;]+);"
)
_STRUCT = re.compile(r"\bstruct\s+(\w+)\s*\{([^}]*)\}")
_FIELD = re.compile(r"((?:@\w+(?:\([^)]*\))?\s*)*)(\w+)\s*:\s*((?:[^,<]|<(?:[^<>]|<[^>]*>)*>)+)(?:,|$)")
_ALIAS = re.compile(r"\balias\s+(\w+)\s*=\s*([^;]+);")
_CONST = re.compile(r"\bconst\s+(\w+)\s*(?::\s*\w+\s*)?=\s*(\d+)[ui]?\s*;")
_OVERRIDE = re.compile(r"\boverride\s+(\w+)\s*(?::\s*\w+\s*)?(?:=\s*([^;]+))?;")
_ENTRY = re.compile(r"@(vertex|fragment|compute)\b([^{;]*?)\bfn\s+(\w+)\s*\(")
_FUNCTION = re.compile(r"\bfn\s+(\w+)\s*\(")
_PARAMETER = re.compile(r"(\w+)\s*:")
_CALL = re.compile(r"(?<![.\w])([A-Za-z_]\w*)\s*\(")
_LOCAL = re.compile(r"\b(?:let|var|const)\s+(\w+)")
_NAME = re.compile(r"(?<![.\w])[A-Za-z_]\w*")
_WORKGROUP = re.compile(r"@workgroup_size\(([^)]*)\)")
_RETURNS = re.compile(r"@fragment\s+fn\s+\w+\s*\([^{]*?->\s*(\w+)\s*\{", re.S)
_SCALARS = {"f32": "<f4", "i32": "<i4", "u32": "<u4", "f16": "<f2"}
_SHORT = {"f": "f32", "i": "i32", "u": "u32", "h": "f16"}


@dataclass(frozen=True)
class Binding:
    """A resource that a module declares."""

    name: str
    group: int
    number: int
    space: str
    """uniform, storage, texture, storage_texture or sampler"""
    access: str
    """read, write or read_write"""
    type: str
    format: str = ""
    """of a storage texture"""


@dataclass(frozen=True)
class Module:
    """A WGSL file with its imports resolved, and its declarations.

    Attributes:
        name: path below `wgsl/`, without the file extension.
        source: the text, with that of all imported files.
        lines: the file and line number of each line of `source`.
    """

    name: str
    source: str
    lines: tuple[tuple[str, int], ...]
    _layouts: dict[str, Layout] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def _clean(self) -> str:
        return strip_comments(self.source)

    @cached_property
    def aliases(self) -> dict[str, str]:
        return {name: re.sub(r"\s+", "", kind) for name, kind in _ALIAS.findall(self._clean)}

    @cached_property
    def constants(self) -> dict[str, int]:
        """Integer constants, which may be sizes of arrays and workgroups."""
        return {name: int(value) for name, value in _CONST.findall(self._clean)}

    @cached_property
    def overrides(self) -> tuple[str, ...]:
        return tuple(name for name, _ in _OVERRIDE.findall(self._clean))

    @cached_property
    def structs(self) -> dict[str, tuple[tuple[str, str, str], ...]]:
        """By struct, its fields: name, type as written, attributes."""
        return {
            name: tuple((f[1], re.sub(r"\s+", "", f[2]), f[0]) for f in _FIELD.findall(" ".join(body.split())))
            for name, body in _STRUCT.findall(self._clean)
        }

    @cached_property
    def stages(self) -> dict[str, str]:
        """The entry point of each stage (vertex, fragment, compute). A module's own replaces an imported one."""
        return {stage: name for stage, _, name in _ENTRY.findall(self._clean)}

    def workgroup_size(self, overrides: Mapping[str, float]) -> tuple[int, int, int]:
        match = _WORKGROUP.search(self._clean)
        if not match:
            raise WgslError(f"{self.name}: no @workgroup_size")
        defaults = {
            name: self._integer(value, {})
            for name, value in _OVERRIDE.findall(self._clean)
            if value[:1].isdigit() and "." not in value
        }
        known = {**self.constants, **defaults, **{name: int(value) for name, value in overrides.items()}}
        sizes = [self._integer(p.strip(), known) for p in match.group(1).split(",") if p.strip()]
        x, y, z = (*sizes, 1, 1)[:3]
        return x, y, z

    def _integer(self, text: str, known: Mapping[str, int]) -> int:
        text = text.strip().rstrip("ui") if text.strip()[:1].isdigit() else text.strip()
        if text.isdigit():
            return int(text)
        if text in known:
            return known[text]
        raise WgslError(f"{self.name}: '{text}' is not an integer constant")

    @cached_property
    def bindings(self) -> dict[str, Binding]:
        bindings = {}
        for group, number, space, access, name, kind in _BINDING.findall(self._clean):
            kind = self.resolve(re.sub(r"\s+", "", kind))
            fmt = ""
            if space:
                access = access or "read"
            elif kind.startswith("sampler"):
                space, access = "sampler", "read"
            elif kind.startswith("texture_storage"):
                fmt, access = kind[kind.index("<") + 1 : -1].split(",")
                space = "storage_texture"
            else:
                space, access = "texture", "read"
            bindings[name] = Binding(name, int(group), int(number), space, access, kind, fmt)
        return bindings

    @cached_property
    def _references(self) -> dict[str, set[str]]:
        """By function, the names of module scope that its body mentions."""
        return {
            name: set(_NAME.findall(body)) - set(_PARAMETER.findall(parameters)) - set(_LOCAL.findall(body))
            | set(_CALL.findall(body))
            for name, parameters, body in _functions(self._clean)
        }

    @cached_property
    def used(self) -> dict[str, Binding]:
        """The bindings that a pass of this module binds: those that its entry points use, themselves or in functions
        that they call. A module with a compute entry point is a compute pass.

        Raises WgslError where two of them share a number, as bindings of two imported files may.
        """
        stages = ("compute",) if "compute" in self.stages else ("vertex", "fragment")
        reached: set[str] = set()
        pending = [self.stages[stage] for stage in stages if stage in self.stages]
        while pending:
            if (name := pending.pop()) not in reached:
                reached.add(name)
                pending += self._references.get(name, ())
        used = {name: binding for name, binding in self.bindings.items() if name in reached}
        by_number: dict[tuple[int, int], str] = {}
        for name, binding in used.items():
            other = by_number.setdefault((binding.group, binding.number), name)
            if other != name:
                place = f"@group({binding.group}) @binding({binding.number})"
                raise WgslError(f"{self.name}: {other} and {name} are both {place}")
        return used

    @cached_property
    def targets(self) -> tuple[tuple[str, str], ...]:
        """The outputs of the fragment shader in the order of their locations: name and texture format."""
        match = _RETURNS.search(self._clean)
        if not match:
            return ()
        fields = self.structs.get(match.group(1), ())
        targets = []
        for name, kind, attributes in fields:
            if "@location" not in attributes:
                continue
            if not re.fullmatch(r"(RGBA|RG|R)\d+(Float|Uint|Unorm|UnormSrgb)", kind):
                raise WgslError(f"{self.name}: output '{name}: {kind}' does not name a render target's format")
            location = attributes.split("@location(")[1].split(")")[0]
            targets.append((int(location), name, kind.lower().replace("srgb", "-srgb")))
        return tuple((name, fmt) for _, name, fmt in sorted(targets))

    def resolve(self, kind: str) -> str:
        """Return a type with its aliases replaced."""
        return re.sub(
            r"\b[A-Za-z_]\w*\b",
            lambda m: self.resolve(self.aliases[m.group()]) if m.group() in self.aliases else m.group(),
            kind,
        )

    def layout(self, kind: str) -> Layout:
        """Return the memory layout of a host-shareable type that this module declares."""
        kind = self.resolve(re.sub(r"\s+", "", kind))
        if kind not in self._layouts:
            self._layouts[kind] = self._compute_layout(kind)
        return self._layouts[kind]

    def _compute_layout(self, kind: str) -> Layout:
        if kind in _SCALARS:
            dtype = np.dtype(_SCALARS[kind])
            return Layout(kind, dtype.itemsize, dtype.itemsize, dtype)
        if match := re.fullmatch(r"atomic<(\w+)>", kind):
            return self._compute_layout(match.group(1))
        if match := re.fullmatch(r"vec([234])(?:<(\w+)>|([fiuh]))", kind):
            n, scalar = int(match[1]), np.dtype(_SCALARS[match[2] or _SHORT[match[3]]])
            return Layout(kind, n * scalar.itemsize, (2 if n == 2 else 4) * scalar.itemsize, np.dtype((scalar, (n,))))
        if match := re.fullmatch(r"mat([234])x([234])(?:<(\w+)>|([fh]))", kind):
            columns, rows = int(match[1]), int(match[2])
            scalar = np.dtype(_SCALARS[match[3] or _SHORT[match[4]]])
            padded = 4 if rows == 3 else rows
            dtype = np.dtype((scalar, (columns, padded)))
            return Layout(kind, dtype.itemsize, padded * scalar.itemsize, dtype, columns=columns)
        if match := re.fullmatch(r"array<(.+?)(?:,(\w+))?>", kind):
            element = self.layout(match[1])
            stride = round_up(element.size, element.align)
            count = self._integer(match[2], self.constants) if match[2] else None
            dtype = padded_dtype(element, stride)
            if count is None:
                return Layout(kind, stride, element.align, dtype, element=element, count=None)
            return Layout(
                kind, stride * count, element.align, np.dtype((dtype, (count,))), element=element, count=count
            )
        if kind in self.structs:
            return self._struct_layout(kind)
        raise WgslError(f"{self.name}: '{kind}' is not a host-shareable type declared here")

    def _struct_layout(self, kind: str) -> Layout:
        offset, align, fields = 0, 1, []
        for name, member, attributes in self.structs[kind]:
            layout = self.layout(member)
            own_align, own_size = layout.align, layout.size
            if match := re.search(r"@align\((\d+)\)", attributes):
                own_align = int(match[1])
            if match := re.search(r"@size\((\d+)\)", attributes):
                own_size = int(match[1])
            offset = round_up(offset, own_align)
            fields.append((name, layout, offset))
            offset, align = offset + own_size, max(align, own_align)
        size = round_up(offset, align)
        names, formats, offsets = [f[0] for f in fields], [f[1].dtype for f in fields], [f[2] for f in fields]
        dtype = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})
        return Layout(kind, size, align, dtype, tuple(fields))

    def explain(self, message: str) -> str:
        """Return a compiler's message with the places in the files: `wgsl:12:3` becomes `blur.wgsl:4:3`."""

        def place(match: re.Match[str]) -> str:
            line = int(match.group(1))
            path, number = self.lines[min(line, len(self.lines)) - 1]
            return f"{path}:{number}:{match.group(2)}"

        return re.sub(r"(?:wgsl)?:(\d+):(\d+)", place, message)


def _functions(clean: str) -> Iterator[tuple[str, str, str]]:
    """Yield name, parameters and body of each function in a text without comments.

    If the brackets of a function do not match, its body is the rest of the text; the compiler reports the error.
    """
    for match in _FUNCTION.finditer(clean):
        opened = _closing(clean, match.end() - 1, "()")
        body = clean.find("{", opened)
        if body < 0:
            yield match.group(1), "", clean[match.end() :]
        else:
            yield match.group(1), clean[match.end() : opened], clean[body : _closing(clean, body, "{}")]


def _closing(clean: str, start: int, brackets: str) -> int:
    """Return the index of the bracket that closes the one at `start`."""
    depth = 0
    for match in re.compile(f"[{re.escape(brackets)}]").finditer(clean, start):
        depth += 1 if match.group() == brackets[0] else -1
        if depth == 0:
            return match.start()
    return len(clean)


def load(name: str, root: Path = ROOT) -> Module:
    """Return the module `wgsl/<name>.wgsl` with its imports.

    Raises WgslError, with file and line, for a missing file, an unknown imported name or a circular import.
    """
    if (name, root) not in loaded:
        lines = resolve(name, root, {}, (), name)
        text = "\n".join(line for line, _, _ in lines)
        loaded[name, root] = Module(name, text, tuple((path, n) for _, path, n in lines))
    return loaded[name, root]


loaded: dict[tuple[str, Path], Module] = {}
"""the modules read so far, by name and root; one that is removed is read again at its next use"""

__all__ = ["ROOT", "Binding", "Layout", "Module", "WgslError", "load", "loaded"]
