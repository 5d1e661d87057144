"""Functions that build closed meshes with about a given number of vertices, in millimetres, y up.

Parametric shapes take milliseconds. The implicit ones (gyroid, milk, statue, head) import scikit-image when called.
"""

from __future__ import annotations

from wgsss.scene.shapes._capsule import capsule
from wgsss.scene.shapes._ear import ear
from wgsss.scene.shapes._gyroid import gyroid
from wgsss.scene.shapes._head import head
from wgsss.scene.shapes._leaf import leaf
from wgsss.scene.shapes._milk import milk
from wgsss.scene.shapes._organ import organ
from wgsss.scene.shapes._patch import patch
from wgsss.scene.shapes._slab import slab
from wgsss.scene.shapes._sphere import sphere
from wgsss.scene.shapes._statue import statue

__all__ = ["capsule", "ear", "gyroid", "head", "leaf", "milk", "organ", "patch", "slab", "sphere", "statue"]
