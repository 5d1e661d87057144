"""Where the window shows the panel and the pictures."""

from __future__ import annotations

from dataclasses import dataclass

PANEL_WIDTH = 330
"""logical pixels"""


@dataclass(frozen=True)
class Layout:
    """The panel on the left of the window and the pictures on its right, in logical pixels, y down."""

    width: float = 960.0
    height: float = 540.0
    """of the window"""
    pixel_ratio: float = 1.0
    """pixels of the screen per logical pixel"""

    @property
    def panel_width(self) -> float:
        return min(PANEL_WIDTH, 0.5 * self.width)

    @property
    def picture_width(self) -> float:
        return max(self.width - self.panel_width, 1.0)

    @property
    def picture_height(self) -> float:
        return max(self.height, 1.0)

    @property
    def aspect(self) -> float:
        """Width of a picture over its height."""
        return self.picture_width / self.picture_height

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of a picture in pixels of the screen."""
        width, height = self.picture_width * self.pixel_ratio, self.picture_height * self.pixel_ratio
        return max(int(width), 1), max(int(height), 1)

    def to_picture(self, x: float, y: float) -> tuple[float, float]:
        """Return a position in the window as one in the picture: -1 to 1 to the right and up."""
        return 2 * (x - self.panel_width) / self.picture_width - 1, 1 - 2 * y / self.picture_height

    def to_window(self, right: float, up: float) -> tuple[float, float]:
        """Return a position in the picture, -1 to 1 to the right and up, as one in the window."""
        x = self.panel_width + 0.5 * (1.0 + right) * self.picture_width
        return x, 0.5 * (1.0 - up) * self.picture_height
