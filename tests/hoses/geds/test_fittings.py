"""Pieces of a hose that are made otherwise: mass, and stiffnesses in series."""

import numpy as np
import pytest

from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.spec import Fitting, HoseSpec

EA, EI, GJ, DENSITY = 5e4, 0.05, 0.04, 0.1
X, Y, Z = np.eye(3)
# No edge of theirs is a knot or the edge of a Gauss point's cell.
PIECES = (
    Fitting(start=0.13, end=0.37, axial_stiffness=4 * EA, bending_stiffness=5 * EI),
    Fitting(start=0.411, end=0.435, torsional_stiffness=20 * GJ, linear_density=1.3),
    Fitting(
        start=0.6,
        end=1.0,
        axial_stiffness=0.5 * EA,
        bending_stiffness=0.4 * EI,
        torsional_stiffness=0.3 * GJ,
        linear_density=0.03,
    ),
)


def make_hose(n=16, pieces=PIECES, **options):
    spec = HoseSpec(
        length=1.0,
        axial_stiffness=EA,
        bending_stiffness=EI,
        torsional_stiffness=GJ,
        linear_density=DENSITY,
        fittings=pieces,
    )
    settings = {"gravity": (0, 0, 0), "control_points": n} | options
    return GedsHose(spec, **settings)


@pytest.mark.parametrize("n", [6, 16, 33])
def test_total_mass_is_exact(n):
    mass = 0.024 * 1.3 + 0.4 * 0.03 + 0.576 * DENSITY
    hose = make_hose(n)
    assert hose.spec.mass == pytest.approx(mass, rel=1e-12)
    hose.reset([[0, 0, 0], [1, 0, 0]], velocity=[1.0, -2.0, 0.5])
    np.testing.assert_allclose(hose.momentum().linear, mass * np.array([1.0, -2.0, 0.5]), rtol=1e-9)
    assert hose.energies().kinetic == pytest.approx(0.5 * mass * 5.25, rel=1e-9)


def test_the_weight_is_carried_where_it_is():
    hose = make_hose(33, gravity=(0, 0, -9.81))
    first = hose.clamp(0.0)
    hose.solve_static()
    reaction = hose.reaction(first)
    assert reaction.force[2] == pytest.approx(9.81 * hose.spec.mass, rel=1e-9)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_axial_stiffness_in_series(plane):
    hose = make_hose(plane=plane)
    hose.attach(0.0)
    pull = 0.01 * EA
    hose.apply_force(1.0, pull * X)
    hose.solve_static()
    softness = 0.24 / (4 * EA) + 0.36 / EA + 0.4 / (0.5 * EA)
    assert hose.position(1.0)[0] @ X - 1.0 == pytest.approx(pull * softness, rel=1e-9)
    np.testing.assert_allclose(hose.tension([0.0, 0.3, 1.0]), pull, rtol=1e-8)


@pytest.mark.parametrize("form", ["scalar", "theta"])
def test_torsional_stiffness_in_series(form):
    hose = make_hose(twist=form)
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    hose.move(last, spin=1.0)
    hose.solve_static()
    softness = 0.024 / (20 * GJ) + 0.576 / GJ + 0.4 / (0.3 * GJ)
    # A spline for theta rounds the corners where the stiffness jumps.
    rel = 1e-9 if form == "scalar" else 0.02
    assert hose.reaction(last).moment @ X == pytest.approx(1.0 / softness, rel=rel)


def compute_tip(n, plane, pieces):
    """Deflection of the tip over that of the stepped beam, under a small load there."""
    hose = make_hose(n, pieces, plane=plane)
    hose.clamp(0.0)
    push = 1e-3 * EI
    hose.apply_force(1.0, push * Z)
    hose.solve_static()
    # The integral of (L - s)^2 / EI, piece by piece.
    softness = 1.0 / (3 * EI)
    for piece in pieces:
        if piece.bending_stiffness is not None:
            moment = ((1.0 - piece.start) ** 3 - (1.0 - piece.end) ** 3) / 3
            softness += moment * (1.0 / piece.bending_stiffness - 1.0 / EI)
    return hose.position(1.0)[0] @ Z / (push * softness)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_a_cantilever_with_a_stiffer_piece(plane):
    sleeve = (Fitting(start=0.41, end=0.58, bending_stiffness=3 * EI),)
    errors = [abs(compute_tip(n, plane, sleeve) - 1.0) for n in (12, 24, 96)]
    # Where the knots lie to the edges matters too, so it is not smooth in n.
    assert errors[1] < 0.005, errors
    assert errors[2] < 0.002, errors


@pytest.mark.parametrize("plane", [None, "xz"])
def test_steps_of_a_hard_and_a_soft_piece_converge_with_the_span(plane):
    # The curvature jumps where the stiffness does; that of a cubic spline does not.
    errors = [abs(compute_tip(n, plane, PIECES) - 1.0) for n in (24, 48, 96)]
    assert errors[0] < 0.03, errors
    assert np.all(np.array(errors[1:]) < 0.6 * np.array(errors[:-1])), errors
