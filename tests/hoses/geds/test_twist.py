"""Twist between clamps: torque, turns, holonomy, balance, and its variation by the shape."""

import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.hoses.geds import basis, mechanics, twist, twist_segments
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.geds.span import make_span
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.spec import Fitting, HoseSpec

pytestmark = pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.errors.HoseWarning")
EI, GJ, DENSITY, GRAVITY = 0.05, 0.04, 0.1, 9.81
X, Y, Z = np.eye(3)
forms = pytest.mark.parametrize("form", ["scalar", "theta"])


def make_spec(**changes):
    settings = {
        "length": 1.0,
        "axial_stiffness": 4e5 * EI,
        "bending_stiffness": EI,
        "torsional_stiffness": GJ,
        "linear_density": DENSITY,
    }
    return HoseSpec(**settings | changes)


def make_hose(form="scalar", *, gravity=(0, 0, 0), control_points=12, options=None, **changes):
    return GedsHose(
        make_spec(**changes),
        twist=form,
        gravity=gravity,
        control_points=control_points,
        **(options or {}),
    )


def space_curve(s):
    """A curve of length 1 that bends and winds, on a cylinder."""
    angle = 2.4 * s
    return np.stack([0.8 * s, 0.25 * np.cos(angle), 0.25 * np.sin(angle)], axis=1)


def turn_about(axis, angle):
    """Rotation matrix about a unit vector."""
    cross = np.cross(np.eye(3), axis)  # times v: axis x v
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


# -- a straight hose -------------------------------------------------------------------------------


@forms
def test_spin_of_a_clamp_twists_the_hose(form):
    hose = make_hose(form)
    first, last = hose.clamp(0.0), hose.clamp(1.0)
    hose.move(last, spin=2.5)
    hose.solve_static()
    places = [0.0, 0.3, 1.0]
    np.testing.assert_allclose(hose.twist(places), 2.5, rtol=1e-9)
    np.testing.assert_allclose(hose.torque(places), 2.5 * GJ, rtol=1e-9)
    assert hose.energies().twisting == pytest.approx(0.5 * GJ * 2.5**2, rel=1e-9)
    np.testing.assert_allclose(hose.reaction(last).moment, 2.5 * GJ * X, atol=1e-10)
    np.testing.assert_allclose(hose.reaction(first).moment, -2.5 * GJ * X, atol=1e-10)
    hose.move(first, spin=2.5)
    hose.solve_static()
    np.testing.assert_allclose(hose.torque(places), 0.0, atol=1e-10)


@forms
def test_many_turns_are_kept(form):
    hose = make_hose(form)
    # Greenhill's helix waits above M L / EI = 2 sqrt(T L^2 / EI): here 179, 27 turns make 136.
    hose.reset([[0, 0, 0], [1.02, 0, 0]])
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    for _ in range(27):
        hose.move(last, spin=2 * np.pi)
        hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.0, 0.6, 1.0]), 54 * np.pi * GJ, rtol=1e-9)
    for _ in range(54):
        hose.move(last, spin=-np.pi)
        hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.0, 0.6, 1.0]), 0.0, atol=1e-9)


def test_a_spin_while_running_is_there_at_once():
    hose = make_hose()
    first, last = hose.clamp(0.0), hose.clamp(1.0)
    for k in range(30):
        hose.move(last, spin=0.1)
        hose.move(first, spin=-0.02)
        hose.step()
        assert hose.torque(0.5)[0] == pytest.approx(0.12 * (k + 1) * GJ, rel=1e-9)
    hose.release(last)
    hose.step()
    assert hose.torque(0.5)[0] == 0.0
    assert hose.energies().twisting == 0.0


def test_theta_settles_to_the_spin_that_was_done_while_running():
    hose = make_hose("theta", damping_time=0.01, drag=0.5)
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    for _ in range(30):
        hose.move(last, spin=0.1)
        hose.step()
    hose.step(100)
    np.testing.assert_allclose(hose.torque([0.1, 0.5, 0.9]), 3.0 * GJ, rtol=1e-4)
    hose.move(last, position=[0.99, 0.0, 0.0], tangent=[1.0, 0.1, 0.0])
    hose.step(10)
    assert hose.torque(0.5)[0] > 2.5 * GJ
    hose.release(last)
    hose.step(1000)
    # What frames have gathered since they were laid is not in theta's splines: some of it stays.
    np.testing.assert_allclose(hose.torque([0.1, 0.5, 0.9]), 0.0, atol=0.02 * GJ)
    assert hose.energies().twisting < 1e-5 * 0.5 * GJ * 3.0**2


def test_damping_adds_the_torque_of_the_spin_s_rate():
    tau, dt = 0.02, 0.005
    hose = make_hose(damping_time=tau, options={"timestep": dt, "scheme": "backward-euler"})
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    for _ in range(10):
        hose.move(last, spin=0.01)
        hose.step()
    wanted = GJ * (0.1 + tau * 0.01 / dt)
    np.testing.assert_allclose(hose.reaction(last).moment, wanted * X, rtol=1e-9, atol=1e-12)


# -- clamps that come and go -----------------------------------------------------------------------


@forms
def test_a_clamp_inside_keeps_the_material(form):
    hose = make_hose(form)
    first, last = hose.clamp(0.0), hose.clamp(1.0)
    hose.move(last, spin=2.0)
    hose.solve_static()
    inside = hose.clamp(0.25)
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.1, 0.6]), 2.0 * GJ, rtol=1e-6)
    np.testing.assert_allclose(hose.reaction(inside).moment, 0.0, atol=1e-8)
    hose.move(inside, spin=0.3)
    hose.solve_static()
    torques = GJ * np.array([2.0 + 0.3 / 0.25, 2.0 - 0.3 / 0.75])
    # A spline for theta rounds the corner at a clamp inside a span.
    rel = 1e-9 if form == "scalar" else 0.03
    np.testing.assert_allclose(hose.torque([0.05, 0.9]), torques, rtol=rel)
    jump = (torques[0] - torques[1]) * X
    np.testing.assert_allclose(hose.reaction(inside).moment, jump, rtol=3 * rel, atol=1e-10)
    np.testing.assert_allclose(
        sum(hose.reaction(hold).moment for hold in (first, inside, last)), 0.0, atol=1e-9
    )
    hose.release(inside)
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.1, 0.6]), 2.0 * GJ, rtol=1e-6)


def test_a_clamp_inside_splits_the_angle_by_compliance():
    # Compliance is 0.3 / GJ + 0.2 / (4 GJ) on one side, 0.5 / GJ on the other.
    fitting = Fitting(start=0.3, end=0.5, torsional_stiffness=4 * GJ)
    hose = make_hose(fittings=(fitting,), control_points=13)
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    hose.move(last, spin=1.7)
    hose.solve_static()
    whole = hose.torque(0.1)[0]
    inside = hose.clamp(0.5)
    np.testing.assert_allclose(hose.torque([0.1, 0.4, 0.9]), whole, rtol=1e-12)
    # The split shows when one side is let go: the other one keeps what it had.
    hose.release(last)
    hose.solve_static()
    assert hose.torque(0.1)[0] == pytest.approx(whole, rel=1e-9)
    assert hose.torque(0.9)[0] == 0.0
    hose.move(inside, spin=-whole / GJ * 0.35)
    hose.solve_static()
    assert hose.torque(0.1)[0] == pytest.approx(0.0, abs=1e-10)


@forms
def test_a_clamp_taken_where_the_hose_lies_stores_nothing(form):
    hose = make_hose(form, control_points=16)
    hose.reset(space_curve)
    hose.clamp(0.0)
    assert hose.energies().twisting == pytest.approx(0.0, abs=1e-15)
    hose.clamp(1.0)
    hose.clamp(0.4)
    assert hose.energies().twisting == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(hose.torque([0.1, 0.5, 0.9]), 0.0, atol=1e-9)


@forms
@pytest.mark.parametrize("angle", [2.0, 3.5, -1.0])
def test_a_clamp_turns_to_a_director_by_less_than_half_a_turn(form, angle):
    hose = make_hose(form)
    hose.reset([[0, 0, 0], [1, 0, 0]], director=Y)
    hose.clamp(0.0, director=Y)
    # Its part along the tangent does not matter, nor does its length.
    hose.clamp(1.0, director=3.0 * (np.cos(angle) * Y + np.sin(angle) * Z) + 5.0 * X)
    hose.solve_static()
    least = (angle + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(hose.torque([0.0, 1.0]), GJ * least, rtol=1e-8)


# -- geometry --------------------------------------------------------------------------------------


@forms
def test_a_tangent_led_round_a_cone_leaves_its_solid_angle(form):
    hose = make_hose(form)
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    tilt, n_steps = 0.5, 60
    for angle in np.linspace(0.0, 2 * np.pi, n_steps + 1):
        around = np.cos(angle) * Y + np.sin(angle) * Z
        hose.move(last, tangent=np.cos(tilt) * X + np.sin(tilt) * around)
        hose.solve_static()
    hose.move(last, tangent=X)
    hose.solve_static()
    # A polygon of great arcs: n isosceles triangles about x (spherical excess).
    apex = 2 * np.pi / n_steps
    base = 2 * np.arctan(1.0 / (np.cos(tilt) * np.tan(0.5 * apex)))
    solid_angle = n_steps * (apex + base - np.pi)
    np.testing.assert_allclose(hose.torque([0.2, 0.8]), GJ * solid_angle, rtol=1e-4)


@forms
def test_turning_everything_three_times_leaves_shape_and_twist(form):
    # Frames that only go along in time would gather the turns; they are laid anew.
    hose = make_hose(form, control_points=14)
    tilt = np.cos(0.6) * X + np.sin(0.6) * Y
    hose.reset(lambda s: np.stack([0.9 * s, 0.2 * np.sin(np.pi * s), 0.1 * s], axis=1))
    first, last = hose.clamp(0.0, tangent=tilt), hose.clamp(1.0)
    hose.move(last, spin=1.0)
    hose.solve_static()
    points, torque = hose.control_points, hose.torque(0.5)[0]
    ends = [(hold, hose.position(s)[0], hose.tangent(s)[0]) for hold, s in ((first, 0), (last, 1))]
    n_steps, angle = 90, 6 * np.pi / 90
    for k in range(n_steps):
        then = turn_about(X, (k + 1) * angle)
        for hold, position, tangent in ends:
            # What the turn about x does beyond the smallest rotation of the tangent.
            along = tangent @ X
            spin = 2 * np.arctan(along * np.tan(0.5 * angle))
            hose.move(hold, position=then @ position, tangent=then @ tangent, spin=spin)
        hose.solve_static()
    np.testing.assert_allclose(hose.control_points, points, atol=2e-5)
    np.testing.assert_allclose(hose.torque([0.1, 0.5, 0.9]), torque, rtol=2e-3)
    assert abs(torque) > 0.5 * GJ


def compute_balance(n, form="scalar"):
    """Sums of forces and of moments about a point, over weight and weight times length."""
    hose = make_hose(form, gravity=(0, 0, -GRAVITY), control_points=n)
    hose.reset(lambda s: np.stack([0.7 * s, 0.2 * np.sin(3 * s), -0.3 * s * (1 - s)], axis=1))
    holds = [hose.clamp(0.0, tangent=[1, 0, 1]), hose.clamp(1.0, tangent=[1, 0, 1])]
    hose.move(holds[1], spin=3.0)
    hose.solve_static(4)
    assert abs(hose.torque(0.5)[0]) > 0.5 * GJ
    point = np.array([0.3, -2.0, 1.0])
    nodes, weights = np.polynomial.legendre.leggauss(4)
    places = (0.5 * (nodes + 1.0) + np.arange(n - 3)[:, None]).ravel() / (n - 3)
    weight = np.outer(np.tile(0.5 * weights, n - 3) / (n - 3), -DENSITY * GRAVITY * Z)
    force = weight.sum(axis=0)
    moment = np.cross(hose.position(places) - point, weight).sum(axis=0)
    for hold in holds:
        reaction = hose.reaction(hold)
        force = force + reaction.force
        arm = hose.position(hold.arc_length)[0] - point
        moment = moment + reaction.moment + np.cross(arm, reaction.force)
    unit = DENSITY * GRAVITY
    return np.abs(force).max() / unit, np.abs(moment).max() / unit


@forms
def test_reactions_balance_the_weight(form):
    force, coarse = compute_balance(12, form)
    assert force < 1e-7
    force, fine = compute_balance(24, form)
    assert force < 1e-7
    assert fine < 1e-4
    assert fine < coarse / 4


def measure_variation_error(n):
    """Largest difference of the rows of Phi from its finite differences, over the largest row."""
    spline = Spline(n, 1.0, None, has_theta=False)
    hose = mechanics.make_constants(make_spec(), spline.knots)
    places = basis.make_greville(spline.knots)
    x = spline.interpolate(places, space_curve(places))
    clamps = twist_segments.make_twist(spline, hose, [0.0, 1.0], x)
    span, step = make_span(), 1e-6

    def measure(shape):
        twist.measure_twist(spline.axes, hose.tables, clamps, shape, span)
        return clamps.trial[0]

    by_difference = np.zeros(len(x))
    for k in range(len(x)):
        move = np.zeros(len(x))
        move[k] = step
        by_difference[k] = (measure(x + move) - measure(x - move)) / (2 * step)
    measure(x)
    rows = clamps.rows[0, : len(x)]
    return np.abs(by_difference - rows).max() / np.abs(rows).max()


def test_rows_are_the_variation_of_the_angle():
    errors = [measure_variation_error(n) for n in (8, 16, 32)]
    assert errors[-1] < 1e-7
    assert np.all(np.array(errors[1:]) < np.array(errors[:-1]) / 8), errors


# -- motion ----------------------------------------------------------------------------------------


@forms
def test_snapshot_continues_bit_by_bit(form):
    hose = make_hose(form, gravity=(0, 0, -GRAVITY))
    hose.reset(space_curve)
    hose.clamp(0.0)
    last = hose.clamp(1.0)

    def go_on(hose, n_steps):
        for k in range(n_steps):
            angle = 0.02 * k
            hose.move(last, tangent=[np.cos(angle), 0.3, np.sin(angle)], spin=0.1)
            hose.step()

    go_on(hose, 25)
    hose.move(last, spin=0.3)
    kept = hose.snapshot()
    other = make_hose(form, gravity=(0, 0, -GRAVITY))
    other.restore(kept)
    for one in (hose, other):
        go_on(one, 20)
    assert abs(hose.torque(0.5)[0]) > GJ
    np.testing.assert_array_equal(other.control_points, hose.control_points)
    np.testing.assert_array_equal(other.torque([0.2, 0.7]), hose.torque([0.2, 0.7]))
    hose.restore(kept)
    go_on(hose, 20)
    np.testing.assert_array_equal(hose.control_points, other.control_points)


def test_both_forms_move_alike():
    # Theta has a little inertia of its own, the scalar form has none.
    shapes, torques = [], []
    for form in ("scalar", "theta"):
        hose = make_hose(
            form, gravity=(0, 0, -GRAVITY), control_points=16, drag=0.3, outer_radius=0.002
        )
        hose.reset([[0, 0, 0], [1, 0, 0]])
        hose.clamp(0.0)
        last = hose.clamp(1.0)
        for k in range(1, 201):
            way = 0.5 - 0.5 * np.cos(np.pi * k / 200)
            hose.move(last, position=[1.0 - 0.4 * way, 0.3 * way, 0.0], spin=4.0 / 200)
            hose.step()
        shapes.append(hose.position(np.linspace(0.0, 1.0, 21)))
        torques.append(hose.torque(0.5)[0])
    assert abs(torques[0]) > GJ
    assert np.abs(shapes[0][:, 1:]).max() > 0.2
    np.testing.assert_allclose(shapes[1], shapes[0], atol=5e-5)
    assert torques[1] == pytest.approx(torques[0], rel=0.02)


# -- what is refused -------------------------------------------------------------------------------


def test_no_spin_for_an_attachment_nor_in_a_plane():
    hose = make_hose()
    with pytest.raises(InputError, match="spin"):
        hose.move(hose.attach(0.5), spin=0.1)
    flat = GedsHose(make_spec(), plane="xz", control_points=12)
    with pytest.raises(InputError, match="spin"):
        flat.move(flat.clamp(0.0), spin=0.1)
    with pytest.raises(InputError, match="director"):
        flat.clamp(1.0, director=Z)
    with pytest.raises(InputError, match="director"):
        hose.clamp(0.0, director=X)


def test_a_hose_without_torsional_stiffness_carries_no_torque():
    hose = make_hose(None, torsional_stiffness=0.0)
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    hose.move(last, spin=2.0)
    hose.solve_static()
    hose.step()
    assert hose.energies().twisting == 0.0
    np.testing.assert_array_equal(hose.torque([0.0, 0.5]), 0.0)
    np.testing.assert_allclose(hose.reaction(last).moment, 0.0, atol=1e-12)
