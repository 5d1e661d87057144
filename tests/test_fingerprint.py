"""Fingerprints change with every field of a value and with every module of the code behind it."""

from __future__ import annotations

import copy
import inspect
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, make_dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from conftest import ROOT

from wgsss import cache, scene, wgsl
from wgsss.bake.octree import octree
from wgsss.bake.samples import subdivided
from wgsss.bake.unwrap import split
from wgsss.fingerprint import _encoded, closure, fingerprint
from wgsss.gpu import Gpu
from wgsss.methods.point_cloud import kernel
from wgsss.optics import Dipole, Layer, Layers, SumOfGaussians, Tabulated
from wgsss.reference.kernel import make_kernel
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import MATERIALS, load_scene
from wgsss.stage import Stage

EAR = load_scene("ear", vertices=500)
MESH, SKIN = EAR.objects[0].mesh, MATERIALS["skin1"]
LAYER = Layer(np.full(3, 0.1), np.ones(3))
PROFILES = [
    SKIN.profile,
    MATERIALS["skin"].profile,
    Layers((replace(LAYER, thickness=2.0), LAYER)),
    Tabulated(np.arange(3.0), np.ones((3, 3)) * 1e-3),
]
LIGHTS = [
    scene.DirectionalLight((0, 0, -1), (1, 1, 1)),
    scene.PointLight((0, 0, 9), (1, 1, 1)),
    scene.RectLight((0, 0, 9), (0, 0, -1), (0, 1, 0), 1, 1, (1, 1, 1)),
    scene.SphereLight((0, 0, 9), 1, (1, 1, 1)),
    scene.EnvironmentLight(),
]
CAMERAS = [scene.OrthographicCamera((0, 0, 9), (0, 0, 0)), scene.PerspectiveCamera((0, 0, 9), (0, 0, 0))]
KERNELS = [kernel(SKIN.profile, 0.1, 1.0), make_kernel(SKIN.profile, 0.1, 1.0)]
GEOMETRY = [MESH, split(MESH), subdivided(MESH, 9.0), octree(MESH.positions)[0], EAR.objects[0]]
DATACLASSES = [*GEOMETRY, SKIN, SKIN.maps, LAYER, *PROFILES, *LIGHTS, *CAMERAS, *KERNELS]


@pytest.mark.parametrize("value", DATACLASSES, ids=lambda value: type(value).__name__)
def test_every_field_of_a_dataclass_counts_but_its_name(value: Any) -> None:
    base = fingerprint(value)
    assert fingerprint(copy.deepcopy(value)) == base
    for field in fields(value):
        other = copy.copy(value)
        object.__setattr__(other, field.name, "another value")
        assert (fingerprint(other) == base) == (field.name == "name"), field.name


@dataclass(frozen=True)
class Thing:
    content: Any


class Pair(NamedTuple):
    first: int = 1


def test_different_values_have_different_fingerprints() -> None:
    base = np.arange(6, dtype=np.int32)
    values: list[Any] = [
        *(base, base[::-1], base.reshape(2, 3), base.astype(np.int64), base.view(np.float32), base.astype(">i4")),
        *(np.int32(1), np.float64(1), np.array(1.0), np.zeros((0, 2)), np.zeros((0, 3)), np.zeros(2, "i4,f4")),
        *(None, True, 1, 1.0, 1j, 0.0, -0.0, float("nan"), "1", b"1", "", b"", "\ud800"),
        *((), [], {}, (1,), [1], {1: 1}, {"1": 1}, (1, 1), ((1,), 1), (1, (1,)), ((1, 1),), ("1", ""), ("", "1")),
        *(Thing(1), Thing((1,)), Thing(Thing(1)), (Thing(1), 1), MATERIALS["skin1"], MATERIALS["skin2"]),
    ]
    assert len({fingerprint(value) for value in values}) == len(values)
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})


@pytest.mark.parametrize(
    "value", [object(), len, Thing, Path("file"), {1}, Pair(), np.array([None]), np.ma.masked_array([1]), Thing([len])]
)
def test_values_of_unknown_types_are_refused(value: Any) -> None:
    with pytest.raises(TypeError, match="has no fingerprint"):
        fingerprint(value)


def test_a_dataclass_without_a_source_file_is_refused() -> None:
    Thing = make_dataclass("Thing", [("content", int)], namespace={"__module__": "nowhere"})
    with pytest.raises(TypeError, match="nowhere has no source file"):
        fingerprint(Thing(1))


# code

SITES = ("wgsss.bake.unwrap", "wgsss.bake.sam", "wgsss.methods.sam.barnes_hut", "wgsss.reference.integral")

CHANGES = """
import json, sys
from pathlib import Path
from wgsss import fingerprint as module, wgsl

def files(site):
    for name in module.closure([site]):
        if name.startswith("wgsl/"):
            yield from {wgsl.ROOT / path for path, _ in wgsl.load(name[5:-5], wgsl.ROOT).lines}
        else:
            path = Path.cwd() / name.replace(".", "/")
            yield path / "__init__.py" if path.is_dir() else path.with_suffix(".py")

def key_with(site, file, text):
    file.write_bytes(text)
    module._package.cache_clear()
    if file.suffix == ".wgsl":
        wgsl.loaded.clear()
    return module.fingerprint(None, site)

same = {}
for site in sys.argv[1:]:
    base = module.fingerprint(None, site)
    for file in sorted(set(files(site))):
        text, line = file.read_bytes(), b"# changed" if file.suffix == ".py" else b"// changed"
        same.setdefault(site, {})[str(file.relative_to(Path.cwd()))] = key_with(site, file, text + line) == base
        assert key_with(site, file, text) == base
print(json.dumps(same))
"""


def copy_of_the_package(folder: Path) -> Path:
    for name in ("wgsss", "wgsl"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def run(folder: Path, *arguments: str, **environment: str) -> str:
    """Run Python with the package in a folder, and return what it prints."""
    environment = {**os.environ, "PYTHONPATH": str(folder), **environment}
    done = subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_changed_line_in_any_module_of_the_closure_changes_the_key(tmp_path: Path) -> None:
    folder = copy_of_the_package(tmp_path)
    same = json.loads(run(folder, "-c", CHANGES, *SITES))
    assert list(same) == list(SITES)
    for site, files in same.items():
        assert not [file for file, is_same in files.items() if is_same], site
    unwrap, sam, scale, integral = same.values()
    assert {"wgsss/scene/mesh.py", "wgsss/bake/atlas.py", "wgsl/bake/atlas_faces.wgsl"} <= unwrap.keys()
    assert {"wgsss/bake/sam/fit/training.py", "wgsl/sam/neighbour_mixture.wgsl", "wgsl/sam/top.wgsl"} <= sam.keys()
    assert {"wgsss/methods/sam/deform.py", "wgsl/sam/barnes_hut.wgsl"} <= scale.keys()
    assert {"wgsss/scene/mesh.py", "wgsss/emitters.py", "wgsl/light.wgsl"} <= integral.keys()
    assert "wgsss/scene/loading.py" not in unwrap, "an edit to a reader of files makes no new atlases"


@pytest.mark.filterwarnings("ignore::wgsss.errors.Note")
def test_the_code_that_runs_while_an_entry_is_made_belongs_to_its_key(
    gpu: Gpu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path))
    keyed: list[set[str]] = []
    """the closure of each entry that is being made, the innermost last"""
    makes: set[str] = set()
    missed: set[tuple[str, str]] = set()

    def fingerprinted(value: object, *modules: str) -> str:
        code = set(modules)
        list(_encoded(value, code))
        keyed.append(set(closure(code)))
        makes.update(modules)
        return fingerprint(value, *modules)

    def ran(name: str) -> None:
        missed.update((name, min(names)) for names in making if name not in names)

    def traced(frame: Any, event: str, _: Any) -> None:
        file = frame.f_code.co_filename
        if event == "call" and file.startswith(str(ROOT / "wgsss")):
            parts = Path(file).relative_to(ROOT).with_suffix("").parts
            ran(".".join(parts).removesuffix(".__init__"))

    making: list[set[str]] = []

    @contextmanager
    def activity(label: str) -> Iterator[None]:
        making.append(keyed[-1])
        sys.setprofile(traced)
        yield
        making.pop()
        sys.setprofile(traced if making else None)

    load: Callable[..., Any] = wgsl.load

    def loaded(name: str, root: Path = wgsl.ROOT) -> Any:
        if inspect.stack()[1].function != "closure":
            ran(f"wgsl/{name}.wgsl")
        return load(name, root)

    monkeypatch.setattr(cache, "fingerprint", fingerprinted)
    monkeypatch.setattr(cache.console, "activity", activity)
    monkeypatch.setattr(wgsl, "load", loaded)
    wave = load_scene("wave", vertices=500)
    for name, knobs in (("deon07", {"map_size": 64}), ("barre11", {}), ("jimenez08", {}), ("jensen02", {"spacing": 9})):
        Renderer(EAR, make_method(name, knobs), (8, 8), gpu)
    for select in ("fit", "top", "coarse"):
        Renderer(EAR, make_method("sam", {"select": select}), (8, 8), gpu)
    Renderer(wave, make_method("sam"), (8, 8), gpu).frame(0.5)
    make_method("integral", {"samples": 1000}).estimate(Stage(gpu, EAR), (4, 4))  # type: ignore[attr-defined]
    assert len(makes) > 10 and not making
    assert not missed


def test_a_flipped_sign_in_the_normals_is_baked_anew(tmp_path: Path) -> None:
    folder = copy_of_the_package(tmp_path / "copy")
    bake = ("-m", "wgsss", "bake", "sphere", "--vertices", "300", "--method", "barre11")
    folders = {"WGSSS_CACHE": str(tmp_path / "cache")}
    run(folder, *bake, **folders)
    assert "no new entries" in run(folder, *bake, **folders)
    mesh = folder / "wgsss" / "scene" / "mesh.py"
    text = mesh.read_text()
    assert text.count(" total / np.maximum(length") == 1
    mesh.write_text(text.replace(" total / np.maximum(length", " -total / np.maximum(length"))
    assert "no new entries" not in run(folder, *bake, **folders)


def test_names_that_a_package_passes_on_lead_to_the_modules_that_define_them() -> None:
    names = closure(["wgsss.bake.thickness"])
    assert {"wgsss.optics", "wgsss.optics.profile", "wgsss.scene.mesh"} <= names.keys()
    assert "wgsss.optics.dipole" not in names, "another profile is another key, by its class"
    assert fingerprint(SKIN.profile) != fingerprint(MATERIALS["skin"].profile)
    assert isinstance(SKIN.profile, Dipole) and isinstance(MATERIALS["skin"].profile, SumOfGaussians)
