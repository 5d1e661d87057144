"""Shaders are read again when their files change; what does not compile gives way to what did."""

from __future__ import annotations

from pathlib import Path

from wgsss import wgsl


class Shaders:
    """The WGSL modules that are in use."""

    def __init__(self, root: Path = wgsl.ROOT) -> None:
        self._root = root
        self._seen = self._times()
        self._good = dict(wgsl.loaded)

    def _times(self) -> dict[str, int]:
        return {str(path): path.stat().st_mtime_ns for path in self._root.rglob("*.wgsl")}

    def changed(self) -> bool:
        """Whether a file has changed since it was asked last; if so, all are read anew."""
        times = self._times()
        if times == self._seen:
            return False
        self._seen = times
        wgsl.loaded.clear()
        return True

    def keep(self) -> None:
        """What is in use is good."""
        self._good = dict(wgsl.loaded)

    def undo(self) -> None:
        """Go back to what was good."""
        wgsl.loaded.update(self._good)
