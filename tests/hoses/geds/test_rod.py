"""Theta, twist and unequal bending at the Gauss points: derivatives, invariance, closed forms."""

import numpy as np
import pytest

from hose_mj.hoses.geds import (
    basis,
    energy,
    frames,
    integrators,
    mechanics,
    records,
    rod,
    twist_segments,
)
from hose_mj.hoses.geds.span import make_span
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.spec import HoseSpec

N, LENGTH, AXES = 8, 1.0, (0.0,) * 4
SPEC = HoseSpec(
    length=LENGTH,
    axial_stiffness=50.0,
    bending_stiffness=0.05,
    second_bending_stiffness=0.2,
    torsional_stiffness=0.04,
    linear_density=0.1,
    rest_curvature=2.0,
    rest_torsion=-1.5,
    damping_time=0.1,
)
SPLINE = Spline(N, LENGTH, None, has_theta=True)
HOSE = mechanics.make_constants(SPEC, SPLINE.knots)
GREVILLE = basis.make_greville(SPLINE.knots)
KINDS = ("near-straight", "curved", "wild")
kinds = pytest.mark.parametrize("kind", KINDS)


def make_points(kind, seed=0):
    rng = np.random.default_rng(seed)
    points = np.zeros((N, 3))
    points[:, 0] = GREVILLE
    if kind == "curved":
        points[:, 0], points[:, 1] = np.sin(5 * GREVILLE) / 5, (1 - np.cos(5 * GREVILLE)) / 5
    return points + {"near-straight": 1e-4, "curved": 0.01, "wild": 0.05}[kind] * rng.normal(
        size=(N, 3)
    )


def make_unknowns(kind, seed=0):
    x = np.zeros((N, 4))
    x[:, :3] = make_points(kind, seed)
    x[:, 3] = np.random.default_rng(seed + 100).normal(size=N)
    return x.ravel()


def make_twist(x):
    twist = twist_segments.make_twist(SPLINE, HOSE, [], x)
    rng = np.random.default_rng(7)
    twist.frames[0, 6:9] = rng.normal(size=3)
    frames.transport_frames(AXES, HOSE.tables, twist, x, make_span(), twist.frames)
    twist.accepted[:] = twist.frames
    return twist


def compute_energy(x, twist):
    """The frames go along by one finite rotation, and come back."""
    frames.restore_frames(twist)
    strains = np.zeros((N - 3, 2))
    parts = energy.compute_energy(
        AXES, HOSE.tables, HOSE.elasticity, twist.frames, x, make_span(), strains
    )
    return sum(parts)


def assemble(x, twist, rate=None, step=np.inf, exact=True, hose=HOSE):
    frames.restore_frames(twist)
    size = 4 * N
    gradient, band = np.zeros(size + 16), np.zeros((size + 16, 32))
    speed = np.zeros(size + 16)
    speed[:size] = 0.0 if rate is None else rate
    span = make_span()
    energy.assemble(AXES, hose, twist, 0.0, x, speed, step, exact, span, gradient, band)
    return gradient[:size], mechanics.make_dense(band, size, 16)


def differentiate(function, x, step=1e-4):
    columns = []
    for k in range(len(x)):
        e = np.zeros(len(x))
        e[k] = step
        near, far = function(x + e) - function(x - e), function(x + 2 * e) - function(x - 2 * e)
        columns.append((8 * near - far) / (12 * step))
    return np.array(columns)


@kinds
def test_gradient_is_the_derivative_of_the_energy(kind):
    for seed in range(3):
        x = make_unknowns(kind, seed)
        twist = make_twist(x)
        gradient, _ = assemble(x, twist)
        by_energy = differentiate(lambda y, twist=twist: compute_energy(y, twist), x)
        np.testing.assert_allclose(by_energy, gradient, atol=1e-7 * np.abs(gradient).max())


@kinds
def test_hessian_is_the_symmetric_part_of_the_gradient_s_derivative(kind):
    # The frames' own rotation is not integrable, so what is left over is antisymmetric.
    for seed in range(3):
        x = make_unknowns(kind, seed)
        twist = make_twist(x)
        _, hessian = assemble(x, twist)
        by_gradient = differentiate(lambda y, twist=twist: assemble(y, twist)[0], x)
        symmetric = 0.5 * (by_gradient + by_gradient.T)
        np.testing.assert_allclose(symmetric, hessian, atol=1e-6 * np.abs(hessian).max())


@kinds
def test_gauss_newton_matrix_is_positive_semidefinite(kind):
    x = make_unknowns(kind)
    values = np.linalg.eigvalsh(assemble(x, make_twist(x), step=0.01, exact=False)[1])
    assert values[0] >= -1e-12 * values[-1]


@kinds
def test_viscous_force_dissipates_and_no_rigid_motion_is_damped(kind):
    x = make_unknowns(kind)
    twist = make_twist(x)
    still = assemble(x, twist)[0]
    rng = np.random.default_rng(2)
    v = rng.normal(size=4 * N)
    assert v @ (assemble(x, twist, v)[0] - still) > 0.0
    spin, shift = rng.normal(size=3), rng.normal(size=3)
    rigid = np.zeros((N, 4))
    rigid[:, :3] = np.cross(spin, x.reshape(N, 4)[:, :3]) + shift
    # What a turn of the hose adds to theta: the turn about the tangent beyond the smallest one.
    tangents = twist.frames[: 3 * (N - 3), :3] @ spin
    values = HOSE.tables.value.reshape(-1, 4)
    design = np.zeros((len(values), N))
    for row, value in enumerate(values):
        design[row, row // 3 : row // 3 + 4] = value
    rigid[:, 3] = np.linalg.lstsq(design, tangents, rcond=None)[0]
    force = assemble(x, twist, rigid.ravel())[0] - still
    general = assemble(x, twist, v)[0] - still
    gap = np.abs(design @ rigid[:, 3] - tangents).max()
    assert np.abs(force).max() <= (1e-10 + 20.0 * gap) * np.abs(general).max()


@kinds
def test_turning_the_whole_hose_changes_nothing(kind):
    x = make_unknowns(kind)
    twist = make_twist(x)
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    moved = x.reshape(N, 4).copy()
    moved[:, :3] = moved[:, :3] @ turn.T + rng.normal(size=3)
    turned = make_twist(x)
    for part in (turned.frames, turned.accepted):
        for k in (0, 3, 6):
            part[:, k : k + 3] = twist.frames[:, k : k + 3] @ turn.T
    assert compute_energy(moved.ravel(), turned) == pytest.approx(
        compute_energy(x, twist), rel=1e-9
    )


def test_equal_bending_is_the_energy_without_theta():
    spec = HoseSpec(
        length=LENGTH,
        axial_stiffness=50.0,
        bending_stiffness=0.05,
        torsional_stiffness=0.04,
        linear_density=0.1,
    )
    hose = mechanics.make_constants(spec, SPLINE.knots)
    for kind in KINDS:
        x = make_unknowns(kind)
        twist = make_twist(x)
        strains, span = np.zeros((N - 3, 2)), make_span()
        tables, elasticity = hose.tables, hose.elasticity
        with_theta = energy.compute_energy(AXES, tables, elasticity, twist.frames, x, span, strains)
        points = np.ascontiguousarray(x.reshape(N, 4)[:, :3]).ravel()
        without = energy.compute_energy(
            (0.0,) * 3, tables, elasticity, twist.frames, points, span, strains
        )
        np.testing.assert_allclose(with_theta[:2], without[:2], rtol=1e-9, atol=1e-12)


def test_frames_laid_along_a_helix_turn_with_its_torsion():
    # A helix of radius R and slope p: frames without twist turn by -torsion against its normal.
    n, radius, pitch = 60, 0.1, 0.05
    speed = np.hypot(radius, pitch)
    spline = Spline(n, LENGTH, None, has_theta=True)
    hose = mechanics.make_constants(SPEC, spline.knots)
    s = basis.make_greville(spline.knots)
    angle = s / speed
    helix = np.stack([radius * np.cos(angle), radius * np.sin(angle), pitch * angle], axis=1)
    x = spline.interpolate(s, helix)
    twist = twist_segments.make_twist(spline, hose, [], x)
    twist.frames[0, 6:9] = [-1.0, 0.0, 0.0]
    frames.transport_frames(AXES, hose.tables, twist, x, make_span(), twist.frames)
    count = 3 * (n - 3)
    nodes = (np.cumsum(np.tile(hose.tables.gaps, n - 3)) - 0.5 * hose.tables.gaps[0]) * (
        LENGTH / (n - 3)
    )
    normal = -np.stack([np.cos(nodes / speed), np.sin(nodes / speed), 0.0 * nodes], axis=1)
    tangent, director = twist.frames[:count, :3], twist.frames[:count, 6:9]
    sine = np.einsum("ni,ni->n", np.cross(normal, director), tangent)
    turned = np.unwrap(np.arctan2(sine, np.einsum("ni,ni->n", normal, director)))
    np.testing.assert_allclose(
        turned - turned[0], -pitch / speed**2 * (nodes - nodes[0]), atol=3e-3
    )


def test_laying_frames_anew_keeps_the_material_at_the_clamps_and_the_twist():
    x = make_unknowns("curved")
    x[3::4] = 0.3 * GREVILLE
    spec_clamps = [0.0, 0.45, LENGTH]
    twist = twist_segments.make_twist(SPLINE, HOSE, spec_clamps, x)
    twist.frames[0, 6:9] = [0.0, 0.0, 1.0]
    span = make_span()
    frames.transport_frames(AXES, HOSE.tables, twist, x, span, twist.frames)
    m = len(spec_clamps)
    starts, values = SPLINE.compute_basis(np.array(spec_clamps))
    rows = np.zeros((m, 4, 4))
    rows[:, :, 3] = values[:, 0]
    twist.turn_rows[:] = np.arange(m)
    numbers = np.zeros((3, m))
    holds = records.Constraints(
        starts, rows.reshape(m, 16), *numbers, twist, records.make_response(0)
    )
    # Frames that have gathered a smooth angle, theta that makes up for it.
    nodes = (np.cumsum(np.tile(HOSE.tables.gaps, N - 3)) - 0.5 * HOSE.tables.gaps[0]) * (
        LENGTH / (N - 3)
    )
    places = np.concatenate([nodes, spec_clamps])
    gathered = 0.4 * places**2
    for row, angle in enumerate(gathered):
        t, d = twist.frames[row, :3].copy(), twist.frames[row, 6:9].copy()
        twist.frames[row, 6:9] = np.cos(angle) * d + np.sin(angle) * np.cross(t, d)
    twist.frames[: len(nodes), 9] = 0.8 * nodes
    theta = SPLINE.evaluate_theta(np.array(spec_clamps), x)
    holds.before[:] = theta
    before = SPLINE.evaluate_theta(nodes, x, 1) + twist.frames[: len(nodes), 9]
    state = integrators.make_state(4 * N)
    state.x[:] = x
    frames.reset_frames(AXES, HOSE, holds, state, span)
    assert np.all(twist.frames[: len(nodes), 9] == 0.0)
    after = SPLINE.evaluate_theta(nodes, state.x, 1)
    np.testing.assert_allclose(after, before, atol=5e-3)
    wanted = theta + gathered[-m:] - gathered[0]
    np.testing.assert_allclose(holds.before, wanted, atol=1e-3)
    found = SPLINE.evaluate_theta(np.array(spec_clamps), state.x)
    np.testing.assert_allclose(found, holds.before, atol=1e-7)


def test_cosine_and_sine_are_as_exact_as_the_angle():
    rng = np.random.default_rng(4)
    corners = np.arange(-40, 41) * np.pi / 4
    for angle in np.concatenate([rng.uniform(-4, 4, 500), rng.uniform(-2e3, 2e3, 500), corners]):
        found = rod.compute_cosine_and_sine(angle)
        np.testing.assert_allclose(
            found, [np.cos(angle), np.sin(angle)], rtol=0, atol=4e-16 * (1.0 + abs(angle))
        )
    assert rod.compute_cosine_and_sine(0.0) == (1.0, 0.0)
    assert np.all(np.isnan(rod.compute_cosine_and_sine(np.nan)))
