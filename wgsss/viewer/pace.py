"""How finely to draw while things move, so that a slow device keeps up with the hand."""

from __future__ import annotations

from dataclasses import dataclass

SCALES = (1.0, 0.5, 0.25, 0.125)
"""of the picture's sides: few, since textures of each size are kept"""
STILL_S = 0.25
"""after which a picture that has not changed is drawn in full"""


@dataclass
class Pace:
    """Halves the resolution where a picture takes longer than `budget_s`, and doubles it where that would not."""

    budget_s: float = 0.1
    step: int = 0

    @property
    def scale(self) -> float:
        return SCALES[self.step]

    def took(self, seconds: float) -> None:
        """A picture at `scale` took so long."""
        if seconds > self.budget_s:
            self.step = min(self.step + 1, len(SCALES) - 1)
        elif 4.0 * seconds < 0.8 * self.budget_s:
            self.step = max(self.step - 1, 0)
