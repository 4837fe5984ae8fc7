import numpy as np
import pytest

from hose_mj.errors import StepError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.spec import HoseSpec

pytestmark = pytest.mark.filterwarnings("ignore::hose_mj.HoseWarning")  # violent by intent
EI, DENSITY = 0.05, 0.1
N_RANDOM = 300
"""Runs here; the compare command has the budget for 100,000."""


def flatten(state):
    """All leaves of a snapshot with the path to each."""
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


def draw_polygon(polygon, flat, rng):
    """Noise up to 2 L, four points in one, a fold by 180 degrees, or a slight disturbance."""
    noise, n = rng.uniform(-1.0, 1.0, polygon.shape) * flat, len(polygon)
    kind = rng.integers(4)
    if kind == 0:
        return polygon + rng.uniform(0.0, 2.0) * noise
    if kind == 1:
        first = rng.integers(0, n - 3)
        polygon[first : first + 4] = polygon[first]
        return polygon
    if kind == 2:
        fold = rng.integers(1, n - 1)
        polygon[fold:] = 2.0 * polygon[fold] - polygon[fold:]
        return polygon
    return polygon + 0.02 * noise


def make_random(rng):
    """A hose with random material, shape, holds and loads up to 100 times its weight."""
    plane = rng.choice([None, "xz"])
    ei = EI * 10 ** rng.uniform(-3, 2)
    ea = ei * 10 ** rng.uniform(2.5, 6)
    damping = rng.choice([0.0, 0.01])
    spec = HoseSpec(
        length=1.0,
        axial_stiffness=ea,
        bending_stiffness=ei,
        torsional_stiffness=0.0,
        linear_density=DENSITY,
        damping_time=float(damping),
    )
    hose = GedsHose(
        spec,
        plane=plane,
        timestep=10 ** rng.uniform(-3.5, -1.7),
        control_points=int(rng.integers(5, 20)),
        scheme=str(rng.choice(["bdf2", "backward-euler"])),
    )
    flat = np.array([1.0, 0.0 if plane else 1.0, 1.0])
    hose.set_control_points(draw_polygon(hose.control_points, flat, rng))
    if rng.random() < 0.5:
        ahead = 1.0 if hose.tangent(0.0)[0, 0] >= 0.0 else -1.0
        hose.clamp(0.0, tangent=[ahead, 0.0, 0.0])
    if rng.random() < 0.5:
        hose.attach(float(rng.uniform(0.2, 1.0)))
    for _ in range(2):
        force = rng.normal(size=3) * flat * DENSITY * 9.81 * 10 ** rng.uniform(-1, 2)
        hose.apply_force(float(rng.uniform(0, 1)), force)
    return hose


def test_random_states_stay_finite_and_rarely_fail():
    rng = np.random.default_rng(20261122)
    failures = 0
    for _ in range(N_RANDOM):
        hose = make_random(rng)
        for _ in range(10):
            before = hose.snapshot()
            try:
                hose.step()
            except StepError:
                failures += 1
                after = hose.snapshot()
                for key in ("state", "steps", "holds", "loads"):
                    assert_same(after[key], before[key])
                break
            state = hose.snapshot()["state"]
            assert all(np.all(np.isfinite(part)) for part in state.values())
    assert failures <= N_RANDOM // 100, failures


def make_thread():
    spec = HoseSpec.from_material(
        length=0.1, youngs_modulus=750e6, poisson_ratio=0.4, density=1100.0, outer_radius=2e-4
    )
    return GedsHose(spec, timestep=1e-3, control_points=24)


def test_suture_thread_pulled_taut_sideways():
    hose = make_thread()
    slack = np.array([np.linspace(0, 0.095, 50), np.zeros(50), np.zeros(50)]).T
    # A parabola of length 0.1 over a span of 0.095: rise h with 8 h^2 / (3 span) = 5 mm.
    rise = np.sqrt(0.005 * 3 * 0.095 / 8)
    slack[:, 2] = -4 * rise * (slack[:, 0] / 0.095) * (1 - slack[:, 0] / 0.095)
    hose.reset(slack)
    ends = hose.attach(0.0, [0, 0, 0]), hose.attach(0.1, [0.095, 0, 0])
    hose.solve_static()
    middle = hose.attach(0.05)
    start = hose.position(0.05)[0]
    # Half a thread of 50 mm spans 47.5 mm along and so 15.61 mm across when it is taut.
    taut = np.array([0.0475, np.sqrt(0.05**2 - 0.0475**2), 0.0])
    goal = taut * [1.0, 1.005, 0.0]
    for part in np.linspace(0.0, 1.0, 401)[1:]:
        hose.move(middle, start + part * (goal - start))
        hose.step()
    hose.step(100)
    assert np.all(np.isfinite(hose.control_points))
    # Bending rounds the corner in the middle, so it takes more than the two straight halves would.
    half = np.hypot(goal[0], goal[1])
    tension = hose.tension([0.01, 0.025, 0.075, 0.09])
    least = hose.spec.axial_stiffness * (half / 0.05 - 1.0)
    assert np.all(tension > least)
    assert np.all(tension < 10 * least)
    pull = hose.reaction(middle).force
    slope = abs(hose.tangent(0.025)[0, 1])
    assert pull[1] == pytest.approx(2 * tension[1] * slope, rel=0.01)
    for end in ends:
        assert hose.reaction(end).force[1] == pytest.approx(-0.5 * pull[1], rel=0.01)


def drive(hose, hold, first, count):
    for k in range(first, first + count):
        angle = 0.02 * k
        hose.move(hold, [0.9 - 0.002 * k, 0.0, 0.001 * k], [np.cos(angle), 0.0, -np.sin(angle)])
        hose.step()


@pytest.mark.parametrize("plane", [None, "xz"])
@pytest.mark.parametrize("scheme", ["bdf2", "backward-euler", "sdirk2", "midpoint"])
@pytest.mark.parametrize("moved", [True, False])
def test_snapshot_in_mid_motion_restores_bitwise(plane, scheme, moved):
    spec = HoseSpec(
        length=1.0,
        axial_stiffness=2e4,
        bending_stiffness=EI,
        torsional_stiffness=0.0,
        linear_density=DENSITY,
        damping_time=0.01,
        drag=0.1,
    )
    hose = GedsHose(spec, plane=plane, scheme=scheme, control_points=12)
    hose.clamp(0.0)
    hold = hose.clamp(1.0)
    hose.apply_force(0.4, [0.0, 0.0, 1.0])
    hose.apply_moment(0.6, [0.0, 0.01, 0.0])
    drive(hose, hold, 1, 20)
    # Between a move and its step, too: the way of the hold is part of the state.
    if moved:
        hose.move(hold, [0.85, 0.0, 0.03])
    saved = hose.snapshot()
    reaction = hose.reaction(hold)
    hose.step()
    drive(hose, hold, 22, 20)
    wanted = hose.snapshot()

    hose.clear_loads()
    hose.release(hold)
    hose.attach(0.3)
    hose.step(3)
    hose.reset([[0, 0, 0], [0.9, 0, 0]])
    hose.restore(saved)
    assert_same(hose.snapshot() | {"holds": 0}, saved | {"holds": 0})
    np.testing.assert_array_equal(hose.reaction(hold).force, reaction.force)
    hose.step()
    drive(hose, hold, 22, 20)
    found = hose.snapshot()
    found["holds"].pop("n_made"), wanted["holds"].pop("n_made")
    assert_same(found, wanted)


def test_snapshot_is_a_copy_of_plain_things():
    hose = make_thread()
    hose.clamp(0.0)
    hose.attach(0.1)
    hose.apply_force(0.05, [0, 0, 1e-3])
    saved = hose.snapshot()
    kept = {path: np.copy(leaf) for path, leaf in flatten(saved) if leaf is not None}
    for path, leaf in flatten(saved):
        assert type(leaf) in (np.ndarray, float, int, bool, str, type(None)), path
    hose.step(3)
    for path, leaf in flatten(saved):
        assert leaf is None or np.array_equal(leaf, kept[path]), path


def test_an_error_leaves_the_state_untouched():
    hose = make_thread()
    hose.clamp(0.0)
    end = hose.attach(0.1)
    hose.step(5)
    before = hose.snapshot()
    hose.move(end, [1e15, 0.0, 0.0])
    with pytest.raises(StepError, match=r"the step at t = 0\.005 s failed"):
        hose.step(3)
    after = hose.snapshot()
    assert_same(after["state"], before["state"])
    assert hose.time == pytest.approx(0.005)
    hose.move(end, [0.1, 0.0, 0.0])
    hose.step()
    assert np.all(np.isfinite(hose.control_points))
