"""A fluid about the spline hose: drag, added mass, buoyancy, currents."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hose_mj import Fluid, HoseSpec, InputError, Obstacle, StepError, make_hose
from hose_mj.hoses.geds.fluid_load import FluidLoad
from hose_mj.hoses.geds.morison import add_fluid
from hose_mj.hoses.geds.records import make_work

LENGTH, RADIUS, DENSITY = 2.0, 0.01, 0.6
SPEC = HoseSpec(
    length=LENGTH,
    axial_stiffness=1e4,
    bending_stiffness=1e-3,
    torsional_stiffness=0.0,
    linear_density=DENSITY,
    outer_radius=RADIUS,
)
WATER = Fluid(density=1000.0, tangential_drag=0.05)
DISPLACED = WATER.density * math.pi * RADIUS**2
WEIGHT = 9.81 * (DENSITY - DISPLACED)
PLANES = pytest.mark.parametrize("plane", ["xz", None])


def make(fluid=WATER, spec=SPEC, **options):
    return make_hose(
        "geds", spec, **{"timestep": 0.005, "control_points": 12} | options, fluid=fluid
    )


def swirl(places):
    """A field that no hose follows."""
    x, y, z = places.T
    return np.stack([0.3 + z, 0.5 * x, np.sin(3.0 * x) - y], axis=1)


def lay_bent(hose, across=1.0):
    """A bent hose that moves in every direction; `across` scales what leaves the xz-plane."""
    hose.reset(
        lambda s: np.stack([np.sin(s), 0.0 * s, 1.0 - np.cos(s)], axis=1),
        lambda s: np.stack([0.3 * s, across * (0.2 - s), np.cos(2.0 * s)], axis=1),
    )


# -- closed forms ------------------------------------------------------------------------------


@PLANES
@pytest.mark.parametrize(
    ("scheme", "order"), [("bdf2", 2), ("backward-euler", 1), ("sdirk2", 2), ("midpoint", 2)]
)
def test_a_line_sinks_as_fast_as_it_should(plane, scheme, order):
    fastest = math.sqrt(WEIGHT / (WATER.density * WATER.normal_drag * RADIUS))
    rate = WEIGHT / (DENSITY + DISPLACED)
    aim = fastest * math.tanh(0.2 * rate / fastest)
    errors = []
    for n_steps in (20, 40):
        hose = make(plane=plane, scheme=scheme, timestep=0.2 / n_steps)
        hose.step(n_steps)
        speeds = hose.velocity([0.0, 1.3])
        assert speeds == pytest.approx(np.tile([0, 0, speeds[0, 2]], (2, 1)), abs=1e-10)
        errors.append(abs(speeds[0, 2] / aim + 1.0))
    assert errors[1] < (1e-2 if order == 1 else 1e-4)
    assert errors[0] / errors[1] > 0.8 * 2**order
    hose.step(2000)
    assert hose.velocity(1.0)[0, 2] == pytest.approx(-fastest, rel=1e-9)
    assert hose.fallbacks == 0


@PLANES
def test_a_line_that_slides_along_itself_is_slowed_by_its_skin(plane):
    hose = make(plane=plane, gravity=(0, 0, 0))
    hose.reset([[0, 0, 0], [LENGTH, 0, 0]], (3.0, 0.0, 0.0))
    hose.step(200)
    pace = WATER.density * math.pi * WATER.tangential_drag * RADIUS / DENSITY
    assert hose.velocity(1.0)[0, 0] == pytest.approx(3.0 / (1.0 + 3.0 * pace), rel=1e-4)


def test_a_hose_goes_with_the_current():
    hose = make(Fluid(density=1000.0, velocity=(0.4, -0.2, 0.1)), gravity=(0, 0, 0))
    hose.reset([[0, 0, 0], [LENGTH, 0, 0]], (0.4, -0.2, 0.1))
    hose.step(50)
    expected = np.array([0.5, 0.0, 0.0]) + hose.time * np.array([0.4, -0.2, 0.1])
    assert hose.position(0.5)[0] == pytest.approx(expected, abs=1e-12)


@PLANES
@pytest.mark.parametrize("speed", [0.0, 0.3, 1.0, 5.0])
def test_a_line_hangs_straight_in_a_current(plane, speed):
    hose = make(replace(WATER, velocity=(speed, 0.0, 0.0)), plane=plane)
    hose.reset([[0, 0, 0], [LENGTH, 0, 0]])
    hold = hose.attach(0.0)
    hose.solve_static()
    drag = WATER.density * WATER.normal_drag * RADIUS * speed**2
    slope = 0.0 if speed == 0.0 else (math.hypot(WEIGHT, 2 * drag) - WEIGHT) / (2 * drag)
    assert hose.tangent([0.1, 1.0, 1.9])[:, 0] == pytest.approx(slope, abs=1e-8)
    # Drag along the hose pulls too.
    skin = WATER.density * math.pi * WATER.tangential_drag * RADIUS * (speed * slope) ** 2
    pull = LENGTH * (WEIGHT * math.sqrt(1.0 - slope**2) + skin)
    assert np.linalg.norm(hose.reaction(hold).force) == pytest.approx(pull, rel=1e-6)
    hose.step(50)
    assert np.abs(hose.control_velocities).max() < 1e-7


def test_a_current_along_a_field_is_an_equilibrium_of_the_motion():
    hose = make(replace(WATER, velocity=lambda at: 0.3 * swirl(at)), control_points=16)
    hose.reset([[0, 0, 0], [LENGTH, 0, 0]])
    hose.attach(0.0)
    hose.attach(LENGTH, (1.5, 0.0, 0.2))
    hose.solve_static()
    shape = hose.control_points
    assert np.ptp(shape[:, 1]) > 0.02
    hose.step(100)
    assert hose.control_points == pytest.approx(shape, abs=1e-6)


@pytest.mark.parametrize(
    ("stiffness", "floor", "current"),
    [(0.0, None, (2.0, 0.0, 0.3)), (1e-5, -0.38, (0.5, 0.3, 0.0)), (1e-5, -0.38, (-0.5, 0.0, 0.0))],
)
def test_a_slack_line_stays_where_statics_put_it(stiffness, floor, current):
    bed = [] if floor is None else [Obstacle(kind="plane", position=(0, 0, floor), friction=0.0)]
    spec = replace(SPEC, bending_stiffness=stiffness)
    hose = make(replace(WATER, velocity=current), spec, control_points=20, obstacles=bed)
    turn = np.linspace(-0.8, 0.8, 401)  # an arc of a circle
    hose.reset(1.25 * np.stack([np.sin(turn), 0 * turn, np.cos(0.8) - np.cos(turn)], axis=1))
    holds = [hose.attach(0.0), hose.attach(LENGTH)]
    hose.solve_static()
    shape = hose.control_points
    hose.step(50)
    assert hose.control_points == pytest.approx(shape, abs=1e-7)
    load = sum(hose.reaction(hold).force for hold in holds) + hose.contacts.compute_forces().sum(
        axis=0
    )
    drag = hose._loads.fluid.compute_drag(hose._state.x)[0].reshape(-1, 3).sum(axis=0)
    assert load + drag == pytest.approx([0, 0, LENGTH * WEIGHT], abs=1e-6)


def test_buoyancy_takes_weight_off_the_holds():
    hose = make(plane="xz")
    hold = hose.attach(0.0)
    hose.solve_static()
    assert hose.reaction(hold).force == pytest.approx([0, 0, LENGTH * WEIGHT], abs=1e-9)
    assert hose.energies().gravitational == pytest.approx(-WEIGHT * LENGTH**2 / 2, rel=1e-3)


def test_a_hose_as_heavy_as_water_floats_where_it_is():
    hose = make(spec=replace(SPEC, linear_density=DISPLACED))
    before = hose.control_points
    hose.step(100)
    assert hose.control_points == pytest.approx(before, abs=1e-12)


def test_added_mass_slows_vibrations_across_the_hose_alone():
    spec = replace(SPEC, bending_stiffness=1.0)
    dry, wet = (make(fluid, spec, gravity=(0, 0, 0)).linearize() for fluid in (None, WATER))
    extra = wet.mass - dry.mass
    points = np.tile(np.eye(3), (12, 1))  # each direction as a rigid motion
    found = points.T @ extra @ points
    assert found == pytest.approx(np.diag([0.0, 1.0, 1.0]) * DISPLACED * LENGTH, abs=1e-12)
    assert np.array_equal(wet.stiffness, dry.stiffness)


@PLANES
def test_inverse_dynamics_knows_the_fluid(plane):
    hose = make(plane=plane, gravity=(0, 0, -9.81))
    hose.reset([[0, 0, 0], [LENGTH, 0, 0]], (0.5, 0.0, 2.0))
    force = hose.compute_required_forces(np.tile([1.0, 0.0, 3.0], (12, 1))).sum(axis=0)
    skin = WATER.density * math.pi * WATER.tangential_drag * RADIUS * 0.5**2
    across = WATER.density * WATER.normal_drag * RADIUS * 2.0**2
    wanted = [DENSITY + skin, 0.0, 3.0 * (DENSITY + DISPLACED) + across + WEIGHT]
    assert force == pytest.approx(LENGTH * np.array(wanted), rel=1e-9)


# -- derivatives and energy --------------------------------------------------------------------


@PLANES
def test_the_matrix_is_the_derivative_by_the_velocity(plane):
    hose = make(plane=plane)
    lay_bent(hose, across=0.0 if plane else 1.0)
    axes, x, v = hose._axes, hose._state.x, hose._state.v
    h, size, width = 0.01, len(x), 4 * len(axes)

    def evaluate(rate):
        work = make_work(12, len(axes), 0)
        fluid = hose._loads.fluid.morison
        add_fluid(axes, fluid, h, 0.5 * v, x, rate, work.gradient, work.band)
        return work.gradient[:size].copy(), work.band

    band = evaluate(v)[1]
    matrix = np.zeros((size, size))
    for k in range(width):
        matrix += np.diag(band[: size - k, k], -k) + (np.diag(band[: size - k, k], k) if k else 0)
    eps = 1e-6
    unit = np.eye(size) * eps
    wanted = [(evaluate(v + e)[0] - evaluate(v - e)[0]) / (2 * eps * h) for e in unit]
    assert matrix == pytest.approx(np.array(wanted).T, rel=1e-5, abs=1e-5 * np.abs(matrix).max())
    assert np.linalg.eigvalsh(matrix).min() > -1e-12 * np.abs(matrix).max()


@PLANES
def test_the_drag_of_statics_is_that_of_the_motion_and_has_its_derivative(plane):
    current = (0.7, 0.0 if plane else 0.4, -0.5)
    hose = make(replace(WATER, velocity=current), plane=plane)
    lay_bent(hose, across=0.0 if plane else 1.0)
    load, x = hose._loads.fluid, hose._state.x
    drag, slope = load.compute_drag(x)
    work = make_work(12, len(hose._axes), 0)
    still = np.zeros_like(x)
    add_fluid(hose._axes, load.morison, 1.0, still, x, still, work.gradient, work.band)
    assert drag == pytest.approx(-work.gradient[: len(x)], rel=1e-12, abs=1e-14)
    unit = 1e-6 * np.eye(len(x))
    wanted = [(load.compute_drag(x + e)[0] - load.compute_drag(x - e)[0]) / 2e-6 for e in unit]
    assert slope == pytest.approx(np.array(wanted).T, abs=1e-6 * np.abs(slope).max())


def test_still_water_only_takes_energy():
    hose = make(gravity=(0, 0, 0), control_points=16)
    lay_bent(hose)
    hose.attach(0.0)
    energies = []
    for _ in range(200):
        hose.step()
        energies.append(sum(vars(hose.energies()).values()))
    assert np.all(np.diff(energies) < 1e-9)
    assert energies[-1] < 0.1 * energies[0]


@pytest.mark.slow
def test_a_hose_with_theta_sinks_alike():
    spec = replace(SPEC, torsional_stiffness=1e-3)
    hoses = [make(spec=spec, twist=twist) for twist in ("theta", "scalar")]
    for hose in hoses:
        hose.attach(0.0)
        hose.step(100)
    shapes = [hose.position(np.linspace(0, LENGTH, 9)) for hose in hoses]
    assert shapes[0] == pytest.approx(shapes[1], abs=1e-6)
    hoses[0].solve_static()


# -- state and input ---------------------------------------------------------------------------


def test_a_snapshot_goes_on_bit_by_bit_in_a_field():
    hose = make(replace(WATER, velocity=swirl))
    hose.attach(0.0)
    hose.step(7)
    state = hose.snapshot()
    hose.step(9)
    expected = hose.control_points
    other = make(replace(WATER, velocity=swirl))
    other.restore(state)
    for _ in range(9):
        other.step()
    assert np.array_equal(other.control_points, expected)


def test_a_tried_step_asks_the_field_too():
    hoses = [make(replace(WATER, velocity=swirl)) for _ in range(2)]
    holds = [hose.attach(0.0) for hose in hoses]
    for _ in range(5):
        hoses[0].step()
        hoses[1].coupling.try_step([holds[1]], np.zeros((1, 3)), np.zeros((3, 3)))
        hoses[1].coupling.accept_step()
    assert hoses[1].control_points == pytest.approx(hoses[0].control_points, abs=1e-12)


def test_a_failed_equilibrium_changes_nothing():
    hose = make(replace(WATER, velocity=(1.0, 0.0, 0.0)))  # nothing holds it
    lay_bent(hose)
    before = hose.snapshot()
    with pytest.raises(StepError):
        hose.solve_static()
    for name, part in hose.snapshot()["state"].items():
        assert np.array_equal(part, before["state"][name])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"density": 0.0}, "density of the fluid"),
        ({"normal_drag": -1.0}, "normal_drag"),
        ({"tangential_drag": "much"}, "tangential_drag"),
        ({"added_mass": math.nan}, "added_mass"),
        ({"velocity": (1.0, 0.0)}, "velocity of the fluid"),
        ({"velocity": (1.0, 0.0, math.inf)}, "velocity of the fluid"),
    ],
)
def test_odd_fluids_are_refused(change, words):
    with pytest.raises(InputError, match=words):
        Fluid(**{"density": 1000.0} | change)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"fluid": 1000.0}, "fluid"),
        ({"scheme": "verlet"}, "implicit"),
        ({"plane": "xz", "fluid": Fluid(density=1.0, velocity=(0, 1, 0))}, "plane"),
    ],
)
def test_hoses_that_cannot_be_in_it_say_so(options, words):
    with pytest.raises(InputError, match=words):
        make(**options)


def test_a_field_of_another_shape_is_refused():
    hose = make(Fluid(density=1.0, velocity=lambda at: at[:, :2]))
    before = hose.control_points
    with pytest.raises(InputError, match=r"velocity\(places\)"):
        hose.step()
    assert np.array_equal(hose.control_points, before)


@pytest.mark.parametrize("model", ["cable", "flex", "hinge-chain"])
def test_other_models_refuse_a_fluid_in_one_line(model):
    pytest.importorskip("mujoco")
    with pytest.raises(InputError, match="fluid") as caught:
        make_hose(model, SPEC, timestep=0.001, fluid=WATER)
    assert "\n" not in str(caught.value)


def test_no_fluid_costs_nothing():
    hose = make(None)
    load = hose._loads.fluid
    assert isinstance(load, FluidLoad)
    assert len(load.morison.current) == 0
