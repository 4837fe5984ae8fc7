import numpy as np
import pytest
import scipy.linalg

pytestmark = pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.errors.HoseWarning")
EI = 0.05
WEIGHT = 0.1 * 9.81
HEAVY = {
    0.1: 0.01249955,
    1.0: 0.12456177,
    3.0: 0.36462083,
    10.0: 1.06680232,
    30.0: 2.54721393,
    100.0: 5.88810462,
}
TIP_LOAD = {
    1.0: (0.05643324, 0.30172077),
    2.0: (0.16064172, 0.49345748),
    5.0: (0.38762836, 0.71379152),
    10.0: (0.55499560, 0.81060902),
}
CLAMPED_FREE = (1.87510407, 4.69409113, 7.85475744)


@pytest.mark.parametrize("gamma", HEAVY)
def test_heavy_cantilever(make_hose, gamma):
    hose = make_hose(plane="xz", ei=WEIGHT / gamma, ea=1e8, control_points=48)
    hose.clamp(0.0)
    hose.solve_static()
    x, _, z = hose.position(1.0)[0]
    assert -z / x == pytest.approx(HEAVY[gamma], rel=5e-5)


def test_heavy_cantilever_in_space_in_a_crooked_direction(make_hose):
    gravity = np.array([1.0, -2.0, 2.0]) / 3.0 * 9.81
    along = np.array([2.0, 2.0, 1.0]) / 3.0
    hose = make_hose(gravity=gravity, ei=WEIGHT / 3.0, ea=1e8, control_points=48)
    hose.reset([0.0 * along, along])
    hose.clamp(0.0)
    hose.solve_static()
    tip = hose.position(1.0)[0]
    assert tip @ gravity / 9.81 / (tip @ along) == pytest.approx(HEAVY[3.0], rel=5e-5)
    assert tip @ np.cross(along, gravity) == pytest.approx(0.0, abs=1e-8)


def test_heavy_cantilever_converges_with_at_least_second_order(make_hose):
    errors = []
    for n in (11, 19, 35):
        hose = make_hose(plane="xz", ei=WEIGHT / 10.0, ea=1e8, control_points=n)
        hose.clamp(0.0)
        hose.solve_static()
        x, _, z = hose.position(1.0)[0]
        errors.append(abs(-z / x / HEAVY[10.0] - 1.0))
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 2.0), errors


@pytest.mark.parametrize("alpha", TIP_LOAD)
def test_tip_load(make_hose, alpha):
    hose = make_hose(plane="xz", gravity=(0, 0, 0), ea=1e8, control_points=40)
    hose.clamp(0.0)
    hose.apply_force(1.0, [0.0, 0.0, alpha * EI])
    hose.solve_static()
    x, _, z = hose.position(1.0)[0]
    np.testing.assert_allclose((1.0 - x, z), TIP_LOAD[alpha], rtol=5e-5)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_catenary(make_hose, plane):
    hose = make_hose(plane=plane, ei=1e-6, ea=1e11, length=1.5, control_points=64)
    s = np.linspace(-1.0, 1.0, 41)
    hose.reset(np.stack([0.5 + 0.5 * s, 0 * s, 0.5 * (s**2 - 1.0)], axis=1))
    first, last = hose.attach(0.0, [0, 0, 0]), hose.attach(1.5, [1, 0, 0])
    hose.solve_static()
    assert -hose.position(0.75)[0, 2] == pytest.approx(0.50263326, rel=1e-3)
    force = hose.reaction(first).force
    assert np.linalg.norm(force) / WEIGHT == pytest.approx(0.81086973, rel=1e-3)
    # The horizontal pull of a catenary is w a.
    assert -force[0] / WEIGHT == pytest.approx(0.30823647, rel=5e-3)
    np.testing.assert_allclose(force + hose.reaction(last).force, [0, 0, 1.5 * WEIGHT], atol=1e-8)


def reduce_to_free_motions(hose):
    linear = hose.linearize()
    basis = np.eye(len(linear.mass))
    if len(linear.constraints):
        basis = scipy.linalg.null_space(linear.constraints)
    return basis.T @ linear.mass @ basis, basis.T @ linear.stiffness @ basis


def compute_lowest_stiffness(make_hose, plane, pinned, load):
    """Smallest eigenvalue of the tangent stiffness of a straight hose under an end load (N)."""
    hose = make_hose(plane=plane, gravity=(0, 0, 0), ea=1e6, control_points=20)
    hose.reset([[0, 0, 0], [1.0 - load / hose.spec.axial_stiffness, 0, 0]])
    if pinned:
        hose.attach(0.0)
        hose.attach(1.0)
    else:
        hose.clamp(0.0)
        hose.apply_force(1.0, [-load, 0, 0])
    np.testing.assert_allclose(hose.tension([0.0, 0.4, 1.0]), -load, rtol=1e-6)
    _, stiffness = reduce_to_free_motions(hose)
    if plane is None and pinned:
        # Turning about its own axis is no motion of the spline, so nothing needs to be left out.
        assert len(stiffness) == 3 * 20 - 6
    return np.linalg.eigvalsh(stiffness)[0]


@pytest.mark.parametrize("plane", [None, "xz"])
@pytest.mark.parametrize(("pinned", "factor"), [(False, 0.25), (True, 1.0)])
def test_stiffness_changes_sign_at_the_euler_load(make_hose, plane, pinned, factor):
    euler = factor * np.pi**2 * EI
    assert compute_lowest_stiffness(make_hose, plane, pinned, 0.999 * euler) > 0.0
    assert compute_lowest_stiffness(make_hose, plane, pinned, 1.001 * euler) < 0.0


def compute_frequencies(make_hose, n, holds, plane="xz"):
    hose = make_hose(plane=plane, gravity=(0, 0, 0), ea=1e8, control_points=n)
    for kind, s in holds:
        getattr(hose, kind)(s)
    mass, stiffness = reduce_to_free_motions(hose)
    values = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)
    scale = EI / 0.1
    rigid = np.sum(np.abs(values) < 1e-3 * scale)
    return rigid, np.sqrt(values[rigid : rigid + 3] / scale)


@pytest.mark.parametrize(
    ("holds", "rigid", "wanted"),
    [
        ([("clamp", 0.0)], 0, CLAMPED_FREE),
        ([], 3, (4.73004074,)),
        ([("clamp", 0.0), ("attach", 1.0)], 0, (3.92660231,)),
        ([("attach", 0.0), ("attach", 1.0)], 0, (np.pi, 2 * np.pi, 3 * np.pi)),
    ],
)
def test_frequencies(make_hose, holds, rigid, wanted):
    errors = []
    for n in (11, 19, 35):
        found_rigid, found = compute_frequencies(make_hose, n, holds)
        assert found_rigid == rigid
        wanted_omega = np.array(wanted) ** 2
        errors.append(np.abs(found[: len(wanted)] / wanted_omega - 1.0).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 1e-4
    assert np.all(orders > 3.8), (errors, orders)


def test_frequencies_in_space_come_in_pairs(make_hose):
    rigid, found = compute_frequencies(make_hose, 19, [("clamp", 0.0)], plane=None)
    assert rigid == 0
    np.testing.assert_allclose(found[:2], CLAMPED_FREE[0] ** 2, rtol=1e-4)
    assert found[2] == pytest.approx(CLAMPED_FREE[1] ** 2, rel=1e-3)


def test_hanging_chain_frequencies(make_hose):
    hose = make_hose(plane="xz", ei=1e-7, ea=1e11, control_points=64)
    hose.reset([[0, 0, 0], [0, 0, -1.0]])
    hose.attach(0.0)
    hose.solve_static()
    mass, stiffness = reduce_to_free_motions(hose)
    found = np.sqrt(scipy.linalg.eigh(stiffness, mass, eigvals_only=True)[:3] / 9.81)
    np.testing.assert_allclose(found, (1.20241, 2.76004, 4.32686), rtol=1e-3)
