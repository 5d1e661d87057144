"""References: methods that take their time, against which other methods and models are measured.

`wgsss.registry` has their names.
"""

from __future__ import annotations

from wgsss.reference.estimate import Estimate, Finished, Reference
from wgsss.reference.integral import Integral

__all__ = ["Estimate", "Finished", "Integral", "Reference"]
