"""Learning curves as pictures."""

from __future__ import annotations

import io

import matplotlib.image
import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.recording.plots.curves import PANEL, Curve, Panel, plot_learning
from hose_mj.recording.plots.style import DPI

X = np.arange(1.0, 11.0)


def make_panel(name, n_lines, scale="linear"):
    lines = {
        f"learner {k}": Curve(X, X / 10 - 0.05 * k, X / 10 - 0.3, X / 10) for k in range(n_lines)
    }
    return Panel(name, lines, scale)


def read_pixels(png):
    return matplotlib.image.imread(io.BytesIO(png))


@pytest.mark.parametrize("n_panels", [1, 2])
def test_panels_stand_side_by_side(n_panels):
    png = plot_learning("title", "episodes", [make_panel("a", 3)] * n_panels)
    height, width, _ = read_pixels(png).shape
    assert height == pytest.approx(PANEL[1] * DPI, abs=1)
    assert width == pytest.approx((PANEL[0] * n_panels + 1.2) * DPI, abs=1)


def test_the_same_curves_make_the_same_picture_and_others_another():
    one, same = (plot_learning("t", "x", [make_panel("a", 2, "share")]) for _ in range(2))
    assert one == same
    assert one != plot_learning("t", "x", [make_panel("a", 3, "share")])
    assert one != plot_learning("t", "x", [make_panel("a", 2)])


def test_what_is_not_finite_is_left_out():
    gap = np.where(X == 5, np.nan, X)
    whole = Curve(np.delete(X, 4), *(np.delete(X, 4) for _ in range(3)))
    drawn = [
        plot_learning("t", "x", [Panel("a", {"l": curve}, "log")])
        for curve in (Curve(X, gap, X, X), whole)
    ]
    assert drawn[0] == drawn[1]


@pytest.mark.parametrize(
    ("panels", "named"),
    [
        ([], "panels"),
        ([Panel("a", {})], "curves"),
        ([Panel("a", {"l": Curve(X, X, X[1:], X)})], "shapes of 'l'"),
    ],
)
def test_nothing_to_draw_is_refused(panels, named):
    with pytest.raises(InputError, match=named):
        plot_learning("t", "x", panels)
