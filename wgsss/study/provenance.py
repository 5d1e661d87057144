"""Where a measurement comes from: the adapter, the version of wgsss and the content of the scene."""

from __future__ import annotations

import hashlib
import subprocess
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from wgsss import __version__
from wgsss.gpu import default_gpu
from wgsss.scene import EnvironmentLight, Scene


def adapter() -> str:
    """Return the name of the adapter that this process measures on."""
    return default_gpu().name


@lru_cache(maxsize=1)
def version() -> str:
    """Return the version of the package. In a checkout, add its commit, with "-dirty" if files have changed since."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return __version__
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        commit = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return __version__
    return f"{__version__}+{commit}"


def scene_digest(scene: Scene) -> str:
    """Return a digest of all fields of a scene: meshes, materials, camera, and lights with their images."""
    digest = hashlib.sha256()

    def add(value: object) -> None:
        if isinstance(value, np.ndarray):
            digest.update(f"{value.dtype.str} {value.shape}:".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        elif is_dataclass(value):
            add([type(value).__name__, *((f.name, getattr(value, f.name)) for f in fields(value))])
            if isinstance(value, EnvironmentLight):
                add(value.pixels())
        elif isinstance(value, tuple | list):
            digest.update(f"{len(value)}(".encode())
            for item in value:
                add(item)
        else:
            digest.update(f"{value!r},".encode())

    add(scene)
    return digest.hexdigest()[:16]
