"""MuJoCo's flex rod against closed forms, and what its softness costs."""

import math

import mujoco
import numpy as np
import pytest

from hose_mj.errors import HoseWarning, InputError, StepError
from hose_mj.hoses.mujoco.flex_layout import FlexLayout, FlexMotion, interpolate
from hose_mj.hoses.protocol import Hold
from hose_mj.hoses.registry import make_hose
from hose_mj.hoses.spec import Fitting, HoseSpec
from hose_mj.validation import reference
from hose_mj.validation.modes import compute_frequencies

EI, DENSITY, WEIGHT = 0.05, 0.1, 0.981


def make(*, segments=20, timestep=1e-3, clamp_correction=True, gravity=(0, 0, -9.81), **spec):
    values = {
        "length": 1.0,
        "axial_stiffness": 1e5,
        "bending_stiffness": EI,
        "torsional_stiffness": 0.0,
        "linear_density": DENSITY,
    }
    return make_hose(
        "flex",
        HoseSpec(**(values | spec)),
        timestep=timestep,
        segments=segments,
        clamp_correction=clamp_correction,
        gravity=gravity,
    )


def measure_order(sizes, errors):
    return np.polyfit(np.log(sizes), np.log(np.abs(errors)), 1)[0]


# -- the layout ---------------------------------------------------------------------------------


def lay_out(*holds, segments=10, clamp_correction=True):
    held = [Hold(k, s, fixes) for k, (s, fixes) in enumerate(holds)]
    return FlexLayout.of_holds(1.0, segments, held, clamp_correction=clamp_correction), held


def test_vertices_are_even_without_holds_inside():
    layout, _ = lay_out((0.0, False), (1.0, True), clamp_correction=False)
    np.testing.assert_allclose(layout.nodes, np.arange(11) / 10, rtol=1e-15)


def test_a_corrected_clamp_at_an_end_is_the_middle_of_an_edge():
    for ends in ((0.0,), (1.0,), (0.0, 1.0)):
        layout, held = lay_out(*((s, True) for s in ends))
        assert len(layout.edges) == 10
        np.testing.assert_allclose(layout.edges, 1.0 / (10 - 0.5 * len(ends)))
        for hold in held:
            assert layout.nodes[layout.find_vertices(hold)].mean() == pytest.approx(hold.arc_length)


@pytest.mark.parametrize("clamp_correction", [True, False])
def test_holds_inside_get_vertices_of_their_own(clamp_correction):
    holds = (0.0, True), (0.33, False), (0.611, True), (0.87, False), (1.0, False)
    layout, held = lay_out(*holds, clamp_correction=clamp_correction)
    assert np.all(np.diff(layout.nodes) > 0.05)
    assert np.all(np.diff(layout.nodes) < 0.15)
    for hold in held[1:]:
        vertices = layout.nodes[layout.find_vertices(hold)]
        if hold.fixes_tangent:
            assert vertices[0] < hold.arc_length < vertices[1]
            # Half of each neighbour's length: centred where both stretches have like edges.
            assert abs(vertices.mean() - hold.arc_length) < 0.01
        else:
            assert vertices == pytest.approx([hold.arc_length], abs=0.0)


def test_the_vertices_weigh_what_the_hose_weighs():
    # Mass and first moment are exact for any layout, also where vertices are beyond the hose.
    for holds in ((), ((0.0, True),), ((0.0, True), (0.4, False), (0.7, True), (1.0, True))):
        layout, _ = lay_out(*holds)
        masses = layout.compute_masses(0.3)
        assert np.all(masses > 0.0)
        assert masses.sum() == pytest.approx(0.3)
        assert masses @ layout.nodes == pytest.approx(0.15)


@pytest.mark.parametrize("places", [(0.5, 0.52), (0.0, 0.03), (0.0, 0.0), (0.98, 0.3)])
def test_holds_too_close_are_refused(places):
    hose = make(segments=10)
    hose.clamp(places[0]) if places[0] != 0.98 else None
    with pytest.raises(InputError, match="arc_length"):
        hose.attach(places[1] if places[0] != 0.98 else 0.98)


def test_interpolation_continues_straight_lines():
    places, values = np.array([0.1, 0.3, 0.4]), np.array([1.0, 3.0, 3.0])
    found = interpolate(np.array([0.0, 0.2, 0.3, 0.35, 1.0]), places, values)
    np.testing.assert_allclose(found, [0.0, 2.0, 3.0, 3.0, 3.0])
    np.testing.assert_array_equal(interpolate(np.array([0.0, 1.0]), places[:1], values[:1]), 1.0)


# -- MuJoCo's bending ---------------------------------------------------------------------------


def test_bending_is_that_of_discrete_elastic_rods():
    # MuJoCo's forces are minus the gradient of the energy that `energies` states, on uneven edges.
    hose = make(gravity=(0, 0, 0))
    hose.attach(0.33)
    nodes = hose.layout.nodes
    rest = np.outer(nodes, [1.0, 0.0, 0.0])
    vertices = rest + 0.2 / 20 * np.random.default_rng(3).normal(size=rest.shape)

    def energy(points):
        motion = FlexMotion(hose.layout, points, np.zeros_like(points))
        return motion.energies(np.zeros(len(nodes)), EI, np.zeros(3)).bending

    hose.data.qpos[:] = (vertices - rest).ravel()
    mujoco.mj_forward(hose.model, hose.data)
    forces = hose.data.qfrc_passive.reshape(-1, 3)
    for vertex, axis in ((0, 1), (1, 2), (7, 0), (8, 1), (19, 2), (20, 0)):
        change = np.zeros_like(vertices)
        change[vertex, axis] = 1e-6
        slope = (energy(vertices + change) - energy(vertices - change)) / 2e-6
        assert forces[vertex, axis] == pytest.approx(-slope, rel=1e-5, abs=1e-5)


def test_damping_is_kelvin_voigt():
    # About the straight shape the damping force of a velocity is tau times its elastic force.
    hose = make(gravity=(0, 0, 0), damping_time=0.02)
    motion = np.random.default_rng(4).normal(size=hose.model.nv)
    motion[0::3] = 0.0
    hose.data.qvel[:] = motion
    mujoco.mj_forward(hose.model, hose.data)
    damping = hose.data.qfrc_passive.copy()
    hose.data.qvel[:], hose.data.qpos[:] = 0.0, 1e-6 * motion
    mujoco.mj_forward(hose.model, hose.data)
    elastic = hose.data.qfrc_passive / 1e-6
    scale = np.abs(damping).max()
    np.testing.assert_allclose(damping[1::3], 0.02 * elastic[1::3], atol=1e-5 * scale)
    np.testing.assert_allclose(damping[2::3], 0.02 * elastic[2::3], atol=1e-5 * scale)


# -- closed forms -------------------------------------------------------------------------------


def measure_droop(segments, gamma, *, clamp_correction):
    hose = make(
        segments=segments,
        clamp_correction=clamp_correction,
        bending_stiffness=WEIGHT / gamma,
    )
    hose.clamp(0.0)
    hose.solve_static()
    x, _, z = hose.position(1.0)[0]
    return -z / x / reference.heavy_cantilever(gamma) - 1.0


@pytest.mark.parametrize("gamma", [1.0, 10.0])
def test_heavy_cantilever(gamma):
    sizes = (10, 20, 40)
    errors = [measure_droop(n, gamma, clamp_correction=True) for n in sizes]
    assert abs(errors[-1]) < 2e-3
    assert measure_order(1 / np.array(sizes), errors) == pytest.approx(2.0, abs=0.15)
    raw = [measure_droop(n, gamma, clamp_correction=False) for n in sizes]
    assert measure_order(1 / np.array(sizes), raw) == pytest.approx(1.0, abs=0.1)


def test_small_tip_load_bends_by_the_beam_formula():
    # P L^3 / (3 EI); the chain of hinges at (k + 1/2) h adds a part of second order in h.
    hose = make(segments=40, gravity=(0, 0, 0))
    hose.clamp(0.0)
    hose.apply_force(1.0, [0.0, 1e-4, 0.0])
    hose.solve_static()
    assert hose.position(1.0)[0, 1] == pytest.approx(1e-4 / (3 * EI), rel=5e-4)


def test_clamp_inside_divides_the_hose():
    # Two cantilevers, .4 and .6 long; both bend as beams on their own.
    hose = make(segments=40, gravity=(0, 0, 0))
    clamp = hose.clamp(0.4, tangent=[0.0, 1.0, 0.0], position=[0.0, 0.0, 0.0])
    for s in (0.0, 1.0):
        hose.apply_force(s, [0.0, 0.0, 1e-4])
    hose.solve_static()
    found = hose.position([0.0, 0.4, 1.0])
    np.testing.assert_allclose(found[:, 1], [-0.4, 0.0, 0.6], atol=1e-6)
    np.testing.assert_allclose(
        found[:, 2], [1e-4 * 0.4**3 / 3 / EI, 0.0, 1e-4 * 0.6**3 / 3 / EI], rtol=4e-3, atol=1e-9
    )
    reaction = hose.reaction(clamp)
    np.testing.assert_allclose(reaction.force, [0, 0, -2e-4], atol=1e-9)
    np.testing.assert_allclose(reaction.moment, [-1e-4 * 0.2, 0, 0], atol=1e-8)


def test_end_moment_rolls_the_hose_into_an_arc():
    hose = make(segments=40, gravity=(0, 0, 0))
    hose.clamp(0.0)
    hose.apply_moment(1.0, [0.0, -EI * math.pi / 2, 0.0])
    hose.solve_static()
    np.testing.assert_allclose(hose.position(1.0)[0], [2 / math.pi, 0, 2 / math.pi], atol=1e-3)
    np.testing.assert_allclose(hose.curvature([0.1, 0.5, 0.9]), math.pi / 2, rtol=1e-3)
    assert hose.energies().bending == pytest.approx(EI * (math.pi / 2) ** 2 / 2, rel=2e-2)


def test_catenary():
    # Nearly without bending; tension is horizontal pull over the cosine of the slope.
    hose = make(segments=40, bending_stiffness=1e-7)
    span, length_over_span = 2 / 3, 1.5
    hose.reset(lambda s: np.stack([span * s, 0 * s, -1.4 * s * (1 - s)], axis=1))
    ends = hose.attach(0.0, [0, 0, 0]), hose.attach(1.0, [span, 0, 0])
    hose.solve_static()
    sag, pull = reference.catenary(length_over_span)
    assert -hose.position(0.5)[0, 2] == pytest.approx(sag, rel=1e-3)
    first, last = (hose.reaction(end).force for end in ends)
    assert np.linalg.norm(first) == pytest.approx(pull * WEIGHT, rel=1e-3)
    np.testing.assert_allclose(first + last, [0, 0, WEIGHT], atol=1e-8)
    assert hose.tension(0.5)[0] == pytest.approx(last[0], rel=2e-3)
    assert hose.tension(0.0)[0] == pytest.approx(pull * WEIGHT, rel=5e-3)


def test_frequencies():
    hose = make(segments=60, gravity=(0, 0, 0))
    hose.clamp(0.0)
    unit = math.sqrt(EI / DENSITY)
    found = compute_frequencies(hose.linearize(), 3, above=0.1 * unit) / unit
    np.testing.assert_allclose(found, reference.beam_frequencies("clamped-free"), rtol=2e-3)


def test_the_first_mode_swings_at_its_frequency():
    # By MuJoCo's own steps: a cantilever let go of swings through zero twice a period. Of its bend
    # under a tip load 97 % are in the first mode.
    hose = make(segments=20, bending_stiffness=5.0, timestep=2e-4, gravity=(0, 0, 0))
    hose.clamp(0.0)
    hose.apply_force(1.0, [0, 0, 1e-1])
    hose.solve_static()
    hose.clear_loads()
    heights = []
    for _ in range(4000):
        hose.step()
        heights.append(hose.position(1.0)[0, 2])
    crossings = 2e-4 * np.flatnonzero(np.diff(np.sign(heights)) != 0)
    assert len(crossings) > 5
    found = math.pi * (len(crossings) - 1) / (crossings[-1] - crossings[0])
    wanted = reference.beam_frequencies("clamped-free")[0] * math.sqrt(5.0 / DENSITY)
    assert found == pytest.approx(wanted, rel=1e-2)


def test_a_vertical_hose_carries_its_weight():
    hose = make(segments=10, bending_stiffness=1e-6)
    hose.reset([[0, 0, 0], [0, 0, -1]])
    top = hose.attach(0.0)
    s = np.array([0.0, 0.2, 0.77, 1.0])
    hose.step(2000)
    for settled in (False, True):
        if settled:
            hose.solve_static()
        np.testing.assert_allclose(hose.tension(s), WEIGHT * (1 - s), atol=1e-4)
        np.testing.assert_allclose(hose.reaction(top).force, [0, 0, WEIGHT], atol=1e-4)


# -- motion -------------------------------------------------------------------------------------


def test_large_steps_are_stable_with_stiff_bending():
    # Explicit forces would need dt < h^2 sqrt(rho / EI) / 2 = 4e-5 s.
    hose = make(segments=40, timestep=5e-3, bending_stiffness=5.0, damping_time=1e-3)
    hose.clamp(0.0)
    hose.step(400)
    droop = DENSITY * 9.81 / (8 * 5.0)
    assert -hose.position(1.0)[0, 2] == pytest.approx(droop, rel=2e-2)


def test_edges_give_with_the_square_of_the_time_step():
    # Edges have a time constant of two steps, so what a given pull opens falls with dt^2.
    stretches = []
    steps = (4e-3, 2e-3, 1e-3)
    for step in steps:
        hose = make(segments=10, timestep=step, bending_stiffness=1e-3, damping_time=0.05)
        hose.reset([[0, 0, 0], [0, 0, -1]])
        hose.attach(0.0)
        hose.apply_force(1.0, [0, 0, -100.0])
        hose.step(round(2.0 / step))
        stretches.append(hose.stretch().max())
    assert 1e-6 < stretches[-1] < 1e-3
    assert measure_order(steps, stretches) == pytest.approx(2.0, abs=0.1)


def test_soft_edges_are_softer():
    stretches = []
    for options in ({}, {"edge_solref": (0.02, 1.0), "edge_solimp": (0.9, 0.95, 1e-3, 0.5, 2.0)}):
        spec = HoseSpec(
            length=1.0,
            axial_stiffness=1e5,
            bending_stiffness=1e-3,
            torsional_stiffness=0.0,
            linear_density=DENSITY,
        )
        hose = make_hose("flex", spec, timestep=2e-3, segments=10, **options)
        hose.reset([[0, 0, 0], [0, 0, -1]])
        hose.attach(0.0)
        hose.step(2000)
        stretches.append(hose.stretch().max())
    # MuJoCo's own defaults: near two per cent under its weight alone.
    assert stretches[0] < 1e-4
    assert stretches[1] > 1e-2


def test_momenta_are_kept_in_free_flight():
    hose = make(segments=12, gravity=(0, 0, 0))
    hose.reset(
        [[0, 0, 0], [1, 0, 0]],
        velocity=lambda s: np.stack([0.3 + 0 * s, s - 0.5, 2 * np.sin(3 * s)], axis=1),
    )
    before = hose.momentum()
    hose.step(300)
    after = hose.momentum()
    np.testing.assert_allclose(after.linear, before.linear, atol=1e-9)
    np.testing.assert_allclose(after.angular, before.angular, atol=2e-3)


def test_reset_keeps_momentum_but_stretches_no_edge():
    hose = make(segments=12)
    hose.reset([[0, 0, 0], [1, 0, 0]], velocity=lambda s: np.outer(s**2, [1.0, 2.0, 0.0]))
    speeds = hose.velocity(np.linspace(0, 1, 13))
    np.testing.assert_allclose(speeds[:, 0], speeds[0, 0], atol=1e-12)
    masses = hose.layout.compute_masses(DENSITY)
    wanted = masses @ np.linspace(0, 1, 13) ** 2
    np.testing.assert_allclose(hose.momentum().linear, [wanted, 2 * wanted, 0], atol=1e-12)


def test_reset_lays_unstretched_edges_on_the_curve():
    hose = make(segments=15)
    hose.reset(lambda s: np.stack([np.sin(2 * s) / 2, (1 - np.cos(2 * s)) / 2, 0 * s], axis=1))
    np.testing.assert_allclose(hose.stretch(), 0.0, atol=1e-12)
    np.testing.assert_array_equal(hose.position(0.0)[0], 0.0)


def test_a_new_hold_leaves_the_rod_where_it_is():
    hose = make(segments=20)
    hose.clamp(0.0)
    hose.step(100)
    before, speed = hose.position(np.linspace(0, 1, 5)), hose.velocity(np.linspace(0, 1, 5))
    time = hose.time
    end = hose.attach(1.0)
    np.testing.assert_array_equal(hose.position(np.linspace(0, 1, 5)), before)
    np.testing.assert_array_equal(hose.velocity(np.linspace(0, 1, 5)), speed)
    hose.release(end)
    hose.attach(0.52)  # between vertices
    np.testing.assert_allclose(hose.position(np.linspace(0, 1, 5)), before, atol=2e-3)
    assert hose.time == time


def test_moving_holds_are_followed():
    hose = make(segments=20, damping_time=0.01, clamp_correction=True)
    clamp, end = hose.clamp(0.0), hose.attach(1.0)
    for k in range(1, 501):
        turn = 1e-3 * k
        hose.move(clamp, position=[0, 0, 2e-4 * k], tangent=[math.cos(turn), 0, math.sin(turn)])
        hose.move(end, [1 - 4e-4 * k, 0, 0])
        hose.step()
    np.testing.assert_allclose(hose.position(0.0)[0], [0, 0, 0.1], atol=3e-4)
    np.testing.assert_allclose(hose.position(1.0)[0], [0.8, 0, 0], atol=3e-4)
    wanted = [math.cos(0.5), 0, math.sin(0.5)]
    np.testing.assert_allclose(hose.tangent(0.0)[0], wanted, atol=3e-3)


def test_reactions_while_running_become_the_static_ones():
    hose = make(segments=20, bending_stiffness=1.0, damping_time=0.05)
    clamp = hose.clamp(0.0)
    hose.step(4000)
    running = hose.reaction(clamp)
    hose.solve_static()
    settled = hose.reaction(clamp)
    np.testing.assert_allclose(running.force, settled.force, atol=1e-3 * WEIGHT)
    np.testing.assert_allclose(running.moment, settled.moment, atol=2e-3 * WEIGHT)
    np.testing.assert_allclose(settled.force, [0, 0, WEIGHT], atol=1e-9)


def test_a_nan_is_a_step_error_and_the_state_is_kept():
    hose = make(segments=10, timestep=0.05)
    end = hose.attach(1.0)
    hose.step(2)
    before = hose.snapshot()
    hose.apply_force(0.5, [0, 0, 1e13])
    loaded = hose.position(0.5)
    with pytest.raises(StepError, match="smaller timestep"):
        hose.step(200)
    np.testing.assert_array_equal(hose.position(0.5), loaded)
    np.testing.assert_array_equal(hose.snapshot()["numbers"], before["numbers"])
    hose.clear_loads()
    hose.move(end, [1.0, 0.0, 0.0])
    hose.step(2)


# -- what it has not ----------------------------------------------------------------------------


def test_nothing_twists():
    hose = make()
    hose.clamp(0.0)
    with pytest.warns(HoseWarning, match="is lost"):
        hose.apply_moment(1.0, [EI, 0.0, 0.0])
    hose.solve_static()
    np.testing.assert_array_equal(hose.twist([0.0, 0.5]), 0.0)
    np.testing.assert_array_equal(hose.torque([0.0, 0.5]), 0.0)
    assert hose.energies().twisting == hose.energies().stretching == 0.0


@pytest.mark.parametrize(
    "spec",
    [
        {"rest_strain": 0.1},
        {"rest_curvature": 1.0},
        {"rest_torsion": 1.0},
        {"drag": 0.1},
        {"second_bending_stiffness": 0.2},
        {"fittings": (Fitting(start=0.1, end=0.2, linear_density=1.0),)},
    ],
)
def test_what_is_not_mapped_is_refused(spec):
    with pytest.raises(InputError, match=f"{next(iter(spec))}.*FlexHose"):
        make(**spec)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("segments", 1),
        ("edge_solref", (0.1, -1.0)),
        ("edge_solimp", (0.9,)),
        ("jacobian", "thick"),
        ("iterations", 0),
    ],
)
def test_bad_settings(option, value):
    spec = HoseSpec(
        length=1.0,
        axial_stiffness=1e5,
        bending_stiffness=EI,
        torsional_stiffness=0.0,
        linear_density=DENSITY,
    )
    with pytest.raises(InputError, match=option):
        make_hose("flex", spec, timestep=1e-3, **{option: value})
