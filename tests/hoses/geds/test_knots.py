"""Knots: what ropes know of themselves, against the published overhand knot."""

import numpy as np
import pytest

from hose_mj import HoseSpec, make_hose
from hose_mj.hoses.obstacles import ContactLaw

RADIUS = 0.002
BENDING = 1e-3
# Audoly, Clauvelin, Neukirch, PRL 99, 164301 (2007): end shortening e over the radius, pull T as
# T e^2 / (2 pi^2 EI); the height of the loop is sqrt(2 EI / T).
SHORTENING = np.array([150, 200, 300, 500, 700])
PULL = np.array([1.326, 1.262, 1.196, 1.139, 1.113])


def make_overhand(loop, tail):
    """An open overhand knot with a loop of radius `loop` and tails, both in radii of the rope."""
    a, h1 = 2.7 * np.sqrt(2.0 * loop), 1.15
    x = np.linspace(-a, a, 400)
    q = (x + a) / (2.0 * a)
    phi = -np.pi / 2 + 3.0 * np.pi * q**2 * (3.0 - 2.0 * q)
    t = np.linspace(0.0, 2.0 * np.pi, 400)
    first = np.stack([x, h1 * np.sin(phi), h1 * np.cos(phi)], 1)
    turn = np.stack([loop * np.sin(t) + a * (1 - t / np.pi), loop * (1 - np.cos(t)) + h1, 0 * t], 1)
    last = np.stack([x, -h1 * np.sin(phi), -h1 * np.cos(phi)], 1)
    out = np.linspace(0.0, tail, 300)[1:, None] * [1.0, 0.0, 0.0]
    whole = [first[0] - out[::-1], first, turn[1:], last[1:], last[-1] + out]
    return RADIUS * np.concatenate(whole)


def tie(loop, tail, control_points, friction=0.0, timestep=0.002):
    """A knot with its ends held, and its holds."""
    knot = make_overhand(loop, tail)
    length = np.linalg.norm(np.diff(knot, axis=0), axis=1).sum()
    spec = HoseSpec(
        length=length,
        axial_stiffness=4.0 * BENDING / RADIUS**2,
        bending_stiffness=BENDING,
        torsional_stiffness=0.0,
        linear_density=0.02,
        outer_radius=RADIUS,
        damping_time=0.005,
        drag=0.2,
    )
    options = {"timestep": timestep, "gravity": (0, 0, 0), "control_points": control_points}
    hose = make_hose("geds", spec, **options)
    hose.set_obstacles([], ContactLaw(self_contact=True, self_friction=friction))
    hose.reset(knot)
    return hose, [hose.attach(0.0), hose.attach(length)]


def measure_shortening(hose):
    ends = hose.position([0.0, hose.spec.length])
    return hose.spec.length - np.linalg.norm(ends[1] - ends[0])


def draw(hose, hold, shortening, n_steps):
    """Moves one end away, in steps of statics, to an end shortening; returns pulls and energies."""
    found = []
    for wanted in np.geomspace(measure_shortening(hose), shortening, n_steps + 1)[1:]:
        ends = hose.position([0.0, hose.spec.length])
        way = ends[1] - ends[0]
        away = way / np.linalg.norm(way) * (measure_shortening(hose) - wanted)
        hose.move(hold, ends[1] + away)
        hose.solve_static()
        pull = np.linalg.norm(hose.reaction(hold).force)
        found.append((measure_shortening(hose), pull, hose.energies().total))
    return np.array(found).T


def check_curve(hose, hold, sizes, n_steps, tolerance):
    for size in sizes:
        e, pull, energy = draw(hose, hold, size * RADIUS, n_steps)
        scale = 2.0 * np.pi**2 * BENDING
        assert pull[-1] * e[-1] ** 2 / scale == pytest.approx(
            np.interp(size, SHORTENING, PULL), rel=tolerance
        )
        # The work of the pull is what the knot holds: contact is smooth enough for both to agree.
        middle = 0.5 * (e[-1] + e[-2])
        force = -(energy[-1] - energy[-2]) / (e[-1] - e[-2])
        assert force * middle**2 / scale == pytest.approx(
            np.interp(middle / RADIUS, SHORTENING, PULL), rel=tolerance
        )
        # The loop turns about the line of its ends as it likes; its crossing is below that line.
        places = hose.position(np.linspace(0.0, hose.spec.length, 2000))
        across = (places - places[0]) * [0.0, 1.0, 1.0]
        top = across[np.argmax(np.linalg.norm(across, axis=1))]
        height = np.ptp(across @ top) / np.linalg.norm(top)
        assert height == pytest.approx(np.sqrt(2.0 * BENDING / pull[-1]), rel=tolerance)
    assert hose.health.crossings == 0
    assert hose.health.deepest_contact < 0.1


@pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.HoseWarning")
def test_an_overhand_knot_follows_the_published_curve():
    hose, (_, hold) = tie(100.0, 400.0, 128)
    assert hose.solve_static().is_stable
    check_curve(hose, hold, [600], 4, 0.02)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.HoseWarning")
@pytest.mark.filterwarnings("ignore:the equilibrium found is unstable:hose_mj.HoseWarning")
def test_an_overhand_knot_follows_the_published_curve_to_its_end():
    hose, (_, hold) = tie(100.0, 600.0, 256)
    hose.solve_static()
    check_curve(hose, hold, [700, 600, 500, 450, 400, 350, 300, 250, 200, 175, 150], 12, 0.05)


@pytest.mark.parametrize("friction", [0.05, 0.13])
@pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.HoseWarning")
def test_a_knot_holds_by_itself_where_friction_is_enough(friction):
    # Published: from .081 on at this size.
    hose, (_, hold) = tie(85.0, 340.0, 160, friction)
    hose.solve_static()
    hose.step(200)
    hose.release(hold)
    hose.step(200)
    before = measure_shortening(hose) / RADIUS
    assert before == pytest.approx(610.0, abs=6.0)
    hose.step(400)
    opened = measure_shortening(hose) / RADIUS - before
    assert opened < 1.0 if friction > 0.1 else opened > 8.0


@pytest.mark.parametrize("timestep", [0.005, 0.001])
@pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.HoseWarning")
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
    assert measure_shortening(hose) > 0.05 * length
    assert hose.health.crossings == 0
    assert hose.health.deepest_contact < 0.3
