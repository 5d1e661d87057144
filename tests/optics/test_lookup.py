"""Tables of profiles: their distances, and the lookups of the shaders against those of numpy."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss import wgsl
from wgsss.graph import Graph
from wgsss.optics import Dipole, lookup

PROBE = """
import package::profile_table::{entry_of, entries_of, fraction_of, at_least_first, log_entry, root_entry};
@group(0) @binding(0) var<uniform> params: vec4u; // x: the first entry
@group(0) @binding(1) var<storage, read> numbers: array<f32>;
@group(0) @binding(2) var<storage, read_write> entries: array<vec4f>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&numbers) { return; }
    let x = numbers[id.x];
    let entry = entry_of(x, params.x);
    let same = f32(all(entries_of(vec4f(x), params.x) == vec4u(entry)));
    entries[2u * id.x] = vec4f(f32(entry), fraction_of(x), at_least_first(x, params.x), same);
    entries[2u * id.x + 1u] = vec4f(log_entry(x, -6.0, 3.0, 20u), root_entry(x, 50.0, 40u), 0.0, 0.0);
}
"""


@pytest.mark.parametrize("shift", [lookup.SHIFT, 16])
def test_leading_bits_count_the_intervals(shift):
    first = int(lookup.leading_bits(0.013, shift))
    starts = lookup.interval_starts(first, first + 2000, shift)
    middles = lookup.interval_middles(first, first + 2000, shift)
    count = np.arange(first, first + 2000)
    np.testing.assert_array_equal(lookup.leading_bits(starts, shift), count)
    np.testing.assert_array_equal(lookup.leading_bits(middles, shift), count)
    below = np.nextafter(starts.astype(np.float32), np.float32(0))
    np.testing.assert_array_equal(lookup.leading_bits(below, shift), count - 1)


def test_each_doubling_of_the_squared_distance_has_256_entries():
    assert lookup.SHIFT == 15
    numbers = np.geomspace(1e-6, 1e6, 30)
    np.testing.assert_array_equal(lookup.leading_bits(2 * numbers) - lookup.leading_bits(numbers), 256)


def test_shaders_find_the_same_entries(gpu, modules):
    table = (wgsl.ROOT / "profile_table.wgsl").read_text()
    units = (wgsl.ROOT / "units.wgsl").read_text()
    modules(probe=PROBE, profile_table=table, units=units)
    numbers = np.random.default_rng(2).uniform(0.1, 100.0, 500).astype(np.float32)
    first = int(lookup.leading_bits(1.0))
    graph = Graph(gpu)
    entries = graph.dispatch(
        "probe", size=1000, params=np.array([first, 0, 0, 0], np.uint32), numbers=gpu.buffer(numbers)
    )
    graph.run(entries)
    found = graph.read(entries).reshape(500, 8)
    entry = lookup.leading_bits(numbers) - first
    np.testing.assert_array_equal(found[:, 0], np.maximum(entry, 0))
    starts = lookup.interval_starts(first - 2000, first + 4000)[entry + 2000]
    ends = lookup.interval_starts(first - 1999, first + 4001)[entry + 2000]
    np.testing.assert_allclose(found[:, 1], (numbers - starts) / (ends - starts), atol=1e-6)
    np.testing.assert_array_equal(found[:, 2], np.maximum(numbers, 1.0))
    np.testing.assert_array_equal(found[:, 3], 1.0)
    np.testing.assert_allclose(found[:, 4], np.clip(3.0 * (np.log2(numbers) + 6.0), 0.0, 20.0 - 1e-3), rtol=1e-5)
    np.testing.assert_allclose(found[:, 5], 40.0 * np.sqrt(np.clip(numbers / 50.0, 0.0, 1.0)), rtol=1e-5)


def test_the_logarithmic_table_gives_the_profile_back(skin):
    low, steps, values = lookup.log_table(skin, 0.01, 40.0, 1024)
    assert values.shape == (1024, 4) and not values[:, 3].any()
    r = np.geomspace(0.02, 20.0, 100)
    at = steps * (2.0 * np.log2(r) - low)
    R = [np.exp2(np.interp(at, np.arange(1024), column)) for column in values[:, :3].T]
    np.testing.assert_allclose(np.stack(R, axis=1), skin.reflectance(r), rtol=1e-3)


def test_the_logarithm_of_a_profile_that_underflows_is_finite():
    assert np.isfinite(lookup.log_table(Dipole((9.0,) * 3, (1.0,) * 3), 1.0, 1e4, 64).values).all()


def test_spaced_distances_have_their_ends_and_their_steps():
    roots = np.sqrt(lookup.root_spaced(9.0, 31))
    np.testing.assert_allclose(np.diff(roots), 0.1, rtol=1e-12)
    assert roots[0] == 0.0 and roots[-1] == 3.0
    logs = np.log10(lookup.geometric(0.01, 10.0, 31))
    np.testing.assert_allclose(np.diff(logs), 0.1, rtol=1e-12)
