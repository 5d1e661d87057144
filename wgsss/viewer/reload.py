"""Shaders are read again when their files change; what does not compile gives way to what did."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from wgsss import wgsl


class Shaders:
    """The WGSL modules that are in use."""

    def __init__(self, root: Path = wgsl.ROOT) -> None:
        self._root = root
        self._seen = self._times()
        self._good = dict(wgsl.loaded)
        self.is_behind = False
        """whether what is in use is not what is in the files, which was bad"""

    def _times(self) -> dict[str, int]:
        times = {}
        for path in self._root.rglob("*.wgsl"):
            with suppress(FileNotFoundError):  # editors may replace a file as it is saved
                times[str(path)] = path.stat().st_mtime_ns
        return times

    def changed(self) -> bool:
        """Whether a file has changed since it was asked last; if so, all are read anew."""
        times = self._times()
        if times == self._seen:
            return False
        self._seen = times
        self.is_behind = False
        wgsl.loaded.clear()
        return True

    def keep(self) -> None:
        """What is in use is good."""
        self._good.update(wgsl.loaded)

    def undo(self) -> bool:
        """Go back to what was good; whether that is something else."""
        bad = dict(wgsl.loaded)
        wgsl.loaded.update(self._good)
        changed = wgsl.loaded != bad
        self.is_behind |= changed
        return changed
