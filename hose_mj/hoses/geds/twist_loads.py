"""Point moments along the tangent of a hose with scalar twist: who carries them, and how much.

A moment M along the tangent at s is carried by what holds the material against turning. In a
segment between two clamps, with compliance c in all and c' beyond s, the moment about the tangent
is M c' / c before s and M c' / c - M after it: the angle between the clamps stays as it is, so its
mean over the compliance is zero, and the moment Phi / c of twist.py comes on top. Between the last
clamp and a free end all of M goes to that clamp. Where no clamp is, nothing balances the moments;
the hose would spin about its axis ever faster, each section with its share of the inertia, which
leaves M (s / L) before and M (s / L - 1) after. A loop without clamps is the same but for its mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.records import Hose
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.geds.twist import Twist
from hose_mj.hoses.geds.twist_segments import make_weights, measure_compliance
from hose_mj.hoses.protocol import Array

_NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(3)[0]


class Stretch(NamedTuple):
    """From `start` to `end` (m) the moment goes in a straight line from `first` to `last` (N m)."""

    start: float
    end: float
    first: float
    last: float


def list_shares(
    spline: Spline, hose: Hose, twist: Twist, place: float, is_closed: bool
) -> list[Stretch]:
    """Returns where one newton metre along the tangent at a place is carried, and with what sign.

    `twist` has the clamps; in a closed loop its first and its last hold nothing.
    """
    length = spline.length
    clamps = twist.places * hose.tables.span_length
    if len(clamps) - 2 * is_closed <= 0:
        shift = (0.5 - place / length) if is_closed else 0.0
        at = place / length + shift
        return [Stretch(0.0, place, shift, at), Stretch(place, length, at - 1.0, shift)]
    if not is_closed and place <= clamps[0]:
        return [Stretch(place, float(clamps[0]), -1.0, -1.0)]
    if not is_closed and place >= clamps[-1]:
        return [Stretch(float(clamps[-1]), place, 1.0, 1.0)]
    parts = _find_segment(clamps, twist, place)
    n_spans = len(hose.tables.first)
    after, total = 0.0, 0.0
    for start, end, is_after in parts:
        own = measure_compliance(hose, make_weights(spline, n_spans, start, end))
        total += own
        after += own * is_after
    share = after / total
    return [Stretch(a, b, share - is_after, share - is_after) for a, b, is_after in parts]


def _find_segment(clamps: Array, twist: Twist, place: float) -> list[tuple[float, float, bool]]:
    """Returns the pieces of the segment around a place, cut there: start, end, whether after it."""
    n_segments = len(twist.angle)
    for k in range(n_segments):
        # The piece across the joint of a loop comes before the first.
        numbers = [*range(n_segments, len(twist.ends)), 0] if k == 0 else [k]
        pieces = [tuple(map(float, clamps[twist.ends[number]])) for number in numbers]
        if any(start <= place <= end for start, end in pieces):
            break
    parts, is_after = [], False
    for start, end in pieces:
        if start <= place <= end and not is_after:
            parts += [(start, place, False), (place, end, True)]
            is_after = True
        else:
            parts.append((start, end, is_after))
    return parts


def weigh_shares(spline: Spline, hose: Hose, shares: list[Stretch]) -> Array:
    """Returns the shares times the length that each Gauss point stands for, (S, 3), m."""
    n_spans = len(hose.tables.first)
    nodes = (np.arange(n_spans)[:, None] + _NODES) * hose.tables.span_length
    weights = np.zeros((n_spans, 3))
    for start, end, first, last in shares:
        if end > start:
            value = first + (last - first) * (nodes - start) / (end - start)
            weights += value * make_weights(spline, n_spans, start, end)
    return weights


def make_loaded(
    spline: Spline, twist: Twist, places: Array, moments: Array, shares: Array
) -> Twist:
    """Returns the twist with k point moments (k, 3) at arc lengths (k,), and their shares."""
    starts, values = spline.compute_basis(places)
    return twist._replace(
        load_starts=starts,
        load_slopes=np.ascontiguousarray(values[:, 1]),
        load_moments=moments,
        load_shares=shares,
    )


@dataclass(frozen=True)
class AppliedTorque:
    """What all point moments together make of the moment about the tangent, in straight lines.

    Attributes:
        edges: arc lengths between which it is one straight line, ascending, (B + 1,), m.
        first, last: its values at the beginning and at the end of each line, (B,), N m.
    """

    edges: Array
    first: Array
    last: Array

    @classmethod
    def add_up(cls, length: float, stretches: list[Stretch]) -> AppliedTorque:
        """Returns the sum of stretches on a hose of that length."""
        ends = [end for one in stretches for end in (one.start, one.end)]
        edges = np.unique(np.array([0.0, length, *ends]))
        first, last = np.zeros((2, len(edges) - 1))
        middles = 0.5 * (edges[:-1] + edges[1:])
        for one in stretches:
            if one.end > one.start:
                inside = (middles > one.start) & (middles < one.end)
                slope = (one.last - one.first) / (one.end - one.start)
                first[inside] += one.first + slope * (edges[:-1][inside] - one.start)
                last[inside] += one.first + slope * (edges[1:][inside] - one.start)
        return cls(edges, first, last)

    def evaluate(self, s: Array) -> Array:
        """Returns the moment (k,), N m, at arc lengths (k,): where it jumps, that before."""
        line = np.clip(np.searchsorted(self.edges, s, side="left") - 1, 0, len(self.first) - 1)
        part = (s - self.edges[line]) / (self.edges[line + 1] - self.edges[line])
        return np.asarray(self.first[line] + (self.last[line] - self.first[line]) * part)

    def measure_jump(self, s: float) -> float:
        """Returns the moment before s less that after it, N m; beyond the ends it is zero."""
        before = float(self.evaluate(np.array([s]))[0]) if s > self.edges[0] else 0.0
        line = int(np.searchsorted(self.edges, s, side="right")) - 1
        if line >= len(self.first):
            return before
        part = (s - self.edges[line]) / (self.edges[line + 1] - self.edges[line])
        return before - float(self.first[line] + (self.last[line] - self.first[line]) * part)

    def integrate(self, spline: Spline, hose: Hose, start: float, end: float) -> float:
        """Returns the angle (rad) by which it twists the hose between two arc lengths."""
        angle = 0.0
        for line in range(len(self.first)):
            low, high = max(start, self.edges[line]), min(end, self.edges[line + 1])
            if low < high and (self.first[line] != 0.0 or self.last[line] != 0.0):
                weights = make_weights(spline, len(hose.tables.first), low, high)
                middle = float(self.evaluate(np.array([0.5 * (low + high)]))[0])
                angle += middle * measure_compliance(hose, weights)
        return angle

    def compute_energy(self, spline: Spline, hose: Hose) -> float:
        """Returns half the integral of its square over GJ (J)."""
        energy = 0.0
        for line, (first, last) in enumerate(zip(self.first, self.last, strict=True)):
            if first != 0.0 or last != 0.0:
                start, end = self.edges[line : line + 2]
                weights = make_weights(spline, len(hose.tables.first), float(start), float(end))
                square = (first * first + first * last + last * last) / 3.0
                energy += 0.5 * square * measure_compliance(hose, weights)
        return energy
