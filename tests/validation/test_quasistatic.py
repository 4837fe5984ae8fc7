"""The minimiser of slow towing, against closed forms of its own."""

import numpy as np
import pytest

from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation.motions import TOW_SAMPLES, compute_tow, compute_tow_place, tow_chain

SPEC = HoseSpec(
    length=1.0,
    axial_stiffness=100.0,
    bending_stiffness=1e-8,
    torsional_stiffness=0.0,
    linear_density=0.1,
)
DRAG = 0.5 * 0.1 * 9.81
"""Friction per length at mu = .5 (N/m)."""


def make_straight(n_links):
    return np.stack([np.linspace(0.0, 1.0, n_links + 1), np.zeros(n_links + 1)], axis=1)


def test_a_chain_pulled_along_itself_stretches_under_its_friction():
    path = np.stack([1.0 + 0.02 * np.arange(1, 11), np.zeros(10)], axis=1)
    (*_, nodes) = tow_chain(SPEC, 0.5, make_straight(50), path, 1e-5)
    # Tension DRAG s from the free end on, hence a stretch of DRAG L^2 / (2 EA).
    length = nodes[-1, 0] - nodes[0, 0]
    assert length - 1.0 == pytest.approx(DRAG / (2 * 100.0), rel=1e-3)
    strain = np.diff(nodes[:, 0]) * 50 - 1.0
    middles = (np.arange(50) + 0.5) / 50
    np.testing.assert_allclose(strain * 100.0, DRAG * middles, atol=2e-2 * DRAG)


def test_a_pull_too_weak_to_reach_the_end_moves_only_a_part():
    # The end moved by u drags the last ell with it: u = DRAG ell^2 / (2 EA).
    moved = DRAG * 0.4**2 / (2 * 100.0)
    path = np.stack([1.0 + moved * np.arange(1, 11) / 10, np.zeros(10)], axis=1)
    (*_, nodes) = tow_chain(SPEC, 0.5, make_straight(200), path, 1e-9)
    shift = nodes[:, 0] - make_straight(200)[:, 0]
    s = np.linspace(0.0, 1.0, 201)
    wanted = DRAG * np.maximum(s - 0.6, 0.0) ** 2 / (2 * 100.0)
    np.testing.assert_allclose(shift, wanted, atol=0.01 * moved)


def test_a_limp_chain_towed_sideways_follows_the_tractrix():
    # Beyond the bend a limp inextensible chain slides along itself: every point follows the one
    # ahead, and far from the corner the free end has not moved sideways.
    limp = HoseSpec(
        length=1.0,
        axial_stiffness=1e4,
        bending_stiffness=1e-9,
        torsional_stiffness=0.0,
        linear_density=0.1,
    )
    path = np.stack([np.ones(400), 0.3 * np.arange(1, 401) / 400], axis=1)
    (*_, nodes) = tow_chain(limp, 0.5, make_straight(100), path, 1e-6)
    lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    np.testing.assert_allclose(lengths, 0.01, rtol=1e-3)
    assert abs(nodes[0, 1]) < 0.01
    assert nodes[-1, 1] == pytest.approx(0.3)


def test_a_stiff_chain_turns_about_a_point_inside():
    # A rigid rod on a rough floor pushed sideways at its end turns about the point at 1 / sqrt 2 of
    # its length from there: the moment of friction about the pushed end vanishes.
    stiff = HoseSpec(
        length=1.0,
        axial_stiffness=1e4,
        bending_stiffness=1e4,
        torsional_stiffness=0.0,
        linear_density=0.1,
    )
    path = np.stack([np.ones(20), 1e-3 * np.arange(1, 21) / 20], axis=1)
    (*_, nodes) = tow_chain(stiff, 0.5, make_straight(200), path, 1e-8)
    still = np.interp(0.0, nodes[:, 1], np.linspace(0.0, 1.0, 201))
    assert 1.0 - still == pytest.approx(1 / np.sqrt(2), abs=5e-3)


def test_the_figure_of_eight_is_even_closed_and_crosses_itself():
    places = compute_tow_place(np.linspace(0.0, 1.0, 201))
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    np.testing.assert_allclose(steps, steps.mean(), rtol=0.02)
    np.testing.assert_allclose(places[[0, 100, 200]], [[1.0, 0.0]] * 3, atol=1e-9)


def test_the_reference_of_the_tow_is_close_to_its_coarser_self():
    reference = compute_tow()
    assert reference.values.shape == (TOW_SAMPLES + 1, 33)
    assert 0.0 < reference.uncertainty < 2e-3
