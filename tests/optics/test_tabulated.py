from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from wgsss.errors import InputError
from wgsss.optics import Dipole, Profile, Tabulated


def table_of(profile, n=64):
    r = np.geomspace(1e-3, profile.range(1e-4).max(), n)
    return r, profile.reflectance(r)


@pytest.fixture
def table(skin):
    return Tabulated(*table_of(skin))


def test_a_table_of_the_dipole_is_the_dipole(measured):
    dipole = measured.dipole
    table = Tabulated(*table_of(dipole))
    np.testing.assert_allclose(table.total, dipole.total, rtol=1e-3)
    r = np.geomspace(1e-4, dipole.range(1e-4).max(), 999)
    near = r[:, None] < dipole.range(1e-3)  # in each channel: far beyond, R has fallen by many decades
    np.testing.assert_allclose(table.reflectance(r)[near], dipole.reflectance(r)[near], rtol=5e-3)


def test_the_curve_passes_through_the_entries_and_is_never_negative():
    """A noisy histogram, with empty bins."""
    rng = np.random.default_rng(7)
    r = np.arange(40) * 0.25
    R = rng.poisson(5 * np.exp(-r))[:, None] * [1.0, 0.3, 0.0]
    table = Tabulated(r, R)
    np.testing.assert_allclose(table.reflectance(r), R, rtol=1e-12)
    t = np.linspace(0, 10, 5000)
    i = np.clip(np.searchsorted(r, t, side="right"), 1, 39)
    between = table.reflectance(t)[t <= r[-1]]
    low, high = (f(R[i], R[i - 1])[t <= r[-1]] for f in (np.minimum, np.maximum))
    assert np.all(between >= low * (1 - 1e-12)) and np.all(between <= high * (1 + 1e-12))
    assert table.total[2] == 0.0 and table.range()[2] == 0.0


def test_constant_before_the_first_entry_and_black_after_the_last(table):
    np.testing.assert_array_equal(table.reflectance([0.0, 5e-4]), table.reflectance([1e-3, 1e-3]))
    assert np.all(table.reflectance(table.r[-1]) > 0)
    assert np.all(table.reflectance([np.nextafter(table.r[-1], 99), 1e6, np.inf]) == 0)


@pytest.mark.parametrize("first", [0.0, 0.2])
def test_closed_forms_are_the_integrals_of_reflectance(first, skin):
    r = first + np.linspace(0, 8, 9)
    table = Tabulated(r, skin.reflectance(r))

    def integral(f, low, high, breaks):
        edges = np.unique(np.clip([low, *breaks, high], low, high))
        return sum(quad(f, a, b, epsabs=1e-13)[0] for a, b in pairwise(edges))

    for c in range(3):
        for a in (0.0, 0.1, 1.0, 1.7, 7.9, 9.0):
            ring = integral(lambda s, c=c: 2 * np.pi * s * table.reflectance(s)[c], a, max(r[-1], a), r)
            assert table.beyond(a)[c] * table.total[c] == pytest.approx(ring, rel=1e-10, abs=1e-12)
            end, *breaks = np.sqrt(np.maximum(r[::-1] ** 2 - a**2, 0))
            line = 2 * integral(lambda y, a=a, c=c: table.reflectance(np.hypot(a, y))[c], 0, end, breaks)
            assert table.line_spread(-a)[c] == pytest.approx(line, rel=1e-5, abs=1e-12)
    assert np.all(table.beyond(0.0) == 1.0)
    assert table.line_spread(np.zeros((2, 1))).shape == (2, 1, 3)


def test_the_range_and_the_line_spread_of_a_table_are_accurate(table, skin):
    np.testing.assert_allclose(table.range(0.01), skin.range(0.01), rtol=5e-3)
    np.testing.assert_allclose(table.line_spread([0.3, 2.0]), Profile.line_spread(table, [0.3, 2.0]), rtol=1e-3)


def test_halving_lengths_scales_reflectance_by_four(table):
    half = Tabulated(table.r / 2, 4 * table.R)
    r = np.array([0.0, 0.03, 0.7, 5.0])
    np.testing.assert_allclose(half.reflectance(r / 2), 4 * table.reflectance(r), rtol=1e-12)
    np.testing.assert_allclose(half.total, table.total, rtol=1e-12)


def test_channels_are_independent(table):
    turned = Tabulated(table.r, table.R[:, [2, 0, 1]])
    r = np.array([0.0, 0.03, 0.7, 5.0])
    for name in ("reflectance", "beyond", "line_spread"):
        np.testing.assert_array_equal(getattr(turned, name)(r), getattr(table, name)(r)[:, [2, 0, 1]])
    np.testing.assert_array_equal(turned.total, table.total[[2, 0, 1]])


def test_a_csv_file_is_read(tmp_path, table):
    path = tmp_path / "skin.csv"
    rows = [",".join(map(repr, map(float, row))) for row in np.column_stack([table.r, table.R])]
    for head in ([], ["r (mm),R,G,B"], ["# from a notebook", "", "r_mm, red, green, blue", ",,,"]):
        path.write_text("\n".join([*head, *rows[:3], "", rows[3] + " # a comment", *rows[4:]]), encoding="utf-8-sig")
        read = Tabulated.read(path)
        np.testing.assert_array_equal(read.r, table.r)
        np.testing.assert_array_equal(read.R, table.R)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the file is empty"),
        ("\n", "needs at least 2 rows, not 0"),
        ("r,R,G,B\n1,2,3,4", "needs at least 2 rows, not 1"),
        ("0,1,1,1\n1;2;3;4", "line 2 has 1 columns, not 4"),
        ("0,1,1,1\n\n1,1,1", "line 3 has 3 columns"),
        ("0,1,1,1,1", "line 1 has 5 columns"),
        ("r,R,G,B\n0,1,1,1\n1,1,x y,1", "R of green on line 3 is not a number: 'x y'"),
        ("0.1,R,G,B\n0,1,1,1\n1,1,1,1", "R of red on line 1 is not a number: 'R'"),
        ("r,R,G,B\nunit,a,b,c\n0,1,1,1\n1,1,1,1", "r on line 2 is not a number: 'unit'"),
        ("0,1,1,1\n1,1,,1", "R of green on line 2 is not a number: ''"),
        ("0,1,1,1\n1,1,1,-2", r"R of blue on line 2 must be a number from 0 to 1e\+18 \(1/mm\^2\), not -2"),
        ("0,1,1,1\n1,nan,1,1", "R of red on line 2 .* not nan"),
        ("0,1,1,1\n1,inf,1,1", "R of red on line 2 .* not inf"),
        ("-1,1,1,1\n1,1,1,1", r"r on line 1 must be a number from 0 to 1e\+06 \(mm\), not -1"),
        ("0,1,1,1\nnan,1,1,1", "r on line 2 .* not nan"),
        ("0,1,1,1\n# note\n0.7,1,1,1\n0.5,1,1,1", "r must ascend: 0.5 on line 4 follows 0.7"),
        ("0,1,1,1\n0,1,1,1", "r must ascend: 0 on line 2 follows 0"),
        (b"\xff\xfe\x00", "not UTF-8"),
    ],
)
def test_bad_files_raise_an_error(tmp_path, text, says):
    path = tmp_path / "bad.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=rf"bad\.csv: .*{says}") as told:
        Tabulated.read(path)
    assert "\n" not in str(told.value)


def test_missing_files_raise_an_error(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        Tabulated.read(tmp_path / "none.csv")
    with pytest.raises(InputError, match="this is a folder"):
        Tabulated.read(tmp_path)


@pytest.mark.parametrize(
    ("r", "R", "says"),
    [
        ([0.0, 1.0], np.ones((3, 3)), "n rows of 3 values"),
        ([0.0, 1.0], np.ones((2, 2)), "n rows of 3 values"),
        ([[0.0, 1.0]], np.ones((2, 3)), "n rows of 3 values"),
        ([0.0], np.ones((1, 3)), "at least 2 rows"),
        ("ab", np.ones((2, 3)), "must be numbers"),
        ([0.0, 1.0, 0.5], np.ones((3, 3)), "r must ascend: 0.5 in row 3 follows 1"),
        ([0.0, 1.0], [[1, 1, 1], [1, -1, 1]], "R of green in row 2"),
    ],
)
def test_bad_tables_raise_an_error(r, R, says):
    with pytest.raises(InputError, match=says):
        Tabulated(r, R)


def test_tables_cannot_be_changed_in_place(table):
    with pytest.raises(ValueError, match="read-only"):
        table.R[0, 0] = 0.0


def test_a_dipole_written_to_a_file_and_read_is_the_same(tmp_path, skin):
    path = tmp_path / "skin.csv"
    np.savetxt(path, np.column_stack(table_of(skin)), delimiter=",", header="r,R,G,B")
    np.testing.assert_allclose(Tabulated.read(path).total, Dipole.total.fget(skin), rtol=1e-3)
