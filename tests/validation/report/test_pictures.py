"""Outlines of obstacles in pictures."""

import numpy as np
import pytest

from hose_mj.hoses.obstacles import Obstacle
from hose_mj.validation.report.pictures import compute_outline, compute_outlines

TURN = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]])
"""Turns the axis z to (.8, 0, .6)."""


@pytest.mark.parametrize(
    ("kind", "size", "reach"),
    [
        ("sphere", (0.3, 0, 0), (0.3, 0.3)),
        ("capsule", (0.1, 0.5, 0), (0.1 + 0.5 * 0.8, 0.1 + 0.5 * 0.6)),
        ("cylinder", (0.1, 0.5, 0), (0.1 * 0.6 + 0.5 * 0.8, 0.1 * 0.8 + 0.5 * 0.6)),
        ("box", (0.1, 0.2, 0.5), (0.1 * 0.6 + 0.5 * 0.8, 0.1 * 0.8 + 0.5 * 0.6)),
    ],
)
def test_an_outline_reaches_as_far_as_the_shape(kind, size, reach):
    place = np.array([1.0, 2.0, 3.0])
    obstacle = Obstacle(kind=kind, position=place, rotation=TURN, size=size)
    outline = compute_outline(obstacle, (0, 2))
    np.testing.assert_allclose(np.ptp(outline, axis=0), 2 * np.array(reach), rtol=2e-3)
    np.testing.assert_allclose(outline.mean(axis=0), place[[0, 2]], atol=0.02)


def test_planes_have_no_outline():
    assert compute_outlines((Obstacle(kind="plane"),), (0, 2)) == []
