"""Closed loops: continuity, momentum, circles, twist and its writhe, holds, snapshots."""

import numpy as np
import pytest
import scipy.linalg

from hose_mj.errors import InputError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.geds.loops import make_circle
from hose_mj.hoses.obstacles import ContactLaw
from hose_mj.hoses.spec import HoseSpec

pytestmark = pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.errors.HoseWarning")
EI, GJ, DENSITY, GRAVITY = 0.05, 0.04, 0.1, 9.81
ENDS = np.array([0.0, 1.0])
planes = pytest.mark.parametrize("plane", [None, "xz"])
schemes = pytest.mark.parametrize(
    "scheme", ["bdf2", "backward-euler", "sdirk2", "midpoint", "verlet"]
)


def make_loop(curve=None, *, spin=0.0, velocity=None, options=None, **changes):
    """A closed hose of 1 m without gravity; a circle in the xz-plane by default."""
    settings = {
        "length": 1.0,
        "axial_stiffness": 4e5 * EI,
        "bending_stiffness": EI,
        "torsional_stiffness": GJ,
        "linear_density": DENSITY,
    }
    settings |= changes
    given = {"gravity": (0, 0, 0), "control_points": 16} | (options or {})
    hose = GedsHose(HoseSpec(**settings), **given)
    hose.reset(make_circle(settings["length"]) if curve is None else curve, velocity)
    hose.close(spin)
    return hose


def make_even(points):
    """A closed curve (k, 3), scaled to length 1, as a function of its own arc length."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    points, along = points / along[-1], along / along[-1]
    return lambda s: np.stack([np.interp(s, along, points[:, c]) for c in range(3)], axis=1)


def make_ellipse(ratio):
    angle = np.linspace(0.0, 2.0 * np.pi, 4001)
    return make_even(np.stack([np.cos(angle), 0.0 * angle, ratio * np.sin(angle)], axis=1))


def measure_gaps(hose):
    return np.ptp(hose.position(ENDS), axis=0).max(), np.ptp(hose.tangent(ENDS), axis=0).max()


# -- motion ----------------------------------------------------------------------------------------


@planes
@schemes
def test_ends_stay_joined_and_momentum_is_conserved(plane, scheme):
    dt = 1e-4 if scheme == "verlet" else 2e-3
    options = {"plane": plane, "scheme": scheme, "timestep": dt, "tolerance": 1e-12}
    options["max_iterations"] = 50
    hose = make_loop(
        make_ellipse(0.6),
        velocity=lambda s: np.stack([2.0 * np.cos(3.0 * s), 0.0 * s, np.sin(5.0 * s)], axis=1),
        options=options,
        axial_stiffness=1e3 * EI,
    )
    hose.step()  # the ends meet at its end
    before = hose.momentum()
    assert np.linalg.norm(before.linear) > 0.01
    assert np.linalg.norm(before.angular) > 1e-3
    largest = np.zeros(2)
    for _ in range(10):
        hose.step(10)
        largest = np.maximum(largest, measure_gaps(hose))
    assert np.all(largest < 1e-12), largest
    after = hose.momentum()
    np.testing.assert_allclose(after.linear, before.linear, atol=1e-12)
    if scheme in ("midpoint", "verlet"):
        np.testing.assert_allclose(after.angular, before.angular, atol=1e-10)
    else:
        atol = (0.2 if scheme == "backward-euler" else 0.02) * np.linalg.norm(before.angular)
        np.testing.assert_allclose(after.angular, before.angular, atol=atol)


@planes
def test_an_ellipse_relaxes_to_a_circle(plane):
    hose = make_loop(
        make_ellipse(0.6), options={"plane": plane, "control_points": 24}, damping_time=0.05
    )
    assert hose.energies().bending > 2.4 * np.pi**2 * EI
    hose.step(1500)
    points = hose.position(np.linspace(0.0, 1.0, 200, endpoint=False))
    radii = np.linalg.norm(points - points.mean(axis=0), axis=1)
    np.testing.assert_allclose(radii, 1.0 / (2.0 * np.pi), rtol=1e-4)
    assert hose.energies().bending == pytest.approx(2.0 * np.pi**2 * EI, rel=1e-4)
    np.testing.assert_allclose(hose.momentum().linear, 0.0, atol=1e-12)
    # Nothing asks for it, but the moment goes on across the joint.
    curvature = hose.curvature([0.0, 1.0])
    np.testing.assert_allclose(curvature, 2.0 * np.pi, rtol=1e-2)


def test_planar_and_spatial_loops_move_alike():
    shapes = []
    for plane in (None, "xz"):
        options = {"plane": plane, "gravity": (0, 0, -GRAVITY), "tolerance": 1e-9}
        hose = make_loop(make_ellipse(0.7), options=options)
        hose.attach(0.1)
        hose.step(100)
        shapes.append(hose.control_points)
    np.testing.assert_allclose(shapes[1], shapes[0], atol=1e-8)


# -- holds and statics -----------------------------------------------------------------------------


@planes
@pytest.mark.parametrize("place", [0.0, 0.3])
def test_a_ring_pulled_at_opposite_points(plane, place):
    # Timoshenko's thin ring: it gives by (pi / 4 - 2 / pi) P R^3 / EI, and narrows by 2 / pi - 1/2.
    radius, way = 1.0 / (2.0 * np.pi), 1e-4
    hose = make_loop(options={"plane": plane, "control_points": 40})
    near, far = hose.clamp(place), hose.attach(place + 0.5)
    hose.solve_static()
    across = hose.position([place + 0.25, (place + 0.75) % 1.0])
    start, end = hose.position([place, place + 0.5])
    before = [hose.reaction(hold).force for hold in (near, far)]
    ahead = (end - start) / np.linalg.norm(end - start)
    hose.move(far, end + way * ahead)
    hose.solve_static()
    pull = way * EI / radius**3 / (np.pi / 4.0 - 2.0 / np.pi)
    for hold, old, sign in zip((near, far), before, (-1.0, 1.0), strict=True):
        gained = hose.reaction(hold).force - old
        np.testing.assert_allclose(gained, sign * pull * ahead, atol=0.01 * pull)
    now = hose.position([place + 0.25, (place + 0.75) % 1.0])
    narrowed = np.linalg.norm(np.diff(across, axis=0)) - np.linalg.norm(np.diff(now, axis=0))
    ratio = (2.0 / np.pi - 0.5) / (np.pi / 4.0 - 2.0 / np.pi)
    assert narrowed == pytest.approx(ratio * way, rel=0.01)


# On a clamp at its lowest point it stands, and in space falls to either side.
@pytest.mark.filterwarnings("ignore:the equilibrium found is unstable:hose_mj.errors.HoseWarning")
@planes
@pytest.mark.parametrize("place", [0.0, 0.37])
def test_a_loop_on_a_clamp_hangs_with_its_weight(plane, place):
    hose = make_loop(options={"plane": plane, "gravity": (0, 0, -GRAVITY)})
    clamp = hose.clamp(place)
    hose.solve_static()
    assert max(measure_gaps(hose)) < 1e-12
    weight = DENSITY * GRAVITY
    reaction = hose.reaction(clamp)
    np.testing.assert_allclose(reaction.force, [0.0, 0.0, weight], atol=1e-8)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    arms = hose.position(0.5 + 0.5 * nodes) - hose.position(place)[0]
    moment = np.cross((0.5 * weights) @ arms, [0.0, 0.0, -weight])
    np.testing.assert_allclose(reaction.moment, -moment, atol=1e-6)


def test_a_free_loop_has_no_statics():
    hose = make_loop()
    before = hose.control_points
    with pytest.raises(InputError, match="holds of a closed loop"):
        hose.solve_static()
    np.testing.assert_array_equal(hose.control_points, before)


# -- twist -----------------------------------------------------------------------------------------


def find_lowest(hose):
    """Smallest squared frequency of a loop that is not that of a rigid motion."""
    small = hose.linearize()
    free = scipy.linalg.null_space(small.constraints)
    points = hose.control_points
    rigid = [np.tile(axis, (len(points), 1)) for axis in np.eye(3)]
    rigid += [np.cross(axis, points - points.mean(axis=0)) for axis in np.eye(3)]
    flat = np.array(rigid).reshape(6, -1)
    free = free @ scipy.linalg.null_space(flat @ small.mass @ free)
    parts = (free.T @ part @ free for part in (small.stiffness, small.mass))
    return scipy.linalg.eigh(*parts, eigvals_only=True)[0]


@pytest.mark.parametrize("ratio", [0.75, 1.25])
@pytest.mark.parametrize("place", [0.0, 0.3])
def test_a_twisted_ring_leaves_its_plane_at_michell_s_angle(ratio, place):
    critical = 2.0 * np.pi * np.sqrt(3.0) / ratio
    found = []
    for part in (0.9995, 1.0005):
        hose = make_loop(
            spin=part * critical, options={"control_points": 24}, torsional_stiffness=ratio * EI
        )
        # The circle as it is found with the loop held where it stays.
        holds = [hose.clamp(place), hose.attach(place + 0.5)]
        hose.solve_static()
        for hold in holds:
            hose.release(hold)
        np.testing.assert_allclose(hose.torque([0.0, 0.6, 1.0]), part * critical * ratio * EI)
        found.append(find_lowest(hose))
    assert found[0] > 0.0 > found[1], found


def compute_writhe(points):
    """Gauss's double integral of a closed curve (k, 3), turns."""
    ahead = np.roll(points, -1, axis=0) - points
    middle = points + 0.5 * ahead
    apart = middle[:, None] - middle[None]
    distance = np.linalg.norm(apart, axis=2) + np.eye(len(points))
    volume = np.einsum("ijc,ijc->ij", np.cross(ahead[:, None], ahead[None]), apart)
    return np.sum(volume / distance**3) / (4.0 * np.pi)


def test_writhe_becomes_twist():
    # A loop laid without twist, then flat: twist plus writhe is kept (Calugareanu, White).
    angle = np.linspace(0.0, 2.0 * np.pi, 1001)
    width = 1.0 + 0.35 * np.cos(2.0 * angle)
    curve = np.stack(
        [width * np.cos(angle), width * np.sin(angle), 0.35 * np.sin(2.0 * angle)], axis=1
    )
    writhe = compute_writhe(curve[:-1])
    assert abs(writhe) > 0.1
    hose = make_loop(make_even(curve), options={"control_points": 32}, damping_time=0.1, drag=0.05)
    np.testing.assert_allclose(hose.torque([0.0, 0.5]), 0.0, atol=1e-12)
    hose.step(2000)
    points = hose.control_points - hose.control_points.mean(axis=0)
    assert np.linalg.svd(points)[1][-1] < 1e-4
    wanted = 2.0 * np.pi * writhe * GJ
    np.testing.assert_allclose(hose.torque([0.0, 0.5, 1.0]), wanted, rtol=5e-3)


def test_total_angle_is_kept_through_a_violent_motion():
    hose = make_loop(spin=6.0, damping_time=0.05, drag=0.2)
    hose.apply_force(0.3, [0.0, 30.0, 0.0])
    hose.apply_force(0.8, [0.0, -30.0, 5.0])
    largest = 0.0
    for _ in range(20):
        hose.step(5)
        largest = max(largest, abs(hose.torque(0.5)[0] / GJ - 6.0))
    assert largest > 0.5
    hose.clear_loads()
    hose.step(2000)
    assert hose.torque(0.5)[0] == pytest.approx(6.0 * GJ, rel=1e-6)


def test_clamps_share_the_twist_of_a_loop():
    hose = make_loop(spin=5.0)
    holds = [hose.clamp(0.3), hose.clamp(0.7)]
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.0, 0.5, 0.9]), 5.0 * GJ, rtol=1e-6)
    hose.move(holds[1], spin=1.0)
    hose.solve_static()
    # 0.4 m between the clamps on one side, 0.6 m across the joint on the other.
    across, between = GJ * (5.0 - 1.0 / 0.6), GJ * (5.0 + 1.0 / 0.4)
    np.testing.assert_allclose(hose.torque([0.0, 0.5, 1.0]), [across, between, across], rtol=1e-5)
    along = hose.tangent([0.3, 0.7])
    torques = [hose.reaction(hold).moment @ t for hold, t in zip(holds, along, strict=True)]
    np.testing.assert_allclose(torques, [across - between, between - across], rtol=1e-3)
    energy = 0.5 * (across**2 * 0.6 + between**2 * 0.4) / GJ
    assert hose.energies().twisting == pytest.approx(energy, rel=1e-5)
    # Clamps that come, also at the joint, take hold of the material as it lies.
    for place in (0.0, 0.5, 0.85):
        holds.append(hose.clamp(place))
        found = hose.torque([0.1, 0.4, 0.6, 0.8, 0.95])
        np.testing.assert_allclose(found, [across, between, between, across, across], rtol=1e-5)
    # What is between the last two that are left spreads over the whole loop.
    for hold in holds[1:]:
        hose.release(hold)
    hose.attach(0.8)
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.0, 0.5, 1.0]), 5.0 * GJ, rtol=1e-5)


def test_a_loop_is_the_ring_of_two_clamps_in_one_place():
    hose = make_loop(spin=3.0, options={"gravity": (0, 0, -GRAVITY)})
    clamp = hose.clamp(0.0)
    other = GedsHose(hose.spec, gravity=(0, 0, -GRAVITY), control_points=16)
    other.reset(make_circle(1.0))
    tangent = hose.tangent(0.0)[0]
    pair = [other.clamp(s, hose.position(0.0)[0], tangent) for s in ENDS]
    other.move(pair[1], spin=3.0)
    for one in (hose, other):
        one.solve_static()
    # Only the size of r', the strain, need not go on there.
    np.testing.assert_allclose(hose.control_points, other.control_points, atol=1e-6)
    np.testing.assert_allclose(hose.torque(0.4), other.torque(0.4), rtol=1e-6)
    total = sum(other.reaction(hold).moment for hold in pair)
    np.testing.assert_allclose(hose.reaction(clamp).moment, total, atol=1e-6)


def test_a_loop_that_is_opened_springs_apart_and_loses_its_twist():
    hose = make_loop(spin=4.0, damping_time=0.02)
    assert hose.is_closed
    hose.step(10)
    hose.open()
    assert not hose.is_closed
    assert hose.energies().twisting == 0.0
    hose.step(100)
    assert np.linalg.norm(np.ptp(hose.position(ENDS), axis=0)) > 0.2
    hose.reset(make_circle(1.0))
    hose.close()
    hose.reset(make_circle(1.0))
    assert not hose.is_closed


# -- snapshots, contact ----------------------------------------------------------------------------


@planes
@pytest.mark.parametrize("scheme", ["bdf2", "verlet"])
def test_snapshot_continues_bit_by_bit(plane, scheme):
    dt = 1e-5 if scheme == "verlet" else 2e-3
    options = {"plane": plane, "gravity": (0, 0, -GRAVITY), "scheme": scheme, "timestep": dt}
    spin = 0.0 if plane else 3.0
    hose = make_loop(make_ellipse(0.8), spin=spin, options=options)
    clamp = hose.clamp(0.4)
    hose.attach(0.9)

    def go_on(one):
        for _ in range(20):
            one.move(clamp, spin=0.0 if plane else 0.1)
            one.step()

    go_on(hose)
    kept = hose.snapshot()
    other = GedsHose(hose.spec, control_points=16, **options)
    other.restore(kept)
    assert other.is_closed
    for one in (hose, other):
        go_on(one)
    np.testing.assert_array_equal(other.control_points, hose.control_points)
    np.testing.assert_array_equal(other.torque([0.1, 0.6]), hose.torque([0.1, 0.6]))
    hose.open()
    hose.restore(kept)
    go_on(hose)
    np.testing.assert_array_equal(hose.control_points, other.control_points)
    assert max(measure_gaps(hose)) < 1e-12


def test_ends_that_are_joined_do_not_push_each_other():
    for is_closed in (True, False):
        shapes = []
        for touches in (True, False):
            hose = make_loop(options={"timestep": 1e-3})
            if not is_closed:
                hose.open()
            if touches:
                hose.set_obstacles((), ContactLaw(self_contact=True))
            hose.step(2)
            shapes.append(hose.control_points)
        # Open, the same ends are in each other's way.
        assert np.array_equal(*shapes) == is_closed


# -- what is refused -------------------------------------------------------------------------------


def test_what_cannot_be_closed():
    hose = make_loop()
    with pytest.raises(InputError, match=r"close.*open"):
        hose.close()
    hose.open()
    with pytest.raises(InputError, match="cannot open a hose that is not closed"):
        hose.open()
    for bad in ("much", np.inf, None):
        with pytest.raises(InputError, match="spin"):
            hose.close(bad)
    hose.clamp(0.0)
    end = hose.attach(1.0)
    with pytest.raises(InputError, match="both ends"):
        hose.close()
    hose.release(end)
    hose.close()
    for place in (0.0, 1.0):
        with pytest.raises(InputError, match="no other hold"):
            hose.attach(place)
    hose.reset([[0, 0, 0], [1, 0, 0]])
    with pytest.raises(InputError, match="gap between the ends"):
        hose.close()
    hose.reset([[0, 0, 0], [0.5, 0, 0], [0, 0, 0.01]])
    with pytest.raises(InputError, match="tangent"):
        hose.close()
    with pytest.raises(InputError, match="spin"):
        make_loop(spin=1.0, options={"plane": "xz"})
    with pytest.raises(InputError, match="theta"):
        make_loop(options={"twist": "theta"})


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"length": -1.0}, "length"),
        ({"length": 1.0, "normal": (0, 0, 0)}, "normal"),
        ({"length": 1.0, "center": (0, 0)}, "center"),
    ],
)
def test_a_circle_s_arguments_are_checked(options, match):
    with pytest.raises(InputError, match=match):
        make_circle(**options)


def test_a_circle_runs_right_handed_about_its_normal():
    points = make_circle(2.0, (1.0, 2.0, 3.0), (0.0, 0.0, 2.0))(np.linspace(0.0, 2.0, 9)[:-1])
    arms = points - [1.0, 2.0, 3.0]
    np.testing.assert_allclose(np.linalg.norm(arms, axis=1), 1.0 / np.pi, rtol=1e-12)
    area = 0.5 * np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)
    np.testing.assert_allclose(area, [0, 0, 4 * np.sin(np.pi / 4) / np.pi**2], atol=1e-12)
