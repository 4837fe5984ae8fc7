"""The literal twist strain of GEDS: right on a well-bent curve, and where it fails."""

import numpy as np
import pytest

from hose_mj import HoseSpec
from hose_mj.hoses.geds import basis, energy, mechanics, stretches
from hose_mj.hoses.geds.span import make_span
from hose_mj.hoses.geds.spline import Spline

N, LENGTH, AXES = 8, 1.0, (0.0,) * 4
SPEC = HoseSpec(
    length=LENGTH,
    axial_stiffness=50.0,
    bending_stiffness=0.05,
    torsional_stiffness=0.04,
    linear_density=0.1,
    rest_torsion=0.5,
    damping_time=0.1,
)
GREVILLE = basis.make_greville(basis.make_knots(N, LENGTH))


def make_unknowns(seed):
    """A helix of half a turn with noise, and any theta."""
    rng = np.random.default_rng(seed)
    x = np.zeros((N, 4))
    x[:, :3] = make_helix(0.25, 0.15, GREVILLE) + 0.01 * rng.normal(size=(N, 3))
    x[:, 3] = rng.normal(size=N)
    return x.ravel()


def make_helix(radius, rise, s):
    angle = s / np.hypot(radius, rise)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), rise * angle], axis=1)


def make_hose(n=N, spec=SPEC):
    spline = Spline(n, LENGTH, None, has_theta=True)
    return spline, mechanics.make_constants(spec, spline.knots, frenet=True)


def measure(hose, x):
    """Stretching, bending and twisting energy."""
    strains, no_frames = np.zeros((len(hose.mass) - 3, 2)), np.zeros((0, 10))
    return energy.compute_energy(
        AXES, hose.tables, hose.elasticity, no_frames, x, make_span(), strains
    )


def assemble(spline, hose, x, rate=None, step=np.inf, exact=True):
    size = len(x)
    gradient, band = np.zeros(size + 16), np.zeros((size + 16, 32))
    speed = np.zeros(size + 16)
    speed[:size] = 0.0 if rate is None else rate
    twist = stretches.make_twist(spline, hose, [], x)
    energy.assemble(AXES, hose, twist, 0.0, x, speed, step, exact, make_span(), gradient, band)
    return gradient[:size], mechanics.make_dense(band, size, 16)


def differentiate(function, x, step=1e-5):
    columns = []
    for e in step * np.eye(len(x)):
        near, far = function(x + e) - function(x - e), function(x + 2 * e) - function(x - 2 * e)
        columns.append((8 * near - far) / (12 * step))
    return np.array(columns)


@pytest.mark.parametrize("seed", range(3))
def test_gradient_and_hessian_are_derivatives_of_the_energy(seed):
    spline, hose = make_hose()
    x = make_unknowns(seed)
    gradient, hessian = assemble(spline, hose, x)
    by_energy = differentiate(lambda y: sum(measure(hose, y)), x)
    np.testing.assert_allclose(by_energy, gradient, atol=1e-7 * np.abs(gradient).max())
    by_gradient = differentiate(lambda y: assemble(spline, hose, y)[0], x)
    np.testing.assert_allclose(by_gradient, hessian, atol=1e-6 * np.abs(hessian).max())


def test_gauss_newton_matrix_and_damping_are_positive_semidefinite():
    spline, hose = make_hose()
    x = make_unknowns(3)
    values = np.linalg.eigvalsh(assemble(spline, hose, x, step=0.01, exact=False)[1])
    assert values[0] >= -1e-12 * values[-1]
    v = np.random.default_rng(4).normal(size=len(x))
    viscous = assemble(spline, hose, x, rate=v)[0] - assemble(spline, hose, x)[0]
    # Kelvin-Voigt: the damping matrix is that of 1 / step, which the Gauss-Newton matrix shows.
    matrix = assemble(spline, hose, x, step=1.0)[1] - assemble(spline, hose, x)[1]
    np.testing.assert_allclose(matrix @ v, viscous, atol=1e-9 * np.abs(viscous).max())
    assert v @ viscous > 0.0
