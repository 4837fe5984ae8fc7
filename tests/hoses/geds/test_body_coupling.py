"""Holds on bodies that give way: springs and masses in closed form, limits, mistakes."""

import numpy as np
import pytest

from hose_mj import HoseSpec, make_hose
from hose_mj.errors import InputError, StepError
from hose_mj.hoses.geds.point_masses import PointMasses
from hose_mj.hoses.geds.shapes import ROW

SPEC = HoseSpec(
    length=1.0, axial_stiffness=1e3, bending_stiffness=0.02, torsional_stiffness=0.01,
    linear_density=0.1, outer_radius=0.01,
)  # fmt: skip
SCHEMES = ("backward-euler", "bdf2", "sdirk2", "midpoint")


def make(scheme="bdf2", **options):
    hose = make_hose(
        "geds", SPEC, timestep=0.002, scheme=scheme, gravity=(0, 0, 0), tolerance=1e-6, **options
    )
    hose.reset([[0, 0, 0], [1, 0, 0]])
    return hose, [hose.attach(0.0), hose.attach(1.0)]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("options", [{}, {"plane": "xy"}, {"twist": "theta"}])
def test_without_compliance_it_is_a_hold(scheme, options):
    hose, holds = make(scheme, **options)
    other, others = make(scheme, **options)
    for k in range(20):
        place = np.array([1.0 + 1e-4 * k, 2e-3 * k, 0.0])
        hose.coupling.try_step([holds[1]], [place], np.zeros((3, 3)))
        hose.coupling.accept_step()
        other.move(others[1], place)
        other.step()
        np.testing.assert_allclose(hose.control_points, other.control_points, atol=1e-12)
    assert hose.time == other.time


@pytest.mark.parametrize("scheme", SCHEMES)
def test_what_holds_the_hose_gives_way_by_its_compliance(scheme):
    hose, (_, tip) = make(scheme)
    compliance = 1e-4 * np.array([[2.0, 0.3, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.5]])
    for k in range(30):
        aim = np.array([[1.0 + 2e-4 * k, 1e-3 * k, 0.0]])
        force = hose.coupling.try_step([tip], aim, compliance)
        hose.coupling.accept_step()
        gave = aim[0] - compliance @ force[0]
        np.testing.assert_allclose(hose.position(1.0)[0], gave, atol=1e-12)
    assert force[0, 0] > 1.0


def test_a_step_may_be_tried_again_and_leaves_no_trace():
    hose, (_, tip) = make()
    twin, (_, other) = make()
    before = hose.control_points
    for aim in (1.5, 0.7, 1.001):
        hose.coupling.try_step([tip], [[aim, 0.0, 0.0]], 1e-3 * np.eye(3))
        np.testing.assert_array_equal(hose.control_points, before)
    hose.coupling.accept_step()
    twin.coupling.try_step([other], [[1.001, 0.0, 0.0]], 1e-3 * np.eye(3))
    twin.coupling.accept_step()
    np.testing.assert_array_equal(hose.control_points, twin.control_points)


def test_a_mass_on_a_taut_hose_swings_as_a_spring_lets_it():
    """EA / L = 1 kN/m and 5 kg, much heavier than the hose: omega^2 = k / (m + rho L / 3)."""
    hose, (_, tip) = make("midpoint")
    zero = np.zeros((1, 3))
    masses = PointMasses(
        position=np.array([[1.0, 0.0, 0.0]]),
        velocity=np.array([[0.01, 0.0, 0.0]]),
        mass=np.full((1, 3), 5.0),
        drag=zero.copy(),
        force=zero.copy(),
        radius=np.zeros(1),
        across=3,
        reach=np.zeros(1),
        walls=np.zeros((0, ROW)),
        owner=np.zeros(0, dtype=np.int64),
        arm=zero[:0].copy(),
        push=zero.copy(),
    )
    omega = np.sqrt(1e3 / (5.0 + 0.1 / 3.0))
    n = round(0.25 * 2.0 * np.pi / omega / hose.timestep)
    assert hose.coupling.step_with_masses([tip], masses, n) == n
    # The mass goes by MuJoCo's first-order steps, so by O(dt) of a quarter of its period.
    assert masses.position[0, 0] - 1.0 == pytest.approx(0.01 / omega, rel=0.02)
    assert abs(masses.velocity[0, 0]) < 0.02 * 0.01


def test_mistakes_are_named():
    hose, (source, tip) = make()
    point = [[1.0, 0.0, 0.0]]
    with pytest.raises(InputError, match="shapes of positions and compliance"):
        hose.coupling.try_step([tip], point, np.eye(2))
    with pytest.raises(InputError, match="positions and compliance"):
        hose.coupling.try_step([tip], [[np.nan, 0.0, 0.0]], np.eye(3))
    hose.release(tip)
    with pytest.raises(InputError, match="hold"):
        hose.coupling.try_step([tip], point, np.eye(3))
    clamp = hose.clamp(1.0)
    with pytest.raises(InputError, match="an attachment"):
        hose.coupling.try_step([clamp], point, np.eye(3))
    with pytest.raises(InputError, match="an attachment"):
        hose.coupling.try_step([source, clamp], point * 2, np.eye(6))
    explicit, holds = make("verlet")
    with pytest.raises(InputError, match="implicit scheme"):
        explicit.coupling.try_step(holds, point * 2, np.eye(6))


def test_a_step_that_fails_changes_nothing():
    hose, (_, tip) = make()
    before = hose.snapshot()
    with pytest.raises(StepError):
        hose.coupling.try_step([tip], [[1e200, 0.0, 0.0]], np.zeros((3, 3)))
    np.testing.assert_array_equal(hose.snapshot()["state"]["x"], before["state"]["x"])
    hose.coupling.try_step([tip], [[1.0, 0.0, 0.0]], np.zeros((3, 3)))
    hose.coupling.accept_step()
    assert np.isfinite(hose.control_points).all()
