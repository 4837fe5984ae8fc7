"""Newton stops on forces, and `hose.health` says what leaves its healthy range."""

import numpy as np
import pytest

from hose_mj import HoseSpec, HoseWarning, Spring, StepError, make_hose
from hose_mj.hoses.health import DEEPEST, LARGEST_JUMP
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.validation.ropes import carry_wire, compare_forces, swing


@pytest.mark.parametrize(("n", "dt"), [(16, 0.005), (64, 0.002)])
def test_forces_are_right_at_the_default_tolerance(n, dt):
    tight = carry_wire(n, dt, 1.0, tolerance=1e-9, force_tolerance=1e-8)
    assert compare_forces(carry_wire(n, dt, 1.0), tight) < 0.01


@pytest.mark.parametrize(
    ("axial", "bending", "n", "dt"),
    [(2e5, 1e-3, 32, 0.005), (2e5, 1e-3, 64, 0.002), (1e6, 1e-3, 64, 0.005), (1e7, 0.05, 32, 0.01)],
)
def test_a_free_swing_gains_no_energy(axial, bending, n, dt):
    _, gains = swing(axial, bending, n, dt, 2.0)
    assert gains.max() < 1e-3


@pytest.fixture
def hose(request):
    spec = HoseSpec(length=1.0, axial_stiffness=2e4, bending_stiffness=0.01, linear_density=0.1)
    made = make_hose("geds", spec, strict=getattr(request, "param", False))
    made.reset([[0, 0, 0], [1, 0, 0]])
    return made


@pytest.mark.parametrize("part", [1.5, 10.0])
def test_a_hold_that_jumps_is_said_once(hose, part):
    hold = hose.attach(1.0)
    hose.move(hold, (1.0, 0.9 * LARGEST_JUMP, 0.0))
    hose.step()
    assert hose.health.warnings == ()
    hose.move(hold, (1.0, 0.9 * LARGEST_JUMP + part * LARGEST_JUMP, 0.0))
    with pytest.warns(HoseWarning, match="moves by .* within one step"):
        hose.step()
    hose.move(hold, (1.0, 0.0, 0.0))
    hose.step()
    assert len(hose.health.warnings) == 1
    assert hose.health.largest_jump >= part * LARGEST_JUMP
    hose.reset([[0, 0, 0], [1, 0, 0]])
    assert hose.health.warnings == ()


@pytest.mark.parametrize("hose", [True], indirect=True)
def test_strict_refuses_the_step(hose):
    hold = hose.attach(1.0)
    hose.step()
    before = hose.control_points
    hose.move(hold, (1.0, 3.0, 0.0))
    with pytest.raises(StepError, match="moves by 3 m"):
        hose.step()
    with pytest.raises(StepError, match="moves by 3 m"):
        hose.step()  # to ask again changes nothing
    np.testing.assert_array_equal(hose.control_points, before)
    hose.move(hold, (1.0, 0.0, 0.0))
    hose.step()


@pytest.mark.parametrize("hose", [True], indirect=True)
def test_strict_refuses_a_strained_start(hose):
    with pytest.raises(StepError, match="laid with a strain"):
        hose.reset([[0, 0, 0], [1.1, 0, 0]])


def test_steps_with_bodies_are_looked_at_too(hose):
    floor = Obstacle(kind="plane", position=(0, 0, -0.006))
    hose.set_obstacles([floor])
    middle, tip = hose.attach(0.5), hose.attach(1.0)
    place = hose.position(1.0)
    hose.coupling.try_step([tip], place, 1e-3 * np.eye(3))
    with pytest.warns(HoseWarning, match="radii inside"):
        hose.coupling.accept_step()
    assert middle in hose.holds


def test_health_goes_on_from_a_snapshot(hose):
    hose.step(80)
    saved = hose.snapshot()
    hose.step(200)
    hose.restore(saved)
    assert hose.health.steps == 80
    assert hose.health.retry_share == 0.0


def test_where_a_hold_begins_in_statics_is_no_jump(hose):
    hose.attach(0.0)
    hose.attach(1.0, (0.5, 0.0, 0.0))
    hose.solve_static()
    hose.step()
    assert hose.health.warnings == ()
    assert hose.health.retry_share == 0.0


def test_a_deep_contact_is_said(hose):
    floor = Obstacle(kind="plane", position=(0, 0, -0.006))
    hose.set_obstacles([floor])
    hose.attach(0.5)  # within the floor
    with pytest.warns(HoseWarning, match="radii inside"):
        hose.step()
    hose.reset([[0, 0, 0.1], [1, 0, 0.1]])
    hose.set_obstacles([floor], ContactLaw(stiffness=30.0))
    hose.step(60)
    assert hose.health.deepest_contact > DEEPEST
    assert hose.health.warnings == ()


@pytest.mark.parametrize(("radius", "n", "sees"), [(0.05, 16, True), (0.05, 24, False)])
def test_a_mesh_too_coarse_for_a_post_is_said(radius, n, sees):
    # Sliding round half a post the ratio of the pulls is 2 % off at 16 control points, .2 % at 24.
    bend, length = radius + 0.005, 0.6
    leg = 0.5 * (length - np.pi * bend)

    def curve(s):
        angle = np.clip((s - leg) / bend, 0.0, np.pi)
        down = np.maximum(leg - s, 0.0) + np.maximum(s - length + leg, 0.0)
        return np.stack([-bend * np.cos(angle), 0 * s, bend * np.sin(angle) - down], axis=1)

    spec = HoseSpec(
        length=length,
        axial_stiffness=1e5,
        bending_stiffness=1e-5,
        linear_density=0.1,
        outer_radius=0.005,
        damping_time=0.01,
    )
    across = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
    post = Obstacle(kind="cylinder", rotation=across, size=(radius, 0.2), friction=0.3)
    hose = make_hose("geds", spec, control_points=n, plane="xz", obstacles=[post])
    hose.reset(curve)
    hose.attach(length)
    hose.apply_force(0.0, (0.0, 0.0, -20.0))
    if sees:
        with pytest.warns(HoseWarning, match="within one span"):
            hose.step(100)
    else:
        hose.step(100)
    span = length / (n - 3)
    assert hose.health.sharpest_contact == pytest.approx(span / bend, rel=0.05)
    hose.reset(curve)
    assert hose.health.sharpest_contact == 0.0


def shake(dt, spring=None, **options):
    """A hose that one clamp shakes and turns for half a second, and the work that is done."""
    spec = HoseSpec(length=1.0, axial_stiffness=2e3, bending_stiffness=0.05, linear_density=0.1)
    hose = make_hose("geds", spec, timestep=dt, control_points=10, **options)
    hose.reset([[0, 0, 0], [1, 0, 0]])
    hose.apply_force(0.5, (0.1, 0.0, 0.2))
    hold = hose.clamp(0.0, spring=spring)
    t = dt * np.arange(1, round(0.5 / dt) + 1)
    turn = 0.3 * np.sin(8.0 * t) ** 2
    hose.follow(
        {hold: np.stack([0 * t, 0 * t, 0.05 * np.sin(12.0 * t) ** 2], axis=1)},
        {hold: np.stack([np.cos(turn), 0 * t, np.sin(turn)], axis=1)},
    )
    return hose, abs(float(hose.snapshot()["state"]["work"][0]))


@pytest.mark.parametrize("spring", [None, Spring(200.0, 0.5)])
@pytest.mark.parametrize("options", [{}, {"plane": "xz"}, {"twist": "theta"}])
def test_no_energy_beyond_the_work_that_is_done(options, spring):
    left = []
    for dt in (0.002, 0.001):
        hose, work = shake(dt, spring, **options)
        left.append(abs(hose.health.energy_gained))
        assert left[-1] < 0.01 * work
    assert left[1] < 0.35 * left[0]  # second order


def test_what_the_step_damps_is_lost_and_what_is_unknown_is_not_given():
    hose, work = shake(0.005)
    assert -0.5 * work < hose.health.energy_gained < 1e-3 * work
    saved, gained = hose.snapshot(), hose.health.energy_gained
    hose.apply_moment(0.5, (0.0, 0.01, 0.0))
    assert np.isnan(hose.health.energy_gained)
    hose.restore(saved)
    assert hose.health.energy_gained == gained
    hose.move(hose.holds[0], spin=0.1)
    assert np.isnan(hose.health.energy_gained)
    hose.reset([[0, 0, 0], [1, 0, 0]])
    assert hose.health.energy_gained == 0.0


@pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.HoseWarning")
def test_a_strand_drawn_through_another_loses_two_links():
    u = np.linspace(-np.pi, np.pi, 801)
    curl = np.stack([u - 2.2 * np.sin(u), 0.3 * np.sin(u), -2.0 * np.cos(u)], axis=1)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curl, axis=0), axis=1))])
    spec = HoseSpec(
        length=1.0,
        axial_stiffness=1e3,
        bending_stiffness=1e-4,
        torsional_stiffness=1e-4,
        linear_density=0.1,
        outer_radius=0.004,
        drag=2.0,
    )
    hose = make_hose("geds", spec, gravity=(0, 0, 0), control_points=32)
    hose.reset(curl / along[-1])
    assert hose.health.lost_links is None
    hose.clamp(0.0)
    hose.clamp(1.0)
    strand = hose.attach(float(np.interp(1.7, u, along) / along[-1]))
    start = hose.position(strand.arc_length)[0]
    found = []
    for share in (0.8, 1.2):
        way = np.linspace(0.0, 1.0, 101)[1:, None] * (0.0, -share * 0.6 / along[-1], 0.0)
        hose.follow({strand: start + way})
        start = start + way[-1]
        found.append(abs(hose.health.lost_links))
        if share < 1.0:
            s = np.linspace(0.0, 1.0, 1001)
            places = hose.position(s)
            near = np.linalg.norm(places[:, None] - places[None], axis=2)
            near = near[np.abs(s[:, None] - s) > 6.0 * spec.outer_radius].min()
            assert hose.health.least_distance * spec.outer_radius == pytest.approx(near, rel=0.02)
    assert found == [0, 2]
    hose.move(hose.holds[0], spin=2.0 * np.pi)
    hose.step(20)
    assert abs(hose.health.lost_links) == 2  # what a spin brings is not lost
    hose.move(hose.holds[1], tangent=hose.tangent(1.0)[0])
    assert hose.health.lost_links is None
