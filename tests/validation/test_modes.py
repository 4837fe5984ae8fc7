"""Frequencies and critical loads of small systems with known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hose_mj.hoses.protocol import Linearization
from hose_mj.validation.modes import compute_critical_load, compute_frequencies
from hose_mj.validation.reference import beam_frequencies


def make_springs(n, stiffness=3.0, mass=2.0, constraints=()):
    """n masses in a row, joined by springs, both ends free."""
    bond = np.diff(np.eye(n), axis=0)
    rows = np.array(constraints, dtype=float).reshape(-1, n)
    return Linearization(mass * np.eye(n), stiffness * bond.T @ bond, rows)


def fix(n, *places):
    return np.eye(n)[list(places)]


def make_beam(n_elements, constraints):
    """Euler-Bernoulli beam of unit length, stiffness and density; (w, w') at each node."""
    h = 1.0 / n_elements
    stiffness = np.array(
        [
            [12.0, 6.0 * h, -12.0, 6.0 * h],
            [6.0 * h, 4.0 * h**2, -6.0 * h, 2.0 * h**2],
            [-12.0, -6.0 * h, 12.0, -6.0 * h],
            [6.0 * h, 2.0 * h**2, -6.0 * h, 4.0 * h**2],
        ]
    )
    mass = np.array(
        [
            [156.0, 22.0 * h, 54.0, -13.0 * h],
            [22.0 * h, 4.0 * h**2, 13.0 * h, -3.0 * h**2],
            [54.0, 13.0 * h, 156.0, -22.0 * h],
            [-13.0 * h, -3.0 * h**2, -22.0 * h, 4.0 * h**2],
        ]
    )
    size = 2 * (n_elements + 1)
    whole = np.zeros((2, size, size))
    for e in range(n_elements):
        part = slice(2 * e, 2 * e + 4)
        whole[0, part, part] += mass * h / 420.0
        whole[1, part, part] += stiffness / h**3
    return Linearization(*whole, fix(size, *constraints))


def test_one_mass_on_a_spring():
    small = Linearization(np.array([[2.0]]), np.array([[18.0]]), np.zeros((0, 1)))
    np.testing.assert_allclose(compute_frequencies(small, 1, above=0.0), [3.0])


def test_masses_between_walls():
    """omega_k = 2 sqrt(k / m) sin(k pi / (2 (n + 1))) with n masses between two walls."""
    n = 5
    small = make_springs(n + 2, constraints=fix(n + 2, 0, n + 1))
    k = np.arange(1, n + 1)
    expected = 2.0 * math.sqrt(3.0 / 2.0) * np.sin(k * math.pi / (2 * (n + 1)))
    np.testing.assert_allclose(compute_frequencies(small, n, above=0.0), expected)
    np.testing.assert_allclose(compute_frequencies(small, 2, above=0.0), expected[:2])


def test_the_scale_of_a_constraint_and_its_repetition_change_nothing():
    rows = fix(4, 0, 3)
    once = compute_frequencies(make_springs(4, constraints=rows), 2, above=0.0)
    again = np.vstack([1e3 * rows, rows[0] + rows[1]])
    np.testing.assert_allclose(
        compute_frequencies(make_springs(4, constraints=again), 2, above=0.0), once
    )


def test_a_constraint_joins_two_masses():
    """The outer masses of three are one to the wall: 2 m and 2 k in effect, opposite to one m."""
    small = make_springs(3, stiffness=1.0, mass=1.0, constraints=[[1.0, 0.0, -1.0]])
    # x0 = x2: 2 x0'' = -2 (x0 - x1), x1'' = -2 (x1 - x0): omega^2 = 1 + 2.
    found = compute_frequencies(small, 1, above=0.1)
    np.testing.assert_allclose(found, [math.sqrt(3.0)])


def test_rigid_motions_are_left_out():
    n = 4
    k = np.arange(1, n)
    expected = 2.0 * math.sqrt(3.0 / 2.0) * np.sin(k * math.pi / (2 * n))
    found = compute_frequencies(make_springs(n), n - 1, above=1e-3)
    np.testing.assert_allclose(found, expected)


def test_a_pair_in_two_planes_counts_once():
    one = make_springs(5, constraints=fix(5, 0))
    twice = Linearization(
        np.kron(one.mass, np.eye(2)),
        np.kron(one.stiffness, np.eye(2)),
        np.kron(one.constraints, np.eye(2)),
    )
    np.testing.assert_allclose(
        compute_frequencies(twice, 3, above=0.0), compute_frequencies(one, 3, above=0.0)
    )


def test_frequencies_that_differ_are_kept_apart():
    small = Linearization(np.eye(2), np.diag([1.0, 1.01]), np.zeros((0, 2)))
    np.testing.assert_allclose(compute_frequencies(small, 2, above=0.0), [1.0, math.sqrt(1.01)])


@pytest.mark.parametrize(
    ("ends", "fixed"),
    [("clamped-free", (0, 1)), ("free-free", ()), ("clamped-pinned", (0, 1, 80))],
)
def test_a_beam_of_finite_elements_has_the_closed_frequencies(ends, fixed):
    small = make_beam(40, fixed)
    found = compute_frequencies(small, 3, above=0.1)
    np.testing.assert_allclose(found, beam_frequencies(ends), rtol=1e-5)


def make_links(n, tension, *, extra=0):
    """n rigid links of length 1 in a row, with torsion springs of stiffness 1 from the wall on.

    Coordinates are the links' angles; `extra` ones that nothing resists spin about the axis.
    """
    stiffness = np.zeros((n + extra, n + extra))
    bond = np.eye(n) - np.eye(n, k=-1)
    stiffness[:n, :n] = bond.T @ bond + tension * np.eye(n)
    return Linearization(np.eye(n + extra), stiffness, np.zeros((0, n + extra)))


@pytest.mark.parametrize("pull", [0.1, 1.0, 30.0])
@pytest.mark.parametrize(("n", "load"), [(1, 1.0), (2, (3.0 - math.sqrt(5.0)) / 2.0)])
def test_critical_load_of_rigid_links(n, load, pull):
    found = compute_critical_load(make_links(n, 0.0), make_links(n, pull), pull, above=1e-6)
    assert found == pytest.approx(load, rel=1e-9)


def test_a_spin_about_the_axis_is_no_instability():
    found = compute_critical_load(
        make_links(2, 0.0, extra=1), make_links(2, 1.0, extra=1), 1.0, above=1e-3
    )
    assert found == pytest.approx((3.0 - math.sqrt(5.0)) / 2.0, rel=1e-9)


def test_a_rigid_rotation_is_no_instability():
    """A pinned pair of links: one hinge with a spring, and a rotation that only a pull resists."""
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    unloaded = Linearization(np.eye(2), spring, np.zeros((0, 2)))
    pulled = Linearization(np.eye(2), spring + 0.5 * np.eye(2), np.zeros((0, 2)))
    assert compute_critical_load(unloaded, pulled, 0.5, above=1e-3) == pytest.approx(2.0)


def test_constraints_raise_the_critical_load():
    free, held = make_links(2, 0.0), make_links(2, 1.0)
    rows = np.array([[1.0, 0.0]])
    found = compute_critical_load(
        Linearization(free.mass, free.stiffness, rows),
        Linearization(held.mass, held.stiffness, rows),
        1.0,
        above=1e-6,
    )
    assert found == pytest.approx(1.0, rel=1e-9)
