"""Snapshots of every kind of hose go on bit by bit, and what is no snapshot changes nothing."""

import copy

import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.geds.loops import make_circle
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.spec import Fitting, HoseSpec

PLAIN = {
    "length": 1.0,
    "axial_stiffness": 2e4,
    "bending_stiffness": 0.05,
    "torsional_stiffness": 0.04,
    "linear_density": 0.1,
    "damping_time": 0.01,
}
KINDS = {
    "plain": {},
    "coil": {"rest_curvature": 4.0, "rest_torsion": 2.0},
    "ribbon": {"second_bending_stiffness": 0.5},
    "fitted": {"fittings": (Fitting(start=0.4, end=0.5, bending_stiffness=1.0),)},
    "chain": {"bending_stiffness": 0.0, "torsional_stiffness": 0.0},
}


def flatten(state):
    if isinstance(state, dict):
        return [(f"{key}/{path}", leaf) for key in state for path, leaf in flatten(state[key])]
    if isinstance(state, (list, tuple)):
        return [(f"{k}/{path}", leaf) for k, one in enumerate(state) for path, leaf in flatten(one)]
    return [("", state)]


def assert_same(found, wanted):
    found, wanted = flatten(found), flatten(wanted)
    assert [path for path, _ in found] == [path for path, _ in wanted]
    for (path, one), (_, other) in zip(found, wanted, strict=True):
        assert np.array_equal(one, other), path


def make_hose(kind, **options):
    hose = GedsHose(HoseSpec(**PLAIN | KINDS[kind]), timestep=2e-3, control_points=12, **options)
    hose.reset(
        lambda s: np.stack([0.8 * s, 0.25 * np.cos(2.4 * s), 0.25 * np.sin(2.4 * s)], axis=1)
    )
    return hose


def carry(hose, hold, first, count):
    """Moves a clamp: place, tangent and, where it can, spin."""
    at = np.array([0.79, 0.25 * np.cos(2.4), 0.25 * np.sin(2.4)])
    tangent = np.array([0.8, -0.6 * np.sin(2.4), 0.6 * np.cos(2.4)])
    for k in range(first, first + count):
        turn = 0.01 * k
        aim = tangent + np.array([0.0, 0.3 * np.sin(turn), 0.2 * turn])
        hose.move(hold, at + np.array([-1e-3 * k, 5e-4 * k, 0.0]), aim, 0.03)
        hose.step()


def check_that_it_goes_on(hose, other, go_on):
    """`other` takes over from a snapshot of `hose`; both go on, and `hose` once more."""
    kept = hose.snapshot()
    other.restore(kept)
    assert_same(other.snapshot(), kept)
    go_on(hose)
    go_on(other)
    wanted = hose.snapshot()
    assert_same(other.snapshot(), wanted)
    hose.restore(kept)
    go_on(hose)
    assert_same(hose.snapshot(), wanted)


@pytest.mark.parametrize("kind", KINDS)
def test_moving_holds_and_loads(kind):
    hose, other = make_hose(kind), make_hose(kind)
    hose.clamp(0.0)
    hold = hose.clamp(1.0)
    hose.attach(0.5)
    hose.apply_force(0.3, [0.0, 0.1, 0.2])
    if kind != "chain":
        hose.apply_moment(0.7, [0.01, 0.0, 0.01])
    carry(hose, hold, 1, 15)
    hose.move(hold, spin=0.2)
    check_that_it_goes_on(hose, other, lambda one: carry(one, hold, 17, 15))


def test_a_coil_after_statics_and_a_change_of_holds():
    hose, other = make_hose("coil"), make_hose("coil")
    hose.clamp(0.0)
    end = hose.clamp(1.0)
    hose.solve_static()
    hose.release(end)
    hose.attach(0.8)
    hose.step(30)
    check_that_it_goes_on(hose, other, lambda one: one.step(30))


def test_a_closed_loop():
    pair = [make_hose("plain") for _ in range(2)]
    for one in pair:
        one.reset(make_circle(1.0))
    hose, other = pair
    hose.close(spin=3.0)
    hold = hose.clamp(0.3)
    hose.step(10)
    hose.move(hold, spin=0.5)
    check_that_it_goes_on(hose, other, lambda one: one.step(20))


def test_contact():
    pair = []
    for _ in range(2):
        hose = make_hose("plain")
        floor = Obstacle(kind="plane", position=(0.0, 0.0, -0.2))
        ball = Obstacle(kind="sphere", position=(0.4, 0.2, -0.1), size=(0.1,))
        hose.set_obstacles([floor, ball], ContactLaw(self_contact=True))
        pair.append(hose)
    hose, other = pair
    hose.step(120)
    hose.contacts.move_obstacle(1, (0.41, 0.2, -0.1))
    check_that_it_goes_on(hose, other, lambda one: one.step(60))


def list_places(state, path=()):
    """Paths to all entries of dictionaries and lists."""
    keys = state if isinstance(state, dict) else range(len(state))
    for key in keys:
        yield (*path, key)
        if isinstance(state[key], (dict, list)):
            yield from list_places(state[key], (*path, key))


def put(state, path, value):
    spoilt = copy.deepcopy(state)
    part = spoilt
    for key in path[:-1]:
        part = part[key]
    if value is KeyError:
        del part[path[-1]]
    else:
        part[path[-1]] = value
    return spoilt


@pytest.mark.parametrize("kind", ["plain", "coil"])
def test_what_is_no_snapshot_is_refused_and_changes_nothing(kind):
    hose = make_hose(kind)
    hose.clamp(0.0)
    hold = hose.clamp(1.0)
    hose.apply_force(0.3, [0.0, 0.1, 0.2])
    hose.apply_moment(0.7, [0.0, 0.0, 0.01])
    carry(hose, hold, 1, 3)
    state = hose.snapshot()
    junk = (KeyError, np.nan, "x", object(), np.full(3, np.nan), np.zeros((2, 2, 2)), 10**400)
    n_refused = 0
    for path in list_places(state):
        if path[0] == "contacts":
            continue
        for value in junk:
            if value is KeyError and not isinstance(path[-1], str):
                continue
            try:
                hose.restore(put(state, path, value))
            except InputError:
                n_refused += 1
                assert_same(hose.snapshot(), state)
            else:
                # A tangent may be None, and three numbers a vector: nothing else goes through.
                assert path[-1] in ("tangent", 0, 1), (path, value)
                hose.restore(state)
    assert n_refused > 200
    for state in (None, 3, "x", [], {}, {"state": {}}):
        with pytest.raises(InputError):
            hose.restore(state)


def test_a_snapshot_of_another_size_is_refused():
    hose = make_hose("plain")
    other = GedsHose(HoseSpec(**PLAIN), control_points=9)
    with pytest.raises(InputError, match="number of unknowns in the snapshot is 27; valid: 36"):
        hose.restore(other.snapshot())
