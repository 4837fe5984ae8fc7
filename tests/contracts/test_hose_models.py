"""What every registered hose model promises, whatever its physics: see hoses/protocol.py."""

import math
import re

import numpy as np
import pytest

from hose_mj.errors import HoseError, InputError
from hose_mj.hoses.protocol import Energies, Hold, HoseModel, Linearization, Momentum, Reaction
from hose_mj.hoses.registry import MODELS, make_hose
from hose_mj.hoses.spec import HoseSpec

LENGTH, DENSITY, WEIGHT = 1.0, 0.1, 0.1 * 9.81
SMALL = {
    "geds": {"control_points": 10},
    "cable": {"segments": 10},
    "hinge-chain": {"segments": 10},
    "flex": {"segments": 20},
}
"""Options that make a model small; a model without an entry runs as it is by default."""
WITHOUT_TWIST = {model for model, entry in MODELS.items() if not entry.twists}
ARC_LENGTHS = np.array([0.0, 0.31, 0.5, 1.0])


def make_spec(**changes):
    values = {
        "length": LENGTH,
        "axial_stiffness": 2e4,
        "bending_stiffness": 0.05,
        "torsional_stiffness": 0.04,
        "linear_density": DENSITY,
        "damping_time": 0.01,
    }
    return HoseSpec(**(values | changes))


def make(model, **options):
    return make_hose(model, make_spec(), **({"timestep": 5e-4} | SMALL.get(model, {}) | options))


def arch(s):
    """A quarter of a circle in the xz-plane, of length 1."""
    angle = np.pi / 2 * np.asarray(s)
    return np.stack([np.sin(angle), 0 * angle, np.cos(angle) - 1], axis=1) / (np.pi / 2)


@pytest.fixture(params=sorted(MODELS))
def model(request):
    return request.param


@pytest.fixture
def hose(model):
    return make(model)


def observe(hose):
    s = ARC_LENGTHS
    parts = [hose.position(s), hose.velocity(s), hose.tangent(s), hose.tension(s)]
    momentum, energies = hose.momentum(), hose.energies()
    total = [energies.kinetic, energies.stretching, energies.bending, energies.gravitational]
    parts += [hose.curvature(s), momentum.linear, momentum.angular, np.array([*total, hose.time])]
    return np.concatenate([part.ravel() for part in parts])


def find_leaves(state):
    if isinstance(state, dict):
        assert all(isinstance(key, str) for key in state)
        return [leaf for part in state.values() for leaf in find_leaves(part)]
    if isinstance(state, (list, tuple)):
        return [leaf for part in state for leaf in find_leaves(part)]
    return [state]


def test_it_follows_the_protocol(hose):
    assert isinstance(hose, HoseModel)
    assert hose.spec == make_spec()
    assert hose.timestep == 5e-4
    assert hose.time == 0.0


def test_queries_of_twist_have_a_leading_axis_of_places(hose):
    hose.reset(arch)
    for query in (hose.twist, hose.torque):
        assert query(0.5).shape == (1,)
        assert query(ARC_LENGTHS).shape == (4,)
        np.testing.assert_allclose(query(ARC_LENGTHS), 0.0, atol=1e-9)
        with pytest.raises(InputError, match=r"arc_length.*1.5.*0 to 1"):
            query(1.5)


def test_queries_have_a_leading_axis_of_places(hose):
    hose.reset(arch)
    for query in (hose.position, hose.velocity, hose.tangent):
        assert query(0.5).shape == (1, 3)
        assert query(ARC_LENGTHS).shape == (4, 3)
        assert query(list(ARC_LENGTHS)).dtype == np.float64
    for query in (hose.tension, hose.curvature):
        assert query(0.5).shape == (1,)
        assert query(ARC_LENGTHS).shape == (4,)
    assert np.all(np.isfinite(observe(hose)))
    np.testing.assert_allclose(np.linalg.norm(hose.tangent(ARC_LENGTHS), axis=1), 1.0, rtol=1e-9)


def test_reset_lays_the_hose_along_a_curve(hose):
    # As a function and as a polyline spaced as it likes; a rigid segment is a chord of 9 degrees.
    uneven = arch(np.linspace(0.0, 1.0, 60) ** 1.3)
    for curve in (arch, uneven, uneven.tolist()):
        hose.reset(curve)
        np.testing.assert_allclose(hose.position(ARC_LENGTHS), arch(ARC_LENGTHS), atol=6e-3)
        np.testing.assert_allclose(hose.curvature([0.3, 0.5, 0.7]), np.pi / 2, rtol=0.15)
        np.testing.assert_allclose(hose.tangent(0.5)[0], np.array([1, 0, -1]) / 2**0.5, atol=0.1)
        assert observe(hose)[12:24].tolist() == [0.0] * 12  # at rest
        # Half EI kappa^2 L; gravity is zero at the origin, the arch's centre below it.
        assert hose.energies().bending == pytest.approx(0.025 * (np.pi / 2) ** 2, rel=0.2)
        below = 2 / np.pi * (1 - 2 / np.pi)
        assert hose.energies().gravitational == pytest.approx(-WEIGHT * below, rel=0.02)


def test_a_path_is_move_and_step_in_turn(hose):
    hose.reset(arch)
    start, tip = hose.position(0.0)[0], hose.attach(1.0)
    first = hose.clamp(0.0)
    ends = hose.position(1.0)[0] + 1e-3 * np.arange(1, 7)[:, None] * [-1.0, 0.0, 0.5]
    starts = start + 1e-3 * np.arange(1, 7)[:, None] * [0.0, 0.0, 1.0]
    saved = hose.snapshot()
    hose.follow({tip: ends, first: starts})
    found = observe(hose)
    assert hose.time == pytest.approx(6 * hose.timestep)
    np.testing.assert_allclose(hose.position(1.0)[0], ends[-1], atol=2e-3)
    hose.restore(saved)
    for end, begin in zip(ends, starts, strict=True):
        hose.move(tip, end)
        hose.move(first, begin)
        hose.step()
    np.testing.assert_array_equal(observe(hose), found)
    with pytest.raises(InputError, match="shape of a path"):
        hose.follow({tip: ends, first: starts[:3]})
    with pytest.raises(InputError, match="tangents"):
        hose.follow({tip: ends}, {tip: ends})


def test_reset_takes_a_velocity_and_starts_the_clock_again(hose):
    hold = hose.attach(0.0)
    hose.step(2)
    hose.reset(arch, velocity=[[0.5, 0.0, -2.0]] * 2)
    assert hose.time == 0.0
    np.testing.assert_allclose(hose.velocity(0.4)[0], [0.5, 0.0, -2.0], atol=1e-6)
    momentum = hose.momentum()
    assert isinstance(momentum, Momentum)
    np.testing.assert_allclose(momentum.linear, [0.05, 0.0, -0.2], atol=1e-7)
    assert hose.energies().kinetic == pytest.approx(0.05 * (0.25 + 4.0), rel=1e-6)
    with pytest.raises(InputError, match="hold"):
        hose.reaction(hold)


def test_momentum_of_a_spinning_rod(hose):
    # Along x from the origin, turning about -y at 2 rad/s: I = m L^2 / 3.
    hose.reset([[0, 0, 0], [1, 0, 0]], velocity=lambda s: np.outer(s, [0.0, 0.0, 2.0]))
    momentum = hose.momentum()
    np.testing.assert_allclose(momentum.linear, [0, 0, 0.1], atol=1e-6)
    np.testing.assert_allclose(momentum.angular, [0, -2 * 0.1 / 3, 0], atol=1e-4)
    assert hose.energies().kinetic == pytest.approx(0.1 / 6 * 4, rel=2e-3)


def test_it_falls_freely(hose):
    hose.reset(arch)
    hose.step(100)
    assert hose.time == pytest.approx(0.05)
    np.testing.assert_allclose(hose.momentum().linear, [0, 0, -WEIGHT * 0.05], atol=5e-4 * WEIGHT)


def test_clamp_attach_move_and_release(hose):
    hose.reset([[0, 0, 0], [1, 0, 0]])
    clamp, end = hose.clamp(0.0), hose.attach(1.0)
    assert isinstance(clamp, Hold)
    assert (clamp.fixes_tangent, end.fixes_tangent) == (True, False)
    assert (clamp.arc_length, end.arc_length) == (0.0, 1.0)
    assert clamp.number != end.number
    for k in range(1, 201):
        hose.move(end, [1.0 - 2e-4 * k, 0.0, 1e-4 * k])
        hose.step()
    np.testing.assert_allclose(hose.position(1.0)[0], [0.96, 0.0, 0.02], atol=1e-3)
    np.testing.assert_allclose(hose.position(0.0)[0], 0.0, atol=1e-3)
    reaction = hose.reaction(end)
    assert isinstance(reaction, Reaction)
    assert reaction.force.shape == reaction.moment.shape == (3,)
    assert np.linalg.norm(reaction.force) > 0.1 * WEIGHT
    hose.release(end)
    for call in (hose.reaction, hose.release, hose.move):
        with pytest.raises(InputError, match="hold"):
            call(end)
    hose.step(400)
    assert hose.position(1.0)[0, 2] < 0.0
    np.testing.assert_allclose(hose.position(0.0)[0], 0.0, atol=1e-3)


def test_a_hold_that_speeds_up_carries_the_mass(model):
    # Drawn along its own line: F = m a, wherever the hold is by then and however it is made.
    hose = make(model, gravity=(0.0, 0.0, 0.0))
    hose.reset([[0, 0, 0], [1, 0, 0]])
    end = hose.attach(0.0)
    for k in range(1, 401):
        hose.move(end, [-1.5 * (5e-4 * k) ** 2, 0.0, 0.0])
        hose.step()
    np.testing.assert_allclose(hose.reaction(end).force, [-3.0 * DENSITY, 0, 0], atol=0.015)
    np.testing.assert_allclose(hose.tension(0.5), 1.5 * DENSITY, atol=0.015)
    np.testing.assert_allclose(hose.momentum().linear, [-0.6 * DENSITY, 0, 0], atol=1e-3)
    force = hose.reaction(end).force
    hose.restore(hose.snapshot())
    np.testing.assert_allclose(hose.reaction(end).force, force, rtol=1e-6, atol=1e-9)


def test_static_reactions_carry_the_weight_and_the_load(hose):
    clamp = hose.clamp(0.0)
    hose.apply_force(0.8, [0.0, 0.0, -0.3])
    hose.solve_static()
    reaction = hose.reaction(clamp)
    np.testing.assert_allclose(reaction.force, [0, 0, WEIGHT + 0.3], atol=0.02 * WEIGHT)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    lever = (0.5 * weights) @ hose.position(0.5 + 0.5 * nodes)[:, 0]
    wanted = WEIGHT * lever + 0.3 * hose.position(0.8)[0, 0]
    # About y a force down at x works with the moment +x |F|: the clamp holds against it.
    assert reaction.moment[1] == pytest.approx(-wanted, rel=0.1)
    np.testing.assert_allclose(hose.velocity(ARC_LENGTHS), 0.0, atol=1e-9)


def test_loads_act_until_they_are_cleared(hose):
    hose.reset([[0, 0, 0], [1, 0, 0]])
    hose.apply_force(0.5, [0.0, 0.0, 2 * WEIGHT])
    hose.step(20)
    np.testing.assert_allclose(hose.momentum().linear[2], WEIGHT * 0.01, rtol=1e-3)
    hose.clear_loads()
    hose.step(20)
    np.testing.assert_allclose(hose.momentum().linear[2], 0.0, atol=1e-3 * WEIGHT)


def test_moment_bends_the_hose(model):
    hose = make(model, gravity=(0.0, 0.0, 0.0))
    hose.clamp(0.0)
    hose.apply_moment(1.0, [0.0, -0.05, 0.0])
    hose.solve_static()
    # One radian over the hose, from x towards z.
    wanted = [math.sin(1.0), 0.0, 1.0 - math.cos(1.0)]
    np.testing.assert_allclose(hose.position(1.0)[0], wanted, atol=0.06)


def make_twisted(model, turns, pieces):
    """A straight hose without gravity whose clamped end was spun, and its two clamps."""
    spec = make_spec(bending_stiffness=0.5, torsional_stiffness=0.004)
    many = {"cable": {"segments": 40, "clamp_correction": True}}
    options = many.get(model, SMALL.get(model, {}))
    hose = make_hose(model, spec, timestep=5e-4, gravity=(0.0, 0.0, 0.0), **options)
    hose.reset([[0, 0, 0], [1, 0, 0]])
    first, last = hose.clamp(0.0), hose.clamp(1.0)
    for _ in range(pieces):
        hose.move(last, spin=2 * np.pi * turns / pieces)
        hose.solve_static()
    return hose, first, last


@pytest.mark.parametrize("turns", [0.1, -10.0])
def test_spinning_a_clamp_twists_the_hose(model, turns):
    # GJ phi / L everywhere: far below the torque at which it would buckle, 8.99 EI / L.
    if model in WITHOUT_TWIST:
        pytest.skip("has no twist")
    hose, first, last = make_twisted(model, turns, pieces=max(1, round(4 * abs(turns))))
    angle = 2 * np.pi * turns
    torque = 0.004 * angle
    np.testing.assert_allclose(hose.twist(ARC_LENGTHS), angle, rtol=1e-6)
    np.testing.assert_allclose(hose.torque(ARC_LENGTHS), torque, rtol=1e-6)
    np.testing.assert_allclose(hose.reaction(last).moment, [torque, 0, 0], atol=1e-6)
    np.testing.assert_allclose(hose.reaction(first).moment, [-torque, 0, 0], atol=1e-6)
    assert hose.energies().twisting == pytest.approx(torque * angle / 2, rel=1e-6)
    assert hose.energies().bending == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(hose.position(ARC_LENGTHS)[:, 0], ARC_LENGTHS, atol=1e-7)


def test_bad_spin(model):
    hose = make(model)
    clamp, end = hose.clamp(0.0), hose.attach(1.0)
    assert re.search("spin.*attachment", catch(lambda: hose.move(end, spin=0.1)))
    assert re.search("spin.*nan", catch(lambda: hose.move(clamp, spin=math.nan)))
    if model in WITHOUT_TWIST:
        assert re.search("spin.*0 for a", catch(lambda: hose.move(clamp, spin=0.1)))


def test_energies_add_up(hose):
    hose.reset(arch, velocity=[[0.0, 0.0, 1.0]] * 2)
    energies = hose.energies()
    assert isinstance(energies, Energies)
    parts = (energies.kinetic, energies.stretching, energies.bending, energies.twisting)
    assert all(math.isfinite(part) and part >= 0.0 for part in parts)
    assert energies.total == pytest.approx(sum(parts) + energies.gravitational)


def test_damped_motion_loses_energy(hose):
    hose.clamp(0.0)
    before = hose.energies().total
    hose.step(600)
    assert hose.energies().total < before - 1e-3


def test_linearization_has_matching_shapes(hose):
    hose.clamp(0.0)
    linear = hose.linearize()
    assert isinstance(linear, Linearization)
    m = len(linear.mass)
    assert linear.mass.shape == linear.stiffness.shape == (m, m)
    assert linear.constraints.shape[1] == m
    np.testing.assert_allclose(linear.mass, linear.mass.T, atol=1e-12 * np.abs(linear.mass).max())
    assert np.linalg.eigvalsh(linear.mass)[0] > 0.0


def test_snapshot_restores_bitwise(hose):
    hose.reset(arch, velocity=[[0.1, 0.0, 0.0]] * 2)
    hose.clamp(0.0)
    end = hose.attach(1.0)
    hose.apply_force(0.5, [0.1, 0.0, 0.3])
    start = hose.position(1.0)[0]
    hose.step(10)
    hose.move(end, start + np.array([0.0, 0.0, 1e-3]))
    saved = hose.snapshot()
    for leaf in find_leaves(saved):
        assert isinstance(leaf, (np.ndarray, np.number, int, float, str, type(None))), type(leaf)
        assert not isinstance(leaf, np.ndarray) or leaf.dtype != object
    at = hose.position(ARC_LENGTHS)
    hose.step(25)
    wanted, reaction = observe(hose), hose.reaction(end)
    hose.clear_loads()
    hose.release(end)
    hose.step(5)
    hose.reset([[0, 0, 0], [1, 0, 0]])
    hose.restore(saved)
    np.testing.assert_allclose(hose.position(ARC_LENGTHS), at, atol=1e-12)
    hose.step(25)
    np.testing.assert_array_equal(observe(hose), wanted)
    np.testing.assert_array_equal(hose.reaction(end).force, reaction.force)
    np.testing.assert_array_equal(hose.reaction(end).moment, reaction.moment)


def test_steps_one_by_one_are_the_same_steps(model):
    at_once, one_by_one = make(model), make(model)
    for hose in (at_once, one_by_one):
        hose.reset(arch)
        hose.clamp(0.0)
    at_once.step(12)
    for _ in range(12):
        one_by_one.step()
    np.testing.assert_array_equal(observe(one_by_one), observe(at_once))


def test_no_steps_change_nothing(hose):
    hose.reset(arch)
    before = observe(hose)
    hose.step(0)
    np.testing.assert_array_equal(observe(hose), before)


# -- bad input: one InputError that names the thing, the value and the valid set ----------------


def catch(call):
    with pytest.raises(InputError) as caught:
        call()
    error = caught.value
    assert isinstance(error, HoseError)
    message = str(error)
    assert "\n" not in message
    assert str(error.thing) in message
    assert repr(error.value) in message
    assert len(error.valid) > 3
    assert message.endswith(f"valid: {error.valid}")
    return message


@pytest.mark.parametrize("name", ["length", "axial_stiffness", "linear_density"])
@pytest.mark.parametrize("value", [-1.0, 0.0, math.nan, math.inf, "soft", None, True])
def test_bad_material(name, value):
    message = catch(lambda: make_spec(**{name: value}))
    assert message.startswith(f"{name} is {value!r}")
    assert "above 0" in message


BAD_CALLS = {
    "clamp off the hose": (lambda h, _: h.clamp(1.2), "arc_length.*1.2.*0 to 1"),
    "attach off the hose": (lambda h, _: h.attach(-0.1), "arc_length.*-0.1.*0 to 1"),
    "query off the hose": (lambda h, _: h.position([0.5, 1.5]), "arc_length.*1.5.*0 to 1"),
    "query at NaN": (lambda h, _: h.tension(math.nan), "arc_length.*nan.*0 to 1"),
    "force off the hose": (lambda h, _: h.apply_force(2.0, [0, 0, 1]), "arc_length.*2.0.*0 to 1"),
    "force that is not finite": (
        lambda h, _: h.apply_force(0.5, [0, 0, math.nan]),
        "force.*nan.*three finite numbers",
    ),
    "force of two numbers": (lambda h, _: h.apply_force(0.5, [0, 1]), r"force.*\[0, 1\].*three"),
    "moment that is not finite": (
        lambda h, _: h.apply_moment(0.5, [0, math.inf, 0]),
        "moment.*inf.*three finite numbers",
    ),
    "position that is not finite": (
        lambda h, _: h.attach(0.5, [0, math.nan, 0]),
        "position.*nan.*three finite numbers",
    ),
    "tangent of no length": (lambda h, _: h.clamp(0.5, None, [0, 0, 0]), "tangent.*0.*not zero"),
    "tangent for an attachment": (
        lambda h, hold: h.move(hold, tangent=[1, 0, 0]),
        "tangent.*attachment",
    ),
    "curve with a repeated point": (
        lambda h, _: h.reset([[0, 0, 0], [0.5, 0, 0], [0.5, 0, 0], [1, 0, 0]]),
        r"curve\[2\].*0.5.*apart",
    ),
    "curve that is not finite": (
        lambda h, _: h.reset([[0, 0, 0], [math.nan, 0, 0]]),
        r"curve\[1\].*nan.*finite",
    ),
    "curve of another length": (
        lambda h, _: h.reset([[0, 0, 0], [9, 0, 0]]),
        "length.*9.*0.5 to 2",
    ),
    "curve of one point": (lambda h, _: h.reset([[0, 0, 0]]), r"curve.*\(1, 3\).*k >= 2"),
    "velocity that is not finite": (
        lambda h, _: h.reset([[0, 0, 0], [1, 0, 0]], velocity=[[math.nan, 0, 0]] * 2),
        "velocity.*nan.*finite",
    ),
    "steps below zero": (lambda h, _: h.step(-1), "n_steps.*-1.*whole"),
    "steps that are no whole number": (lambda h, _: h.step(1.5), "n_steps.*1.5.*whole"),
}


@pytest.mark.parametrize("case", BAD_CALLS)
def test_bad_call(hose, case):
    hose.reset(arch)
    hold = hose.attach(0.25)
    before = observe(hose)
    call, pattern = BAD_CALLS[case]
    message = catch(lambda: call(hose, hold))
    assert re.search(pattern, message), message
    np.testing.assert_array_equal(observe(hose), before)


ODD = [10**400, 10**5000, 1j, {"a": 1}, {1}, "text", np.zeros((2, 2)), np.array([1j] * 3), object()]
ODD_CALLS = {
    "clamp": lambda h, hold, odd: h.clamp(odd),
    "clamp position": lambda h, hold, odd: h.clamp(0.5, odd),
    "clamp tangent": lambda h, hold, odd: h.clamp(0.5, None, odd),
    "attach": lambda h, hold, odd: h.attach(odd),
    "attach position": lambda h, hold, odd: h.attach(0.5, odd),
    "move": lambda h, hold, odd: h.move(odd, [0.0, 0.0, 1.0]),
    "move position": lambda h, hold, odd: h.move(hold, odd),
    "move entry": lambda h, hold, odd: h.move(hold, [odd, 0.0, 0.0]),
    "move tangent": lambda h, hold, odd: h.move(hold, None, odd),
    "move spin": lambda h, hold, odd: h.move(hold, spin=odd),
    "release": lambda h, hold, odd: h.release(odd),
    "reaction": lambda h, hold, odd: h.reaction(odd),
    "force": lambda h, hold, odd: h.apply_force(0.5, odd),
    "force place": lambda h, hold, odd: h.apply_force(odd, [0.0, 0.0, 1.0]),
    "moment": lambda h, hold, odd: h.apply_moment(0.5, odd),
    "position": lambda h, hold, odd: h.position(odd),
    "torque": lambda h, hold, odd: h.torque(odd),
    "curve": lambda h, hold, odd: h.reset(odd),
    "curve function": lambda h, hold, odd: h.reset(lambda s: odd),
    "velocity": lambda h, hold, odd: h.reset(arch, odd),
    "velocity function": lambda h, hold, odd: h.reset(arch, lambda s: odd),
    "steps": lambda h, hold, odd: h.step(odd),
    "snapshot": lambda h, hold, odd: h.restore(odd),
    "timestep": lambda h, hold, odd: type(h)(make_spec(), timestep=odd),
    "gravity": lambda h, hold, odd: type(h)(make_spec(), timestep=1e-3, gravity=odd),
    "model": lambda h, hold, odd: make_hose(odd, make_spec(), timestep=1e-3),
}


@pytest.mark.parametrize("case", ODD_CALLS)
def test_what_is_no_number_no_vector_and_no_hold_is_refused(hose, case):
    hose.reset(arch)
    hold = hose.attach(0.25)
    before = observe(hose)
    for odd in ODD:
        with pytest.raises(InputError):
            ODD_CALLS[case](hose, hold, odd)
    np.testing.assert_array_equal(observe(hose), before)
    assert hose.reaction(hold).force.shape == (3,)


def test_a_snapshot_of_which_a_part_is_missing_or_odd_changes_nothing(hose):
    hose.reset(arch)
    hose.attach(0.25)
    before = observe(hose)
    for name in hose.snapshot():
        for odd in (None, "text", {"a": 1}):
            with pytest.raises(InputError, match="snapshot"):
                hose.restore(hose.snapshot() | {name: odd})
        state = hose.snapshot()
        del state[name]
        with pytest.raises(InputError, match="snapshot"):
            hose.restore(state)
    np.testing.assert_array_equal(observe(hose), before)


@pytest.mark.filterwarnings("ignore:a hold moves:hose_mj.HoseWarning")
@pytest.mark.parametrize("size", [1e14, 1e160, 1e308])
def test_absurd_numbers_are_refused_or_fail_and_leave_the_state_finite(hose, size):
    calls = {
        "place": lambda hold: hose.move(hold, [size, 0.0, 0.0]),
        "velocity": lambda hold: hose.reset(arch, [[0.0, 0.0, size]] * 2),
        "velocity function": lambda hold: hose.reset(arch, lambda s: np.full((len(s), 3), size)),
        "force": lambda hold: hose.apply_force(0.5, [0.0, 0.0, size]),
        "moment": lambda hold: hose.apply_moment(0.5, [0.0, size, 0.0]),
    }
    for name, call in calls.items():
        hose.reset(arch)
        hold = hose.attach(1.0)
        try:
            call(hold)
            assert size < 1e15, name
            hose.step(3)
        except HoseError:
            pass
        assert np.isfinite(observe(hose)).all(), name


def test_a_spec_that_is_none(model):
    message = catch(lambda: make_hose(model, None, timestep=1e-3))
    assert message.startswith("spec is None; valid: a HoseSpec")


@pytest.mark.parametrize("timestep", [math.nan, -1e-3, 0.0, math.inf, "fast"])
def test_bad_timestep(model, timestep):
    message = catch(lambda: make(model, timestep=timestep))
    assert re.search(r"timestep is .*above 0", message), message


def test_bad_gravity(model):
    message = catch(lambda: make(model, gravity=[0.0, 0.0, math.nan]))
    assert re.search("gravity.*nan.*three finite numbers", message), message


def test_unknown_option(model):
    message = catch(lambda: make(model, stiffness=3.0))
    assert re.search(f"option of {model} is 'stiffness'.*timestep", message), message


def test_unknown_model():
    message = catch(lambda: make_hose("spaghetti", make_spec(), timestep=1e-3))
    assert "'spaghetti'" in message
    assert all(name in message for name in MODELS)
