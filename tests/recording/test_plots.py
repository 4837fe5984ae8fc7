import io

import matplotlib as mpl
import matplotlib.image
import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.recording import plots
from hose_mj.recording.palette import COLORS
from hose_mj.recording.plot_style import spread_apart

TIMES = np.linspace(0.0, 1.0, 20)
MODELS = ("geds", "cable", "flex", "hinge-chain")
CONVERGENCE = {m: (np.array([8, 16, 32]), (i + 1) * np.array([8, 16, 32.0]) ** -2)
               for i, m in enumerate(MODELS)}  # fmt: skip
SHAPES = {m: np.stack([TIMES, 0 * TIMES, i * TIMES**2], axis=1) for i, m in enumerate(MODELS)}
SERIES = {m: (TIMES, np.sin(3 * TIMES) + i) for i, m in enumerate(MODELS)}
WORK = [
    plots.WorkPoint(model, str(n), (i + 1) / n**2, 0.01 * n * (i + 1), corrected)
    for i, model in enumerate(MODELS)
    for n in (10, 20, 40)
    for corrected in ((None,) if model == "geds" else (True, False))
]
DRAWINGS = {
    "work": lambda: plots.plot_work_precision("t", WORK),
    "convergence": lambda: plots.plot_convergence("t", "n", CONVERGENCE, slopes=(2,)),
    "shapes": lambda: plots.plot_shapes("t", SHAPES),
    "series": lambda: plots.plot_series("t", "y", SERIES, limit=2.0),
    "series-log": lambda: plots.plot_series("t", "y", SERIES, logy=True),
    "dots": lambda: plots.plot_bars_vs_reference("t", WORK),
}


def read_pixels(png):
    return matplotlib.image.imread(io.BytesIO(png), format="png")[..., :3]


@pytest.mark.parametrize("kind", DRAWINGS)
def test_a_plot_shows_every_model_in_its_colour(kind):
    before = dict(mpl.rcParams)
    png = DRAWINGS[kind]()
    assert png.startswith(b"\x89PNG")
    assert dict(mpl.rcParams) == before
    pixels = read_pixels(png)
    assert np.all(pixels[0] == 1.0)
    for model in MODELS:
        near = np.all(np.abs(pixels - np.array(COLORS[model]) / 255.0) < 0.02, axis=-1)
        assert near.sum() > 100, model


def test_the_same_data_give_the_same_bytes():
    assert DRAWINGS["work"]() == DRAWINGS["work"]()


def test_values_that_a_log_axis_cannot_show_do_not_break_it():
    points = [*WORK, plots.WorkPoint("cable", "80", 0.0, 1.0), plots.WorkPoint("x", "1", 1.0, 0.0)]
    plots.plot_work_precision("t", points)
    plots.plot_bars_vs_reference("t", points)
    plots.plot_bars_vs_reference("t", [plots.ErrorPoint("geds", "8", 0.0)])
    plots.plot_convergence("t", "n", {"geds": ([8, 16], [0.0, 0.0]), "cable": ([8], [0.1])})
    plots.plot_series("t", "y", {"geds": ([0.0, 1.0], [0.0, 0.0])}, logy=True)
    plots.plot_series("t", "y", {"geds": ([0.0], [1.0])})


def test_snapshots_fade_and_carry_their_times():
    swing = {m: np.stack([points, points + np.array([0, 0, 0.3])]) for m, points in SHAPES.items()}
    assert plots.plot_shapes("t", swing, times=(0.0, 0.5)) != plots.plot_shapes("t", swing)


def test_the_pareto_front_has_no_beaten_point():
    cost, error = np.array([1.0, 2.0, 2.0, 3.0, 4.0]), np.array([5.0, 4.0, 6.0, 4.5, 1.0])
    assert plots.find_pareto_front(cost, error).tolist() == [0, 1, 4]


def test_the_order_of_an_exact_power_law_is_measured():
    x = np.array([8.0, 16.0, 64.0])
    assert plots.measure_order(x, 7.0 * x**-4) == pytest.approx(-4.0)
    assert plots.measure_order(x[:1], x[:1]) is None


def test_labels_are_spread_as_little_as_possible():
    assert spread_apart([0.2, 0.8], 0.1) == pytest.approx([0.2, 0.8])
    assert spread_apart([0.5, 0.5], 0.1) == pytest.approx([0.45, 0.55])
    assert spread_apart([1.0, 1.0, 0.0], 0.1) == pytest.approx([0.9, 1.0, 0.0])


@pytest.mark.parametrize(
    "draw",
    [
        lambda: plots.plot_work_precision("t", []),
        lambda: plots.plot_convergence("t", "n", {"a": ([1, 2], [1])}),
        lambda: plots.plot_shapes("t", {"a": np.zeros((3, 2))}),
        lambda: plots.plot_shapes("t", {"a": np.full((3, 3), np.nan)}),
        lambda: plots.plot_series("t", "y", {}),
    ],
)
def test_bad_input_is_refused(draw):
    with pytest.raises(InputError):
        draw()
