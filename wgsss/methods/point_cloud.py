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

from wgsss import frame as shared
from wgsss import wgsl
from wgsss.bake.octree import Octree
from wgsss.bake.point_cloud import PointCloud as Cloud
from wgsss.bake.point_cloud import point_cloud
from wgsss.frame import Frame
from wgsss.graph import Handle
from wgsss.methods.method import Diffused
from wgsss.optics import Profile
from wgsss.scene import Material
from wgsss.stage import Body, Stage

Array = npt.NDArray[Any]

NEAR = 1.5
"""Within this many spacings of x_o, the profile is blunted to what samples resolve. An evenly lit plane of Skin1, at a
spacing of a mean free path, is then even to 0.1, 0.2 and 0.4 %; with 1, to 0.2, 0.5 and 1.1 %. With more, shadows stay
sharp where light should have spread.
"""
_ENTRIES = 4096  # of the table of R_d
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
        mesh, spacing = body.rest.mesh, self.spacing * mean_free_path(body.material)
        return body.stage.shared(("point cloud", id(mesh), spacing), lambda: point_cloud(mesh, spacing))

    def kernel(self, body: Body) -> Kernel:
        """The profile of a body's material as its samples see it."""
        cloud, mesh, profile = self.cloud(body), body.rest.mesh, body.material.profile
        size = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        key = ("kernel", id(body.material), cloud.spacing, size)
        return body.stage.shared(key, lambda: kernel(profile, NEAR * cloud.spacing, 2.0 * size))

    def passes(self, frame: Frame) -> Diffused:
        irradiance = shared.irradiance_pixels(frame)
        M: Any = {}
        for body in frame.stage.bodies:
            posed, kernel = self._posed(body), self.kernel(body)
            drawn = frame.graph.draw(
                "point_cloud/gather",
                into=M,
                size=frame.size,
                params={
                    "clip_to_world": frame.view.clip_to_world,
                    "near": kernel.near,
                    "nearest": kernel.r[0],
                    "farthest": kernel.r[-1],
                    "steps": (len(kernel.r) - 1) / np.log(kernel.r[-1] / kernel.r[0]),
                },
                surface=body.surface,
                irradiance=irradiance,
                table=np.pad(kernel.R, ((0, 0), (0, 1))),
                entering=self._entering(frame, body, posed),
                **frame.seen("where_seen", "normal", "base_color", "depth"),
            )
            M = vars(drawn)
        return Diffused(M["M_front"], M["M_back"], irradiance)

    def _entering(self, frame: Frame, body: Body, posed: Posed) -> Handle:
        """What the nodes of a body's octree stand for, from the samples up."""
        graph, tree = frame.graph, posed.tree
        irradiance = shared.irradiance_points(frame, body, posed.points, int(tree.count[0]))
        entering = graph.dispatch(
            "point_cloud/enter_samples",
            size=len(tree.first),
            points=posed.points,
            irradiance=irradiance,
            nodes=posed.nodes,
        )
        for height in range(1, int(tree.height.max()) + 1):
            chosen = np.flatnonzero(tree.height == height).astype(np.uint32)
            entering = graph.dispatch(
                "point_cloud/enter_nodes",
                size=len(chosen),
                label=f"height {height}",
                params={"epsilon": self.epsilon},
                nodes=posed.nodes,
                chosen=chosen,
                entering=entering,
            )
        return entering

    def _posed(self, body: Body) -> Posed:
        """A body's samples as posed, on the device. Of a moving one only the last pose is kept."""
        cloud, stage = self.cloud(body), body.stage
        if body.rest.motion is None:
            return stage.shared(("posed", id(body.rest.mesh), cloud.spacing), lambda: posed(body, cloud))
        last: dict[float, Posed] = stage.shared(("posed", body.index, cloud.spacing), dict)
        if stage.time_s not in last:
            last.clear()
            last[stage.time_s] = posed(body, cloud)
        return last[stage.time_s]


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
    """float64 (n,), mm, equally spaced in the logarithm"""
    R: Array
    """float64 (n, 3), 1/mm^2; as at the first entry before it, 0 from the last"""
    near: Array
    """float64 (3,), the rest: what is missing to the profile's total"""


def kernel(profile: Profile, blunt: float, size: float) -> Kernel:
    """R_d to `size` mm, within `blunt` mm replaced by R_d((r^2 + blunt^2) / (2 blunt)), which is flat in the middle."""
    far = max(min(size, float(profile.range(_BEYOND).max())), 2.0 * blunt)
    r = np.geomspace(0.02 * blunt, far, _ENTRIES)

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

    tree: Octree
    points: Any
    """buffer of array<Vertex>: the samples"""
    nodes: Any
    """buffer of array<Node> (wgsl/point_cloud/tree.wgsl)"""


def posed(body: Body, cloud: Cloud) -> Posed:
    """The samples of a body where they are now, and the boxes around them."""
    tree, at = cloud.tree, body.at(cloud.samples)
    area = at.area.astype(np.float64)
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
    return Posed(tree, body.points(cloud.samples), body.stage.gpu.buffer(layout.pack(nodes)))
