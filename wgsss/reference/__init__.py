"""References: methods that take their time, against which other methods and models are measured."""

from __future__ import annotations

from wgsss.reference.estimate import Estimate, Finished, Reference
from wgsss.reference.integral import Integral
from wgsss.reference.volume import Volume

REFERENCES: dict[str, type[Reference]] = {"volume": Volume, "integral": Integral}
"""The references by name. They can be used wherever a method can."""

__all__ = ["REFERENCES", "Estimate", "Finished", "Integral", "Reference"]
