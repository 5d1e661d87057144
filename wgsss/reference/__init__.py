"""The truths that methods and models are measured against."""

from __future__ import annotations

from wgsss.reference.estimate import Estimate, Reference
from wgsss.reference.integral import Integral
from wgsss.reference.volume import Volume

REFERENCES: dict[str, type[Reference]] = {"volume": Volume, "integral": Integral}
"""those that can be asked for by name where a method can"""

__all__ = ["REFERENCES", "Estimate", "Integral", "Reference"]
