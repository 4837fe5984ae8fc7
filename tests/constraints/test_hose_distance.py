"""The nearest point of the hose: against dense sampling, on curves that bend in every way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hose_mj.constraints import hose_distance
from hose_mj.hoses.geds import shapes
from hose_mj.world.centre_line import CentreLine

KINDS = {
    "sphere": shapes.SPHERE,
    "capsule": shapes.CAPSULE,
    "cylinder": shapes.CYLINDER,
    "box": shapes.BOX,
}
DENSE = 6000


def make_row(kind, size, position, rotation):
    row = np.zeros((1, shapes.ROW))
    row[0, shapes.KIND] = KINDS[kind]
    row[0, shapes.SIZE : shapes.SIZE + 3] = size
    row[0, shapes.BOUND] = np.linalg.norm(size)
    row[0, shapes.POSITION : shapes.POSITION + 3] = position
    row[0, shapes.ROTATION : shapes.ROTATION + 9] = np.ravel(rotation)
    return row


def make_line(rng, roughness):
    """A smooth wandering curve of 12 pieces of uneven length; large roughness makes knots of it."""
    arcs = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, 12))])
    heading = np.eye(3)[0] + np.cumsum(roughness * rng.normal(size=(13, 3)), axis=0)
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    points = np.cumsum(np.diff(arcs, prepend=0.0)[:, None] * heading, axis=0)
    spline = CubicSpline(arcs, points)
    return CentreLine.of_spline(arcs, points, spline(arcs, 1))


def find_nearest(row, line, low, high, best=np.inf):
    balls = np.zeros((len(line.coefficients), hose_distance.BALL))
    hose_distance.update_balls(line.coefficients, balls)
    pieces = (line.arc_lengths, line.coefficients, balls)
    distance, k, u = hose_distance.find_nearest(row, 0, pieces, low, high, best)
    low_arc, high_arc = line.arc_lengths[k], line.arc_lengths[k + 1]
    return distance, k, low_arc + u * (high_arc - low_arc)


def measure(row, points):
    distances = np.zeros(len(points))
    shapes.measure_points(row, 0, points, distances, np.zeros_like(points))
    return distances


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("roughness", [0.3, 1.0])
def test_no_sample_is_nearer_in_two_thousand_queries(kind, roughness, make_rotation):
    rng = np.random.default_rng(sum(map(ord, kind)))
    for _ in range(250):
        line = make_line(rng, roughness)
        size = rng.uniform(0.05, 0.8, 3)
        near = line.position(rng.uniform(0.0, line.arc_lengths[-1], 1))[0]
        position = near + rng.uniform(0.0, 3.0) * rng.normal(size=3)
        row = make_row(kind, size, position, make_rotation(rng))
        low, high = np.sort(rng.uniform(0.0, line.arc_lengths[-1], 2))
        arcs = np.linspace(low, high, DENSE)
        samples = measure(row, line.position(arcs))
        distance, _, arc = find_nearest(row, line, low, high)
        assert distance <= samples.min() + 1e-9
        assert low - 1e-12 <= arc <= high + 1e-12
        assert measure(row, line.position(np.array([arc])))[0] == pytest.approx(distance, abs=1e-9)


def test_a_straight_hose_beside_a_ball_and_its_end():
    line = CentreLine.of_chain(
        np.array([0.0, 1.0, 4.0]), np.array([[0.0, 0, 0], [1, 0, 0], [4, 0, 0]])
    )
    row = make_row("sphere", (0.5, 0, 0), (2.3, 2.0, 0.0), np.eye(3))
    assert find_nearest(row, line, 0.0, 4.0) == pytest.approx((1.5, 1, 2.3))
    assert find_nearest(row, line, 0.0, 2.0) == pytest.approx((np.hypot(0.3, 2.0) - 0.5, 1, 2.0))
    assert find_nearest(row, line, 3.0, 4.0) == pytest.approx((np.hypot(0.7, 2.0) - 0.5, 1, 3.0))


@pytest.mark.parametrize("angle", [0.3, 1.9, 2.8])
def test_an_arc_around_a_post(angle):
    """Every point of a circle about a post is as far; a shifted post is nearest along its shift."""
    radius, count = 2.0, 10
    angles = np.linspace(0.0, np.pi, count + 1)
    points = radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    slopes = np.stack([-np.sin(angles), np.cos(angles), 0.0 * angles], axis=1)
    line = CentreLine.of_spline(radius * angles, points, slopes)
    shift = 0.5 * np.array([np.cos(angle), np.sin(angle), 0.0])
    row = make_row("cylinder", (0.2, 1.0, 0.0), shift, np.eye(3))
    distance, _, arc = find_nearest(row, line, 0.0, radius * np.pi)
    # A cubic through the circle is off by about radius (pi / count)^4 / 384.
    assert distance == pytest.approx(radius - 0.5 - 0.2, abs=1e-4)
    assert arc == pytest.approx(radius * angle, abs=5e-3)


def test_nothing_beyond_what_is_looked_for():
    line = CentreLine.of_chain(np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [1, 0, 0]]))
    row = make_row("box", (0.1, 0.1, 0.1), (0.5, 1.0, 0.0), np.eye(3))
    assert find_nearest(row, line, 0.0, 1.0, 0.8)[:2] == (0.8, -1)
    assert find_nearest(row, line, 0.0, 1.0, 1.0)[0] == pytest.approx(0.9)


def test_balls_hold_their_pieces():
    rng = np.random.default_rng(5)
    for _ in range(50):
        coefficients = rng.normal(size=(3, 4, 3))
        balls = np.zeros((3, hose_distance.BALL))
        hose_distance.update_balls(coefficients, balls)
        line = CentreLine(np.arange(4.0), coefficients)
        for k in range(3):
            u = np.linspace(0.0, 1.0 - 1e-12, 2000)
            points = line.position(k + u)
            assert np.all(np.linalg.norm(points - balls[k, :3], axis=1) <= balls[k, 3] + 1e-12)
            speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(u)
            assert np.all(speeds <= balls[k, 4] * (1.0 + 1e-9))
