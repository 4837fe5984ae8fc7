"""Moments along the tangent of a hose with scalar twist: shares, balance, changing holds."""

import numpy as np
import pytest

from hose_mj.errors import HoseWarning
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.geds.loops import make_circle
from hose_mj.hoses.spec import Fitting, HoseSpec

EI, GJ = 0.05, 0.04


def make_hose(form="scalar", control_points=13, options=None, **changes):
    values = {
        "length": 1.0,
        "axial_stiffness": 4e5 * EI,
        "bending_stiffness": EI,
        "torsional_stiffness": GJ,
        "linear_density": 0.1,
        "outer_radius": 0.002,
    }
    settings = {"gravity": (0, 0, 0), "control_points": control_points, "twist": form}
    return GedsHose(HoseSpec(**values | changes), **settings | (options or {}))


def measure_balance(hose, holds, loads):
    """Sum of the moments about the origin of holds and of (place, force, moment) loads."""
    total = np.zeros(3)
    for hold in holds:
        found = hose.reaction(hold)
        total += found.moment + np.cross(hose.position(hold.arc_length)[0], found.force)
    for place, force, moment in loads:
        total += moment + np.cross(hose.position(place)[0], force)
    return total


def test_both_forms_bend_alike_under_moments_of_any_direction():
    shapes = []
    for form in ("scalar", "theta"):
        hose = make_hose(form, 24)
        clamp = hose.clamp(0.0)
        hose.apply_moment(1.0, [0.03, 0.02, -0.04])
        hose.solve_static()
        shapes.append(hose.position([0.3, 0.7, 1.0]))
        balance = measure_balance(hose, [clamp], [(1.0, np.zeros(3), [0.03, 0.02, -0.04])])
        np.testing.assert_allclose(balance, 0.0, atol=2e-5)
        carried = np.array([0.03, 0.02, -0.04]) @ hose.tangent(1.0)[0]
        np.testing.assert_allclose(hose.torque(0.99)[0], carried, rtol=0.02)
    np.testing.assert_allclose(shapes[0], shapes[1], atol=3e-4)


def test_a_closed_form_of_a_bent_hose():
    # A moment that keeps its direction bends a clamped hose into a helix whose axis it is:
    # M = EI kappa n + GJ tau t everywhere, so r(s) goes round the moment's direction.
    hose = make_hose(control_points=32)
    hose.clamp(0.0)
    moment = 0.06 * np.array([0.6, 0.8, 0.0])
    hose.apply_moment(1.0, moment)
    hose.solve_static()
    axis = moment / 0.06
    along = hose.tangent(np.linspace(0.0, 1.0, 9)) @ axis
    np.testing.assert_allclose(along, 0.6, atol=1e-4)
    np.testing.assert_allclose(hose.curvature([0.2, 0.5, 0.8]), 0.06 * 0.8 / EI, rtol=1e-3)
    np.testing.assert_allclose(hose.torque([0.1, 0.5, 0.9]), 0.06 * 0.6, rtol=1e-4)


def test_shares_go_by_compliance():
    # 0.3 / GJ + 0.2 / (4 GJ) on one side, 0.5 / GJ on the other.
    fitting = Fitting(start=0.3, end=0.5, torsional_stiffness=4 * GJ)
    hose = make_hose(fittings=(fitting,))
    holds = hose.clamp(0.0), hose.clamp(1.0)
    hose.apply_moment(0.5, [0.01, 0.0, 0.0])
    hose.solve_static()
    first = 0.01 * 0.5 / (0.5 + 0.35)
    np.testing.assert_allclose(hose.torque([0.1, 0.4]), first, rtol=1e-9)
    np.testing.assert_allclose(hose.torque([0.6, 0.9]), first - 0.01, rtol=1e-9)
    # The angle of the material there, from both sides.
    angle = first * 0.35 / GJ
    energy = 0.5 * (first * angle + (0.01 - first) * angle)
    assert hose.energies().twisting == pytest.approx(energy, rel=1e-9)
    found = [hose.reaction(hold).moment[0] for hold in holds]
    np.testing.assert_allclose(found, [-first, first - 0.01], rtol=1e-9)


def test_spin_and_moments_add_up():
    hose = make_hose()
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    hose.move(last, spin=2.0)
    hose.apply_moment(0.25, [0.01, 0.0, 0.0])
    hose.step()
    np.testing.assert_allclose(hose.torque([0.1, 0.9]), [2 * GJ + 0.0075, 2 * GJ - 0.0025])
    # A clamp that takes hold of the twisted hose changes nothing, wherever it is.
    inside = hose.clamp(0.6)
    hose.step()
    np.testing.assert_allclose(hose.torque([0.1, 0.9]), [2 * GJ + 0.0075, 2 * GJ - 0.0025])
    # The moment gone, each side keeps its angle.
    hose.clear_loads()
    hose.step()
    angle = (2 * GJ + 0.0075) * 0.25 + (2 * GJ - 0.0025) * 0.35
    np.testing.assert_allclose(hose.torque([0.1, 0.5]), angle / 0.6)
    np.testing.assert_allclose(hose.torque(0.9), 2 * GJ - 0.0025)
    hose.release(inside)
    np.testing.assert_allclose(hose.torque(0.5), 2 * GJ)


def test_a_clamp_on_the_twisted_free_end_keeps_what_the_moment_did():
    hose = make_hose()
    hose.clamp(0.0)
    hose.apply_moment(1.0, [0.01, 0.0, 0.0])
    hose.step()
    hose.clamp(1.0)
    hose.clear_loads()
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.1, 0.9]), 0.01, rtol=1e-9)


def test_a_moment_at_a_clamp_goes_straight_into_it():
    hose = make_hose()
    first, inside = hose.clamp(0.0), hose.clamp(0.5)
    hose.apply_moment(0.5, [0.01, 0.0, 0.0])
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.1, 0.9]), 0.0, atol=1e-12)
    np.testing.assert_allclose(hose.reaction(inside).moment, [-0.01, 0, 0], atol=1e-9)
    np.testing.assert_allclose(hose.reaction(first).moment, 0.0, atol=1e-9)


def test_without_a_clamp_the_moment_is_spent_on_a_spin():
    # As with theta at the beginning: each section takes its share, m (s / L - 1) beyond the moment.
    hose = make_hose()
    hose.attach(0.0), hose.attach(1.0)
    hose.apply_moment(0.4, [0.01, 0.0, 0.0])
    with pytest.warns(HoseWarning, match="nothing holds the hose against turning"):
        hose.step()
    np.testing.assert_allclose(hose.torque([0.2, 0.7, 1.0]), [0.002, -0.003, 0.0], atol=1e-9)
    with pytest.warns(HoseWarning, match="nothing holds the hose against turning"):
        hose.solve_static()


def test_a_loop_shares_a_moment_both_ways_round():
    hose = make_hose(control_points=24)
    hose.reset(make_circle(1.0, normal=(0, 0, 1)))
    hose.close()
    clamp = hose.clamp(0.2)
    hose.attach(0.6)
    hose.solve_static()
    place = 0.7
    moment = 0.01 * hose.tangent(place)[0]
    hose.apply_moment(place, moment)
    hose.solve_static()
    # From the clamp at 0.2 to the moment it is 0.5, on across the joint another 0.5.
    np.testing.assert_allclose(hose.torque([0.3, 0.6]), 0.005, rtol=0.02)
    np.testing.assert_allclose(hose.torque([0.8, 0.95, 0.1]), -0.005, rtol=0.02)
    assert abs(hose.reaction(clamp).moment @ hose.tangent(0.2)[0]) == pytest.approx(0.01, rel=0.05)


def test_energy_of_a_moment_that_is_switched_on_and_damped():
    hose = make_hose(damping_time=0.02, drag=0.5, options={"timestep": 2e-3})
    clamp = hose.clamp(0.0)
    hose.apply_moment(1.0, [0.01, 0.004, 0.0])
    hose.step(5000)
    moved = hose.position(1.0)[0].copy()
    rest = hose.reaction(clamp).moment
    hose.solve_static()
    np.testing.assert_allclose(hose.position(1.0)[0], moved, atol=1e-5)
    np.testing.assert_allclose(hose.reaction(clamp).moment, rest, atol=1e-6)
    np.testing.assert_allclose(rest, [-0.01, -0.004, 0.0], atol=1e-5)
