"""Paths through a scene, by a Mitsuba that runs beside us: found, started when first needed, ended with us."""

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
from wgsss.reference.mitsuba_xml import described
from wgsss.scene import Scene

Array = npt.NDArray[Any]

_BATCH = 1 << 20  # paths, about: what is lost when a run is stopped
_PER_PIXEL = (4, 256)  # paths of a batch, least and most
_LEAST_LLVM = 16  # 15 does not compile what Mitsuba 3.9 asks of it
_LLVM_PLACES = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib*/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm/lib/libLLVM*.dylib",
)


class Paths:
    """Paths along `rays` (N, 6), origins in mm and directions, of a scene as it stands. To be used in a `with`.

    Raises InputError where Mitsuba is not installed.
    """

    def __init__(self, scene: Scene, size: tuple[int, int], rays: Array) -> None:
        if importlib.util.find_spec("mitsuba") is None:
            raise InputError("volume needs Mitsuba 3: pip install mitsuba")
        from importlib.metadata import version

        self._scene, self._size, self._rays = scene, size, rays
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
        """Write meshes and environments; a digest of them."""
        files = mitsuba_scene.write_meshes(self._scene, self._folder)
        for channel in range(3):
            files += mitsuba_scene.write_environment(self._scene, self._folder, channel)
        digest = hashlib.sha256()
        for file in files:
            digest.update(file.read_bytes())
        return digest.hexdigest()

    def batches(self, samples: int) -> list[int]:
        """Paths per ray of each batch: as many as `samples` in all. The first ones are the same for any number."""
        fewest, most = _PER_PIXEL
        size = max(fewest, min(most, _BATCH // max(len(self._rays), 1)))
        return [min(size, samples - first) for first in range(0, samples, size)]

    def follow(self, channel: int, scatters: bool, samples: int, bar: Any) -> tuple[Array, Array]:
        """Mean radiance (N,) in W/(m^2 sr) of `samples` paths per ray, and the square of its standard error."""
        first, second = np.zeros(len(self._rays)), np.zeros(len(self._rays))
        xml = described(self._scene, self._size, channel, scatters)
        for number, paths in enumerate(self.batches(samples)):
            # No two batches share random numbers; each ray of a batch takes its own from there.
            seed = ((2 * channel + scatters) << 24) + (number << 6)
            order = {"paths": paths, "seed": seed}
            key = [*self._content, xml, *order.values()]
            found = cached("volume", key, lambda xml=xml, order=order: self._ask(xml, order))  # type: ignore[misc]
            first += paths * found["mean"]
            second += paths * found["square"]
            bar.update(paths)
        mean = first / samples
        return mean, np.maximum(second / samples - mean**2, 0.0) / (samples - 1)

    def _ask(self, xml: str, order: dict[str, int]) -> dict[str, Array]:
        """A batch from the process."""
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
        told = json.loads(answer) if answer else {"error": f"it ended: {self._last_words()}"}
        if "error" in told:
            raise RenderError(f"Mitsuba: {told['error']}")
        with np.load(result) as arrays:
            return dict(arrays)

    def _start(self, rays: Path) -> subprocess.Popen[str]:
        np.save(rays, self._rays)
        if self._llvm is None:
            warnings.warn(
                f"no LLVM of at least version {_LEAST_LLVM} found (libllvm19 in Debian): Mitsuba follows one path after"
                " another, on one core",
                Note,
                stacklevel=2,
            )
        environment = {**os.environ, **({"DRJIT_LIBLLVM_PATH": self._llvm} if self._llvm else {})}
        # -P: the folder of the program holds modules of ours, which are not those of its imports.
        command = [sys.executable, "-P", str(mitsuba_render.__file__), self._variant]
        with (self._folder / "errors").open("w") as errors:
            self._process = subprocess.Popen(
                command,
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                start_new_session=True,  # so that signals from the terminal reach only us
            )
        return self._process

    def _last_words(self) -> str:
        lines = (self._folder / "errors").read_text(errors="replace").split("\n")
        return next((line.strip()[:200] for line in reversed(lines) if line.strip()), "without a word")


def newest_llvm() -> str | None:
    """The LLVM library by which Mitsuba compiles: $DRJIT_LIBLLVM_PATH, else the newest that is known to do."""
    if chosen := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return chosen
    found = []
    for place in _LLVM_PLACES:
        for path in glob.glob(place):
            match = re.search(r"libLLVM(?:-|\.so\.|\.)?(\d+)", Path(path).name)
            if match and int(match[1]) >= _LEAST_LLVM:
                found.append((int(match[1]), path))
    return max(found)[1] if found else None
