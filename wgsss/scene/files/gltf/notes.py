"""What a reader leaves out, counted: one line for each kind of loss."""

from __future__ import annotations

from wgsss.scene.repair import counted


class Notes:
    """Losses by what is lost, each with how many things lose it."""

    def __init__(self) -> None:
        self._counts: dict[tuple[str, str], int] = {}

    def add(self, what: str, unit: str = "", count: int = 1) -> None:
        """Count a loss. The line ends in how many of the `unit` ("material") there were, where one is given."""
        self._counts[what, unit] = self._counts.get((what, unit), 0) + count

    def lines(self) -> tuple[str, ...]:
        """One line for each loss, in the order in which they came."""
        return tuple(f"{what} {counted(n, unit)}" if unit else what for (what, unit), n in self._counts.items())
