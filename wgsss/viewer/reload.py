"""Reloading of shaders whose files change. While a new version fails, the last version that worked stays in use."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from wgsss import wgsl


class Shaders:
    """Watches the WGSL files below a folder, and remembers the last loaded modules that worked."""

    def __init__(self, root: Path = wgsl.ROOT) -> None:
        self._root = root
        self._times = self._read_times()
        self._working = dict(wgsl.loaded)
        self.is_outdated = False
        """whether the modules in use are older than the files, because the files contain an error"""

    def _read_times(self) -> dict[str, int]:
        """Return the modification time of each WGSL file, ns."""
        times = {}
        for path in self._root.rglob("*.wgsl"):
            with suppress(FileNotFoundError):  # an editor may replace a file while it saves
                times[str(path)] = path.stat().st_mtime_ns
        return times

    def reload_changed(self) -> bool:
        """Return whether a file has changed since the last call. If so, unload all modules, so that they are reread."""
        times = self._read_times()
        if times == self._times:
            return False
        self._times = times
        self.is_outdated = False
        wgsl.loaded.clear()
        return True

    def mark_working(self) -> None:
        """Remember the modules in use as the last ones that worked."""
        self._working.update(wgsl.loaded)

    def restore_working(self) -> bool:
        """Put the last modules that worked back into use. Return whether any of them differs from those in use."""
        failed = dict(wgsl.loaded)
        wgsl.loaded.update(self._working)
        is_changed = wgsl.loaded != failed
        self.is_outdated |= is_changed
        return is_changed
