"""Small motions of any hose model: frequencies and critical loads from `HoseModel.linearize`."""

import math

import numpy as np
from scipy.linalg import eigh, null_space
from scipy.optimize import brentq

from hose_mj.hoses.protocol import Array, Linearization

_SAME = 1e-4  # relative distance below which two frequencies count as one mode seen in two planes


def compute_frequencies(small: Linearization, n_modes: int, above: float) -> Array:
    """Returns the first distinct angular frequencies, shape (n_modes,), rad/s.

    Args:
        small: mass, stiffness and constraints.
        n_modes: how many; modes in two planes of one frequency count once.
        above: frequencies below this are rigid motions (rad/s).
    """
    basis = _free_basis(small)
    stiffness = basis.T @ small.stiffness @ basis
    squares = eigh(0.5 * (stiffness + stiffness.T), basis.T @ small.mass @ basis, eigvals_only=True)
    frequencies = np.sqrt(np.maximum(squares, 0.0))
    distinct: list[float] = []
    for value in frequencies[frequencies > above]:
        if not distinct or value > distinct[-1] * (1.0 + _SAME):
            distinct.append(float(value))
    return np.array(distinct[:n_modes])


def compute_critical_load(
    unloaded: Linearization, pulled: Linearization, pull: float, above: float
) -> float:
    """Returns the smallest thrust at which the straight state loses its stability (N).

    The stiffness of a straight, nearly inextensible hose is linear in its tension, K0 + T Kg, so
    two linearizations, unloaded and under a pull, give the thrusts P with K0 z = P Kg z. Solved in
    the form K0 z = theta (K0 + pull Kg) z, P = pull theta / (1 - theta), whose right side is
    positive definite. Rigid rotations have theta = 0 and are left out; so are, before, motions that
    swing below `above` (rad/s) even under the pull, such as a spin about the axis.
    """
    basis = _free_basis(unloaded)
    right = basis.T @ pulled.stiffness @ basis
    squares, modes = eigh(0.5 * (right + right.T), basis.T @ pulled.mass @ basis)
    basis = basis @ modes[:, squares > above**2]
    left = basis.T @ unloaded.stiffness @ basis
    right = basis.T @ pulled.stiffness @ basis
    theta = eigh(0.5 * (left + left.T), 0.5 * (right + right.T), eigvals_only=True)
    lowest = float(np.min(theta[theta > 1e-3]))
    return pull * lowest / (1.0 - lowest)


def compute_critical_twist(
    untwisted: Linearization, twisted: Linearization, twist: float, n_neutral: int = 0
) -> float:
    """Returns the twist at which a state that twist does not move loses its stability.

    The stiffness of a straight rod or a flat ring is linear in its twist, K0 + M K1, so two
    linearizations, without twist and with some, tell K1. Sought is the M at which the lowest
    eigenvalue, neutral modes left out, vanishes.

    Args:
        untwisted: the state without twist.
        twisted: the same with twist, below the critical one.
        twist: how much, an angle or a moment; the answer is in the same unit.
        n_neutral: modes that cost no energy whatever the twist.
    """
    basis = _free_basis(untwisted)
    start = basis.T @ untwisted.stiffness @ basis
    change = (basis.T @ twisted.stiffness @ basis - start) / twist

    def compute_lowest(moment: float) -> float:
        stiffness = start + moment * change
        return float(np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))[n_neutral])

    high = twist
    while compute_lowest(high) > 0.0:
        high *= 1.3
    return float(brentq(compute_lowest, 0.0, high, xtol=1e-9 * twist))


def turn_about_x(small: Linearization, angle: float) -> Linearization:
    """Returns a linearization whose coordinates are vectors of the world, all turned about x."""
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    whole = np.kron(np.eye(len(small.mass) // 3), turn)
    return Linearization(
        whole @ small.mass @ whole.T, whole @ small.stiffness @ whole.T, small.constraints @ whole.T
    )


def _free_basis(small: Linearization) -> Array:
    """Orthonormal basis of the motions that the constraints allow, (m, free)."""
    if len(small.constraints) == 0:
        return np.eye(len(small.mass))
    return np.asarray(null_space(small.constraints, rcond=1e-10))
