"""Notes of a reader on data that it leaves out, with counts."""

from __future__ import annotations

from wgsss.scene.repair import counted


class Notes:
    """Counted notes: one line for each kind of loss."""

    def __init__(self) -> None:
        self._counts: dict[tuple[str, str], int] = {}

    def add(self, loss: str, unit: str = "", count: int = 1) -> None:
        """Add `count` objects that are affected by a loss.

        `loss` is the text of the line. If `unit` names the objects ("material"), the line ends with their total count.
        """
        self._counts[loss, unit] = self._counts.get((loss, unit), 0) + count

    def lines(self) -> tuple[str, ...]:
        """Return one line for each loss, in the order in which they were added."""
        return tuple(f"{loss} {counted(n, unit)}" if unit else loss for (loss, unit), n in self._counts.items())
