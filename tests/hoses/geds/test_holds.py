"""Many holds, holds in any order, clamps that are moved in place or by a frame, and spin."""

import numpy as np
import pytest

from hose_mj.errors import HoseError, InputError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.spec import HoseSpec

PLAIN = {
    "length": 1.0,
    "axial_stiffness": 2e4,
    "bending_stiffness": 0.05,
    "torsional_stiffness": 0.04,
    "linear_density": 0.1,
}
forms = pytest.mark.parametrize("form", ["scalar", "theta"])


def make_hose(changes=None, **options):
    return GedsHose(HoseSpec(**PLAIN | (changes or {})), **({"control_points": 16} | options))


@pytest.mark.parametrize("options", [{}, {"plane": "xz"}, {"twist": "theta"}])
@pytest.mark.parametrize("n_holds", [13, 16, 24, 60])
def test_more_holds_than_the_spline_can_follow_are_refused(n_holds, options):
    hose = make_hose(**options)
    try:
        for s in np.linspace(0.0, 1.0, n_holds):
            hose.attach(s)
        hose.step(5)
    except HoseError:
        assert n_holds > 13
    assert np.all(np.isfinite(hose.control_points))
    # A hold too many changes nothing.
    n_before = len(hose.holds)
    if n_holds == 60:
        with pytest.raises(InputError, match=r"number of rows of all holds is .*; valid: at most"):
            hose.clamp(0.013)
        assert len(hose.holds) == n_before


@pytest.mark.parametrize("stiffness", [0.0, 0.04])
def test_the_order_of_clamps_does_not_matter(stiffness):
    heights = []
    for order in ((0.0, 0.5, 1.0), (1.0, 0.5, 0.0), (0.5, 1.0, 0.0), (1.0, 0.0, 0.5)):
        hose = make_hose({"torsional_stiffness": stiffness})
        holds = [hose.clamp(place) for place in order]
        hose.release(holds[order.index(0.5)])
        hose.step(10)
        heights.append(hose.position(0.5)[0, 2])
    np.testing.assert_allclose(heights, heights[0], rtol=1e-9)


@pytest.mark.parametrize("options", [{}, {"plane": "xz"}, {"twist": "theta"}])
def test_a_clamp_is_moved_in_place(options):
    hose = make_hose(**options)
    hose.clamp(0.0)
    last = hose.clamp(0.97)
    hose.attach(0.4)
    hose.step(3)
    rows = hose._constraints.rows
    hose.move(last, [0.96, 0.0, 0.01], [1.0, 0.0, 0.1])
    assert hose._constraints.rows is rows
    found = [np.copy(part) for part in rows[:4]]
    hose._constraints._rebuild()
    for one, other in zip(found, hose._constraints.rows[:4], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-13)


@forms
def test_a_clamp_is_moved_by_a_frame(form):
    hose = make_hose(twist=form, gravity=(0, 0, 0))
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    start = hose.frame(1.0)[0]
    for k in range(1, 21):
        turn, bend = 0.1 * k, 0.02 * k
        tangent = np.array([np.cos(bend), np.sin(bend), 0.0])
        carried = np.array(
            [[np.cos(bend), -np.sin(bend), 0], [np.sin(bend), np.cos(bend), 0], [0, 0, 1]]
        )
        base = carried @ start
        m1 = np.cos(turn) * base[:, 1] + np.sin(turn) * base[:, 2]
        frame = np.stack([tangent, m1, np.cross(tangent, m1)], axis=1)
        hose.move(last, frame=frame)
        hose.solve_static()
        np.testing.assert_allclose(hose.frame(1.0)[0], frame, atol=1e-3)
    assert hose.torque(0.5)[0] == pytest.approx(0.04 * 2.0, rel=0.05)
    for junk in (3, "x", np.eye(2), 2.0 * np.eye(3), -np.eye(3), np.full((3, 3), np.nan)):
        with pytest.raises(InputError, match=r"frame is .*rotation"):
            hose.move(last, frame=junk)
    with pytest.raises(InputError, match="no tangent and no spin"):
        hose.move(last, spin=0.1, frame=frame)


def test_spin_counts_in_the_angular_momentum_and_is_kept():
    # Torsion waves run to and fro in a free straight hose; nothing turns it from outside.
    hose = make_hose(
        {"outer_radius": 0.02}, twist="theta", gravity=(0, 0, 0), timestep=1e-4, scheme="midpoint"
    )
    clamp = hose.clamp(0.0)
    for _ in range(200):
        hose.move(clamp, spin=0.005)
        hose.step()
    hose.release(clamp)
    start = hose.momentum().angular
    assert start[0] > 1e-5
    most = 0.5 * 0.1 * 0.02**2 * 50.0 * 2.0
    assert start[0] < most
    twisting = []
    for _ in range(20):
        hose.step(20)
        twisting.append(hose.energies().twisting)
        np.testing.assert_allclose(hose.momentum().angular, start, rtol=1e-6, atol=1e-12)
    assert np.ptp(twisting) > 0.01 * max(twisting)
