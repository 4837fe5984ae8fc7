"""Nothing thicker than the hose's radius is passed at default settings, and friction holds."""

import numpy as np
import pytest

from hose_mj import HoseSpec, Obstacle, make_hose
from hose_mj.validation.leaks import RADIUS, drop_on_bar, pull_round, throw_at_wall
from hose_mj.validation.leaks import make_light_hose as make


@pytest.mark.filterwarnings("ignore:a surface bends the hose:hose_mj.HoseWarning")
@pytest.mark.parametrize("dt", [0.001, 0.005])
@pytest.mark.parametrize("force", [20.0, 200.0])
@pytest.mark.parametrize("post", [0.005, 0.03, 0.1])
def test_a_taut_hose_stays_outside_a_round_post(post, force, dt):
    obstacle = Obstacle(kind="cylinder", size=(post, 1.0), friction=0.3)
    pull = pull_round(obstacle, post, force, dt)
    assert pull.sink < 0.2
    assert pull.iterations < 6
    assert pull.unbalanced < 0.01


@pytest.mark.parametrize("half", [0.01, 0.02, 0.05])
@pytest.mark.parametrize("length", [1.0, 3.0])
def test_no_bar_is_fallen_through(length, half):
    rng = np.random.default_rng(3)
    for _ in range(6):
        place = rng.uniform(0.3, 0.7) * length
        hose, gain = drop_on_bar(place, half, length)
        assert hose.position(place)[0, 2] > 0.0
        assert gain < 1e-3


@pytest.mark.parametrize("speed", [5.0, 20.0, 50.0])
def test_a_thin_wall_stops_whatever_hits_it(speed):
    rng = np.random.default_rng(4)
    for _ in range(8):
        hose, _, energies = throw_at_wall(speed, rng)
        assert hose.position(np.linspace(0, 1, 201))[:, 0].max() < 0.0
        assert energies[-1] < energies[0]


@pytest.mark.parametrize("n", [16, 32])
def test_the_tip_stands_on_the_floor(n):
    spec = HoseSpec(length=1.0, axial_stiffness=2e4, bending_stiffness=0.5, linear_density=0.1)
    floor = Obstacle(kind="plane", friction=0.5)
    hose = make_hose("geds", spec, timestep=2e-3, control_points=n, obstacles=[floor])
    hose.reset([[0.02, 0, 1.05], [0, 0, 0.05]])
    hold = hose.attach(0.0, (0.02, 0, 1.05))
    for k in range(500):
        hose.move(hold, (0.02, 0, 1.05 - 0.15 * (k + 1) / 500))
        hose.step()
        assert hose.position(np.linspace(0.9, 1, 21))[:, 2].min() > 0.7 * RADIUS


def test_a_cord_on_a_drum_holds_what_it_was_drawn_to():
    drum, r, tail = 0.1, 0.005, 0.25
    middle = drum + r
    length = 2 * tail + np.pi * middle

    def lay(s):
        angle = np.clip((s - tail) / middle, 0, np.pi)
        end = np.where(angle >= np.pi, s - tail - np.pi * middle, 0.0)
        below = np.where(s < tail, tail - s, end)
        return np.stack([middle * np.cos(angle), middle * np.sin(angle) - below, 0 * s], 1)

    spec = HoseSpec(
        length=length,
        axial_stiffness=2e3,
        bending_stiffness=1e-6,
        linear_density=0.02,
        outer_radius=r,
        damping_time=0.005,
        drag=0.05,
    )
    obstacle = Obstacle(kind="cylinder", size=(drum, 1.0), friction=0.5)
    options = {"gravity": (0, 0, 0), "control_points": 48, "obstacles": [obstacle]}
    hose = make_hose("geds", spec, timestep=0.002, **options)
    hose.reset(lay)
    hose.apply_force(0.0, (0, -1.0, 0))
    hold = hose.attach(length)
    place = hose.position(length)[0]
    for k in range(500):
        place = place - np.array([0, 0.02 * 0.002 * min(1, k / 100), 0])
        hose.move(hold, place)
        hose.step()
    hose.step(50)
    drawn = -hose.reaction(hold).force[1]
    assert drawn == pytest.approx(np.exp(0.5 * np.pi), rel=0.03)
    hose.step(500)
    assert -hose.reaction(hold).force[1] == pytest.approx(drawn, rel=1e-3)


def test_a_turntable_carries_a_hose_round():
    table = Obstacle(kind="plane", friction=0.5, angular_velocity=(0.0, 0.0, 1.0))
    hose = make(timestep=0.002, obstacles=[table])
    hose.reset([[0.1, 0, RADIUS], [1.1, 0, RADIUS]], lambda s: np.stack([0 * s, 0.1 + s, 0 * s], 1))
    hose.step(round(np.pi / 0.002))
    ends = hose.position([0.0, 1.0])
    # 1 rad/s asks for .11 g at the outer end: friction holds that.
    np.testing.assert_allclose(ends[:, :2], [[-0.1, 0.0], [-1.1, 0.0]], atol=5e-3)


@pytest.mark.parametrize("speed", [0.5, 3.0])
def test_it_is_the_same_who_comes_to_whom(speed):
    """Galilei: a hose thrown at a floor, and a floor that comes up to a hose at rest."""
    runs = []
    for floor_speed in (0.0, speed):
        floor = Obstacle(kind="plane", velocity=(0, 0, floor_speed), friction=0.3)
        hose = make(timestep=0.005, gravity=(0, 0, 0), obstacles=[floor], drag=0.0)
        hose.reset([[0, 0, 0.03], [1, 0, 0.08]], (0.0, 0.0, floor_speed - speed))
        shape = []
        for k in range(60):
            height = floor_speed * 0.005 * (k + 1)
            hose.contacts.move_obstacle(0, position=(0, 0, height))
            hose.step()
            shape.append(hose.control_points - [0, 0, height])
        runs.append(np.array(shape))
    np.testing.assert_allclose(runs[0], runs[1], atol=1e-6)
