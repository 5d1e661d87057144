"""The parts of a render graph: resources, handles to them, and declared passes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.gpu import Buffer, PoolKey, Texture, TextureKey
from wgsss.wgsl import Module

Size: TypeAlias = int | tuple[int, int] | tuple[int, int, int]
"""Items of a buffer, or width, height and layers of a texture."""


@dataclass(eq=False)
class Resource:
    """A texture or buffer that passes of one graph write."""

    name: str
    format: str
    """of a texture; empty for a buffer"""
    size: tuple[int, int, int]
    """width, height and layers of a texture; (elements, 1, 1) of a buffer"""
    layout: wgsl.Layout | None = None
    """of a buffer: the type of its array"""
    usage: int = 0
    version: int = 0
    """number of passes declared so far that write it"""
    drawn: set[int] = field(default_factory=set)
    """layers that a raster pass has cleared and drawn"""
    gpu: Buffer | Texture | None = None
    """while the graph runs and, of what it was asked for, afterwards"""
    key: PoolKey | None = None
    """with which it goes back to the pool"""

    @property
    def nbytes(self) -> int:
        if self.layout is not None:
            return self.size[0] * self.layout.size
        return TextureKey(self.size, self.format, 0).nbytes


@dataclass(frozen=True)
class Handle:
    """An output of a pass: a resource as it is after that pass."""

    resource: Resource
    version: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in texels."""
        return self.resource.size[:2]

    @property
    def format(self) -> str:
        """The texture's format; empty for a buffer."""
        return self.resource.format

    def layer(self, number: int) -> int:
        """Return the layer that a pass for layer `number` draws to: 0 where there is only one."""
        return number if self.resource.size[2] > 1 else 0

    def __repr__(self) -> str:
        return f"{self.resource.name}@{self.version}"


class Outputs(dict[str, Handle]):
    """All outputs of a pass by name, as items and as attributes; `depth` is the depth buffer."""

    def __getattr__(self, name: str) -> Handle:
        if name not in self:
            raise AttributeError(f"the pass writes {', '.join(self)}, and no '{name}'")
        return self[name]


Value: TypeAlias = (
    "Handle | Buffer | Texture | npt.NDArray[Any] | np.generic | float | Mapping[str, Any] | Sequence[Any]"
)
"""What a binding can be given: an output of another pass, a resource that persists, or numbers to pack and upload."""


Bindings: TypeAlias = dict[str, Any]
"""A Value for each of several bindings, by name, to be unpacked in a call."""


@dataclass(frozen=True)
class Draw:
    """The state of a raster pass."""

    targets: tuple[tuple[str, bool], ...]
    """name in `writes`, and whether earlier content is kept"""
    keep_depth: bool
    """whether the depth buffer's earlier content is kept, where "depth" is in `writes`"""
    layer: int
    indices: Buffer | None
    count: int
    """of vertices"""


@dataclass(frozen=True)
class Dispatch:
    """The state of a compute pass."""

    groups: tuple[int, int, int]


@dataclass(eq=False)
class Pass:
    """One declared pass. All but the first three are by name of a binding or an output."""

    name: str
    module: Module
    constants: dict[str, float]
    reads: dict[str, Handle] = field(default_factory=dict)
    writes: dict[str, Handle] = field(default_factory=dict)
    imports: dict[str, Buffer | Texture] = field(default_factory=dict)
    """resources that persist"""
    uploads: dict[str, bytes] = field(default_factory=dict)
    """packed values"""
    state: Draw | Dispatch | None = None
    """None while it is being declared"""
