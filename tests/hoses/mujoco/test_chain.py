import math

import numpy as np
import pytest
import scipy.linalg

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.mujoco.cable import CableHose
from hose_mj.hoses.mujoco.hinge_chain import HingeChainHose
from hose_mj.hoses.protocol import HoseModel
from hose_mj.hoses.registry import MODELS, make_hose
from hose_mj.hoses.spec import HoseSpec

EI, GJ, WEIGHT = 0.05, 0.05 / 1.3, 0.981
HEAVY_CANTILEVER = {1.0: 0.12456177, 10.0: 1.06680232, 100.0: 5.88810462}
models = pytest.mark.parametrize("model", ["cable", "hinge-chain"])


def make_spec(**changes):
    values = {
        "length": 1.0,
        "axial_stiffness": 1e5,
        "bending_stiffness": EI,
        "torsional_stiffness": GJ,
        "linear_density": 0.1,
    }
    return HoseSpec(**{**values, **changes})


def make(model, *, segments=10, timestep=1e-4, clamp_correction=True, spec=None, **options):
    return make_hose(
        model,
        spec or make_spec(),
        timestep=timestep,
        segments=segments,
        clamp_correction=clamp_correction,
        **options,
    )


def droop_error(model, segments, gamma, correction):
    spec = make_spec(bending_stiffness=WEIGHT / gamma, torsional_stiffness=WEIGHT / gamma / 1.3)
    hose = make(model, segments=segments, clamp_correction=correction, spec=spec)
    hose.clamp(0.0)
    hose.solve_static()
    tip = hose.position(1.0)[0]
    return -tip[2] / tip[0] / HEAVY_CANTILEVER[gamma] - 1.0


def wave(s):
    return np.stack([s, 0 * s, 0.1 * np.sin(3 * s)], axis=1)


@models
def test_protocol(model):
    assert isinstance(make(model), HoseModel)
    assert make(model).fallbacks == 0


@models
def test_documented_clamp_errs_with_first_order(model):
    errors = [droop_error(model, n, 1.0, False) for n in (10, 20, 40)]
    np.testing.assert_allclose(errors, [-0.190, -0.097, -0.049], atol=1e-3)


@models
@pytest.mark.parametrize("gamma", [1.0, 10.0, 100.0])
def test_corrected_clamp_converges_with_second_order(model, gamma):
    coarse, fine = (droop_error(model, n, gamma, True) for n in (10, 20))
    assert abs(fine) < {1.0: 2e-3, 10.0: 3e-3, 100.0: 1.5e-2}[gamma]
    assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.3)


@models
def test_tip_load(model):
    hose = make(model, segments=20, gravity=(0, 0, 0))
    hose.clamp(0.0)
    hose.apply_force(1.0, [0, 0, 2 * EI])
    hose.solve_static()
    np.testing.assert_allclose(hose.position(1.0)[0], [1 - 0.16064172, 0, 0.49345748], atol=2e-3)


@pytest.mark.parametrize("torsional_stiffness", [0.0, 1e-4])
def test_torsional_stiffness_does_not_bend_an_untwisted_cable(torsional_stiffness):
    tips = []
    for stiffness in (GJ, torsional_stiffness):
        hose = make("cable", spec=make_spec(torsional_stiffness=stiffness))
        hose.clamp(0.0)
        hose.apply_force(1.0, [0, 0.5, 0.8])
        hose.apply_force(0.5, [0.1, -0.7, 0])
        hose.solve_static()
        tips.append(hose.position(1.0)[0])
    np.testing.assert_allclose(tips[1], tips[0], atol=1e-6)


def test_unstable_equilibrium_is_left():
    hose = make("hinge-chain", spec=make_spec(bending_stiffness=0.01))
    hose.reset([[0, 0, 0], [0.02, 0, 1]])
    hose.clamp(0.0, tangent=[0, 0, 1])
    hose.solve_static()
    assert hose.position(1.0)[0, 2] < 0.0


@models
def test_end_moment_closes_a_circle(model):
    hose = make(model, segments=20, gravity=(0, 0, 0))
    clamp = hose.clamp(0.0)
    hose.apply_moment(1.0, [0, -2 * math.pi * EI, 0])
    hose.solve_static()
    np.testing.assert_allclose(hose.position(1.0)[0], 0.0, atol=4e-3)
    np.testing.assert_allclose(hose.curvature([0, 0.3, 1]), 2 * math.pi, rtol=1e-8)
    np.testing.assert_allclose(hose.reaction(clamp).moment, [0, 2 * math.pi * EI, 0], atol=1e-8)


def test_twisting_moment_meets_the_torsional_stiffness():
    hose = make("cable", gravity=(0, 0, 0))
    clamp = hose.clamp(0.0)
    hose.apply_moment(1.0, [0.3 * GJ, 0, 0])
    hose.solve_static()
    np.testing.assert_allclose(hose.reaction(clamp).moment, [-0.3 * GJ, 0, 0], atol=1e-10)
    middle_of_last = 1.0 - hose.layout.segment_length / 2
    angle = 2 * math.asin(hose.data.body("B_last").xquat[1])
    assert angle == pytest.approx(0.3 * middle_of_last, rel=1e-8)
    assert hose.energies().twisting == pytest.approx(GJ * 0.09 / 2, rel=0.1)


@models
def test_bending_frequencies(model):
    hose = make(model, segments=20, gravity=(0, 0, 0))
    hose.clamp(0.0)
    small = hose.linearize()
    values = scipy.linalg.eigh(small.stiffness, small.mass, eigvals_only=True)
    beta = np.unique((values / (EI / 0.1)).round(6)) ** 0.25
    np.testing.assert_allclose(beta[:3], [1.87510407, 4.69409113, 7.85475744], rtol=2e-3)


@models
@pytest.mark.parametrize("correction", [False, True])
def test_hanging_hose(model, correction):
    hose = make(model, clamp_correction=correction)
    hose.reset([[0, 0, 0], [0, 0, -1]])
    clamp = hose.clamp(0.0, tangent=[0, 0, -1])
    s = np.array([0.0, 0.3, 0.5, 1.0])
    np.testing.assert_allclose(hose.tension(s), WEIGHT * (1 - s), atol=1e-9)
    hose.apply_force(1.0, [0, 0, -2.0])
    np.testing.assert_allclose(hose.tension(s), WEIGHT * (1 - s) + 2, atol=1e-9)
    np.testing.assert_allclose(hose.reaction(clamp).force, [0, 0, WEIGHT + 2], atol=1e-9)
    np.testing.assert_allclose(hose.tangent(0.3)[0], [0, 0, -1], atol=1e-12)


@models
def test_catenary(model):
    spec = make_spec(length=1.5, bending_stiffness=1e-6, torsional_stiffness=1e-6)
    hose = make(model, segments=20, spec=spec)
    hose.reset([[0, 0, 0], [0.5, 0, -0.55], [1, 0, 0]])
    ends = [hose.attach(0.0, [0, 0, 0]), hose.attach(1.5, [1, 0, 0])]
    hose.solve_static()
    assert hose.position(0.75)[0, 2] == pytest.approx(-0.50263326, rel=3e-3)
    assert hose.tension(0.0)[0] / WEIGHT == pytest.approx(0.81086973, rel=5e-3)
    forces = [hose.reaction(end).force for end in ends]
    np.testing.assert_allclose(forces[0] + forces[1], [0, 0, 1.5 * WEIGHT], atol=1e-8)


@models
def test_two_clamps_balance_weight_before_and_after_steps(model):
    spec = make_spec(damping_time=0.01, torsional_stiffness=0.005)
    hose = make(model, segments=10, timestep=5e-4, spec=spec)
    target = np.array([0.8, 0, 0.1])
    first, last = hose.clamp(0.0, [0, 0, 0]), hose.clamp(1.0, target, [0, 0, 1])
    hose.solve_static()
    np.testing.assert_allclose(hose.tangent(1.0)[0], [0, 0, 1], atol=1e-8)
    for _ in range(2):
        a, b = hose.reaction(first), hose.reaction(last)
        centre = hose.data.subtree_com[hose.model.site("held1").bodyid[0] - 9]
        turning = a.moment + b.moment + np.cross(target, b.force)
        np.testing.assert_allclose(a.force + b.force, [0, 0, WEIGHT], atol=2e-4)
        np.testing.assert_allclose(turning, np.cross(centre, [0, 0, WEIGHT]), atol=2e-4)
        hose.step(400)
    np.testing.assert_allclose(hose.position(1.0)[0], target, atol=1e-5)


def momentum_drift(model, timestep):
    spec = make_spec(torsional_stiffness=1e-3)
    hose = make(model, gravity=(0, 0, 0), timestep=timestep, spec=spec)
    hose.reset(wave, lambda s: np.stack([0.1 + 0 * s, 0 * s, 2 * s - 0.7], axis=1))
    before = hose.momentum()
    hose.step(round(0.05 / timestep))
    after = hose.momentum()
    return (
        np.linalg.norm(after.linear - before.linear) / np.linalg.norm(before.linear),
        np.linalg.norm(after.angular - before.angular) / np.linalg.norm(before.angular),
    )


@models
def test_free_flight_keeps_momentum_with_first_order(model):
    # Joint coordinates: MuJoCo's integrator does not keep even linear momentum exactly.
    coarse, fine = np.array([momentum_drift(model, h) for h in (1e-4, 5e-5)])
    assert np.all(coarse < 1e-3)
    np.testing.assert_allclose(coarse / fine, 2.0, atol=0.3)


@models
def test_swing_keeps_its_energy(model):
    hose = make(model, spec=make_spec(torsional_stiffness=1e-3))
    hose.attach(0.0)
    start = hose.energies().total
    hose.step(2000)
    energies = hose.energies()
    assert energies.kinetic > 0.1
    assert energies.total - start == pytest.approx(0.0, abs=5e-3 * energies.kinetic)
    assert np.linalg.norm(hose.position(0.0)[0]) < 1e-5


@models
def test_reset_meets_the_velocity(model):
    hose = make(model)
    hose.reset([[0, 0, 0], [1, 0, 0]], [[0, 0, 1], [0, 0, 3]])
    np.testing.assert_allclose(hose.velocity([0, 0.25, 1])[:, 2], [1, 1.5, 3], atol=1e-9)
    assert hose.energies().kinetic == pytest.approx(0.05 * 13 / 3, rel=1e-6)


@models
def test_change_of_holds_keeps_the_motion(model):
    hose = make(model, clamp_correction=False)
    hose.reset(wave, lambda s: np.stack([0 * s, 0 * s, s**2], axis=1))
    s = np.linspace(0, 1, 11)
    before = hose.position(s), hose.velocity(s)
    hold = hose.attach(0.5)
    hose.release(hold)
    np.testing.assert_allclose(hose.position(s), before[0], atol=1e-12)
    np.testing.assert_allclose(hose.velocity(s), before[1], atol=1e-12)


@models
def test_moving_holds_arrive_in_time(model):
    hose = make(model, spec=make_spec(torsional_stiffness=1e-3))
    hold, clamp = hose.attach(1.0), hose.clamp(0.0)
    for k in range(1, 301):
        hose.move(hold, [1 - 2e-5 * k, 0, 0])
        hose.move(clamp, tangent=[math.cos(1e-4 * k), 0, math.sin(1e-4 * k)])
        hose.step()
    np.testing.assert_allclose(hose.position(1.0)[0], [1 - 6e-3, 0, 0], atol=1e-5)
    np.testing.assert_allclose(hose.tangent(0.0)[0, 2], math.sin(0.03), atol=1e-4)


@models
def test_snapshot_continues_bit_by_bit(model):
    hose = make(model, spec=make_spec(torsional_stiffness=1e-3))
    hose.reset(wave)
    hose.clamp(0.0)
    hold = hose.attach(1.0)
    hose.apply_force(0.6, [0, 0, 0.5])
    hose.step(20)
    hose.move(hold, hose.position(1.0)[0] + [0, 0, 1e-4])
    state = hose.snapshot()

    def go_on():
        hose.step(15)
        hose.tension(0.5)
        hose.move(hold, hose.position(1.0)[0])
        hose.step(15)
        return np.concatenate([hose.position([0.3, 1]).ravel(), hose.reaction(hold).force])

    first = go_on()
    hose.release(hold)
    hose.restore(state)
    assert hose.time == pytest.approx(20e-4)
    np.testing.assert_array_equal(go_on(), first)


@models
def test_queries_do_not_change_the_motion(model):
    asked, silent = make(model), make(model)
    for hose in (asked, silent):
        hose.attach(0.0)
    for _ in range(5):
        asked.tension(0.5)
        asked.energies()
        asked.step(3)
    silent.step(15)
    np.testing.assert_array_equal(asked.data.qpos, silent.data.qpos)


@models
def test_divergence_is_an_error_and_keeps_the_state(model, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings to a file here
    hose = make(model, segments=20, timestep=0.02)
    hose.clamp(0.0)
    before = hose.snapshot()
    with pytest.raises(StepError, match="timestep"):
        hose.step(500)
    np.testing.assert_array_equal(hose.snapshot()["numbers"], before["numbers"])
    assert hose.time == 0.0


@pytest.mark.parametrize(
    ("cls", "options", "named"),
    [
        (CableHose, {"timestep": math.nan}, "timestep"),
        (CableHose, {"timestep": -1e-3}, "timestep"),
        (CableHose, {"segments": 1}, "segments"),
        (CableHose, {"integrator": "verlet"}, "integrator"),
        (CableHose, {"torsional_stiffness": -1.0}, "torsional_stiffness"),
        (CableHose, {"hold_solref": (1.0, -1.0)}, "hold_solref"),
        (CableHose, {"spec": make_spec(drag=1.0)}, "drag"),
        (HingeChainHose, {"spec": make_spec(rest_curvature=1.0)}, "rest_curvature"),
        (HingeChainHose, {"plane": "zz"}, "plane"),
        (HingeChainHose, {"jacobian": "full"}, "jacobian"),
    ],
)
def test_bad_settings(cls, options, named):
    options = {"spec": make_spec(), "timestep": 1e-3, **options}
    with pytest.raises(InputError, match=named):
        cls(options.pop("spec"), **options)


@models
def test_bad_calls(model):
    hose = make(model)
    hold = hose.attach(0.5)
    bad = [
        lambda: hose.attach(0.52),
        lambda: hose.clamp(1.5),
        lambda: hose.move(hold, tangent=[1, 0, 0]),
        lambda: hose.clamp(0.0, tangent=[0, 0, 0]),
        lambda: hose.apply_force(0.5, [math.nan, 0, 0]),
        lambda: hose.step(-1),
        lambda: hose.reset(np.zeros((3, 3))),
        lambda: hose.restore({}),
    ]
    for call in bad:
        with pytest.raises(InputError):
            call()
    hose.release(hold)
    with pytest.raises(InputError, match="hold"):
        hose.reaction(hold)


def test_hinge_chain_stays_in_its_plane():
    hose = make("hinge-chain", plane="xy", gravity=(0, -9.81, 0))
    hose.clamp(0.0)
    hose.solve_static()
    assert hose.position(1.0)[0, 1] < -0.1
    with pytest.raises(InputError, match="plane xy"):
        hose.reset(wave)


def test_registry_names_what_is_wrong():
    assert {"geds", "cable", "hinge-chain"} <= MODELS.keys()
    with pytest.raises(InputError, match="hinge-chain"):
        make_hose("rope", make_spec(), timestep=1e-3)
    with pytest.raises(InputError, match="segments"):
        make_hose("cable", make_spec(), timestep=1e-3, control_points=8)
    with pytest.raises(InputError, match="timestep"):
        make_hose("cable", make_spec())


def test_discrete_holds_follow_a_steady_motion_in_time():
    # Without the step that the integrator needs more, the end would be .4 mm late.
    spec = make_spec(damping_time=0.02)
    hose = make("hinge-chain", timestep=1e-3, integrator="discrete", spec=spec)
    hose.attach(0.0)
    end = hose.attach(1.0)
    for k in range(1, 201):
        hose.move(end, [1 - 4e-4 * k, 0, 0])
        hose.step()
    np.testing.assert_allclose(hose.position(1.0)[0], [0.92, 0, 0], atol=2e-5)


# -- twist --------------------------------------------------------------------------------------


def test_twist_is_over_the_length_that_is_free():
    # Two clamped segments leave (N - 1) h to the joints, h = L / N: the documented clamp.
    hose = make("cable", clamp_correction=False, gravity=(0, 0, 0))
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    hose.move(last, spin=0.9)
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.0, 0.4, 1.0]), GJ * 0.9 / 0.9, rtol=1e-6)
    np.testing.assert_allclose(hose.twist(0.5), 1.0, rtol=1e-6)


def test_spin_while_running():
    # Slow against the damped twisting waves: the end follows, the torque is the static one.
    hose = make("cable", spec=make_spec(damping_time=0.005), gravity=(0, 0, 0))
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    for _ in range(4000):
        hose.move(last, spin=2 * np.pi / 4000)
        hose.step()
    hose.step(2000)
    np.testing.assert_allclose(hose.twist([0.1, 0.5, 0.9]), 2 * np.pi, rtol=1e-3)
    torque = GJ * 2 * np.pi
    np.testing.assert_allclose(hose.torque([0.1, 0.5, 0.9]), torque, rtol=1e-3)
    np.testing.assert_allclose(hose.reaction(last).moment, [torque, 0, 0], rtol=2e-3, atol=1e-3)


def test_spins_of_half_a_turn_in_one_step_are_refused():
    # A weld sees its target up to full turns: beyond half a turn it would go the shorter way.
    hose = make("cable")
    clamp = hose.clamp(1.0)
    hose.move(clamp, spin=2.0)
    saved = hose.snapshot()
    for _ in range(2):
        with pytest.raises(InputError, match=r"spin is 1.2.*less than pi in one step"):
            hose.move(clamp, spin=1.2)
        hose.restore(saved)
    hose.move(clamp, spin=-1.2)
    hose.solve_static()
    hose.move(clamp, spin=2.5)
