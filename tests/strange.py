"""Random damaged and strange input of every kind."""

from __future__ import annotations

import io
import json
import random
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import OpenEXR
from PIL import Image

Input = tuple[list[str], dict[str, bytes]]
"""arguments of a command, and the contents of its files by name"""

STRANGE = (
    *("0", "-1", "2.5", "1e-300", "1e-9", "1e9", "1e15", "1e30", "1e300", "1e999", "inf", "-inf", "nan", "true", '""'),
    *('"$x$"', '"a\\nb\\u001b"', '"~nouser/x"', '"/dev/zero"', '"."', "[]", "[1]", "[1, 2, 3]", "[1, 2, 3, 4]", "{}"),
    *('["a", "b", "c"]', "[[1], [2], [3]]", "[nan, 1, 1]", "[1e300, 1, 1]", "[true, true, true]", "[0, 0, 0]"),
    *("9" * 400, "9" * 5000, "1979-05-27", "07:32:00", "[" * 2000, "{a = {b = {c = 1}}}", "[1e15, -1e15, 1e15]"),
)
WORDS = (
    *(
        "",
        "0",
        "-1",
        "-1e-1",
        "-.5",
        "-inf",
        "nan",
        "1e300",
        "1e999",
        "9" * 400,
        "x" * 5000,
        "$x$",
        "=",
        "a=b",
        "a=b=c",
    ),
    *("{", "{}", "{kind = 1}", "{a = " + "[" * 2000, "8x8x8", "0x0", "-8x8", "\u0668x\u0668", "a,,b", ":", "+", "a+b"),
    *("/dev/null", "/", ".", "~nouser/x", "\0", "a\nb", "\udcff", "\u202e", "none", "lambert:x=1", "map_size=1e400"),
)
OPTIONS = {
    "render": (
        *("--material", "--size-mm", "--animation", "--simplify", "--vertices", "--camera", "--light", "--method"),
        *("--surface", "--translucency", "--set", "--size", "--frames", "--fps", "--time", "--exposure", "--tone-map"),
        *("--bloom", "-o", "--graph-out"),
    ),
    "profile": ("--model", "--k", "--thickness", "--r", "-o"),
    "export": ("--mitsuba", "--gltf", "--size", "--time"),
    "compare": ("--methods", "--reference", "--lights", "--size", "-o"),
    "bench": ("--methods", "--reference", "--table", "--size", "-o"),
}
OBJECT = '[[object]]\nshape = "sphere"\nvertices = 100\ntranslate = [0, 0, 0]\nrotate = [0, 0, 0]\n'
SCENES = (
    'name = "n"\nexposure = 0\ntone_map = "aces"\nbloom = 0\n' + OBJECT,
    *(
        f'{OBJECT}material = "marble"\n[[light]]\nkind = {light}\n'
        for light in (
            '"directional"\ndirection = [0, 0, -1]\nirradiance = [1, 1, 1]',
            '"point"\nposition = [0, 0, 300]\nintensity = [1, 1, 1]',
            '"rect"\nposition = [0, 0, 300]\ndirection = [0, 0, -1]\nup = [0, 1, 0]\nwidth = 50\n'
            "height = 50\nradiance = [1, 1, 1]",
            '"sphere"\nposition = [0, 0, 300]\nradius = 20\nradiance = [1, 1, 1]\nsamples = 4',
            '"environment"\nradiance = [1, 1, 1]\nrotation = 30',
        )
    ),
    *(
        f"{OBJECT}[camera]\nkind = {camera}\n"
        for camera in (
            '"perspective"\neye = [0, 0, 300]\ntarget = [0, 0, 0]\nup = [0, 1, 0]\nfov = 30\nturn = 0',
            '"orthographic"\neye = [0, 0, 300]\ntarget = [0, 0, 0]\nheight = 100',
            '"perspective"\ntarget = [0, 0, 0]\ndistance = 300\nazimuth = 20\nelevation = 10',
        )
    ),
    f'{OBJECT}[object.motion]\nkind = "bend_and_swell"\nlength = 60\nbend = 75\nswell = 0.3\nwaves = 1\nperiod_s = 4\n',
    '[[object]]\nmesh = "box.ply"\nsize_mm = 50\n[[light]]\nkind = "environment"\nfile = "sky.hdr"\n',
)
MATERIALS = (
    "sigma_a = [0.1, 0.1, 0.1]\nsigma_s_prime = [1, 1, 1]\neta = 1.3\nroughness = 0.3\nbase_color = [1, 1, 1]\n",
    "[gaussians]\nvariances = [0.1, 1]\nweights = [[0.4, 0.4, 0.4], [0.4, 0.4, 0.4]]\n",
    "reflectance = [0.5, 0.5, 0.5]\nmean_free_path = [1, 1, 1]\n",
    'preset = "marble"\nspecular = 0.5\ncolor_after = 0.5\ntransport = [0.2, 1, 0]\nname = "m"\n',
    "[[layers]]\nsigma_a = [0.1, 0.1, 0.1]\nsigma_s_prime = [2, 2, 2]\nthickness = 5\n[[layers]]\nsigma_a = [0.1, 0.1, "
    "0.1]\nsigma_s_prime = [1, 1, 1]\ng = 0.5\n",
    'table = "table.csv"\n',
)
TABLE = b"r,R,G,B\n0,0.2,0.2,0.2\n0.5,0.1,0.1,0.1\n2,0.01,0.01,0.01\n"
RUN: dict[str, Any] = {
    **{"scene": "ball", "digest": "d", "method": "sam", "knobs": {"samples": 3}, "step": 0, "size": [24, 16]},
    **{
        "reference": "integral",
        "version": "1",
        "adapter": "a",
        "clock": "sundial",
        "date": "2026-01-02",
        "floor": 0.01,
    },
    **{"bake_ms": 1.0, "bake_cached": True, "frame_ms": 2.0, "frame_ms_quartiles": [1.5, 2.5], "frames": 9, "bytes": 7},
    **{"passes": {"p": 2.0}, "error": {"rel_rmse": 0.1, "psnr": 30.0, "flip": None, "bias": 1.0}},
}


def box() -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[x, y, z] for x in (0, 40) for y in (0, 40) for z in (0, 40)], np.float32)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)


def meshes() -> dict[str, bytes]:
    """Return a box as a file of every format."""
    corners, faces = box()
    head = f"element vertex {len(corners)}\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    lists = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    lists["count"], lists["corners"] = 3, faces
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in corners)
    threes = "".join(f"3 {a} {b} {c}\n" for a, b, c in faces)
    triangles = np.zeros(len(faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    triangles["corners"] = corners[faces]
    data = corners.tobytes() + faces.astype("<u2").tobytes()
    views = [{"buffer": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 72}]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": [40, 40, 40]},
        {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
    ]
    tree = {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "scene": 0, "nodes": [{"mesh": 0, "name": "n"}]}
    tree |= {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}]}
    tree |= {"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}}], "accessors": accessors}
    tree |= {"bufferViews": views, "buffers": [{"byteLength": len(data)}]}
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return {
        "a.ply": f"ply\nformat ascii 1.0\n{head}{rows}{threes}".encode(),
        "b.ply": f"ply\nformat binary_little_endian 1.0\n{head}".encode() + corners.tobytes() + lists.tobytes(),
        "a.obj": "".join(
            [f"v {r}\n" for r in rows.splitlines()] + [f"f {a} {b} {c}\n" for a, b, c in faces + 1]
        ).encode(),
        "a.stl": bytes(80) + struct.pack("<I", len(faces)) + triangles.tobytes(),
        "a.off": f"OFF\n8 12 0\n{rows}{threes}".encode(),
        "a.glb": struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks,
    }


def images() -> dict[str, bytes]:
    """Return two skies and a texture as files."""
    rgbe = np.full((8, 16, 4), 128, np.uint8)
    rgbe[..., :3] = np.arange(3, 131).reshape(8, 16, 1)  # 1 1 1 would be a run
    stream, exr = io.BytesIO(), io.BytesIO()
    Image.fromarray(rgbe[..., :3]).save(stream, format="png")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": np.linspace(0, 1, 8 * 16 * 3, dtype=np.float32).reshape(8, 16, 3)}) as file:
        file.write(exr)
    return {
        "sky.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + rgbe.tobytes(),
        "sky.exr": exr.getvalue(),
        "wood.png": stream.getvalue(),
    }


def damaged(chance: random.Random, data: bytes) -> bytes:
    """Cut data, or change, insert or remove bytes."""
    changed = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 8))):
        at = chance.randrange(len(changed) + 1)
        how = chance.randrange(6)
        if how == 0:
            del changed[at:]
        elif how == 1:
            del changed[at : at + chance.randrange(1, 40)]
        elif how == 2:
            changed[at:at] = chance.randbytes(chance.randrange(1, 9))
        elif how == 3:
            changed[at : at + 4] = chance.choice(
                (b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\0\0\xc0\x7f")
            )
        elif how == 4 and at < len(changed):
            changed[at] ^= 1 << chance.randrange(8)
        else:
            changed[at:at] = chance.choice(
                (b"\n", b"\0", b"\xef\xbb\xbf", b"-", b"1e999", b'"', b"}", b"[" * 999, b"nan")
            )
    return bytes(changed)


def altered(chance: random.Random, text: str) -> bytes:
    """Change TOML text: replace a value, rename a key, repeat a line, or damage bytes."""
    lines = text.splitlines()
    values = [i for i, line in enumerate(lines) if " = " in line]
    at = chance.choice(values)
    how = chance.randrange(8)
    if how == 0:
        return damaged(chance, text.encode())
    if how == 1:
        lines.insert(at, lines[at])
    elif how == 2:
        lines[at] = lines[at].replace(" = ", "x = ")
    else:
        lines[at] = f"{lines[at].partition(' = ')[0]} = {chance.choice(STRANGE)}"
    return "\n".join(lines).encode()


RENDER = ["--method", "lambert", "--size", "8x8", "-o", "out.npy", "--json"]
FILES = {"box.ply": meshes()["a.ply"], "sky.hdr": images()["sky.hdr"], "table.csv": TABLE}


def scene(chance: random.Random) -> Input:
    return ["render", "s.toml", *RENDER], {**FILES, "s.toml": altered(chance, chance.choice(SCENES))}


def material(chance: random.Random) -> Input:
    files = {**FILES, "m.toml": altered(chance, chance.choice(MATERIALS))}
    if chance.random() < 0.5:
        return ["profile", "m.toml", "--r", "0.5", "--k", "2", "--model", "gaussians", "--json"], files
    return ["render", "sphere", "--vertices", "100", "--material", "m.toml", *RENDER], files


def table(chance: random.Random) -> Input:
    files = {"table.csv": damaged(chance, TABLE), "m.toml": b'table = "table.csv"'}
    return ["profile", "m.toml", "--r", "0.5", "--k", "2", "--model", "table", "--json"], files


def runs(chance: random.Random) -> Input:
    run = json.loads(json.dumps(RUN))
    key = chance.choice(list(run))
    values = (
        None,
        True,
        -1,
        1e300,
        0,
        10**400,
        "",
        "$\\frac{",
        "<!--<script>",
        [],
        {},
        [1, "a"],
        {"a": [1]},
        float("nan"),
    )
    if chance.random() < 0.2:
        del run[key]
    elif chance.random() < 0.3:
        run["error"][chance.choice(list(run["error"]))] = chance.choice(values)
    else:
        run[key] = chance.choice(values)
    bad = json.dumps(run).encode()
    bad = damaged(chance, bad) if chance.random() < 0.4 else bad
    good = json.dumps(RUN).encode() + b"\n"
    return ["bench", "-o", ".", "--json"], {
        "runs.jsonl": good * chance.randrange(2) + bad + b"\n" * chance.randrange(2)
    }


def arguments(chance: random.Random) -> Input:
    command = chance.choice(list(OPTIONS))
    argv = ["profile", "marble"] if command == "profile" else [command, "sphere", "--vertices", "100", "--size", "8x8"]
    argv += {
        "render": ["--method", "lambert"],
        "compare": ["--methods", "lambert"],
        "bench": ["--methods", "lambert"],
    }.get(command, [])
    for _ in range(chance.choice((1, 1, 2))):
        argv += [chance.choice(OPTIONS[command]), chance.choice(WORDS)]
    if chance.random() < 0.2:
        argv[chance.randrange(len(argv))] = chance.choice(WORDS)
    return [*argv, "--json"], {}


def mesh(chance: random.Random) -> Input:
    name, data = chance.choice(list(meshes().items()))
    files = {name: damaged(chance, data)}
    return (["render", name, *RENDER] if chance.random() < 0.7 else ["info", name, "--json"]), files


def image(chance: random.Random) -> Input:
    name, data = chance.choice(list(images().items()))
    text = OBJECT + (
        f'[object.material]\npreset = "marble"\nbase_color_map = "{name}"\n'
        if name == "wood.png"
        else f'[[light]]\nkind = "environment"\nfile = "{name}"\n'
    )
    return ["render", "s.toml", *RENDER], {name: damaged(chance, data), "s.toml": text.encode()}


KINDS: dict[str, tuple[Callable[[random.Random], Input], int]] = {
    "scene": (scene, 80),
    "material": (material, 40),
    "table": (table, 20),
    "runs": (runs, 30),
    "arguments": (arguments, 60),
    "mesh": (mesh, 40),
    "image": (image, 30),
}
