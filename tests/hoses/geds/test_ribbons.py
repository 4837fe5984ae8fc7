"""Hoses that bend unequally, and hoses that are curved or twisted at rest, in space."""

import numpy as np
import pytest
import scipy.linalg

from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.spec import HoseSpec

EI, GJ = 0.05, 0.04
X, Y, Z = np.eye(3)


def make_hose(*, control_points=16, second=None, torsion=GJ, twist=None, ea=1e6, **changes):
    spec = HoseSpec(
        length=1.0,
        axial_stiffness=ea * EI,
        bending_stiffness=EI,
        second_bending_stiffness=second,
        torsional_stiffness=torsion,
        linear_density=0.1,
        **changes,
    )
    return GedsHose(spec, gravity=(0, 0, 0), control_points=control_points, twist=twist)


# -- unequal bending -------------------------------------------------------------------------------


@pytest.mark.parametrize("director", [Y, Z])
@pytest.mark.parametrize("load", [Y, Z])
def test_the_director_says_which_way_a_ribbon_is_stiff(director, load):
    hose = make_hose(second=4 * EI)
    hose.reset([[0, 0, 0], [1, 0, 0]], director=director)
    hose.clamp(0.0)
    push = 1e-3 * EI
    hose.apply_force(1.0, push * load)
    hose.solve_static()
    # EI bends about m1, so a load along m1 meets the second stiffness.
    stiffness = 4 * EI if load @ director == 1.0 else EI
    tip = hose.position(1.0)[0] - X
    np.testing.assert_allclose(tip, push / (3 * stiffness) * load, rtol=1e-4, atol=1e-7)
    energies = hose.energies()
    assert energies.bending == pytest.approx(0.5 * push * tip @ load, rel=1e-4)


def test_a_load_between_the_principal_directions_bends_askew():
    hose = make_hose(second=4 * EI)
    director = np.array([0.0, 0.6, 0.8])
    hose.reset([[0, 0, 0], [1, 0, 0]], director=director)
    hose.clamp(0.0)
    push = 1e-3 * EI
    hose.apply_force(1.0, push * Z)
    hose.solve_static()
    across = np.cross(X, director)
    wanted = push / 3 * (0.8 * director / (4 * EI) + (across @ Z) * across / EI)
    np.testing.assert_allclose(hose.position(1.0)[0] - X, wanted, rtol=1e-3, atol=1e-7)


def test_a_ribbon_turns_its_director_when_its_clamp_is_spun():
    hose = make_hose(second=4 * EI)
    hose.reset([[0, 0, 0], [1, 0, 0]], director=Z)
    first = hose.clamp(0.0)
    hose.move(first, spin=0.5 * np.pi)
    hose.solve_static()
    push = 1e-3 * EI
    hose.apply_force(1.0, push * Z)
    hose.solve_static()
    assert hose.position(1.0)[0] @ Z == pytest.approx(push / (3 * EI), rel=1e-4)
    np.testing.assert_allclose(hose.torque([0.1, 0.9]), 0.0, atol=1e-9)


def compute_lowest_stiffness(load, n):
    """Smallest eigenvalue of a narrow cantilever's tangent stiffness under a tip load (N)."""
    hose = make_hose(second=1000 * EI, ea=1e8, control_points=n)
    hose.reset([[0, 0, 0], [1, 0, 0]], director=Z)
    hose.clamp(0.0)
    hose.apply_force(1.0, -load * Z)
    hose.solve_static()
    assert abs(hose.position(1.0)[0] @ Y) < 1e-9
    linear = hose.linearize()
    free = scipy.linalg.null_space(linear.constraints)
    return np.linalg.eigvalsh(free.T @ linear.stiffness @ free)[0]


def test_a_narrow_cantilever_buckles_sideways_at_the_load_of_michell_and_prandtl():
    # 4.0126 sqrt(EI GJ) / L^2 (1899); the bow before it raises that by 0.9 parts in a thousand.
    strong = 1000 * EI
    critical = 4.0126 * np.sqrt(EI * GJ / ((1.0 - EI / strong) * (1.0 - GJ / strong)))
    assert compute_lowest_stiffness(0.998 * critical, 16) > 0.0
    assert compute_lowest_stiffness(1.002 * critical, 16) < 0.0


# -- rest shapes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("director", [Z, np.array([0.0, -0.6, 0.8])])
def test_a_rest_curvature_bends_about_the_director_and_is_free_of_energy(director):
    curvature = 2.0
    hose = make_hose(rest_curvature=curvature, control_points=20)
    hose.reset([[0, 0, 0], [1, 0, 0]], director=director)
    hose.clamp(0.0)
    straight = hose.energies()
    assert straight.bending == pytest.approx(0.5 * EI * curvature**2, rel=1e-9)
    hose.solve_static()
    s = np.linspace(0.0, 1.0, 11)
    arc = np.outer(np.sin(curvature * s), X)
    arc += np.outer(1.0 - np.cos(curvature * s), np.cross(director, X))
    np.testing.assert_allclose(hose.position(s), arc / curvature, atol=2e-6)
    np.testing.assert_allclose(hose.curvature(s), curvature, rtol=3e-3)
    energies = hose.energies()
    assert energies.bending + energies.stretching + energies.twisting < 1e-6 * straight.bending


def test_a_rest_torsion_alone_is_free_of_torque():
    hose = make_hose(rest_torsion=3.0, twist="theta")
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    np.testing.assert_allclose(hose.twist([0.0, 0.5, 1.0]), 0.0, atol=1e-9)
    assert hose.energies().total == pytest.approx(0.0, abs=1e-15)
    hose.move(last, spin=1.0)
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.0, 0.5, 1.0]), GJ, rtol=1e-9)


@pytest.mark.parametrize("torsion", [2.0, -2.0])
def test_a_rest_curvature_with_a_rest_torsion_makes_a_coil(torsion):
    curvature = 4.0
    hose = make_hose(rest_curvature=curvature, rest_torsion=torsion, control_points=32)
    hose.reset([[0, 0, 0], [1, 0, 0]], director=Z)
    hose.clamp(0.0)
    straight = hose.energies().bending
    hose.solve_static(4)
    energies = hose.energies()
    assert energies.bending + energies.stretching + energies.twisting < 1e-4 * straight
    # The helix of that curvature and torsion (Frenet), from its own frame at s = 0.
    rate = np.hypot(curvature, torsion)
    s = np.linspace(0.0, 1.0, 9)
    turn, binormal = rate * s, Z
    normal = np.cross(binormal, X)
    axis = (torsion * X + curvature * binormal) / rate
    out, along = -normal, np.cross(axis, -normal)
    radius, climb = curvature / rate**2, torsion / rate
    helix = np.outer(np.cos(turn) - 1.0, radius * out) + np.outer(np.sin(turn), radius * along)
    helix += np.outer(climb * s, axis)
    np.testing.assert_allclose(hose.position(s), helix, atol=1e-4)
