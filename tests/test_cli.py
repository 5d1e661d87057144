"""The command line: its output and files, and for bad input one line, exit code 2 and no file."""

from __future__ import annotations

import json
import logging
import os
import re
import shlex
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from conftest import ROOT
from PIL import Image as Picture

from wgsss.cli import catalogue, main
from wgsss.errors import Note
from wgsss.graph import Graph
from wgsss.registry import METHODS, REFERENCES, SURFACES, TRANSLUCENCIES
from wgsss.rendering import AOVS, DEFAULT_METHOD
from wgsss.scene import MATERIALS
from wgsss.scene.builtin import SCENES

SMALL = ["sphere", "--vertices", "300", "--method", "lambert", "--size", "24x16"]
HEAVY = ("numpy", "wgpu", "scipy", "trimesh", "xatlas", "PIL", "OpenEXR", "tqdm")


@dataclass
class Output:
    """Exit code and output of a command."""

    code: int
    out: str
    err: str


@pytest.fixture
def wgsss(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Output]:
    """Return a function that runs a command in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(*argv: str) -> Output:
        code = main(argv)
        return Output(code, *capsys.readouterr())

    return run


Run = Callable[..., Output]


def process(*argv: str, cwd: Path = ROOT, **environment: str) -> subprocess.Popen[str]:
    """Start the command of this checkout as a process in a folder."""
    command = [sys.executable, "-m", "wgsss", *argv]
    env = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    return subprocess.Popen(command, cwd=cwd, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


# lists and help


@pytest.mark.parametrize(("command", "names"), [("scenes", SCENES), ("methods", METHODS), ("materials", MATERIALS)])
def test_lists_describe_every_name(wgsss: Run, command: str, names: dict[str, object]) -> None:
    text = wgsss(command)
    entries = [line for line in text.out.split("\n\n")[0].splitlines() if not line.startswith(" ")]
    lines = [line.split(maxsplit=1) for line in entries if not line.endswith(" (a reference)")]
    assert [line[0] for line in lines] == list(names)
    assert all(len(line) == 2 for line in lines)
    listed = json.loads(wgsss(command, "--json").out)[command]
    assert [entry["name"] for entry in listed] == list(names)
    assert (text.code, text.err) == (0, "")


def test_references_are_listed_after_the_methods(wgsss: Run) -> None:
    text = wgsss("methods").out
    assert [line.split()[0] for line in text.splitlines() if line.endswith(" (a reference)")] == list(REFERENCES)
    listed = json.loads(wgsss("methods", "--json").out)["references"]
    assert [entry["name"] for entry in listed] == list(REFERENCES)


def test_a_method_that_is_a_pair_is_listed_with_its_parts(wgsss: Run) -> None:
    assert re.search(r"^deon07 .* \(the pair texture\+tsm\)$", wgsss("methods").out, re.M)
    pairs = {method["name"]: method["pair"] for method in json.loads(wgsss("methods", "--json").out)["methods"]}
    assert (pairs["deon07"], pairs["barre11"], pairs["lambert"]) == ("texture+tsm", "none+thickness", None)


def test_methods_list_surfaces_and_translucencies_for_pairs(wgsss: Run) -> None:
    pairs = json.loads(wgsss("methods", "--json").out)["pairs"]
    assert pairs == {"surface": list(SURFACES), "translucency": ["none", *TRANSLUCENCIES]}
    assert f"--surface one of {', '.join(SURFACES)}" in wgsss("methods").out


def test_pairs_list_the_surface_methods_that_fit_their_translucency_method(wgsss: Run) -> None:
    methods = {method["name"]: method for method in json.loads(wgsss("methods", "--json").out)["methods"]}
    surfaces = {
        name: [knob for knob in method["knobs"] if knob["name"] == "surface"] for name, method in methods.items()
    }
    assert [name for name, knobs in surfaces.items() if knobs] == ["jimenez15", "barre11", "sam"]
    assert (surfaces["sam"][0]["default"], surfaces["sam"][0]["choices"]) == ("texture", ["texture", "screen", "none"])


def test_methods_list_knobs_with_unit_default_and_range(wgsss: Run) -> None:
    methods = {m["name"]: m for m in json.loads(wgsss("methods", "--json").out)["methods"]}
    knob = next(k for k in methods["deon07"]["knobs"] if k["name"] == "map_size")
    assert (knob["default"], knob["unit"], knob["range"]) == (1024, "texels", [64, 4096])
    assert "--set map_size=1024" in wgsss("methods").out


def test_info_names_the_adapter_and_the_versions(wgsss: Run) -> None:
    info = json.loads(wgsss("info", "--json").out)
    assert info["chosen"] and info["versions"]["numpy"] == np.__version__
    assert info["cache"]["folder"] == os.environ["WGSSS_CACHE"]
    assert info["chosen"] in wgsss("info").out


def test_help_loads_no_heavy_packages_and_names_all_commands() -> None:
    script = f"""
import sys
from wgsss.cli import catalogue, main
from wgsss.errors import Note
for argv in (["--help"], ["render", "--help"]):
    try:
        main(argv)
    except SystemExit as end:
        assert end.code == 0
print([name for name in {HEAVY} if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    for word in ("render", "bake", "scenes", "methods", "materials", "info", f"default: {DEFAULT_METHOD}", "512x512"):
        assert word in done.stdout


def test_import_loads_no_heavy_packages_and_has_all_public_names() -> None:
    script = f"""
import sys, wgsss
print([name for name in {HEAVY} if name in sys.modules])
assert "render" in dir(wgsss) and not hasattr(wgsss, "rendr")
from wgsss.rendering import Renderer
assert all(getattr(wgsss, name) is not None for name in wgsss.__all__)
assert callable(wgsss.render) and wgsss.Renderer is Renderer
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == ("[]", "")


# rendering


def test_render_writes_the_picture_named_after_the_scene(wgsss: Run, tmp_path: Path) -> None:
    output = wgsss("render", *SMALL)
    assert (output.code, output.err) == (0, "")
    assert output.out.startswith("sphere.png: ")
    assert [path.name for path in tmp_path.iterdir()] == ["sphere.png"]
    with Picture.open(tmp_path / "sphere.png") as picture:
        pixels = np.asarray(picture)
    assert pixels.shape == (16, 24, 4)
    assert pixels[8, 12, 3] == 255 and pixels[0, 0, 3] == 0
    assert pixels[8, :, :3].max() > 40


def test_linear_files_hold_all_extra_outputs(wgsss: Run, tmp_path: Path) -> None:
    assert wgsss("render", *SMALL, "-o", "a.npy").code == 0
    assert {path.name for path in tmp_path.iterdir()} == {"a.npy", *(f"a.{name}.npy" for name in AOVS)}
    assert wgsss("render", *SMALL, "-o", "a.exr").code == 0
    with OpenEXR.File("a.exr", separate_channels=True) as file:
        assert {name.split(".")[0] for name in file.channels()} == {"R", "G", "B", "A", *AOVS}
        red, header = file.channels()["R"].pixels, dict(file.header())
    np.testing.assert_array_equal(red, np.load("a.npy")[..., 0])
    assert (header["wgsss.scene"], header["wgsss.method"], header["wgsss.exposure"]) == ("sphere", "lambert", "0")
    assert header["Software"].startswith("wgsss ") and header["wgsss.adapter"]


def test_json_describes_the_picture_and_its_options(wgsss: Run) -> None:
    output = wgsss("render", *SMALL, "-o", "a.png", "--json")
    result = json.loads(output.out)
    assert (result["files"], result["scene"], result["method"]) == (["a.png"], "sphere", "lambert")
    assert result["size"] == [24, 16]
    assert output.err == ""


def test_graph_lists_the_passes_with_times(wgsss: Run, tmp_path: Path) -> None:
    output = wgsss("render", *SMALL, "--graph", "--graph-out", "a.dot")
    assert "frame/gbuffer" in output.out and "passes ran" in output.out and "MiB" in output.out
    assert (tmp_path / "a.dot").read_text().startswith("digraph")
    graph = json.loads(wgsss("render", *SMALL, "--graph", "--json").out)["graph"]
    assert all(entry["culled"] or entry["ms"] > 0 for entry in graph["passes"])
    assert graph["peak_bytes"] > 0 and graph["clock"]


def test_frames_follow_the_motion(wgsss: Run, tmp_path: Path) -> None:
    wave = ["wave", "--vertices", "300", "--method", "lambert", "--size", "16x16"]
    output = wgsss("render", *wave, "--frames", "2", "--fps", "1", "-o", "a.npy")
    assert (output.code, output.err) == (0, "")
    assert wgsss("render", *wave, "--time", "1", "-o", "b.npy").code == 0
    first, second, alone = (np.load(f"{name}.npy") for name in ("a.0001", "a.0002", "b"))
    np.testing.assert_array_equal(second, alone)
    assert np.abs(first - second).max() > 0.01
    assert wgsss("render", *wave, "--frames", "3", "-o", "a.mp4").code == 0
    assert (tmp_path / "a.mp4").stat().st_size > 0


def test_exposure_material_and_tone_map_replace_those_of_the_scene(wgsss: Run) -> None:
    def brightest(*choice: str) -> float:
        assert wgsss("render", *SMALL, "--tone-map", "none", "-o", "a.png", *choice).code == 0
        with Picture.open("a.png") as picture:
            return float(np.asarray(picture)[..., :3].max())

    assert brightest("--exposure", "-3") < brightest("--exposure", "-1") - 10
    assert brightest("--exposure", "-1", "--material", "ketchup") != brightest("--exposure", "-1")


def test_bake_lists_new_cache_entries_once(wgsss: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path / "cache"))
    scene = ["sphere", "--vertices", "300", "--set", "map_size=64", "--json"]
    first = json.loads(wgsss("bake", *scene).out)
    assert first["made"] and all(Path(entry["file"]).stat().st_size == entry["bytes"] for entry in first["made"])
    assert json.loads(wgsss("bake", *scene).out)["made"] == []


# bad input


def ply(vertices: str, faces: str = "3 0 1 2\n", count: int = 3, face_count: int = 1) -> bytes:
    head = f"ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {face_count}\nproperty list uchar int vertex_indices\nend_header\n"
    return f"{head}{vertices}{faces}".encode()


TRIANGLE = "0 0 0\n1 0 0\n0 1 0\n"
SCENE = '[[object]]\nshape = "sphere"\nvertices = 300\n[[light]]\n'
FILES = {
    "empty.ply": ply("", "", 0, 0),
    "nan.ply": ply("nan 0 0\n1 0 0\n0 1 0\n"),
    "points.ply": ply(TRIANGLE, "", 3, 0),
    "small.ply": ply("2 2 2\n" * 3),
    "text.ply": b"this is not a mesh",
    "text.glb": b"this is not a mesh",
    "nothing.obj": b"",
    "good.ply": ply("0 0 0\n1 0 0\n0 1 0\n0 0 1\n", "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n", 4, 4),
    "key.toml": f'{SCENE}kind = "point"\nposition = [0, 0, 99]\nitensity = [1, 1, 1]\n'.encode(),
    "broken.toml": b"[[object",
    "hdr.toml": f'{SCENE}kind = "environment"\nfile = "damaged.hdr"\n'.encode(),
    "damaged.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n\x02\x02\x00\x10\xff",
}

BAD = [
    ("render nowhere.ply", "nowhere.ply: no such file"),
    ("render nowhere.toml", "nowhere.toml: no such file"),
    ("render text.ply", "text.ply"),
    ("render text.glb", "text.glb"),
    ("render nothing.obj", "nothing.obj: the file is empty"),
    ("render empty.ply", "empty.ply"),
    ("render nan.ply", "nan.ply: 1 of 3 positions are not finite"),
    ("render points.ply", "points.ply"),
    ("render small.ply", "small.ply: the mesh has zero size"),
    ("render good.ply --size-mm 0", "--size-mm"),
    ("render good.ply --vertices 5", "vertices is for built-in scenes"),
    ("render ear --size-mm 5", "size_mm is for mesh files"),
    ("render ear --vertices 0", "--vertices"),
    ("render key.toml", "key.toml: [[light]] 1: unknown key 'itensity'; did you mean 'intensity'?"),
    ("render broken.toml", "broken.toml: not a TOML file"),
    ("render hdr.toml --method lambert --size 8x8", "damaged.hdr: damaged"),
    ("render eer", "unknown scene 'eer'; did you mean 'ear'?"),
    ("render ear --material marbel", "unknown material 'marbel'; did you mean 'marble'?"),
    ("render ear --method deon70", "unknown method 'deon70'; did you mean 'deon07'?"),
    ("render ear --light {kind=1", "argument --light: '{kind=1' is not a table such as {kind"),
    ("render ear --light 3", "argument --light: '3' is not a table such as {kind"),
    ("render ear --light {kind='dir'}", "light: unknown kind 'dir'"),
    ("render ear --camera {kind='perspective'}", "camera: key 'eye' is missing"),
    ("render ear --material {presto='marble'}", "material: unknown key 'presto'"),
    ("render ear --surface paper", "unknown surface 'paper'"),
    ("render ear --translucency samm", "unknown translucency 'samm'; did you mean 'sam'?"),
    ("render ear --method sam --surface screen", "name either it or those"),
    ("render ear --set mapsize=512", "unknown knob of deon07 'mapsize'; did you mean 'map_size'?"),
    ("render ear --set map_size=12", "map_size must lie between 64 and 4096 (texels), not 12"),
    ("render ear --set map_size=big", "map_size must be a whole number, not 'big'"),
    ("render ear --set map_size", "'map_size' is not KNOB=VALUE"),
    ("render ear --size 0x100", "image size must be 1 to 8192 pixels"),
    ("render ear --size 100x9000", "image size must be 1 to 8192 pixels"),
    ("render ear --size 100", "'100' is not WIDTHxHEIGHT"),
    ("render ear --size -5x5", "--size"),
    ("render ear --frames 0", "--frames"),
    ("render ear --fps nan", "--fps"),
    ("render ear --fps 1e300", "'1e300' is not a number from 0.01 to 1000"),
    ("render ear --vertices 9999999999", "'9999999999' is not a whole number from 1 to 999999999"),
    ("render ear --time soon", "'soon' is not a number"),
    ("render ear --exposure 99", "exposure"),
    ("render ear --tone-map asces", "did you mean 'aces'?"),
    ("render ear -o a.jpg", "a.jpg: the file extension must be"),
    ("render ear -o no/where.png", "no/where.png: there is no folder 'no'"),
    ("render ear -o /proc/a.png", "/proc/a.png: cannot be written"),
    ("render ear --graph-out a.txt", "a.txt: the file extension must be .dot"),
    ("render ear --metod lambert", "unknown option '--metod'; did you mean '--method'?"),
    ("render ear lambert", "unexpected argument 'lambert'"),
    ("render", "SCENE"),
    ("rendr ear", "unknown command 'rendr'; did you mean 'render'?"),
    ("bake eer", "did you mean 'ear'?"),
    ("", "COMMAND"),
]


@pytest.mark.parametrize(("command", "message"), BAD, ids=[command for command, _ in BAD])
def test_bad_input_is_one_line_and_no_file(wgsss: Run, tmp_path: Path, command: str, message: str) -> None:
    for name, content in FILES.items():
        (tmp_path / name).write_bytes(content)
    result = wgsss(*command.split())
    assert result.err.startswith("wgsss: error: ") and result.err.count("\n") == 1 and result.err.endswith("\n")
    assert message in result.err
    assert (result.code, result.out) == (2, "")
    assert {path.name for path in tmp_path.iterdir()} == set(FILES)


@pytest.mark.parametrize("command", ["render", "bake", "info"])
def test_no_adapter_is_one_line(tmp_path: Path, command: str) -> None:
    scene = [] if command == "info" else SMALL[:5]
    done = process(command, *scene, cwd=tmp_path, VK_DRIVER_FILES="/nonexistent", VK_ICD_FILENAMES="/nonexistent")
    out, err = done.communicate()
    assert err.startswith("wgsss: error: no Vulkan adapter found") and err.count("\n") == 1
    assert done.returncode == 2
    assert ("chosen" in out) == (command == "info")  # info prints the rest nevertheless
    assert not list(tmp_path.iterdir())


def test_a_picture_that_is_not_finite_is_an_error_and_no_file(
    wgsss: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = Graph.read
    monkeypatch.setattr(Graph, "read", lambda graph, handle: read(graph, handle) + np.array([np.nan, 0, 0, 0]))
    result = wgsss("render", *SMALL, "-o", "a.exr")
    assert result.err.startswith("wgsss: error: ") and "not finite" in result.err and result.err.count("\n") == 1
    assert (result.code, result.out) == (1, "")
    assert not list(tmp_path.iterdir())


def test_warnings_are_one_line_each_and_in_the_json(wgsss: Run, tmp_path: Path) -> None:
    (tmp_path / "open.ply").write_bytes(ply(TRIANGLE))
    command = ["render", "open.ply", "--method", "lambert", "--size", "8x8"]
    result = wgsss(*command)
    lines = result.err.splitlines()
    assert lines[0].startswith("wgsss: warning: open.ply: 3 boundary edges") and result.code == 0
    assert all(line.startswith("wgsss: warning: ") for line in lines) and len(set(lines)) == len(lines)
    warnings_ = json.loads(wgsss(*command, "--json").out)["warnings"]
    assert [f"wgsss: warning: {text}" for text in warnings_] == lines
    assert json.loads(wgsss("render", *SMALL, "--json").out)["warnings"] == []


def test_warnings_of_libraries_are_not_printed(
    wgsss: Run, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def scenes(args: object) -> None:
        warnings.warn("a library's own", DeprecationWarning, stacklevel=1)
        np.float64(1.0) / np.float64(0.0)
        logging.getLogger("library").warning("logged")
        for _ in range(2):
            warnings.warn("the\n   user's", Note, stacklevel=1)

    monkeypatch.setattr(catalogue, "scenes", scenes)
    assert wgsss("scenes") == Output(0, "", "wgsss: warning: the user's\n")


# bugs, interrupts and closed streams


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (
            IndexError("list index\nout of range"),
            "a fault of wgsss, not of the input (IndexError: list index out of range)",
        ),
        (RecursionError("too deep"), "a fault of wgsss, not of the input (RecursionError: too deep)"),
        (AssertionError(), "a fault of wgsss, not of the input (AssertionError: )"),
        (MemoryError("Unable to allocate 9 TiB"), "there is not enough memory for this (Unable to allocate 9 TiB)"),
    ],
)
def test_a_bug_is_one_line_or_a_traceback_on_request(
    wgsss: Run, monkeypatch: pytest.MonkeyPatch, error: Exception, message: str
) -> None:
    def scenes(args: object) -> None:
        raise error

    monkeypatch.setattr(catalogue, "scenes", scenes)
    result = wgsss("scenes")
    assert result.err.startswith(f"wgsss: error: {message}") and result.err.count("\n") == 1
    assert (result.code, result.out) == (1, "")
    monkeypatch.setenv("WGSSS_DEBUG", "1")
    lines = wgsss("scenes").err.splitlines()
    assert lines[0].startswith("Traceback") and "in scenes" in "".join(lines) and lines[-1] == result.err.rstrip()


def test_an_interrupt_is_quiet_and_leaves_only_complete_frames(tmp_path: Path) -> None:
    running = process("render", *SMALL, "--frames", "100000", cwd=tmp_path)
    while not (tmp_path / "sphere.0002.png").exists() and running.poll() is None:
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=10)
    assert (running.returncode, out, err) == (130, "", "")
    for path in tmp_path.iterdir():
        assert path.suffix == ".png" and not path.name.startswith(".")
        Picture.open(path).load()


def test_a_closed_pipe_is_no_error() -> None:
    running = process("materials")
    assert running.stdout and running.stderr
    running.stdout.close()
    assert running.stderr.read() == ""
    assert running.wait() == 141


@pytest.mark.parametrize("redirected", [">&-", ">&- 2>&-"])
def test_commands_work_without_standard_output(tmp_path: Path, redirected: str) -> None:
    command = shlex.join([sys.executable, "-m", "wgsss", "render", *SMALL])
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(f"{command} {redirected}", shell=True, cwd=tmp_path, env=env, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (0, b"")
    assert (tmp_path / "sphere.png").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_standard_output_is_an_error_of_one_line() -> None:
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "wgsss", "methods"], stdout=full, stderr=subprocess.PIPE, env=env, text=True
        )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("wgsss: error: standard output cannot be written (")


def test_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    from wgsss import __version__

    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert (end.value.code, capsys.readouterr().out) == (0, f"wgsss {__version__}\n")
