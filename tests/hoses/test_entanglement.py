"""Writhe and least distance of polylines, against closed forms and published numbers."""

import numpy as np
import pytest

from hose_mj.hoses.entanglement import compute_least_distance, compute_writhe


@pytest.mark.parametrize(
    ("n", "wanted"), [(100, -3.51222), (200, -3.51673), (400, -3.51786), (800, -3.51814)]
)
def test_writhe_of_a_trefoil(n, wanted):
    t = np.linspace(0.0, 2.0 * np.pi, n + 1)
    far = 2.0 + np.cos(3 * t)
    knot = np.stack([far * np.cos(2 * t), far * np.sin(2 * t), np.sin(3 * t)], axis=1)
    assert compute_writhe(knot) == pytest.approx(wanted, abs=2e-5)
    assert compute_writhe(knot * [1, 1, -1]) == pytest.approx(-wanted, abs=2e-5)
    assert compute_writhe(knot[:, [0, 0, 2]]) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("n", [100, 240])
def test_least_distance_of_a_helix_and_of_a_ring(n):
    radius, pitch, turns = 1.0, 0.3, 3.0
    angle = np.linspace(0.0, 2.0 * np.pi * turns, n + 1)
    helix = np.stack([radius * np.cos(angle), radius * np.sin(angle), pitch * angle / 6.28319], 1)
    length = turns * np.hypot(2 * np.pi * radius, pitch)
    wanted = pitch * 2 * np.pi * radius / np.hypot(2 * np.pi * radius, pitch)
    assert compute_least_distance(helix, length, 1.0, False) == pytest.approx(wanted, rel=0.03)
    ring = np.stack([np.cos(angle / turns), np.sin(angle / turns), 0 * angle], axis=1)
    apart = 0.5 * np.pi
    found = compute_least_distance(ring, 2 * np.pi, apart, True)
    assert found == pytest.approx(np.sqrt(2.0), rel=0.05)
    assert compute_least_distance(ring, 2 * np.pi, apart, False) == pytest.approx(0.0, abs=1e-9)
    assert compute_least_distance(ring, 2 * np.pi, 7.0, False) == np.inf
