import numpy as np
import pytest

from hose_mj.hoses.geds import basis, energy, mechanics, records, twist_segments
from hose_mj.hoses.geds import span as spans
from hose_mj.hoses.geds.spline import Spline

N, LENGTH = 8, 1.0
KNOTS = basis.make_knots(N, LENGTH)
TABLES = basis.make_tables(KNOTS)
GREVILLE = basis.make_greville(KNOTS)
KINDS = ("near-straight", "curved", "wild", "compressed", "crushed")
dimensions = pytest.mark.parametrize("d", [2, 3])
kinds = pytest.mark.parametrize("kind", KINDS)


def make_elasticity(*, strain=0.0, curvature=0.0, damping=0.0, ea=50.0, ei=0.05, n_spans=N - 3):
    points = (n_spans, 3)
    return spans.Elasticity(
        axial_stiffness=np.full(n_spans, ea),
        bending_stiffness=np.full(points, ei),
        second_stiffness=np.full(points, ei),
        torsional_stiffness=np.full(points, 0.8 * ei),
        rest_strain=np.full(n_spans, strain),
        rest_curvature=np.full(points, curvature),
        rest_torsion=np.zeros(points),
        damping_time=damping,
    )


def make_constants(elasticity, tables=TABLES):
    n = len(tables.first) + 3
    mass = basis.make_mass(basis.make_knots(n, LENGTH), np.full((n - 3, 4), 0.1))
    return records.Hose(tables, elasticity, mass, 1e-4, 0.0, 0.1)


def make_no_twist(hose, d):
    spline = Spline(len(hose.mass), LENGTH, "xy" if d == 2 else None)
    return twist_segments.make_twist(spline, hose, [], np.zeros(spline.size))


def make_state(kind, d, seed=0):
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(N, d))
    straight = np.zeros((N, d))
    straight[:, 0] = GREVILLE
    if kind == "near-straight":
        return (straight + 1e-4 * noise).ravel()
    if kind == "curved":
        circle = np.zeros((N, d))
        circle[:, 0], circle[:, 1] = np.sin(5 * GREVILLE) / 5, (1 - np.cos(5 * GREVILLE)) / 5
        return (circle + 0.01 * noise).ravel()
    if kind == "wild":
        return (straight + 0.05 * noise).ravel()
    # |r'| around 0.1, where the continuation begins, and far below it.
    return ((0.1 if kind == "compressed" else 0.03) * straight + 0.002 * noise).ravel()


def compute_parts(x, d, elasticity, tables=TABLES):
    strains = np.zeros((len(tables.first), 2))
    axes, no_frames = (0.0,) * d, np.zeros((0, 10))
    span = spans.make_span()
    return energy.compute_energy(axes, tables, elasticity, no_frames, x, span, strains)[:2]


def compute_energy(x, d, elasticity):
    return sum(compute_parts(x, d, elasticity))


def assemble(x, d, elasticity, rate=None, step=np.inf, exact=True):
    """Gradient (n d,) and dense stiffness of the kernel."""
    size = len(x)
    gradient, band = np.zeros(size + 4 * d), np.zeros((size + 4 * d, 8 * d))
    speed = np.zeros(size + 4 * d)
    if rate is not None:
        speed[:size] = rate
    axes, span, hose = (0.0,) * d, spans.make_span(), make_constants(elasticity)
    no_twist = make_no_twist(hose, d)
    energy.assemble(axes, hose, no_twist, 0.0, x, speed, step, exact, span, gradient, band)
    return gradient[:size], mechanics.make_dense(band, size, 4 * d)


def differentiate(function, x, step):
    columns = []
    for k in range(len(x)):
        e = np.zeros(len(x))
        e[k] = step
        # Fourth order, so that a step well above rounding will do.
        near, far = function(x + e) - function(x - e), function(x + 2 * e) - function(x - 2 * e)
        columns.append((8 * near - far) / (12 * step))
    return np.array(columns)


@dimensions
@kinds
@pytest.mark.parametrize(("strain", "curvature"), [(0.0, 0.0), (0.05, 3.0)])
def test_gradient_and_hessian_are_derivatives_of_the_energy(d, kind, strain, curvature):
    elasticity = make_elasticity(strain=strain, curvature=curvature if d == 2 else 0.0)
    step = 1e-5 if kind in ("compressed", "crushed") else 1e-4
    for seed in range(3):
        x = make_state(kind, d, seed)
        gradient, hessian = assemble(x, d, elasticity)
        by_energy = differentiate(lambda y: compute_energy(y, d, elasticity), x, step)
        by_gradient = differentiate(lambda y: assemble(y, d, elasticity)[0], x, step)
        loose = 1e-3 if kind == "compressed" else 1e-5  # W'' has a kink where |a| = 0.1
        scale = np.abs(gradient).max() + step * np.abs(hessian).max()
        np.testing.assert_allclose(by_energy, gradient, atol=1e-5 * scale)
        np.testing.assert_allclose(by_gradient, hessian, atol=loose * np.abs(hessian).max())


@pytest.mark.parametrize("kernel", [spans.compute_stretch, spans.compute_inverse_square])
def test_continuation_joins_twice_smoothly_and_stays_finite(kernel):
    edge = spans.SMALLEST_A
    below, above = kernel(edge * (1 - 1e-12)), kernel(edge)
    np.testing.assert_allclose(below, above, rtol=1e-10)
    values = np.array([kernel(A) for A in np.linspace(0.0, edge, 50)])
    assert np.all(np.isfinite(values))
    assert np.all(values[:, 0] > 0.0)


@dimensions
def test_energy_of_a_hose_in_one_point_is_finite(d):
    gradient, hessian = assemble(np.zeros(N * d), d, make_elasticity())
    assert np.all(np.isfinite(gradient))
    assert np.all(np.isfinite(hessian))


@dimensions
@kinds
@pytest.mark.parametrize("curvature", [0.0, 3.0])
def test_gauss_newton_matrix_is_positive_semidefinite(d, kind, curvature):
    elasticity = make_elasticity(strain=0.02, curvature=curvature if d == 2 else 0.0, damping=0.1)
    for seed in range(5):
        _, matrix = assemble(make_state(kind, d, seed), d, elasticity, step=0.01, exact=False)
        values = np.linalg.eigvalsh(matrix)
        assert values[0] >= -1e-12 * values[-1]


@dimensions
@kinds
def test_rigid_motions_change_nothing(d, kind):
    elasticity = make_elasticity(strain=0.03, curvature=2.0 if d == 2 else 0.0)
    rng = np.random.default_rng(5)
    for seed in range(3):
        x = make_state(kind, d, seed).reshape(N, d)
        turn = np.linalg.qr(rng.normal(size=(d, d)))[0]
        turn[:, 0] *= np.linalg.det(turn)
        moved = x @ turn.T + rng.normal(size=d)
        energy_before = compute_energy(x.ravel(), d, elasticity)
        assert compute_energy(moved.ravel(), d, elasticity) == pytest.approx(
            energy_before, rel=1e-9
        )
        force = assemble(x.ravel(), d, elasticity)[0].reshape(N, d)
        scale = np.abs(force).max()
        np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-11 * scale)
        torque = np.einsum("ia,ib->ab", x, force)
        np.testing.assert_allclose(torque - torque.T, 0.0, atol=1e-11 * scale)


@dimensions
@kinds
def test_kelvin_voigt_force_dissipates_and_is_c_times_v(d, kind):
    elasticity = make_elasticity(damping=0.1)
    rng = np.random.default_rng(2)
    for seed in range(3):
        x, v = make_state(kind, d, seed), rng.normal(size=N * d)
        force = assemble(x, d, elasticity, v)[0] - assemble(x, d, elasticity)[0]
        viscosity = assemble(x, d, elasticity, step=1.0)[1] - assemble(x, d, elasticity)[1]
        scale = np.abs(viscosity).max() * np.abs(v).max()
        assert v @ force >= 0.0
        np.testing.assert_allclose(viscosity @ v, force, atol=1e-11 * scale)
        assert np.abs(force).max() > 1e-3 * scale


@kinds
def test_planar_rigid_motion_is_not_damped(kind):
    x = make_state(kind, 2)
    points = x.reshape(N, 2)
    spin = np.stack([3.0 - points[:, 1], points[:, 0] - 2.0], axis=1)
    elasticity = make_elasticity(damping=0.1)
    force = assemble(x, 2, elasticity, spin.ravel())[0] - assemble(x, 2, elasticity)[0]
    viscosity = assemble(x, 2, elasticity, step=1.0)[1] - assemble(x, 2, elasticity)[1]
    np.testing.assert_allclose(force, 0.0, atol=1e-11 * np.abs(viscosity).max())


@dimensions
@pytest.mark.parametrize("strain", [0.0, 0.1])
def test_pure_stretch_energy(d, strain):
    for stretch in (0.8, 1.0, 1.3):
        x = np.zeros((N, d))
        x[:, d - 1] = stretch * GREVILLE
        stretching, bending = compute_parts(x.ravel(), d, make_elasticity(strain=strain))
        wanted = 0.5 * 50.0 * LENGTH * (stretch - 1.0 - strain) ** 2
        assert stretching == pytest.approx(wanted, rel=1e-12, abs=1e-14)
        assert bending == pytest.approx(0.0, abs=1e-14)


@dimensions
def test_bending_energy_of_half_a_circle_converges(d):
    radius = LENGTH / np.pi
    errors = []
    for n in (11, 19, 35):
        knots, s = basis.make_knots(n, LENGTH), np.linspace(0.0, LENGTH, n)
        circle = np.zeros((n, d))
        circle[:, 0], circle[:, 1] = np.sin(s / radius), 1.0 - np.cos(s / radius)
        x = basis.interpolate(knots, s, radius * circle).ravel()
        tables = basis.make_tables(knots)
        elasticity = make_elasticity(n_spans=n - 3)
        bending = compute_parts(x, d, elasticity, tables)[1]
        errors.append(abs(bending / (0.5 * 0.05 * LENGTH / radius**2) - 1.0))
        if d == 2:
            bent = make_elasticity(n_spans=n - 3, curvature=1.0 / radius)
            against = make_elasticity(n_spans=n - 3, curvature=-1.0 / radius)
            assert compute_parts(x, d, bent, tables)[1] < 1e-3 * bending
            # (kappa - kappa_0)^2 = (2 kappa)^2: the rest curvature has a sign.
            found = compute_parts(x, d, against, tables)[1]
            assert found == pytest.approx(4.0 * bending, rel=2e-2)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 1e-4
    assert np.all(orders > 1.8), orders


@kinds
@pytest.mark.parametrize("dims", [(0, 1), (0, 2), (1, 2)])
def test_plane_equals_its_embedding_in_space(kind, dims):
    flat = make_state(kind, 2).reshape(N, 2)
    v = np.random.default_rng(3).normal(size=(N, 2))
    spatial, v_spatial = np.zeros((N, 3)), np.zeros((N, 3))
    spatial[:, dims], v_spatial[:, dims] = flat, v
    elasticity = make_elasticity(strain=0.01, damping=0.1)
    inside = (3 * np.arange(N)[:, None] + np.array(dims)).ravel()
    for exact in (True, False):
        force_2, matrix_2 = assemble(flat.ravel(), 2, elasticity, v.ravel(), 0.1, exact)
        force_3, matrix_3 = assemble(spatial.ravel(), 3, elasticity, v_spatial.ravel(), 0.1, exact)
        atol = 1e-12 * np.abs(matrix_2).max()
        np.testing.assert_allclose(force_3[inside], force_2, atol=10 * atol)
        np.testing.assert_allclose(matrix_3[np.ix_(inside, inside)], matrix_2, atol=atol)
    flat_energy = compute_energy(flat.ravel(), 2, elasticity)
    assert compute_energy(spatial.ravel(), 3, elasticity) == pytest.approx(flat_energy, rel=1e-12)
