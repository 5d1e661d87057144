"""Materials of OBJ files: textures with options, and notes on statements that are left out."""

from __future__ import annotations

from pathlib import Path

import pytest

from wgsss.errors import InputError
from wgsss.scene.files.contents import Look, Texture
from wgsss.scene.files.obj.mtl import read_materials


def read(folder: Path, text: str, *images: str) -> tuple[Look, list[str]]:
    """Read a material file with one material, and return its look and the notes. Images are empty files."""
    for image in images:
        (folder / image).parent.mkdir(parents=True, exist_ok=True)
        (folder / image).write_bytes(b"x")
    path = folder / "a.mtl"
    path.write_bytes(f"newmtl m\n{text}\n".encode("utf-8", "surrogateescape"))
    looks, notes = read_materials(path)
    assert all(len(note.splitlines()) == 1 for note in notes)
    return looks["m"], notes


def test_colour_roughness_and_index_of_refraction(tmp_path: Path) -> None:
    look, notes = read(tmp_path, "  Kd 0.1\t.2 3e-1 # c\nNi 1.45\nPr 0.25\nKa 1 1 1\nillum 2\nd 1\nTr 0\nKe 0 0 0")
    assert look == Look("m", base_color=(0.1, 0.2, 0.3), eta=1.45, roughness=0.25) and notes == []


@pytest.mark.parametrize("eta", ["1", "1.0", "0", "3.5", "nan"])
def test_invalid_indices_of_refraction_are_ignored(tmp_path: Path, eta: str) -> None:
    assert read(tmp_path, f"Ni {eta}")[0].eta is None


def test_a_single_number_is_repeated(tmp_path: Path) -> None:
    assert read(tmp_path, "Kd 0.5")[0].base_color == (0.5, 0.5, 0.5)


def test_a_black_colour_with_a_texture_becomes_white(tmp_path: Path) -> None:
    look, notes = read(tmp_path, "Kd 0 0 0\nmap_Kd t.png", "t.png")
    assert look.base_color == (1, 1, 1) and notes == [
        "material m: Kd 0 0 0 would make its texture black and is replaced by 1 1 1"
    ]
    assert read(tmp_path, "Kd 0 0 0")[0].base_color == (0, 0, 0)


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("map_Kd t.png", "t.png"),
        ("MAP_KD t.png", "t.png"),
        ("\tmap_Kd\t t.png  # c", "t.png"),
        ("map_Kd T.PNG", "t.png"),
        ("map_Kd SUB/T.png", "sub/t.png"),
        ("map_Kd sub\\t.png", "sub/t.png"),
        ("map_Kd C:\\Users\\me\\maps\\t.png", "t.png"),
        ("map_Kd /home/me/t.png", "t.png"),
        ("map_Kd ../gone/t.png", "t.png"),
        ("map_Kd my skin.png", "my skin.png"),
        ("map_Kd my%20skin.png", "my skin.png"),
        ('map_Kd "my skin.png"', "my skin.png"),
        ("map_Kd -s 2 2 2 my skin.png", "my skin.png"),
        ("map_Kd skin #2.png", "skin #2.png"),
        ("map_Kd na\u00efve.png", "na\u00efve.png"),
        ("map_Kd na\udcefve.png", "na\u00efve.png"),
        ("map_Kd 100%.png", "100%.png"),
    ],
)
def test_names_of_textures(tmp_path: Path, line: str, name: str) -> None:
    look, notes = read(tmp_path, line, name)
    assert look.base_color_map is not None and notes == []
    assert look.base_color_map.source == tmp_path / name and look.base_color_map.name == Path(name).name


def test_the_written_name_is_tried_before_other_spellings(tmp_path: Path) -> None:
    look, _ = read(tmp_path, "map_Kd T%20.png", "T%20.png", "T .png", "t%20.png")
    assert look.base_color_map and look.base_color_map.source == tmp_path / "T%20.png"


def test_missing_textures_are_noted(tmp_path: Path) -> None:
    (tmp_path / "folder.png").mkdir()
    for name in ("gone.png", "folder.png", "/dev/zero", "x" * 300, "a\0b"[:1] + ".png", "."):
        look, (note,) = read(tmp_path, f"map_Kd {name}")
        assert look.base_color_map is None and "does not exist and is left out" in note


OPTIONS = (
    "-blendu on -blendv on -boost 2 -cc off -clamp off -imfchan l -mm 0 1 -o 0.1 0.2 0.3 -s 2 3 -t 0 0 0 -texres 64"
)


@pytest.mark.parametrize("line", [f"{OPTIONS} 1 t.png", f"1 t.png {OPTIONS}"])
def test_options_take_different_numbers_of_words(tmp_path: Path, line: str) -> None:
    look, notes = read(tmp_path, f"map_Kd {line}", "1 t.png")
    assert notes == []
    assert look.base_color_map is not None and look.base_color_map.source == tmp_path / "1 t.png"
    rows = look.base_color_map.transform
    assert rows is not None
    # At (u, v) = (0.25, 0.5), v up, the lookup is at (2 * 0.25 + 0.1, 3 * 0.5 + 0.2).
    u, v = (a * 0.25 + b * (1 - 0.5) + c for a, b, c in rows)
    assert (u, 1 - v) == pytest.approx((0.6, 1.7))


def test_offset_of_one_number_and_clamp(tmp_path: Path) -> None:
    look, _ = read(tmp_path, "map_Kd -o .5 -clamp on t.png", "t.png")
    assert look.base_color_map == Texture(
        tmp_path / "t.png", "t.png", transform=((1, 0, 0.5), (0, 1, 0)), wrap=("clamp", "clamp")
    )


@pytest.mark.parametrize("option", ["-mm 0.1 2", "-cc on", "-t 1 0 0", "-blendu off", "-imfchan r"])
def test_options_that_are_ignored_are_noted(tmp_path: Path, option: str) -> None:
    assert read(tmp_path, f"map_Kd {option} t.png", "t.png")[1] == [
        f"material m: the option {option} of map_kd is ignored"
    ]


def test_normal_maps_are_not_height_maps(tmp_path: Path) -> None:
    look, notes = read(tmp_path, "norm -bm 0.5 n.png\nmap_Bump -bm 2 b.png", "n.png", "b.png")
    assert look.normal_map is not None and look.normal_map.name == "n.png" and look.normal_scale == 0.5
    assert notes == [
        "material m: the height map 'b.png' (map_bump) is left out (if it holds normals, name it by 'norm')"
    ]
    assert read(tmp_path, "map_Kn n.png")[0].normal_map is not None


def test_specular_map(tmp_path: Path) -> None:
    look, notes = read(tmp_path, "map_Ks s.png", "s.png")
    assert look.specular_map is not None and look.specular_map.channels == "L" and notes == []


def test_opacity_in_the_alpha_of_the_colour_map_is_a_mask(tmp_path: Path) -> None:
    look, notes = read(tmp_path, "map_Kd leaf.png\nmap_d Leaf.png\nd 0.0", "leaf.png")
    assert look.cutoff == 0.5 and notes == []
    look, notes = read(tmp_path, "map_Kd leaf.png\nmap_d mask.png", "leaf.png", "mask.png")
    assert look.cutoff is None and notes == ["material m: the texture 'mask.png' (map_d) is left out"]


@pytest.mark.parametrize(
    ("line", "note"),
    [
        ("d 0.5", "transparency (d, Tr) is left out: the material is drawn opaque"),
        ("d -halo 0.5", "transparency (d, Tr) is left out: the material is drawn opaque"),
        ("Tr 0.5", "transparency (d, Tr) is left out: the material is drawn opaque"),
        ("Ke 1 0 0", "emission (Ke) is left out"),
        ("Tf 1 .5 1", "transmission filter (Tf) is left out"),
        ("Pm 1", "metallic (Pm) is left out"),
        ("Ns 96\nKs .5 .5 .5", "Phong highlights (Ks, Ns) are left out"),
        ("Kd 2 0 0", "Kd is outside 0 to 1 and is clipped"),
        ("Kd spectral file.rfl 1", "'kd spectral file.rfl 1' is not understood and is left out"),
        ("Kd 1 2", "'kd 1 2' is not understood and is left out"),
        ("Kd nan 0 0", "'kd nan 0 0' is not understood and is left out"),
        ("map_Pr r.png", "the texture 'r.png' (map_pr) is left out"),
        ("disp -mm 0 2 h.png", "the texture 'h.png' (disp) is left out"),
        ("refl -type sphere sky.png", "the texture 'sky.png' (refl) is left out"),
    ],
)
def test_unused_statements_are_noted(tmp_path: Path, line: str, note: str) -> None:
    assert f"material m: {note}" in read(tmp_path, line)[1]


def test_the_ambient_texture_that_repeats_the_diffuse_one_is_not_noted(tmp_path: Path) -> None:
    assert read(tmp_path, "map_Ka t.png\nmap_Kd t.png", "t.png")[1] == []
    assert len(read(tmp_path, "map_Ka u.png\nmap_Kd t.png", "u.png")[1]) == 1


def test_one_note_names_many_materials(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("".join(f"newmtl m{i}\nd 0.5\n" for i in range(5)))
    looks, notes = read_materials(tmp_path / "a.mtl")
    assert len(looks) == 5
    assert notes == ["materials m0, m1, m2 and 2 more: transparency (d, Tr) is left out: the material is drawn opaque"]


def test_the_first_of_two_materials_with_one_name_is_used(tmp_path: Path) -> None:
    look, notes = read(tmp_path, "Kd 1 0 0\nnewmtl m\nKd 0 1 0")
    assert look.base_color == (1, 0, 0)
    assert notes == ["material m: it is defined more than once, and the first definition is used"]


@pytest.mark.parametrize("data", [b"", b"newmtl a\0"])
def test_a_missing_material_file_is_an_error(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.mtl").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.mtl"):
        read_materials(tmp_path / "a.mtl")
