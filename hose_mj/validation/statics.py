"""The static cases: equilibria, frequencies and critical loads with a closed form."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import numpy as np

from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.validation import reference
from hose_mj.validation.case import (
    BENDING_STIFFNESS,
    CHAIN,
    GRAVITY,
    LENGTH,
    LINEAR_DENSITY,
    STOUT,
    UNIT_FREQUENCY,
    WEIGHT,
    Case,
    find_tip,
    lay_between,
    lay_cantilever,
    lay_free,
    lay_pinned,
)
from hose_mj.validation.modes import compute_critical_load, compute_frequencies


def make_heavy_cantilever(gamma: float) -> Case:
    """A cantilever under its own weight, gamma = rho A g L^3 / EI."""

    def probe(hose: HoseModel) -> Array:
        hose.solve_static()
        x, _, z = find_tip(hose)
        return np.array([-z / x])

    return Case(
        id=f"heavy-cantilever-gamma-{gamma:g}",
        family="heavy-cantilever",
        title=f"Heavy cantilever, Gamma = {gamma:g}",
        about="A horizontal cantilever sags under its own weight, Gamma = rho A g L^3 / EI. "
        "Compared: drop of the tip over its distance from the wall, with the elastica.",
        spec=STOUT,
        gravity=(0.0, 0.0, -gamma * BENDING_STIFFNESS / (LINEAR_DENSITY * LENGTH**3)),
        lay=lay_cantilever,
        probe=probe,
        truth=lambda: np.array([reference.heavy_cantilever(gamma)]),
        clamped=True,
    )


def make_tip_load(alpha: float) -> Case:
    """A cantilever under a transverse tip load, alpha = P L^2 / EI."""

    def probe(hose: HoseModel) -> Array:
        hose.apply_force(LENGTH, (0.0, 0.0, -alpha * BENDING_STIFFNESS / LENGTH**2))
        hose.solve_static()
        x, _, z = find_tip(hose)
        return np.array([LENGTH - x, -z])

    return Case(
        id=f"tip-load-{alpha:g}",
        family="tip-load",
        title=f"Cantilever with a tip load, P L^2 / EI = {alpha:g}",
        about="A weightless cantilever carries a transverse load at its tip. Compared: axial and "
        "transverse displacement of the tip, with the elastica.",
        spec=STOUT,
        gravity=(0.0, 0.0, 0.0),
        lay=lay_cantilever,
        probe=probe,
        truth=lambda: np.array(reference.tip_load(alpha)) * LENGTH,
        clamped=True,
    )


def make_end_moment(turn: float, name: str) -> Case:
    """A cantilever under an end moment, turn = M L / EI."""

    def probe(hose: HoseModel) -> Array:
        hose.apply_moment(LENGTH, (0.0, turn * BENDING_STIFFNESS / LENGTH, 0.0))
        hose.solve_static()
        x, _, z = find_tip(hose)
        return np.array([x, -z])

    return Case(
        id=f"end-moment-{name}",
        family="end-moment",
        title=f"Cantilever rolled up by an end moment, M L / EI = {name}",
        about="A moment at the tip bends a weightless cantilever into an arc of a circle, closed "
        "at 2 pi. Compared: the place of the tip, as a fraction of the length.",
        spec=STOUT,
        gravity=(0.0, 0.0, 0.0),
        lay=lay_cantilever,
        probe=probe,
        truth=lambda: np.array(reference.end_moment(turn)) * LENGTH,
        scale=LENGTH,
        clamped=True,
    )


def make_frequencies(ends: str) -> Case:
    """Bending frequencies of a straight hose: its ends as in reference.beam_frequencies."""

    def lay(hose: HoseModel) -> list[Hold]:
        if ends == "free-free":
            return lay_free(hose)
        holds = lay_cantilever(hose)
        if ends == "clamped-pinned":
            holds.append(hose.attach(LENGTH, (LENGTH, 0.0, 0.0)))
        return holds

    def probe(hose: HoseModel) -> Array:
        found = compute_frequencies(hose.linearize(), 3, above=0.1 * UNIT_FREQUENCY)
        return np.asarray(found / UNIT_FREQUENCY)

    return Case(
        id=f"frequencies-{ends}",
        family="frequencies",
        title=f"First three bending frequencies, {ends}",
        about="Small vibrations of a straight weightless hose. Compared: omega in units of "
        "sqrt(EI / (rho A L^4)), with Euler and Bernoulli's beam.",
        spec=STOUT,
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        truth=lambda: reference.beam_frequencies(ends),
        clamped=ends != "free-free",
    )


def make_hanging_chain() -> Case:
    """Frequencies of a chain hung at one end."""

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset([[0.0, 0.0, 0.0], [0.0, 0.0, -LENGTH]])
        return [hose.attach(0.0, (0.0, 0.0, 0.0))]

    def probe(hose: HoseModel) -> Array:
        hose.solve_static()
        unit = math.sqrt(GRAVITY / LENGTH)
        return np.asarray(compute_frequencies(hose.linearize(), 3, above=0.1 * unit) / unit)

    return Case(
        id="hanging-chain",
        family="hanging-chain",
        title="First three frequencies of a hanging chain",
        about="Small swings of a chain hung at one end. Compared: omega sqrt(L / g), with half the "
        "zeros of the Bessel function J0.",
        spec=CHAIN,
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay,
        probe=probe,
        truth=reference.chain_frequencies,
    )


def make_catenary() -> Case:
    """A chain between two points of one height."""
    ratio = 1.5
    supports: WeakKeyDictionary[HoseModel, Hold] = WeakKeyDictionary()

    def lay(hose: HoseModel) -> list[Hold]:
        holds = lay_between(hose, LENGTH / ratio)
        supports[hose] = holds[0]
        return holds

    def probe(hose: HoseModel) -> Array:
        hose.solve_static()
        sag = -hose.position(0.5 * LENGTH)[0, 2]
        pull = np.linalg.norm(hose.reaction(supports[hose]).force)
        return np.array([sag / LENGTH, pull / WEIGHT])

    return Case(
        id="catenary",
        family="catenary",
        title="Catenary, length 1.5 times the span",
        about="A chain hangs between two points of one height. Compared: sag over length and pull "
        "on a support over weight, with the catenary.",
        spec=CHAIN,
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay,
        probe=probe,
        truth=lambda: np.array(reference.catenary(ratio)),
    )


def make_euler_buckling(ends: str) -> Case:
    """Critical thrust: its ends as in reference.euler_load."""
    unit = BENDING_STIFFNESS / LENGTH**2

    def probe(hose: HoseModel) -> Array:
        unloaded = hose.linearize()
        hose.apply_force(LENGTH, (unit, 0.0, 0.0))
        hose.solve_static()
        above = 0.1 * UNIT_FREQUENCY
        return np.array([compute_critical_load(unloaded, hose.linearize(), unit, above) / unit])

    return Case(
        id=f"euler-buckling-{ends}",
        family="euler-buckling",
        title=f"Euler's critical thrust, {ends}",
        about="The thrust under which the straight state loses its stability, from the eigenvalues "
        "of the tangent stiffness, unloaded and under a pull. Compared: P L^2 / EI. Pinned: one "
        "end attached, the thrust on the other keeps its direction; load and shape are the pinned "
        "column's.",
        spec=STOUT,
        gravity=(0.0, 0.0, 0.0),
        lay=lay_cantilever if ends == "clamped-free" else lay_pinned,
        probe=probe,
        truth=lambda: np.array([reference.euler_load(ends)]),
        clamped=ends == "clamped-free",
    )
