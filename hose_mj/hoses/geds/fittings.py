"""Stiffness and mass of a hose that is not the same everywhere, at its quadrature points.

A Gauss point stands for a cell of its span as long as its weight, and has the mean of that cell: a
short coupling between two Gauss points is not lost, and the mass is right to the last gram.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec


def make_cells(weights: Array, n_spans: int, length: float) -> Array:
    """Returns where the cells of Gauss points with these weights (k,) begin and end, (S, k, 2)."""
    edges = np.concatenate([[0.0], np.cumsum(weights)])
    inside = np.stack([edges[:-1], edges[1:]], axis=1)
    return np.asarray((np.arange(n_spans)[:, None, None] + inside) * length / n_spans)


def average_stiffness(spec: HoseSpec, name: str, cells: Array) -> Array:
    """Returns the stiffness of cells (..., 2) whose pieces are springs in series.

    It is the inverse of the mean softness; 0 everywhere if the hose itself has none.
    """
    if getattr(spec, name) == 0.0:
        return np.zeros(cells.shape[:-1])
    return 1.0 / _average(spec, name, cells, lambda value: 1.0 / value)


def average_density(spec: HoseSpec, cells: Array) -> Array:
    """Returns the mean mass per length of cells (..., 2), kg/m."""
    return _average(spec, "linear_density", cells, lambda value: value)


def _average(spec: HoseSpec, name: str, cells: Array, convert: Callable[[float], float]) -> Array:
    """Mean of what is made of a property over cells (..., 2)."""
    own = convert(float(getattr(spec, name)))
    mean = np.full(cells.shape[:-1], own)
    for fitting in spec.fittings:
        value = getattr(fitting, name)
        if value is not None:
            common = np.minimum(cells[..., 1], fitting.end) - np.maximum(
                cells[..., 0], fitting.start
            )
            share = np.maximum(common, 0.0) / (cells[..., 1] - cells[..., 0])
            mean += share * (convert(float(value)) - own)
    return mean
