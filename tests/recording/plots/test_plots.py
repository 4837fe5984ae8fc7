import io

import matplotlib as mpl
import matplotlib.image
import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.recording.palette import COLORS, find_model, lighten, name_model
from hose_mj.recording.plots.curves import measure_order, plot_convergence, plot_series
from hose_mj.recording.plots.labels import Label, label_points, spread_apart
from hose_mj.recording.plots.shapes import (
    Fan,
    choose_label_point,
    choose_size,
    group_places,
    plot_fan,
    plot_shapes,
)
from hose_mj.recording.plots.statics import ErrorPoint, plot_errors, shade
from hose_mj.recording.plots.style import (
    choose_length_unit,
    format_percent,
    format_seconds,
    make_axes,
)
from hose_mj.recording.plots.work import (
    Gap,
    WorkPoint,
    compute_pareto_front,
    plot_overview,
    plot_work_precision,
)

TIMES = np.linspace(0.0, 1.0, 20)
MODELS = ("geds", "cable", "flex", "hinge-chain")
CONVERGENCE = {m: (np.array([8, 16, 32]), (i + 1) * np.array([8, 16, 32.0]) ** -2)
               for i, m in enumerate(MODELS)}  # fmt: skip
SHAPES = {m: np.stack([TIMES, 0 * TIMES, i * TIMES**2], axis=1) for i, m in enumerate(MODELS)}
SERIES = {m: (TIMES, np.sin(3 * TIMES) + i) for i, m in enumerate(MODELS)}
WORK = [
    WorkPoint(model, str(n), (i + 1) / n**2, 0.01 * n * (i + 1), corrected)
    for i, model in enumerate(MODELS)
    for n in (10, 20, 40)
    for corrected in ((None,) if model == "geds" else (True, False))
]
GAPS = [Gap(1e-2, "cable", 0.1, 2.0), Gap(1e-3, "hinge-chain", 0.1, 0.5)]
ERRORS = [
    ErrorPoint(model, f"\u0393 = {gamma}", n, gamma * (i + 1) / n**2, corrected)
    for i, model in enumerate(MODELS)
    for gamma in (1, 2, 3)
    for n in (10, 20, 40)
    for corrected in ((None,) if model == "geds" else (True, False))
]
SWINGS = {m: np.stack([p, p + np.array([0, 0, 0.3])]) for m, p in SHAPES.items()}
FANS = [
    Fan(m, {"\u0393 = 1": SHAPES[m], "\u0393 = 2": 0.5 * SHAPES[m]}, dotted=m != "geds")
    for m in MODELS
]
DRAWINGS = {
    "work": lambda: plot_work_precision("t", WORK, GAPS),
    "convergence": lambda: plot_convergence("t", "n", CONVERGENCE, slopes=(2,)),
    "shapes": lambda: plot_shapes("t", SHAPES),
    "cost": lambda: plot_convergence("t", "n", CONVERGENCE, (1,), in_seconds=True),
    "series": lambda: plot_series("t", "y", SERIES, limits={"bound": 2.0}),
    "statics": lambda: plot_errors("t", ERRORS),
    "fan": lambda: plot_fan("t", FANS),
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
        pale = lighten(COLORS[model], 0.45)  # the lowest of several shapes
        for color in (COLORS[model], pale if kind == "shapes" else COLORS[model]):
            near = np.all(np.abs(pixels - np.array(color) / 255.0) < 0.02, axis=-1)
            if near.sum() > 100:
                break
        else:
            pytest.fail(model)


def test_the_same_data_give_the_same_bytes():
    assert DRAWINGS["work"]() == DRAWINGS["work"]()


def test_values_that_a_log_axis_cannot_show_do_not_break_it():
    points = [*WORK, WorkPoint("cable", "80", 0.0, 1.0), WorkPoint("x", "1", 1.0, 0.0)]
    plot_work_precision("t", points)
    plot_errors("t", [ErrorPoint("geds", "", 8, 0.0)])
    plot_errors("t", [*ERRORS, ErrorPoint("cable", "", 8, 0.0, False)])
    plot_convergence("t", "n", {"geds": ([8, 16], [0.0, 0.0]), "cable": ([8], [0.1])})
    plot_series("t", "y", {"geds": ([0.0, 1.0], [0.0, 0.0])})
    plot_series("t", "y", {"geds": ([0.0], [1.0])})
    plot_series("t", "y", {"20 N": ([5], [0.02])}, {"bound": 0.2}, "radius (mm)", is_log=True)


def test_snapshots_fade_and_carry_their_times():
    assert plot_shapes("t", SWINGS, times=(0.0, 0.5)) != plot_shapes("t", SWINGS)


def test_the_overview_has_the_size_that_the_readme_wants():
    swings = {m: SWINGS[m] for m in ("geds", "cable")}
    png = plot_overview(swings, (0.0, 0.5), WORK, GAPS, ("left\nsmall", "right"))
    pixels = read_pixels(png)
    assert pixels.shape[:2] == (700, 1600)
    for model in ("geds", "cable"):
        near = np.all(np.abs(pixels - np.array(COLORS[model]) / 255.0) < 0.02, axis=-1)
        assert near.sum() > 100, model


def test_a_gap_adds_an_arrow():
    assert plot_work_precision("t", WORK, GAPS) != plot_work_precision("t", WORK)


def test_labels_keep_off_each_other_and_off_the_edge():
    with make_axes("", (4.0, 3.0)) as (figure, axes):
        axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
        labels = [Label(0.5, 0.5, "12, 2.5 ms", "#000000") for _ in range(40)]
        n_placed = label_points(figure, axes, [*labels, Label(0.5, 5.0, "out", "#000000")])
        boxes = [text.get_window_extent() for text in axes.texts]
    assert 2 <= n_placed == len(boxes) < 40
    assert all(box.count_overlaps(boxes[:k]) == 0 for k, box in enumerate(boxes))


def test_planar_geds_is_a_series_of_its_own():
    assert find_model("geds planar") == "geds planar"
    assert find_model("geds, 12 control points, planar") == "geds"
    assert name_model("cable 20, 1 ms") == "MuJoCo cable 20, 1 ms"
    assert name_model("midpoint") == "midpoint"


def test_shades_run_from_pale_to_dark_through_the_model_colour():
    shades = [sum(shade("geds", rank, 5)) for rank in range(5)]
    assert shades == sorted(shades, reverse=True)
    assert shade("geds", 2, 5) == shade("geds", 0, 1) == COLORS["geds"]


def test_figures_of_shapes_follow_the_data():
    wide, high = (choose_size(np.array([[0, 0], size])) for size in ([4.0, 1.0], [1.0, 4.0]))
    assert wide[0] > 2.0 * wide[1]
    assert high[1] > high[0]


def test_snapshots_are_labelled_where_they_differ():
    held = np.zeros((3, 5, 2))
    held[:, :, 0] = np.linspace(0.0, 1.0, 5)
    held[:, 2, 1] = (0.0, 1.0, 1.001)
    assert choose_label_point(held) == 2
    assert group_places(held[:, 2], 0.02) == [[0], [1, 2]]


def test_quantities_have_units_that_suit_them():
    assert [format_seconds(t) for t in (2.0, 8.3333e-4, 0.0025, 1e-10)] == [
        *("2 s", "833 \u00b5s", "2.5 ms", "0.1 ns")
    ]
    assert format_percent(1e-3) == "0.1 %"
    assert choose_length_unit(0.02) == ("mm", 1e3)
    assert choose_length_unit(2.0) == ("m", 1.0)


def test_the_pareto_front_has_no_beaten_point():
    cost, error = np.array([1.0, 2.0, 2.0, 3.0, 4.0]), np.array([5.0, 4.0, 6.0, 4.5, 1.0])
    assert compute_pareto_front(cost, error).tolist() == [0, 1, 4]


def test_the_order_of_an_exact_power_law_is_measured():
    x = np.array([8.0, 16.0, 64.0])
    assert measure_order(x, 7.0 * x**-4) == pytest.approx(-4.0)
    assert measure_order(x[:1], x[:1]) is None


def test_labels_are_spread_as_little_as_possible():
    assert spread_apart([0.2, 0.8], 0.1) == pytest.approx([0.2, 0.8])
    assert spread_apart([0.5, 0.5], 0.1) == pytest.approx([0.45, 0.55])
    assert spread_apart([1.0, 1.0, 0.0], 0.1) == pytest.approx([0.9, 1.0, 0.0])


@pytest.mark.parametrize(
    "draw",
    [
        lambda: plot_work_precision("t", []),
        lambda: plot_convergence("t", "n", {"a": ([1, 2], [1])}),
        lambda: plot_shapes("t", {"a": np.zeros((3, 2))}),
        lambda: plot_shapes("t", {"a": np.full((3, 3), np.nan)}),
        lambda: plot_series("t", "y", {}),
        lambda: plot_errors("t", []),
        lambda: plot_fan("t", []),
        lambda: plot_overview({}, (), WORK, GAPS, ("", "")),
    ],
)
def test_bad_input_is_refused(draw):
    with pytest.raises(InputError):
        draw()


def test_outlines_are_drawn_and_seen_whole():
    square = np.array([[0.0, -3.0], [1.0, -3.0], [1.0, -2.0], [0.0, -2.0]])
    assert plot_shapes("t", SHAPES, outlines=[square]) != plot_shapes("t", SHAPES)
