"""`CentreLine`: a hose's centre line as pieces of cubic polynomials, whatever the hose's model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hose_mj.hoses.protocol import Array


@dataclass(frozen=True)
class CentreLine:
    """r(s) = sum_j c[k, j] u^j with u = (s - s_k) / (s_(k+1) - s_k) on piece k of K."""

    arc_lengths: Array  # s_k, rising from 0 to L, (K + 1,), m
    coefficients: Array  # c, (K, 4, 3), m; a straight piece has zeros for j = 2, 3

    @classmethod
    def of_spline(cls, arc_lengths: Array, points: Array, slopes: Array) -> CentreLine:
        """The curve that is cubic in each piece, with points (K + 1, 3), m, and dr/ds there.

        Linear in both, so columns may also be what each of n control points counts for.
        """
        lengths = np.diff(arc_lengths)[:, None]
        first, last = lengths * slopes[:-1], lengths * slopes[1:]
        step = points[1:] - points[:-1]
        parts = [points[:-1], first, 3.0 * step - 2.0 * first - last, first + last - 2.0 * step]
        return cls(arc_lengths, np.stack(parts, axis=1))

    @classmethod
    def of_chain(cls, arc_lengths: Array, points: Array) -> CentreLine:
        """Straight pieces between points (K + 1, 3), m."""
        parts = np.zeros((len(points) - 1, 4, 3))
        parts[:, 0], parts[:, 1] = points[:-1], np.diff(points, axis=0)
        return cls(arc_lengths, parts)

    def position(self, arc_lengths: Array) -> Array:
        """Points (k, 3), m, at arc lengths (k,)."""
        k = np.searchsorted(self.arc_lengths, arc_lengths, side="right") - 1
        k = np.clip(k, 0, len(self.coefficients) - 1)
        low, high = self.arc_lengths[k], self.arc_lengths[k + 1]
        u = ((arc_lengths - low) / (high - low))[:, None]
        c = self.coefficients[k]
        return np.asarray(c[:, 0] + u * (c[:, 1] + u * (c[:, 2] + u * c[:, 3])))
