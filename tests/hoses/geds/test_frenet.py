"""The literal twist strain of GEDS: right on a well-bent curve, and where it fails."""

import numpy as np
import pytest

from hose_mj import HoseSpec, InputError
from hose_mj.hoses.geds import basis, energy, frames, mechanics, twist_segments
from hose_mj.hoses.geds.hose import GedsHose
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
PLAIN = HoseSpec(
    length=LENGTH,
    axial_stiffness=2e4,
    bending_stiffness=0.05,
    torsional_stiffness=0.04,
    linear_density=0.1,
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
    twist = twist_segments.make_twist(spline, hose, [], x)
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


# -- where it is right -----------------------------------------------------------------------------


def test_on_a_helix_it_is_the_twist_of_the_material():
    # The normal of a helix turns by rise / (radius^2 + rise^2) against frames without twist.
    n, radius, rise = 60, 0.2, 0.1
    torsion = rise / (radius**2 + rise**2)
    spline, hose = make_hose(n, PLAIN)
    s = basis.make_greville(spline.knots)
    x = spline.interpolate(s, make_helix(radius, rise, s))
    x[3::4] = 0.7 * s
    wanted = 0.5 * PLAIN.torsional_stiffness * (0.7 + torsion) ** 2
    assert measure(hose, x)[2] == pytest.approx(wanted, rel=1e-4)
    by_theta = mechanics.make_constants(PLAIN, spline.knots)
    twist = twist_segments.make_twist(spline, by_theta, [], x)
    twist.frames[0, 6:9] = [-1.0, 0.0, 0.0]
    x[3::4] += torsion * s
    frames.transport_frames(AXES, by_theta.tables, twist, x, make_span(), twist.frames)
    twist_energy = energy.compute_energy(
        *(AXES, by_theta.tables, by_theta.elasticity, twist.frames, x),
        *(make_span(), np.zeros((n - 3, 2))),
    )
    assert twist_energy[2] == pytest.approx(wanted, rel=1e-4)
    assert twist_energy[:2] == pytest.approx(measure(hose, x)[:2], rel=1e-9)


def test_a_clamp_holds_theta_and_spins_it():
    hose = GedsHose(PLAIN, control_points=12, twist="frenet", timestep=1e-3, gravity=(0, 0, 0))
    hose.reset(lambda s: make_helix(0.2, 0.1, s))
    hose.clamp(0.0)
    end = hose.clamp(LENGTH)
    hose.move(end, spin=0.05)
    hose.step()
    theta = hose.snapshot()["state"]["x"][3::4]
    assert theta[0] == pytest.approx(0.0, abs=1e-12)
    assert theta[-1] == pytest.approx(0.05, abs=1e-12)
    # The torque at the clamps is that of twist beyond none: both ends are turned against it.
    assert np.all(hose.torque([0.3, 0.5, 0.7]) > 0.0)


# -- where it fails --------------------------------------------------------------------------------


@pytest.mark.parametrize("bulge", [1e-2, 1e-4, 1e-6])
def test_a_hose_straight_to_a_millionth_has_the_torsion_of_a_bent_one(bulge):
    # y = e s^2, z = e s^3, which a cubic is exactly: torsion 3 / (1 + 9 s^2 + 9 e^2 s^4).
    hose = GedsHose(PLAIN, control_points=10, twist="frenet")
    hose.reset(lambda s: np.stack([s, bulge * s**2, bulge * s**3], axis=1))
    s = np.linspace(0.0, LENGTH, 50)
    torsion = 3.0 / (1.0 + 9.0 * s**2 + 9.0 * bulge**2 * s**4)
    np.testing.assert_allclose(hose.twist(s), torsion, rtol=1e-6)
    found = hose.energies()
    # The integral of 9 / (1 + 9 s^2)^2, for a hose that is as good as straight.
    stored = 0.5 * PLAIN.torsional_stiffness * 9.0 * (0.05 + np.arctan(3.0) / 6.0)
    assert found.twisting == pytest.approx(stored, rel=2e-3)
    assert found.bending <= 2.1 * PLAIN.bending_stiffness * 4.0 * bulge**2


@pytest.mark.parametrize("width", [0.2, 0.1, 0.05])
def test_an_inflection_stores_the_more_twist_the_flatter_the_curve(width):
    # y'' = e s, z'' = e w: the normal turns by almost pi within the width w, at w / (w^2 + s^2).
    bulge = 1e-4
    hose = GedsHose(PLAIN, control_points=64, twist="frenet")
    at = np.linspace(0.0, LENGTH, 500)
    hose.reset(
        lambda s: np.stack(
            [s, bulge * (s - 0.5) ** 3 / 6.0, bulge * width * (s - 0.5) ** 2 / 2.0], axis=1
        )
    )
    np.testing.assert_allclose(
        np.abs(hose.twist(at)), width / (width**2 + (at - 0.5) ** 2), rtol=1e-4
    )
    integral = 0.5 / (0.25 + width**2) + np.arctan(0.5 / width) / width
    stored = 0.5 * PLAIN.torsional_stiffness * integral
    found = hose.energies()
    assert found.twisting == pytest.approx(stored, rel=1e-3)
    assert found.twisting > 1e5 * found.bending


def test_it_jumps_at_knots_however_straight_the_hose():
    # y = e s^2, z = e s^4: r''' jumps by the span's length times z'''' = 24 e, the torsion by y''
    # times that over y''^2 + z''^2.
    n = 15
    span = LENGTH / (n - 3)
    knots = span * np.arange(3, n - 5)  # those that the ends of the interpolation do not disturb
    wanted = 48.0 * span / (4.0 + 144.0 * knots**4)
    assert wanted[0] > 0.8
    for bulge in (1e-2, 1e-6):
        hose = GedsHose(PLAIN, control_points=n, twist="frenet")
        hose.reset(lambda s, bulge=bulge: np.stack([s, bulge * s**2, bulge * s**4], axis=1))
        jumps = hose.twist(knots + 1e-9) - hose.twist(knots - 1e-9)
        np.testing.assert_allclose(jumps, wanted, rtol=0.05)


def solve_cantilever(form, n):
    """Tip and largest twist of a straight hose that two forces bend out of one plane."""
    hose = GedsHose(PLAIN, control_points=n, twist=form, gravity=(0.0, 0.0, 0.0))
    hose.clamp(0.0)
    hose.apply_force(0.5, (0.0, 0.4, 0.0))
    hose.apply_force(LENGTH, (0.0, 0.0, 0.1))
    hose.solve_static()
    twist = np.abs(hose.twist(np.linspace(0.0, LENGTH, 200))).max()
    return hose.position(LENGTH)[0], twist


def test_a_cantilever_bent_in_two_planes_comes_out_twisted_and_in_the_wrong_place():
    # No torque acts on its free end, so there is no twist.
    tip, no_twist = solve_cantilever("scalar", 32)
    assert no_twist == 0.0
    near, little = solve_cantilever("theta", 8)
    assert np.linalg.norm(near - tip) < 8e-4
    assert little < 0.02
    far, much = solve_cantilever("frenet", 8)
    assert np.linalg.norm(far - tip) > 3e-3
    assert much > 5.0


@pytest.mark.parametrize(
    ("change", "options"),
    [
        ({"second_bending_stiffness": 0.1}, {}),
        ({"rest_curvature": 1.0}, {}),
        ({"torsional_stiffness": 0.0}, {}),
        ({}, {"plane": "xz"}),
        ({}, {"scheme": "verlet"}),
    ],
)
def test_what_it_cannot_do_is_refused(change, options):
    numbers = {
        **{"length": 1.0, "axial_stiffness": 100.0, "bending_stiffness": 0.05},
        **{"torsional_stiffness": 0.04, "linear_density": 0.1},
    }
    with pytest.raises(InputError):
        GedsHose(HoseSpec(**numbers | change), twist="frenet", **options)


def test_it_takes_no_director():
    hose = GedsHose(PLAIN, twist="frenet")
    with pytest.raises(InputError, match="director"):
        hose.clamp(0.0, director=(0.0, 1.0, 0.0))
