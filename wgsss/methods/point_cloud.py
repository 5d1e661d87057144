"""jensen02: two passes, over samples of the surface and over an octree of them (Jensen & Buhler 2002; Mikkelsen 2009,
section 3.2).

L_d is gathered at samples about a mean free path apart, its flux summed up an octree, and M at a pixel is the sum over
nodes small enough for their distance. A sum over samples knows nothing of what happens between them: the part of the
profile that is narrower than their spacing is left to L_d at the pixel itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.point_cloud import PointCloud as Cloud
from wgsss.bake.point_cloud import point_cloud
from wgsss.cache import Arrays, cached
from wgsss.frame import Frame, irradiance_pixels, irradiance_points
from wgsss.gpu import Buffer
from wgsss.graph import Handle, Outputs
from wgsss.methods.method import Diffused
from wgsss.optics import Profile
from wgsss.optics.lookup import interval_middles, leading_bits
from wgsss.scene import Material
from wgsss.stage import Body, Stage

Array = npt.NDArray[Any]

_GATHER = "point_cloud/gather"
NEAR = 1.5
"""Within this many spacings of x_o, the profile is blunted to what samples resolve. An evenly lit plane of Skin1, at a
spacing of a mean free path, is then even to 0.1, 0.2 and 0.4 %; with 1, to 0.2, 0.5 and 1.1 %. With more, shadows stay
sharp where light should have spread.
"""
_CLOSEST = 0.02  # of that distance: closer, R_d is level
_MANTISSA, _EXPONENT = 9, 5  # bits of the table's entries
_NO_AREA = 1e-30  # mm^2, of samples of a body that has been scaled to nothing: the middle of none is not defined
_BEYOND = 1e-5  # share of the light that is left out for being far


@dataclass(frozen=True)
class PointCloud:
    """M_front and M_back as sums over the samples, or the nodes that stand for them, on either side."""

    epsilon: float = field(
        default=0.3,
        metadata={"unit": "", "range": (0.1, 2), "help": "largest ratio of a node's size to its distance (eq. 42)"},
    )
    spacing: float = field(
        default=1.0,
        metadata={"unit": "mean free paths", "range": (0.1, 20), "help": "distance between samples"},
    )

    source: ClassVar[str] = "Jensen & Buhler 2002; Mikkelsen 2009, section 3.2"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = (
        {"epsilon": 1.0, "spacing": 4.0},
        {"epsilon": 0.5, "spacing": 2.0},
        {"epsilon": 0.3, "spacing": 1.0},
        {"epsilon": 0.15, "spacing": 0.5},
    )

    def bake(self, stage: Stage) -> None:
        """Spread samples over each mesh and build their octree; tabulate each material's profile."""
        for body in stage.bodies:
            self.cloud(body)
            self.kernel(body)

    def cloud(self, body: Body) -> Cloud:
        """The samples of a body's mesh at rest."""
        mesh, material, stage = body.rest.mesh, body.material, body.stage
        path = stage.shared(("mean free path", id(material)), lambda: mean_free_path(material))  # takes milliseconds
        spacing = self.spacing * path
        return stage.shared(("point cloud", id(mesh), spacing), lambda: point_cloud(mesh, spacing))

    def kernel(self, body: Body) -> Kernel:
        """The profile of a body's material as its samples see it."""
        cloud, mesh, profile = self.cloud(body), body.rest.mesh, body.material.profile
        size = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        key = ("kernel", id(body.material), cloud.spacing, size)
        return body.stage.shared(key, lambda: kernel(profile, NEAR * cloud.spacing, 2.0 * size))

    def passes(self, frame: Frame) -> Diffused:
        irradiance = irradiance_pixels(frame)
        tile = wgsl.load(_GATHER).constants["TILE"]
        M = Outputs(
            {name: frame.graph.texture(name, (*frame.size, 1), "rgba32float") for name in ("M_front", "M_back")}
        )
        for body in frame.stage.bodies:
            kernel = self.kernel(body)
            M = frame.graph.dispatch_outputs(
                _GATHER,
                size=(64 * -(-frame.size[0] // tile), -(-frame.size[1] // tile)),
                params={"near": kernel.near, "unit": kernel.unit, "first_entry": kernel.first},
                constants={"FIRST": body.index == 0},
                irradiance=irradiance,
                table=self._table(body),
                entering=self._entering(frame, body),
                M_front=M.M_front,
                M_back=M.M_back,
                **frame.bindings(_GATHER, body),
            )
        return Diffused(M.M_front, M.M_back)

    def _table(self, body: Body) -> Buffer:
        kernel = self.kernel(body)
        return body.stage.shared(("table", id(kernel)), lambda: body.stage.gpu.buffer(kernel.packed))

    def _entering(self, frame: Frame, body: Body) -> Handle:
        """What the nodes of a body's octree stand for, from the samples up."""
        graph, posed, cloud = frame.graph, self._posed(body), self.cloud(body)
        tree, params = cloud.tree, {"epsilon": self.epsilon, "farthest": self.kernel(body).r[-1]}
        irradiance = irradiance_points(frame, body, posed.points, len(cloud.samples.face), cloud.samples)
        entering = graph.dispatch(
            "point_cloud/enter_samples",
            size=len(tree.first),
            points=posed.points,
            irradiance=irradiance,
            nodes=posed.nodes,
        )
        for height, (count, chosen) in enumerate(self._heights(body), start=1):
            entering = graph.dispatch(
                "point_cloud/enter_nodes",
                size=count,
                label=f"height {height}",
                params=params,
                nodes=posed.nodes,
                chosen=chosen,
                entering=entering,
            )
        return entering

    def _heights(self, body: Body) -> list[tuple[int, Buffer]]:
        """How many nodes there are of each height from 1 on, and a buffer of which they are."""
        cloud, gpu = self.cloud(body), body.stage.gpu

        def make() -> list[tuple[int, Buffer]]:
            chosen = [nodes.astype(np.uint32) for nodes, _, _ in cloud.tree.levels()][1:]
            return [(len(nodes), gpu.buffer(nodes)) for nodes in chosen]

        return body.stage.shared(("heights", id(cloud)), make)

    def _posed(self, body: Body) -> Posed:
        """A body's samples as posed, on the device. Of a moving one only the last pose is kept. Bodies of one mesh do
        not share them: others hide other parts of the sky from each."""
        cloud, stage = self.cloud(body), body.stage
        last: dict[float, Posed] = stage.shared(("posed", body.index, cloud.spacing), dict)
        time_s = 0.0 if body.rest.motion is None else stage.time_s
        if time_s not in last:
            last.clear()
            last[time_s] = posed(body, cloud)
        return last[time_s]


def mean_free_path(material: Material) -> float:
    """1/(sigma_a + sigma_s') in mm, of the top layer; where only the profile is known, the distance within which half
    of the light leaves. Of the channels the middle one: what is narrower in another is left to the pixel.
    """
    if material.stack is None:
        return float(np.median(material.profile.range(0.5)))
    return float(np.median(material.stack[0].mean_free_path))


@dataclass(frozen=True, eq=False)
class Kernel:
    """A profile without what samples cannot resolve."""

    r: Array
    """float64 (n,), mm, each in the middle of the squared distances whose leading bits are the same"""
    R: Array
    """float64 (n, 3), 1/mm^2; as at the first entry before it, 0 from the last"""
    near: Array
    """float64 (3,), the rest: what is missing to the profile's total"""

    @property
    def first(self) -> int:
        """The leading bits of the first entry's squared distance."""
        return int(leading_bits(np.square(self.r[0])))

    @property
    def unit(self) -> float:
        """1/mm^2: more than any R, of which one step is a share of 2^-9 or less."""
        return float(2.0 ** np.ceil(np.log2(max(self.R.max(), 1e-30) * 1.01)))

    @property
    def packed(self) -> Array:
        """uint32 (n,): R in `unit`, three mantissas that share an exponent. What an R is off by is a share of 1/512 of
        the largest channel's, and no two distances' alike."""
        R = self.R / self.unit
        most, steps = 2**_EXPONENT - 1, 2**_MANTISSA
        # One less than all bits of a mantissa, so that rounding cannot reach the next exponent.
        exponent = np.ceil(np.log2(np.maximum(R.max(axis=1), 1e-30) * steps / (steps - 1)))
        shared = np.clip(exponent + most, 0, most)
        mantissa = np.rint(R * 2.0 ** (most + _MANTISSA - shared[:, None])).astype(np.uint32)
        places = np.arange(3, dtype=np.uint32) * _MANTISSA
        packed: Array = np.bitwise_or.reduce(mantissa << places, axis=1) | shared.astype(np.uint32) << 3 * _MANTISSA
        return packed


def kernel(profile: Profile, blunt: float, size: float) -> Kernel:
    """R_d to `size` mm, within `blunt` mm replaced by R_d((r^2 + blunt^2) / (2 blunt)), which is flat in the middle;
    cached."""

    def make() -> Arrays:
        return vars(_kernel(profile, blunt, size))

    return Kernel(**cached("point-cloud-kernel", [profile, blunt, size], make))


def _kernel(profile: Profile, blunt: float, size: float) -> Kernel:
    far = max(min(size, float(profile.range(_BEYOND).max())), 2.0 * blunt)
    first, last = leading_bits(np.square([_CLOSEST * blunt, far])).tolist()
    r = np.sqrt(interval_middles(first, last + 1))

    def blunted(r: Array) -> Array:
        return profile.reflectance(np.where(r < blunt, (np.square(r) + blunt**2) / (2.0 * blunt), r))

    x, w = np.polynomial.legendre.leggauss(64)
    inside = 0.5 * blunt * (x + 1.0)
    kept = (0.5 * blunt * w * 2.0 * np.pi * inside) @ blunted(inside)
    R = blunted(r)
    R[-1] = 0.0
    return Kernel(r, R, profile.total * profile.enclosed(blunt) - kept)


@dataclass(frozen=True, eq=False)
class Posed:
    """A point cloud at one time on the device, in object space."""

    points: Buffer
    """buffer of array<Vertex>: the samples"""
    nodes: Buffer
    """buffer of array<Node> (wgsl/point_cloud/tree.wgsl)"""


def posed(body: Body, cloud: Cloud) -> Posed:
    """The samples of a body where they are now, and the boxes around them."""
    tree, at = cloud.tree, body.at(cloud.samples)
    area = at.area.astype(np.float64)
    if body.mesh.shrunk:
        area[:] = _NO_AREA
    else:
        area *= body.mesh.area / area.sum()  # cells that cross faces change a little differently from their sample's
    sums = tree.sums(area)
    nodes = {
        "low": tree.lowest(at.position),
        "area": sums,
        "high": -tree.lowest(-at.position),
        "next": tree.next,
        "centre": tree.sums(at.position * area[:, None]) / sums[:, None],
        "first": tree.first,
    }
    layout = wgsl.load("point_cloud/tree").layout("array<Node>")
    return Posed(body.points(cloud.samples), body.stage.gpu.buffer(layout.pack(nodes)))
