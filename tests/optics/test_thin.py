from __future__ import annotations

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.optics.thin import blend

R, T = np.array([0.4, 0.2, 0.1]), np.array([0.04, 0.01, 0.0])


@pytest.mark.parametrize(
    ("degrees", "wanted"),
    [(0, [0.4, 0.2, 0.1]), (60, [0.31, 0.1525, 0.075]), (90, [0.22, 0.105, 0.05]), (180, [0.04, 0.01, 0.0])],
)
def test_the_normals_choose_between_R_and_T(degrees, wanted):
    np.testing.assert_allclose(blend(R, T, np.cos(np.radians(degrees))), wanted, rtol=1e-12, atol=1e-16)


def test_many_pairs_of_points():
    cosines = np.array([[1.0, -1.0], [0.5, 0.0]])
    found = blend(np.stack([R, 2 * R]), T, cosines)
    assert found.shape == (2, 2, 3)
    np.testing.assert_allclose(found[0], [R, T])
    np.testing.assert_allclose(found[1, 1], R + T / 2)


def test_normals_with_rounding_errors_are_accepted():
    np.testing.assert_array_equal(blend(R, T, -1.0 - 1e-7), T)


@pytest.mark.parametrize("cosine", [1.1, [0.0, -2.0], np.nan])
def test_bad_cosines_raise_an_error(cosine):
    with pytest.raises(InputError, match="cosine between normals must be from -1 to 1"):
        blend(R, T, cosine)
