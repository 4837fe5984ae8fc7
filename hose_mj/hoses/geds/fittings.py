"""Stiffness and mass of a hose that is not the same everywhere, at its quadrature points.

A Gauss point stands for a cell of its span as long as its weight, and has the mean of that cell: a
short coupling between two Gauss points is not lost, and the mass is right to the last gram.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.model import Array
from hose_mj.hoses.spec import HoseSpec


def make_cells(weights: Array, n_spans: int, length: float) -> Array:
    """Returns where the cells of Gauss points with these weights (k,) begin and end, (S, k, 2)."""
    edges = np.concatenate([[0.0], np.cumsum(weights)])
    inside = np.stack([edges[:-1], edges[1:]], axis=1)
    return np.asarray((np.arange(n_spans)[:, None, None] + inside) * length / n_spans)


def average(spec: HoseSpec, name: str, cells: Array, *, inverse: bool = False) -> Array:
    """Returns the mean of a property of the hose, or of its inverse, over cells (..., 2)."""

    def convert(value: float) -> float:
        return 1.0 / value if inverse else value

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
