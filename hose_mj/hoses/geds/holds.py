"""`HoldSet`: the clamps and attachments of a hose, as rows of G x = g (thesis A.3).

An attachment is d rows, r(s) = position. A clamp has d - 1 more, r'(s) . e = 0 for unit vectors e
across the wanted tangent: the hose may stretch through it, but not turn. The rows' multipliers are
the forces that a hold does to the hose, in space and on r'.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds import solver
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.model import Array, Hold, Reaction


@dataclass
class _Held:
    """One hold: where it is wanted at the end of the next step, and its multipliers."""

    hold: Hold
    position: Array  # (3,)
    tangent: Array | None  # (3,), unit
    multipliers: Array  # (d,) or (2 d - 1,)
    first: int = 0  # its first row of G x = g


class HoldSet:
    """All holds of one hose.

    Args:
        spline: the hose's geometry.

    Attributes:
        rows: what the kernels read and write; made anew by every change.
    """

    def __init__(self, spline: Spline) -> None:
        self._spline = spline
        self._held: list[_Held] = []
        self._n_made = 0
        self.rows = solver.Holds(
            np.zeros(0, dtype=np.int64),
            np.zeros((0, 4 * spline.dimension)),
            *(np.zeros(0) for _ in range(3)),
        )

    @property
    def n_rows(self) -> int:
        """Rows of G."""
        return len(self.rows.start)

    def clear(self, x: Array) -> None:
        """Drops all holds; their numbers are not used again."""
        self._held = []
        self._rebuild(x)

    def add(
        self, arc_length: float, position: ArrayLike | None, tangent: Array | None, x: Array
    ) -> Hold:
        """Adds a hold.

        Args:
            arc_length: where on the hose (m).
            position: wanted place (3,) m; None for where the hose is now.
            tangent: wanted unit tangent (3,) of a clamp; None for an attachment.
            x: the hose's control points, (n d,).

        Raises:
            InputError: a place off the hose or that another hold is at, a position off its plane.
        """
        spline = self._spline
        s = spline.check_place(arc_length)
        for held in self._held:
            if abs(held.hold.arc_length - s) < 1e-9 * spline.length:
                raise InputError("arc_length", s, "a place that no other hold is at")
        if position is None:
            point = spline.evaluate(np.array([s]), x)[0] + spline.offset
        else:
            point = spline.check_position(position)
        hold = Hold(self._n_made, s, tangent is not None)
        n_rows = spline.dimension if tangent is None else 2 * spline.dimension - 1
        self._n_made += 1
        self._held.append(_Held(hold, point, tangent, np.zeros(n_rows)))
        self._rebuild(x)
        return hold

    def move(
        self, hold: Hold, position: ArrayLike | None, tangent: ArrayLike | None, x: Array
    ) -> None:
        """Sets where a hold is to be at the end of the next step; see `HoseModel.move`.

        Raises:
            InputError: a hold that is not here, a vector out of the plane, a tangent for an
                attachment; nothing has changed then.
        """
        held = self._find(hold)
        if tangent is not None and held.tangent is None:
            raise InputError("tangent", tangent, "None for an attachment (use clamp)")
        point = held.position if position is None else self._spline.check_position(position)
        aim = held.tangent if tangent is None else self._spline.check_direction(tangent)
        held.position, held.tangent = point, aim
        if tangent is None:
            self._aim(held, x)
        else:
            self._rebuild(x)

    def release(self, hold: Hold, x: Array) -> None:
        """Drops one hold; raises `InputError` for one that is not here."""
        self._held.remove(self._find(hold))
        self._rebuild(x)

    def reaction(self, hold: Hold, x: Array) -> Reaction:
        """Force and moment of a hold on the hose at the end of the last step, world frame."""
        held = self._find(hold)
        d = self._spline.dimension
        force = np.zeros(3)
        force[self._spline.dims] = held.multipliers[:d]
        moment = np.zeros(3)
        if held.tangent is not None:
            # A force f on r' works like the moment r' x f.
            slope = self._spline.evaluate(np.array([hold.arc_length]), x, 1)[0]
            moment = np.cross(slope, held.multipliers[d:] @ self._across(held.tangent))
        return Reaction(force, moment)

    # -- state ---------------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """All of it as arrays, plain numbers and containers of them."""
        held = [
            {
                "number": one.hold.number,
                "arc_length": one.hold.arc_length,
                "position": one.position.copy(),
                "tangent": None if one.tangent is None else one.tangent.copy(),
                "multipliers": one.multipliers.copy(),
            }
            for one in self._held
        ]
        return {"held": held, "n_made": self._n_made, "before": self.rows.before.copy()}

    def restore(self, state: dict[str, Any], x: Array) -> None:
        """Returns to a snapshot; x are the control points of the same moment."""
        self._held = [
            _Held(
                Hold(one["number"], one["arc_length"], one["tangent"] is not None),
                one["position"].copy(),
                None if one["tangent"] is None else one["tangent"].copy(),
                one["multipliers"].copy(),
            )
            for one in state["held"]
        ]
        self._n_made = max(self._n_made, state["n_made"])
        self._rebuild(x)
        self.rows.before[:] = state["before"]

    # -- inside --------------------------------------------------------------------------------

    def _find(self, hold: Hold) -> _Held:
        for held in self._held:
            if held.hold == hold:
                return held
        raise InputError("hold", hold, "a hold of this hose that was not released")

    def _across(self, tangent: Array) -> Array:
        """Unit vectors of the hose's space that are normal to a tangent, (d - 1, 3)."""
        if self._spline.dimension == 2:
            return np.cross(self._spline.normal, tangent)[None]
        away = np.eye(3)[int(np.argmin(np.abs(tangent)))]
        first = np.cross(tangent, away)
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(tangent, first)])

    def _rebuild(self, x: Array) -> None:
        """Makes the rows of G x = g from the list of holds: positions first, then slopes across.

        `before` is what x meets now, so a hold that was moved goes its way within the next step
        and not before it begins.
        """
        d = self._spline.dimension
        m = sum(len(held.multipliers) for held in self._held)
        start = np.zeros(m, dtype=np.int64)
        coefficients, before, after = np.zeros((m, 4 * d)), np.zeros(m), np.zeros(m)
        multipliers = np.zeros(m)
        first = 0
        for held in self._held:
            own = slice(first, first + len(held.multipliers))
            places, values = self._spline.compute_basis(np.array([held.hold.arc_length]))
            start[own] = places[0]
            coefficients[own] = self._make_rows(held, values[0])
            before[own] = coefficients[own] @ x[places[0] : places[0] + 4 * d]
            after[first : first + d] = (held.position - self._spline.offset)[self._spline.dims]
            multipliers[own] = held.multipliers
            # A view: what the kernels write belongs to the hold.
            held.multipliers, held.first = multipliers[own], first
            first = own.stop
        self.rows = solver.Holds(start, coefficients, before, after, multipliers)

    def _aim(self, held: _Held, x: Array) -> None:
        """What `_rebuild` does for a hold of which only the position has changed."""
        d, rows = self._spline.dimension, self.rows
        own = slice(held.first, held.first + len(held.multipliers))
        window = slice(rows.start[held.first], rows.start[held.first] + 4 * d)
        rows.before[own] = rows.rows[own] @ x[window]
        wanted = (held.position - self._spline.offset)[self._spline.dims]
        rows.after[held.first : held.first + d] = wanted

    def _make_rows(self, held: _Held, values: Array) -> Array:
        """Coefficients of one hold's rows from the basis there (3, 4): (d or 2 d - 1, 4 d)."""
        d = self._spline.dimension
        rows = np.zeros((len(held.multipliers), 4 * d))
        for c in range(d):
            rows[c, c::d] = values[0]
        if held.tangent is not None:
            for k, direction in enumerate(self._across(held.tangent)):
                rows[d + k] = np.outer(values[1], direction[self._spline.dims]).ravel()
        return rows
