"""jensen02: a sum over samples of the surface, by an octree (Jensen & Buhler 2002; Mikkelsen 2009, section 3.2).

L_d is computed at samples about a mean free path apart, and its flux is summed up an octree. M at a pixel is the sum
over nodes that are small compared with their distance. The sum cannot resolve the part of the profile that is narrower
than the spacing of the samples: this part multiplies L_d at the pixel itself.
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
"""The distance from x_o, in spacings of samples, within which the profile is flattened. On an evenly lit plane of Skin1
with samples a mean free path apart, M then varies by 0.1, 0.2 and 0.4 % in red, green and blue; with 1 instead by 0.2,
0.5 and 1.1 %. Larger values would make more of the light leave where it enters, and shadows too sharp.
"""
_CLOSEST = 0.02  # as a share of that distance: closer to x_o, R_d is taken to be constant
_MANTISSA, _EXPONENT = 9, 5  # bits of the table's entries
_NO_AREA = 1e-30  # mm^2, of the samples of a body that is scaled to nothing: means weighted by 0 would be undefined
_BEYOND = 1e-5  # share of the light that is ignored since it leaves far away


@dataclass(frozen=True)
class PointCloud:
    """M_front and M_back as sums over samples, or nodes of samples, on the front and on the back side."""

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
        """Distribute samples over each mesh, build their octree, and tabulate each material's profile."""
        for body in stage.bodies:
            self.cloud(body)
            self.kernel(body)

    def cloud(self, body: Body) -> Cloud:
        """Return the samples of a body's mesh at rest."""
        mesh, material, stage = body.rest.mesh, body.material, body.stage
        path = stage.shared(("mean free path", id(material)), lambda: mean_free_path(material))
        spacing = self.spacing * path
        return stage.shared(("point cloud", id(mesh), spacing), lambda: point_cloud(mesh, spacing))

    def kernel(self, body: Body) -> Kernel:
        """Return the table of the profile of a body's material for the spacing of its samples."""
        cloud, mesh, profile = self.cloud(body), body.rest.mesh, body.profile
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
        """Return the buffer of array<Entering> of a body's octree, filled from the samples upwards."""
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
        """Return, for each height from 1 on, the number of its nodes and a buffer of u32 with their indices."""
        cloud, gpu = self.cloud(body), body.stage.gpu

        def make() -> list[tuple[int, Buffer]]:
            chosen = [nodes.astype(np.uint32) for nodes, _, _ in cloud.tree.levels()][1:]
            return [(len(nodes), gpu.buffer(nodes)) for nodes in chosen]

        return body.stage.shared(("heights", id(cloud)), make)

    def _posed(self, body: Body) -> Posed:
        """Return a body's samples as posed, on the device. Of a moving body only the last pose is kept. Bodies with the
        same mesh do not share them, since the share of the environment that they receive differs."""
        cloud, stage = self.cloud(body), body.stage
        last: dict[float, Posed] = stage.shared(("posed", body.index, cloud.spacing), dict)
        time_s = 0.0 if body.rest.motion is None else stage.time_s
        if time_s not in last:
            last.clear()
            last[time_s] = posed(body, cloud)
        return last[time_s]


def mean_free_path(material: Material) -> float:
    """Return 1 / (sigma_a + sigma_s') of the top layer in mm, the median of the channels. Where only the profile of a
    material is known, return the distance within which half of the light leaves."""
    if material.stack is None:
        return float(np.median(material.profile.range(0.5)))
    return float(np.median(material.stack[0].mean_free_path))


@dataclass(frozen=True, eq=False)
class Kernel:
    """The table of a profile without the narrow part that samples cannot resolve."""

    r: Array
    """float64 (n,), mm: the distance of each entry (wgsss/optics/lookup.py)"""
    R: Array
    """float64 (n, 3), 1/mm^2; smaller distances have the value of the first entry, larger ones that of the last, 0"""
    near: Array
    """float64 (3,): the total reflectance of the profile minus the integral of R"""

    @property
    def first(self) -> int:
        """Leading bits of the first entry's squared distance."""
        return int(leading_bits(np.square(self.r[0])))

    @property
    def unit(self) -> float:
        """A power of two larger than all R, 1/mm^2: the unit of `packed`."""
        return float(2.0 ** np.ceil(np.log2(max(self.R.max(), 1e-30) * 1.01)))

    @property
    def packed(self) -> Array:
        """uint32 (n,): R in `unit`, as three mantissas with a common exponent. The error of each channel is at most
        1/512 of the largest channel's value."""
        R = self.R / self.unit
        most, steps = 2**_EXPONENT - 1, 2**_MANTISSA
        # Mantissas stay one below 2^_MANTISSA, so that rounding up does not overflow.
        exponent = np.ceil(np.log2(np.maximum(R.max(axis=1), 1e-30) * steps / (steps - 1)))
        shared = np.clip(exponent + most, 0, most)
        mantissa = np.rint(R * 2.0 ** (most + _MANTISSA - shared[:, None])).astype(np.uint32)
        places = np.arange(3, dtype=np.uint32) * _MANTISSA
        packed: Array = np.bitwise_or.reduce(mantissa << places, axis=1) | shared.astype(np.uint32) << 3 * _MANTISSA
        return packed


def kernel(profile: Profile, blunt: float, size: float) -> Kernel:
    """Return the table of R_d up to `size` mm, cached. At distances below `blunt` mm it has R_d((r^2 + blunt^2) /
    (2 blunt)) instead of R_d(r), which is flat at r = 0."""

    def make() -> Arrays:
        return _kernel(profile, blunt, size)

    return Kernel(**cached("point-cloud-kernel", [profile, blunt, size], make))


def _kernel(profile: Profile, blunt: float, size: float) -> Arrays:
    far = max(min(size, float(profile.range(_BEYOND).max())), 2.0 * blunt)
    first, last = leading_bits(np.square([_CLOSEST * blunt, far])).tolist()
    r = np.sqrt(interval_middles(first, last + 1))

    def blunted(r: Array) -> Array:
        return profile.reflectance(np.where(r < blunt, (np.square(r) + blunt**2) / (2.0 * blunt), r))

    x, w = np.polynomial.legendre.leggauss(64)
    inside = 0.5 * blunt * (x + 1.0)
    flattened = (0.5 * blunt * w * 2.0 * np.pi * inside) @ blunted(inside)
    R = blunted(r)
    R[-1] = 0.0
    return {"r": r, "R": R, "near": profile.total * profile.enclosed(blunt) - flattened}


@dataclass(frozen=True, eq=False)
class Posed:
    """A point cloud at one time on the device, in object space."""

    points: Buffer
    """buffer of array<Vertex>: the samples"""
    nodes: Buffer
    """buffer of array<Node> (wgsl/point_cloud/tree.wgsl)"""


def posed(body: Body, cloud: Cloud) -> Posed:
    """Return the samples of a body as posed, and the boxes of the octree's nodes."""
    tree, at = cloud.tree, body.at(cloud.samples)
    area = at.area.astype(np.float64)
    if body.mesh.shrunk:
        area[:] = _NO_AREA
    else:
        area *= body.mesh.area / area.sum()  # a sample on several faces was scaled like one of them
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
