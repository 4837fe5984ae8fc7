import mujoco
import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.hoses.geds import shapes
from hose_mj.hoses.geds.contacts import ContactSet
from hose_mj.hoses.geds.integrators import make_state
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.spec import HoseSpec

KINDS = ("plane", "sphere", "capsule", "cylinder", "box")
PROBE = 1e-3
"""Radius of the sphere that stands for a point in MuJoCo (m)."""


def make_rotation(rng):
    quaternion = rng.normal(size=4)
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion / np.linalg.norm(quaternion))
    return matrix.reshape(3, 3)


def make_obstacle(kind, rng):
    size = rng.uniform(0.1, 1.0, 3)
    return Obstacle(kind=kind, position=rng.normal(size=3), rotation=make_rotation(rng), size=size)


def make_row(obstacle):
    spec = HoseSpec(length=1.0, axial_stiffness=1.0, bending_stiffness=1.0, linear_density=1.0)
    state = make_state(15)
    contacts = ContactSet(Spline(5, 1.0, None), spec, 1e-4, 0.005, state)
    contacts.set_obstacles([obstacle], ContactLaw())
    return contacts.contact.geoms


def measure(obstacle, points):
    distances, normals = np.zeros(len(points)), np.zeros((len(points), 3))
    shapes.measure_points(make_row(obstacle), 0, points, distances, normals)
    return distances, normals


def compute_peer_distances(obstacle, points):
    """mj_geomDistance between the shape and a small ball, plus the ball's radius."""
    spec = mujoco.MjSpec()
    geom = spec.worldbody.add_geom(type=getattr(mujoco.mjtGeom, f"mjGEOM_{obstacle.kind.upper()}"))
    geom.size = [1.0, 1.0, 1.0] if obstacle.kind == "plane" else obstacle.size
    geom.pos = obstacle.position
    mujoco.mju_mat2Quat(geom.quat, np.asarray(obstacle.rotation).ravel())
    ball = spec.worldbody.add_body(mocap=True)
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[PROBE, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    found = []
    for point in points:
        data.mocap_pos[0] = point
        mujoco.mj_kinematics(model, data)
        found.append(mujoco.mj_geomDistance(model, data, 0, 1, 100.0, np.zeros(6)) + PROBE)
    return np.array(found)


@pytest.mark.parametrize("kind", KINDS)
def test_distance_is_mujocos(kind):
    rng = np.random.default_rng(1)
    n_inside = 0
    for _ in range(40):
        obstacle = make_obstacle(kind, rng)
        points = obstacle.position + rng.normal(size=(25, 3)) * rng.choice([0.3, 1.0, 3.0])
        ours, _ = measure(obstacle, points)
        n_inside += np.sum(ours < 0.0)
        theirs = compute_peer_distances(obstacle, points)
        np.testing.assert_allclose(ours, theirs, atol=1e-6)
    assert n_inside > 50


@pytest.mark.parametrize("kind", KINDS)
def test_normal_is_the_gradient_and_bend_the_hessian(kind):
    rng = np.random.default_rng(2)
    for _ in range(200):
        obstacle = make_obstacle(kind, rng)
        geoms = make_row(obstacle)
        point = obstacle.position + rng.normal(size=3)
        distance, normal, (across, along), axis = shapes.measure(geoms, 0, tuple(point))
        normal, axis = np.array(normal), np.array(axis)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        # The point on the surface: one distance back along the normal.
        assert shapes.measure(geoms, 0, tuple(point - distance * normal))[0] == pytest.approx(
            0.0, abs=1e-9
        )
        step = 1e-5
        moved = [point + step * e for e in np.vstack([np.eye(3), -np.eye(3)])]
        values, normals = measure(obstacle, np.array(moved))
        gradient = (values[:3] - values[3:]) / (2 * step)
        np.testing.assert_allclose(gradient, normal, atol=1e-7)
        hessian = (normals[:3] - normals[3:]) / (2 * step)
        sides = np.eye(3) - np.outer(normal, normal) - np.outer(axis, axis)
        wanted = across * sides + along * np.outer(axis, axis)
        np.testing.assert_allclose(hessian, wanted, atol=1e-6 * max(1.0, across**2))


@pytest.mark.parametrize("kind", KINDS)
def test_prefilter_leaves_out_nothing_that_touches(kind):
    rng = np.random.default_rng(3)
    left_out = 0
    for _ in range(300):
        obstacle = make_obstacle(kind, rng)
        geoms, point = make_row(obstacle), tuple(obstacle.position + 2.0 * rng.normal(size=3))
        reach = rng.uniform(0.01, 0.5)
        near = shapes.is_near(geoms, 0, point, reach)
        left_out += not near
        assert near or shapes.measure(geoms, 0, point)[0] >= reach
    assert left_out > 30


def test_points_on_an_axis_have_a_normal():
    for kind in ("sphere", "capsule", "cylinder"):
        obstacle = Obstacle(kind=kind, size=(0.2, 0.5, 0.0))
        distance, normal = measure(obstacle, np.zeros((1, 3)))
        assert distance[0] == pytest.approx(-0.2)
        assert np.linalg.norm(normal) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("options", "thing"),
    [
        ({"kind": "torus"}, "kind of obstacle"),
        ({"kind": "box", "size": (0.1, 0.2)}, "size of a box"),
        ({"kind": "sphere", "size": -1.0}, "size of a sphere"),
        ({"kind": "capsule", "size": (0.1, np.inf)}, "size of a capsule"),
        ({"kind": "plane", "position": (0.0, np.nan, 0.0)}, "position"),
        ({"kind": "plane", "rotation": np.diag([1.0, 1.0, -1.0])}, "rotation"),
        ({"kind": "plane", "rotation": np.ones((3, 3))}, "rotation"),
        ({"kind": "plane", "friction": -0.1}, "friction"),
    ],
)
def test_a_wrong_obstacle_is_refused(options, thing):
    with pytest.raises(InputError, match=thing):
        Obstacle(**options)


@pytest.mark.parametrize(
    "options",
    [
        {"stiffness": 0.0},
        {"width": -1.0},
        {"damping_time": -1.0},
        {"slip_speed": 0.0},
        {"stick_stiffness": 0.0},
        {"points_per_span": 0},
    ],
)
def test_a_wrong_law_is_refused(options):
    with pytest.raises(InputError):
        ContactLaw(**options)


def test_an_obstacle_keeps_its_own_copy():
    place = np.zeros(3)
    obstacle = Obstacle(kind="sphere", position=place, size=1.0)
    place[0] = 1.0
    assert obstacle.position[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        obstacle.position[0] = 1.0
