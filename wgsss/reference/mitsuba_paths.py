"""Path tracing of a scene by Mitsuba in a separate process, which starts when it is first needed."""

from __future__ import annotations

import glob
import hashlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.cache import cached
from wgsss.errors import InputError, Note, RenderError
from wgsss.reference import mitsuba_render, mitsuba_scene
from wgsss.reference.mitsuba_grids import VOXELS
from wgsss.reference.mitsuba_xml import scene_xml
from wgsss.scene import Scene

Array = npt.NDArray[Any]

_BATCH = 1 << 20  # approximate number of paths of a batch: an interrupt loses at most these
_PER_PIXEL = (4, 256)  # smallest and largest number of paths per pixel of a batch
_LEAST_LLVM = 16  # version 15 does not compile the code of Mitsuba 3.9
_LLVM_PATTERNS = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib*/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm/lib/libLLVM*.dylib",
)


class Paths:
    """Paths along `rays` (N, 6), origins in mm and directions, through a scene as posed. A context manager.

    `bounces`: as of `scene_xml`. `voxels`: largest number of voxels of an object with layers.

    Raises InputError if Mitsuba is not installed.
    """

    def __init__(
        self, scene: Scene, size: tuple[int, int], rays: Array, bounces: int = 0, voxels: int = VOXELS
    ) -> None:
        if importlib.util.find_spec("mitsuba") is None:
            raise InputError("volume needs Mitsuba 3: pip install mitsuba")
        from importlib.metadata import version

        self._scene, self._size, self._rays = scene, size, rays
        self._bounces, self._voxels = bounces, voxels
        self._folder = Path(tempfile.mkdtemp(prefix="wgsss-"))
        self._process: subprocess.Popen[str] | None = None
        self._llvm = newest_llvm()
        self._variant = "llvm_ad_mono" if self._llvm else "scalar_rgb"
        self._content: list[Any] = [version("mitsuba"), self._variant, rays, self._content_of_files()]

    def __enter__(self) -> Paths:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process:
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _content_of_files(self) -> str:
        """Write the meshes, the media and the environments, and return a digest of the files."""
        files = mitsuba_scene.write_meshes(self._scene, self._folder)
        for channel in range(3):
            files += mitsuba_scene.write_environment(self._scene, self._folder, channel)
            files += mitsuba_scene.write_media(self._scene, self._folder, channel, self._voxels)
        digest = hashlib.sha256()
        for file in files:
            digest.update(file.read_bytes())
        return digest.hexdigest()

    def batches(self, samples: int) -> list[int]:
        """Split `samples` paths per ray into batches. The first batches do not depend on the number of samples."""
        fewest, most = _PER_PIXEL
        size = max(fewest, min(most, _BATCH // max(len(self._rays), 1)))
        return [min(size, samples - first) for first in range(0, samples, size)]

    def trace(self, channel: int, scatters: bool, samples: int, bar: Any) -> tuple[Array, Array]:
        """Return the mean radiance (N,) of `samples` paths per ray, W/(m^2 sr), and its standard error squared."""
        first, second = np.zeros(len(self._rays)), np.zeros(len(self._rays))
        xml = scene_xml(self._scene, self._size, channel, scatters, self._bounces)
        for number, paths in enumerate(self.batches(samples)):
            # Each batch has its own seed, from which every ray of the batch derives its random numbers.
            seed = ((2 * channel + scatters) << 24) + (number << 6)
            order = {"paths": paths, "seed": seed}
            key = [*self._content, xml, *order.values()]
            moments = cached("volume", key, lambda xml=xml, order=order: self._request(xml, order))  # type: ignore[misc]
            first += paths * moments["mean"]
            second += paths * moments["square"]
            bar.update(paths)
        mean = first / samples
        return mean, np.maximum(second / samples - mean**2, 0.0) / (samples - 1)

    def _request(self, xml: str, order: dict[str, int]) -> dict[str, Array]:
        """Let the process trace a batch, and return its result."""
        name = hashlib.sha256(xml.encode()).hexdigest()[:16]
        scene, rays, result = (self._folder / n for n in (f"{name}.xml", "rays.npy", "result.npz"))
        if not scene.exists():
            scene.write_text(xml)
        process = self._process or self._start(rays)
        assert process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(
                json.dumps({"scene": str(scene), "rays": str(rays), "result": str(result), **order}) + "\n"
            )
            process.stdin.flush()
            answer = process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        reply = json.loads(answer) if answer else {"error": f"the process ended: {self._last_error()}"}
        if "error" in reply:
            raise RenderError(f"Mitsuba: {reply['error']}")
        with np.load(result) as arrays:
            return dict(arrays)

    def _start(self, rays: Path) -> subprocess.Popen[str]:
        np.save(rays, self._rays)
        if self._llvm is None:
            warnings.warn(
                f"no LLVM of at least version {_LEAST_LLVM} was found (libllvm19 in Debian): Mitsuba traces one path"
                " after another on one core",
                Note,
                stacklevel=2,
            )
        environment = {**os.environ, **({"DRJIT_LIBLLVM_PATH": self._llvm} if self._llvm else {})}
        # -P: otherwise the program could import modules of its own folder.
        command = [sys.executable, "-P", str(mitsuba_render.__file__), self._variant]
        with (self._folder / "errors").open("w") as errors:
            self._process = subprocess.Popen(
                command,
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                start_new_session=True,  # so that signals from the terminal do not reach it
            )
        return self._process

    def _last_error(self) -> str:
        lines = (self._folder / "errors").read_text(errors="replace").split("\n")
        return next((line.strip()[:200] for line in reversed(lines) if line.strip()), "no message")


def newest_llvm() -> str | None:
    """Return the LLVM library that Mitsuba compiles with: $DRJIT_LIBLLVM_PATH, or the newest one found."""
    if chosen := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return chosen
    versions = []
    for pattern in _LLVM_PATTERNS:
        for path in glob.glob(pattern):
            match = re.search(r"libLLVM(?:-|\.so\.|\.)?(\d+)", Path(path).name)
            if match and int(match[1]) >= _LEAST_LLVM:
                versions.append((int(match[1]), path))
    return max(versions)[1] if versions else None
