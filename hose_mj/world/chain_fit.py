"""A chain of straight pieces of given lengths that is held where robots hold it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hose_mj.hoses.protocol import Array

_ROUNDS = 50
_TOLERANCE = 1e-13


@dataclass(frozen=True)
class Pin:
    """A point of a chain that is to be at a target.

    Attributes:
        piece: number of the straight piece.
        part: fraction of the piece that lies before the point.
        target: (3,), m.
    """

    piece: int
    part: float
    target: Array


def fit_curve(curve: Array, nodes: Array, arc_lengths: Array, places: Array) -> Array:
    """Returns a chain along a curve.

    Args:
        curve: points even in arc length from 0 to L (n, 3), m.
        nodes: arc lengths of the chain's nodes, rising from 0 to L, (K + 1,), m.
        arc_lengths: of what holds it (k,), m.
        places: where that is (k, 3), m.

    Returns:
        nodes (K + 1, 3), m, near the curve; see `fit_chain`.
    """
    even, lengths = np.linspace(0.0, nodes[-1], len(curve)), np.diff(nodes)
    points = np.stack([np.interp(nodes, even, curve[:, c]) for c in range(3)], axis=1)
    piece = np.clip(np.searchsorted(nodes, arc_lengths, "right") - 1, 0, len(lengths) - 1)
    parts = (arc_lengths - nodes[piece]) / lengths[piece]
    pins = [Pin(int(k), float(part), p) for k, part, p in zip(piece, parts, places, strict=True)]
    return fit_chain(points, lengths, pins)


def fit_chain(points: Array, lengths: Array, pins: list[Pin]) -> Array:
    """Returns nodes near `points` whose distances are `lengths` and that meet the pins.

    Newton's method on these equations, each step the smallest that solves their linear form. What
    cannot be met (pins further apart than the chain is long) is left as it is after so many rounds.

    Args:
        points: (N + 1, 3), m.
        lengths: (N,), m.
        pins: what holds the chain.

    Returns:
        nodes (N + 1, 3), m.
    """
    nodes = points.copy()
    count = len(lengths)
    rows = np.zeros((count + 3 * len(pins), count + 1, 3))
    for k, pin in enumerate(pins):
        block = rows[count + 3 * k : count + 3 * k + 3]
        block[:, pin.piece] = (1.0 - pin.part) * np.eye(3)
        block[:, pin.piece + 1] = pin.part * np.eye(3)
    piece = np.arange(count)
    for _ in range(_ROUNDS):
        chords = np.diff(nodes, axis=0)
        found = np.linalg.norm(chords, axis=1)
        errors = [found - lengths]
        for pin in pins:
            errors.append(nodes[pin.piece] + pin.part * chords[pin.piece] - pin.target)
        error = np.concatenate(errors)
        if np.abs(error).max() < _TOLERANCE * lengths.sum():
            break
        tangents = chords / found[:, None]
        rows[piece, piece], rows[piece, piece + 1] = -tangents, tangents
        change = np.linalg.lstsq(rows.reshape(len(rows), -1), error, rcond=1e-10)[0]
        nodes -= change.reshape(-1, 3)
    return nodes
