import numpy as np
import pytest
import scipy.linalg

from hose_mj.hoses.geds import band as banded
from hose_mj.hoses.geds import mechanics, solver

N = 9
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


@dimensions
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


def make_holds(d, seed=0):
    rng = np.random.default_rng(seed)
    start = np.array([0, 0, 2 * d, 5 * d], dtype=np.int64)
    m = len(start)
    return solver.Holds(start, rng.normal(size=(m, 4 * d)), np.zeros(m), np.zeros(m), np.zeros(m))


@dimensions
def test_solve_with_holds_matches_the_dense_kkt_system(d):
    axes, size = (0.0,) * d, N * d
    for seed in range(5):
        rng = np.random.default_rng(seed)
        dense, packed = make_matrix(d, seed)
        holds = make_holds(d, seed)
        m = len(holds.start)
        rows = mechanics.make_dense_rows(holds, size)
        gradient, shift = rng.normal(size=size), rng.normal(size=m)
        work = solver.make_work(N, d, m)
        work.band[:] = packed
        work.gradient[:size], work.shift[:m] = gradient, shift
        assert banded.factorize(axes, size, work.band)
        assert solver.solve_with_holds(axes, holds, size, work)
        kkt = np.block([[dense, -rows.T], [rows, np.zeros((m, m))]])
        wanted = np.linalg.solve(kkt, np.concatenate([-gradient, shift]))
        scale = np.abs(wanted).max()
        np.testing.assert_allclose(work.gradient[:size], wanted[:size], atol=1e-8 * scale)
        np.testing.assert_allclose(work.multipliers, wanted[size:], atol=1e-8 * scale)


@dimensions
def test_rows_that_depend_on_each_other_are_refused(d):
    axes, size = (0.0,) * d, N * d
    _, packed = make_matrix(d)
    holds = make_holds(d)
    holds.rows[1] = -2.0 * holds.rows[0]
    work = solver.make_work(N, d, len(holds.start))
    work.band[:] = packed
    assert banded.factorize(axes, size, work.band)
    assert not solver.solve_with_holds(axes, holds, size, work)
