import numpy as np
import pytest
import scipy.linalg

from hose_mj.hoses.geds import band as banded
from hose_mj.hoses.geds import kkt, mechanics, records, twist_segments
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.spec import HoseSpec

N = 9
SPEC = HoseSpec(
    length=1.0,
    axial_stiffness=1e3,
    bending_stiffness=0.05,
    torsional_stiffness=0.5,
    linear_density=0.1,
)
dimensions = pytest.mark.parametrize("d", [2, 3])


def make_matrix(d, seed=0):
    """A symmetric positive definite matrix with 4 d - 1 lower diagonals: dense, and as our band."""
    rng = np.random.default_rng(seed)
    size, width = N * d, 4 * d
    lower = np.tril(rng.normal(size=(size, size)))
    for k in range(width, size):
        lower -= np.diag(np.diag(lower, -k), -k)
    lower[np.diag_indices(size)] = 1.0 + np.abs(lower.diagonal())
    dense = lower @ lower.T
    packed = np.zeros((N * d + 4 * d, 8 * d))
    for k in range(width):
        packed[: size - k, k] = np.diag(dense, -k)
    return dense, packed


@dimensions
def test_dense_copy_of_a_band(d):
    dense, packed = make_matrix(d)
    np.testing.assert_array_equal(mechanics.make_dense(packed, N * d, 4 * d), dense)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_factor_and_solves_match_scipy(d):
    axes, size = (0.0,) * d, N * d
    for seed in range(5):
        dense, packed = make_matrix(d, seed)
        rhs = np.zeros(size + 4 * d)
        rhs[:size] = np.random.default_rng(seed + 10).normal(size=size)
        lower = np.array([packed[:size, k] for k in range(4 * d)])
        wanted = scipy.linalg.solveh_banded(lower, rhs[:size], lower=True)
        assert banded.factorize(axes, size, packed)
        half = scipy.linalg.solve_triangular(np.linalg.cholesky(dense), rhs[:size], lower=True)
        banded.solve_lower(axes, size, packed, rhs[None])
        np.testing.assert_allclose(rhs[:size], half, rtol=1e-8, atol=1e-10 * np.abs(half).max())
        rhs[size:] = 0.0
        banded.solve_upper(axes, size, packed, rhs)
        np.testing.assert_allclose(rhs[:size], wanted, rtol=1e-6, atol=1e-8 * np.abs(wanted).max())


@dimensions
@pytest.mark.parametrize("place", [0, N, 2 * N - 1])
@pytest.mark.parametrize("pivot", [0.0, -1.0, np.nan, -np.inf])
def test_a_pivot_that_is_not_positive_is_refused(d, place, pivot):
    _, packed = make_matrix(d)
    packed[place, 0] = pivot
    assert not banded.factorize((0.0,) * d, N * d, packed)


@dimensions
def test_nan_beside_the_diagonal_is_refused(d):
    _, packed = make_matrix(d)
    packed[3, 2] = np.nan
    assert not banded.factorize((0.0,) * d, N * d, packed)


def make_holds(d, seed=0, with_twist=False):
    rng = np.random.default_rng(seed)
    start = np.array([0, 0, 2 * d, 5 * d], dtype=np.int64)
    m = len(start)
    rows, numbers = rng.normal(size=(m, 4 * d)), np.zeros((3, m))
    spline = Spline(N, 1.0, "xy" if d == 2 else None)
    hose = mechanics.make_constants(SPEC, spline.knots)
    # Three clamps make two stretches, whose rows a test may fill as it likes.
    clamps = [0.0, 0.5, 1.0] if with_twist else []
    twist = twist_segments.make_twist(spline, hose, clamps, np.zeros(spline.size))
    twist.rows[:, : N * d] = rng.normal(size=(len(twist.angle), N * d))
    return records.Constraints(start, rows, *numbers, twist, records.make_response(0))


def stack(holds, size):
    """Rows (m, size) of holds and twist, and the diagonal D (m,) that belongs to them."""
    rows = mechanics.make_dense_rows(holds, size, holds.rows.shape[1])
    twist = holds.twist
    softness = np.concatenate([np.zeros(len(rows)), 0.5 * twist.compliance])
    return np.concatenate([rows, twist.rows[:, :size]]), softness


@dimensions
@pytest.mark.parametrize("with_twist", [False, True])
def test_solve_with_holds_matches_the_dense_kkt_system(d, with_twist):
    axes, size = (0.0,) * d, N * d
    for seed in range(5):
        rng = np.random.default_rng(seed)
        dense, packed = make_matrix(d, seed)
        holds = make_holds(d, seed, with_twist)
        rows, softness = stack(holds, size)
        m, n_holds = len(rows), len(holds.start)
        gradient, shift = rng.normal(size=size), np.zeros(m)
        shift[:n_holds] = rng.normal(size=n_holds)
        work = records.make_work(N, d, m)
        work.band[:] = packed
        work.gradient[:size], work.shift[:m] = gradient, shift
        assert banded.factorize(axes, size, work.band)
        assert kkt.solve_with_constraints(axes, holds, 0.0, 0.5, 0, size, work) == records.DONE
        saddle = np.block([[dense, -rows.T], [rows, np.diag(softness)]])
        wanted = np.linalg.solve(saddle, np.concatenate([-gradient, shift]))
        scale = np.abs(wanted).max()
        np.testing.assert_allclose(work.gradient[:size], wanted[:size], atol=1e-8 * scale)
        np.testing.assert_allclose(work.multipliers, wanted[size:], atol=1e-8 * scale)


@dimensions
def test_indefinite_matrix_is_solved_only_where_twist_and_holds_make_it_stable(d):
    axes, size = (0.0,) * d, N * d
    n_stable = 0
    for seed in range(80):
        rng = np.random.default_rng(seed)
        dense, packed = make_matrix(d, seed)
        holds = make_holds(d, seed, d == 3)
        rows, softness = stack(holds, size)
        n_holds = len(holds.start)
        # Just enough off the diagonal to make one eigenvalue negative, or two.
        lowest = (
            np.linalg.eigvalsh(dense)[[0, 1]].mean() if seed % 2 else np.linalg.eigvalsh(dense)[0]
        )
        dense = dense - (lowest + 0.02) * np.eye(size)
        packed[:size, 0] -= lowest + 0.02
        work = records.make_work(N, d, len(rows))
        work.band[:] = packed
        work.gradient[:size] = rng.normal(size=size)
        gradient = work.gradient[:size].copy()
        n_negative = banded.factorize_indefinite(axes, size, work.band, work.signs)
        assert n_negative == np.sum(np.linalg.eigvalsh(dense) < 0.0)
        verdict = kkt.solve_with_constraints(axes, holds, 0.0, 0.5, n_negative, size, work)
        twist = rows[n_holds:]
        whole = dense + twist.T @ (twist / softness[n_holds:, None])
        null = scipy.linalg.null_space(rows[:n_holds])
        stable = bool(np.linalg.eigvalsh(null.T @ whole @ null)[0] > 0.0)
        assert verdict == (records.DONE if stable else records.NOT_POSITIVE)
        if stable and n_negative > 0:
            n_stable += 1
            saddle = np.block([[dense, -rows.T], [rows, np.diag(softness)]])
            wanted = np.linalg.solve(saddle, np.concatenate([-gradient, np.zeros(len(rows))]))
            scale = np.abs(wanted).max()
            np.testing.assert_allclose(work.gradient[:size], wanted[:size], atol=1e-6 * scale)
    assert n_stable >= 3


@dimensions
def test_rows_that_depend_on_each_other_are_refused(d):
    axes, size = (0.0,) * d, N * d
    _, packed = make_matrix(d)
    holds = make_holds(d)
    holds.rows[1] = -2.0 * holds.rows[0]
    work = records.make_work(N, d, len(holds.start))
    work.band[:] = packed
    assert banded.factorize(axes, size, work.band)
    verdict = kkt.solve_with_constraints(axes, holds, 0.0, 1.0, 0, size, work)
    assert verdict == records.DEPENDENT_CONSTRAINTS
