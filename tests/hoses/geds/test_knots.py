"""Knots: what ropes know of themselves, against the published overhand knot and plectoneme."""

import numpy as np
import pytest

from hose_mj import HoseSpec, make_hose
from hose_mj.hoses.obstacles import ContactLaw
from hose_mj.validation import knots, reference

SCALE = 2.0 * np.pi**2 * knots.BENDING


@pytest.mark.parametrize("size", [600.0])
def test_an_overhand_knot_follows_the_published_curve(size):
    knot = knots.Knot(100.0, 400.0, 128)
    e, pull, energy = knot.draw(size * knots.RADIUS, 4)
    assert pull[-1] * e[-1] ** 2 / SCALE == pytest.approx(reference.find_knot_pull(size), rel=0.01)
    # The work of the pull is what the knot holds: contact is smooth enough for both to agree.
    middle = 0.5 * (e[-1] + e[-2])
    work = -(energy[-1] - energy[-2]) / (e[-1] - e[-2]) * middle**2 / SCALE
    assert work == pytest.approx(reference.find_knot_pull(middle / knots.RADIUS), rel=0.02)
    assert knot.height == pytest.approx(np.sqrt(2.0 * knots.BENDING / pull[-1]), rel=0.02)
    assert 0.98 < knot.least_distance < 1.0


def test_a_knot_holds_by_itself_where_friction_is_enough():
    # Published: from .081 on.
    assert knots.measure_opening(0.13) < 0.5
    assert knots.measure_opening(0.05) > 3.0


def test_a_plectoneme_loses_no_turn():
    twist, writhe, tension, hose = knots.twist_rope(0.002, 1.5)
    assert writhe > 3.0
    assert twist + writhe == pytest.approx(14.0, rel=1e-3)
    moment = twist * 2.0 * np.pi * hose.spec.torsional_stiffness * knots.RADIUS / knots.BENDING
    assert moment == pytest.approx(reference.find_plectoneme_moment(tension), rel=0.05)
    assert hose.health.crossings == 0


@pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.HoseWarning")
@pytest.mark.parametrize("timestep", [0.005, 0.001])
def test_a_knot_drawn_tight_stays(timestep):
    t = np.linspace(-2.35, 2.35, 723)
    knot = 0.1 * np.stack(
        [0.55 * (t**3 - 3 * t), 0.35 * (t**4 - 4 * t**2), 0.35 * (t**5 / 5 - 2 * t)], 1
    )
    length = np.linalg.norm(np.diff(knot, axis=0), axis=1).sum()
    spec = HoseSpec(
        length=length,
        axial_stiffness=2e3,
        bending_stiffness=2e-4,
        linear_density=0.05,
        outer_radius=0.005,
        damping_time=0.005,
        drag=0.2,
    )
    hose = make_hose("geds", spec, timestep=timestep, gravity=(0, 0, 0), control_points=64)
    hose.set_obstacles([], ContactLaw(self_contact=True))
    hose.reset(knot)
    holds = [hose.attach(0.0), hose.attach(length)]
    ends = hose.position([0.0, length])
    way = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    pull, drawn = 0.0, 0.0
    while pull < 5.0:
        drawn += 0.1 * timestep
        hose.move(holds[0], ends[0] - way * drawn)
        hose.move(holds[1], ends[1] + way * drawn)
        hose.step()
        pull = hose.reaction(holds[1]).force @ way
    apart = np.diff(hose.position([0.0, length]), axis=0)
    assert np.linalg.norm(apart) < 0.95 * length
    assert hose.health.crossings == 0
    assert hose.health.deepest_contact < 0.3
