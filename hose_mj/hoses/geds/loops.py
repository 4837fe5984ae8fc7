"""Closed loops: an O-ring, a drive belt, a rubber band.

The end of a loop is joined to its beginning, r(0) = r(L) and r'(0) = r'(L), by 2 d rows of
G x = g. They read the first and the last four control points and so do not fit a band; like the
rows of all constraints they are met by Lagrange multipliers (kkt.py). Their coefficients add up to
zero, and place and slope are joined alike: the joint changes neither linear nor angular momentum.
The moment is continuous across it as it is in the continuum, where nothing asks for it.

The twist of a loop is that of one segment whose last director is glued to its first (twist.py).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.inputs import check_vector
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import check_number

LARGEST_GAP = 0.1
"""Between ends that are to be joined, in lengths of the hose."""


def make_circle(
    length: float,
    center: ArrayLike = (0.0, 0.0, 0.0),
    normal: ArrayLike = (0.0, 1.0, 0.0),
) -> Callable[[Array], Array]:
    """Returns a circle as long as the hose, to `reset` it along before it is closed.

    Args:
        length: of the hose (m).
        center: (3,) m.
        normal: of the circle's plane, (3,); it runs right-handed about it.

    Raises:
        InputError: a length that is not above zero, a normal that is zero.
    """
    check_number("length", length)
    middle, axis = check_vector("center", center), check_vector("normal", normal)
    size = float(np.linalg.norm(axis))
    if size == 0.0:
        raise InputError("normal", axis.tolist(), "a vector that is not zero")
    first = np.cross(axis / size, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    second = np.cross(axis / size, first)
    radius = length / (2.0 * np.pi)

    def circle(s: Array) -> Array:
        angle = s / radius
        turned = np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second)
        return np.asarray(middle + radius * turned)

    return circle


def make_joint_rows(spline: Spline) -> Array:
    """Returns the coefficients of r(0) - r(L) and r'(0) - r'(L), (2 d, 8 d).

    Of the first and then of the last 4 d unknowns.
    """
    d = spline.dimension
    _, values = spline.compute_basis(np.array([0.0, spline.length]))
    rows = np.zeros((2, d, 2, 4, d))
    for derivative in range(2):
        for c in range(d):
            rows[derivative, c, 0, :, c] = values[0, derivative]
            rows[derivative, c, 1, :, c] = -values[1, derivative]
    return rows.reshape(2 * d, 8 * d)


def check_ends(spline: Spline, held: Sequence[float], x: Array) -> None:
    """Raises `InputError` for ends that cannot be joined.

    Args:
        spline: the hose's geometry.
        held: arc lengths of the holds.
        x: the unknowns.
    """
    ends = np.array([0.0, spline.length])
    if all(np.any(np.abs(np.array(held) - end) < 1e-9 * spline.length) for end in ends):
        raise InputError.about("cannot close a hose that is held at both ends: release one")
    first, last = spline.evaluate(ends, x)
    gap = float(np.linalg.norm(last - first))
    if gap > LARGEST_GAP * spline.length:
        valid = f"at most {LARGEST_GAP * spline.length:g} m; lay the hose along a closed curve"
        raise InputError("gap between the ends that close() joins (m)", gap, valid)
    first, last = spline.evaluate(ends, x, 1)
    if first @ last < 0.0:
        valid = "a direction within 90 degrees of that of the first"
        raise InputError("tangent of the last end", last.tolist(), valid)
