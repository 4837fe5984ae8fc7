"""Bars with intervals: what is drawn, and that missing values leave gaps only."""

from __future__ import annotations

import io
import math

import matplotlib.image
import pytest

from hose_mj.errors import InputError
from hose_mj.recording.palette import OTHERS
from hose_mj.recording.plots.bars import Bar, BarPanel, plot_bars


def count_pixels(png, color):
    image = (matplotlib.image.imread(io.BytesIO(png))[:, :, :3] * 255.0).round()
    return int((image == color).all(axis=2).sum())


def make_panel(*values, **more):
    return BarPanel("here", {"share": [Bar(value, **more) for value in values]})


def test_a_bar_is_as_long_as_its_value():
    lengths = [
        count_pixels(plot_bars(["a"], [make_panel(value)], "there"), OTHERS[1])
        for value in (0.0, 0.25, 0.5, 1.0)
    ]
    legend, quarter, half, whole = lengths
    assert half - legend == pytest.approx(2.0 * (quarter - legend), rel=0.03)
    assert whole - legend == pytest.approx(4.0 * (quarter - legend), rel=0.03)


def test_the_same_input_gives_the_same_bytes():
    panels = [make_panel(0.5, 0.6, interval=0.1, reference=0.4)]
    assert plot_bars(["a", "b"], panels, "there") == plot_bars(["a", "b"], panels, "there")


def test_values_intervals_and_references_may_be_missing():
    series = {
        "one": [Bar(math.nan), Bar(0.5, 0.2, 0.1, False)],
        "two": [Bar(0.9), Bar(1.0, 0.3)],
    }
    panels = [BarPanel("left", series, (0.7, "always")), BarPanel("right", series)]
    png = plot_bars(["a", "b"], panels, "there")
    assert count_pixels(png, OTHERS[1]) > 0
    assert count_pixels(png, OTHERS[2]) > 0


def test_nothing_to_draw_is_refused():
    with pytest.raises(InputError, match="items"):
        plot_bars([], [make_panel()], "there")
    with pytest.raises(InputError, match="panels"):
        plot_bars(["a"], [], "there")
