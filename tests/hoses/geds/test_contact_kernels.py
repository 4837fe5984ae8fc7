"""Residual and matrix of contact: finite differences, definiteness, the third law."""

import numpy as np
import pytest

from hose_mj.hoses.geds import contact, contact_law, mechanics, shapes
from hose_mj.hoses.geds.contacts import ContactSet
from hose_mj.hoses.geds.integrators import make_state
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.spec import HoseSpec

N = 8
STEP = 3e-3
SPEC = HoseSpec(
    length=1.0,
    axial_stiffness=1e3,
    bending_stiffness=0.05,
    torsional_stiffness=0.0,
    linear_density=0.1,
    outer_radius=0.05,
)
OBSTACLES = {
    "plane": Obstacle(kind="plane", position=(0.0, 0.0, -0.03)),
    "sphere": Obstacle(kind="sphere", position=(0.4, 0.1, -0.2), size=0.22),
    "capsule": Obstacle(
        kind="capsule",
        position=(0.5, 0.0, -0.12),
        rotation=[[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        size=(0.1, 0.1),
    ),
    "cylinder": Obstacle(kind="cylinder", position=(0.4, 0.0, -0.3), size=(0.2, 0.28)),
    "box": Obstacle(kind="box", position=(0.5, 0.0, -0.3), size=(0.2, 0.02, 0.28)),
}


def make(obstacles, plane=None, **law):
    spline = Spline(N, SPEC.length, plane)
    contacts = ContactSet(spline, SPEC, 1e-6, STEP, make_state(spline.size))
    contacts.set_obstacles(obstacles, ContactLaw(stiffness=1e3, width=0.01, **law))
    return spline, contacts


def draw_state(spline, rng):
    """A wavy hose near the x axis, moving: control points and velocities, flat."""
    points = np.zeros((N, 3))
    points[:, 0] = np.linspace(0.0, 1.0, N)
    points += 0.02 * rng.normal(size=points.shape)
    return points[:, spline.dims].ravel(), rng.normal(size=N * spline.dimension)


def add(spline, contacts, x, rate, start, step, exact):
    """Gradient (n d,), dense matrix and the number of touching points, in a stage of its own."""
    size, width = len(x), 4 * spline.dimension
    gradient, band = np.zeros(size + width), np.zeros((size + width, 2 * width))
    contacts.contact.found[contact_law.STAGE] += 1
    motion = contact_law.Motion(rate, start, start, step, STEP, 0.0)
    touching = contact.add_contact(spline.axes, contacts.contact, x, motion, exact, gradient, band)
    return gradient[:size], mechanics.make_dense(band, size, width), touching


def accept(spline, contacts, x, rate, start):
    """Ends a step from `start` at x: what was found is remembered."""
    state = contacts._state
    state.x[:], state.v[:], state.x_old[:] = x, rate, start
    contact.accept_contact(spline.axes, contacts.contact, state)


def compute_energy(spline, contacts, x):
    """Energy of the normal force, from the integral of the law's definition."""
    points = spline.evaluate(contacts.arc_lengths, x)[:, contacts.order]
    distances, normals = np.zeros(len(points)), np.zeros_like(points)
    shapes.measure_points(contacts.contact.geoms, 0, points, distances, normals)
    k, width = contacts.law.stiffness, contacts.law.width
    depth = np.maximum(SPEC.outer_radius - distances, 0.0)
    ramp = k * np.minimum(depth, 2 * width) ** 3 / (12 * width)
    beyond = np.maximum(depth - 2 * width, 0.0)
    energy = ramp + k * beyond * (width + beyond / 2)
    return float(contacts.contact.points[:, 4] @ energy)


@pytest.mark.parametrize("plane", [None, "xz"])
@pytest.mark.parametrize("kind", OBSTACLES)
def test_matrix_is_the_derivative_of_the_normal_force(kind, plane):
    rng = np.random.default_rng(4)
    spline, contacts = make([OBSTACLES[kind]], plane, damping_time=0.0)
    x, _ = draw_state(spline, rng)
    still = np.zeros_like(x)
    gradient, matrix, touching = add(spline, contacts, x, still, x, np.inf, True)
    assert touching > 2
    assert np.max(np.abs(gradient)) > 0.1
    step, columns, slopes = 1e-7, [], []
    for k in range(len(x)):
        move = np.zeros_like(x)
        move[k] = step
        there = add(spline, contacts, x + move, still, x, np.inf, True)[0]
        back = add(spline, contacts, x - move, still, x, np.inf, True)[0]
        columns.append((there - back) / (2 * step))
        rise = compute_energy(spline, contacts, x + move) - compute_energy(
            spline, contacts, x - move
        )
        slopes.append(rise / (2 * step))
    np.testing.assert_allclose(gradient, slopes, atol=1e-6 * np.max(np.abs(gradient)))
    np.testing.assert_allclose(matrix, np.array(columns).T, atol=1e-5 * np.max(np.abs(matrix)))


@pytest.mark.parametrize("stick", [1e-2, 1e3, 1e7])
@pytest.mark.parametrize("plane", [None, "xy"])
def test_matrix_is_the_derivative_of_friction(plane, stick):
    # On a floor that a hose moves along, N does not change: the derivative is friction's alone.
    rng = np.random.default_rng(5)
    spline, contacts = make([OBSTACLES["plane"]], plane, damping_time=0.0, stick_stiffness=stick)
    x, way = draw_state(spline, rng)
    if plane is None:
        x[2::3], way[2::3] = -0.02, 0.0
    else:
        spline.offset[2] = -0.02
        contacts.set_closed(False)  # reads the offset anew
    start, still = x - 1e-3 * way, np.zeros_like(x)
    _, matrix, touching = add(spline, contacts, x, still, start, STEP, False)
    assert touching == len(contacts.arc_lengths)
    d, step = spline.dimension, 1e-8
    along = [k for k in range(len(x)) if k % d < 2]
    for k in along:
        move = np.zeros_like(x)
        move[k] = step
        there = add(spline, contacts, x + move, still, start, STEP, False)[0]
        back = add(spline, contacts, x - move, still, start, STEP, False)[0]
        wanted = (there - back) / (2 * step)
        np.testing.assert_allclose(
            matrix[along, k], wanted[along], atol=1e-5 * np.max(np.abs(matrix))
        )


def test_damping_closes_the_matrix_too():
    rng = np.random.default_rng(6)
    floor = Obstacle(kind="plane", position=(0.0, 0.0, 0.2), friction=0.0)
    spline, contacts = make([floor], damping_time=0.02)
    x, rate = draw_state(spline, rng)
    # Below -width the law is linear in place and speed: the matrix is exact.
    _, matrix, touching = add(spline, contacts, x, rate, x, STEP, False)
    assert touching == len(contacts.arc_lengths)
    step = 1e-6
    for k in range(0, len(x), 5):
        move = np.zeros_like(x)
        move[k] = step
        there = add(spline, contacts, x + move, rate + move / STEP, x, STEP, False)[0]
        back = add(spline, contacts, x - move, rate - move / STEP, x, STEP, False)[0]
        wanted = (there - back) / (2 * step)
        np.testing.assert_allclose(matrix[:, k], wanted, atol=1e-6 * np.max(np.abs(matrix)))


@pytest.mark.parametrize("plane", [None, "xz"])
def test_matrix_without_curvature_is_positive_semidefinite(plane):
    rng = np.random.default_rng(7)
    spline, contacts = make(list(OBSTACLES.values()), plane)
    for _ in range(50):
        x, rate = draw_state(spline, rng)
        start = x + rng.normal(size=len(x)) * 10.0 ** rng.uniform(-9, -1)
        _, matrix, touching = add(spline, contacts, x, rate, start, STEP, False)
        assert touching > 0
        values = np.linalg.eigvalsh(matrix)
        assert values[0] > -1e-9 * values[-1]


def test_nothing_rubs_in_statics():
    rng = np.random.default_rng(8)
    spline, contacts = make([OBSTACLES["plane"]])
    moving, belt = make([Obstacle(kind="plane", position=(0, 0, -0.03), velocity=(1.0, 0, 0))])
    x, _ = draw_state(spline, rng)
    still = np.zeros_like(x)
    one = add(spline, contacts, x, still, x, np.inf, True)[0]
    other = add(moving, belt, x, still, x, np.inf, True)[0]
    np.testing.assert_array_equal(one, other)
    assert np.all(one[0::3] == 0.0)
    assert np.any(one[2::3] != 0.0)


@pytest.mark.parametrize("plane", [None, "xy", "xz", "yz"])
def test_reactions_are_opposite_to_what_the_hose_feels(plane):
    rng = np.random.default_rng(9)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    dims = {"xy": [0, 1], "xz": [0, 2], "yz": [1, 2], None: [0, 1, 2]}[plane]
    centre = np.zeros(3)
    centre[dims[0]] = 0.5
    obstacles = [
        Obstacle(
            kind="box",
            position=centre + 0.1 * rng.normal(size=3),
            rotation=turn,
            size=(0.3, 0.2, 0.2),
            friction=0.4,
            velocity=rng.normal(size=3),
            angular_velocity=rng.normal(size=3),
        ),
        Obstacle(kind="sphere", position=centre, size=0.3, angular_velocity=(1.0, 2.0, 3.0)),
    ]
    spline, contacts = make(obstacles, plane)
    x, rate = draw_state(spline, rng)
    start = x - 1e-3 * rng.normal(size=len(x))
    gradient, _, touching = add(spline, contacts, x, rate, start, STEP, False)
    assert touching > 3
    accept(spline, contacts, x, rate, start)
    reactions = contacts.compute_reactions()
    on_obstacles = reactions[:, :3].sum(axis=0)
    on_points = spline.to_world(-gradient)
    assert np.linalg.norm(on_obstacles) > 1.0
    np.testing.assert_allclose(on_points.sum(axis=0)[dims], -on_obstacles[dims], rtol=1e-12)
    forces = contacts.compute_forces()
    np.testing.assert_allclose(forces.sum(axis=0), -on_obstacles, rtol=1e-12)
    # Moments about the world's origin, each obstacle's from its own position.
    places = spline.to_world(x)
    about = sum(
        row[3:] + np.cross(obstacle.position, row[:3])
        for row, obstacle in zip(reactions, obstacles, strict=True)
    )
    spots = spline.evaluate(contacts.arc_lengths, x)
    np.testing.assert_allclose(np.cross(spots, forces).sum(axis=0), -about, rtol=1e-10, atol=1e-12)
    if plane is None:
        np.testing.assert_allclose(
            np.cross(places, on_points).sum(axis=0), -about, rtol=1e-10, atol=1e-12
        )


def test_surface_velocity_is_that_of_a_rigid_body():
    # A hose at rest above a turning ball is dragged the way the ball's top moves.
    ball = Obstacle(
        kind="sphere", position=(0.5, 0.0, -0.2), size=0.2, angular_velocity=(0.0, 3.0, 0.0)
    )
    spline, contacts = make([ball], stick_stiffness=1e6)
    x = np.zeros((N, 3))
    x[:, 0] = np.linspace(0.0, 1.0, N)
    accept(spline, contacts, x.ravel(), 0.0 * x.ravel(), x.ravel())
    force = contacts.compute_forces().sum(axis=0)
    # omega x arm = (0, 3, 0) x (0, 0, .2) = (.6, 0, 0), far above what it could stick to.
    assert force[0] == pytest.approx(0.5 * force[2], rel=0.05)
    assert force[1] == pytest.approx(0.0, abs=1e-12)


def test_a_fourth_unknown_is_left_alone():
    rng = np.random.default_rng(12)
    spline, contacts = make(list(OBSTACLES.values()))
    x, rate = draw_state(spline, rng)
    start = x - 1e-3 * rate
    gradient, matrix, touching = add(spline, contacts, x, rate, start, STEP, True)

    def widen(flat):
        """The same with a turn of the section behind each control point's coordinates."""
        return np.concatenate([flat.reshape(-1, 3), rng.normal(size=(N, 1))], axis=1).ravel()

    axes, size = (0.0,) * 4, 4 * N
    wide, band = np.zeros(size + 16), np.zeros((size + 16, 32))
    contacts.contact.found[contact_law.STAGE] += 1
    begun = widen(start)
    motion = contact_law.Motion(widen(rate), begun, begun, STEP, STEP, 0.0)
    arguments = (contacts.contact, widen(x), motion, True)
    assert contact.add_contact(axes, *arguments, wide, band) == touching > 0
    places = np.arange(size).reshape(N, 4)
    space, turn = places[:, :3].ravel(), places[:, 3]
    np.testing.assert_allclose(wide[space], gradient, rtol=1e-12, atol=1e-12)
    dense = mechanics.make_dense(band, size, 16)
    np.testing.assert_allclose(dense[np.ix_(space, space)], matrix, rtol=1e-12, atol=1e-9)
    assert not wide[turn].any()
    assert not dense[turn].any()
