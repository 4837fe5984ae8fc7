"""One look for every plot: figures, axes, units, levels, slopes, notes, checked input."""

import io
from collections.abc import Iterator, Mapping, Sequence, Sized
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context, rc_params_from_file
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.recording.episode import Array
from hose_mj.recording.palette import MARKERS, darken, find_color, find_model, format_hex

DPI = 150
PLAIN = "#555555"
SOFT = "#666666"
"""Colour of guides' names and other text that stands back."""
HALO = (withStroke(linewidth=2.2, foreground="white"),)
"""Keeps small text readable over faint points and lines."""
ERRORS = (1e-2, 1e-3)  # error levels drawn across plots
STYLE = rc_params_from_file(Path(__file__).with_name("house.mplstyle"), use_default_template=False)
DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
"""Dash patterns that tell lines apart."""


@dataclass(frozen=True)
class Look:
    """The look of one group: "#rrggbb", the same for text, marker, dash pattern."""

    color: str
    ink: str
    marker: str
    dashes: Any


def choose_looks(labels: Sequence[str]) -> dict[str, Look]:
    """Gives each label its model's colour and marker; labels of one model differ in dashes."""
    looks: dict[str, Look] = {}
    seen: dict[str | None, int] = {}
    for label in labels:
        model = find_model(label)
        count = seen.get(model, 0)
        seen[model] = count + 1
        color, marker = find_color(label, count), MARKERS.get(model or "", ".")
        dashes = "-" if model is None else DASHES[count % len(DASHES)]
        looks[label] = Look(format_hex(color), format_hex(darken(color)), marker, dashes)
    return looks


@contextmanager
def make_figure(size: tuple[float, float], title: str = "") -> Iterator[Figure]:
    """Yields a figure of `size` inches in the house style; no global state is touched."""
    with rc_context(STYLE):
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        if title:
            figure.suptitle(title, x=0.01, ha="left", fontsize=11.0, fontweight="bold")
        yield figure


@contextmanager
def make_axes(title: str, size: tuple[float, float]) -> Iterator[tuple[Figure, Axes]]:
    """Yields a figure with one axes."""
    with make_figure(size, title) as figure:
        yield figure, figure.add_subplot()


def encode_png(figure: Figure) -> bytes:
    """Returns the figure as PNG; the same figure gives the same bytes."""
    sink = io.BytesIO()
    figure.savefig(sink, format="png", dpi=DPI, metadata={"Software": None})
    return sink.getvalue()


def add_legend(owner: Figure, handles: Sequence[Any], columns: int = 4) -> None:
    """Puts the legend below the axes of a figure, where it hides no data."""
    if handles:
        owner.legend(handles=list(handles), loc="outside lower left", ncols=columns)


def write_note(axes: Axes, text: str, at: tuple[float, float], **style: Any) -> Annotation:
    """Writes a small text that stands back, `xytext` points off a place in `xycoords`."""
    look = {"color": SOFT, "fontsize": 7.5, "textcoords": "offset points", "xytext": (0, 0)}
    return axes.annotate(text, at, **{**look, **style})


def draw_levels(axes: Axes, levels: Sequence[float], *, named: bool = True) -> list[Annotation]:
    """Draws lines across at errors within half a decade of the axis' range, named in percent."""
    low, high = axes.get_ylim()
    seen = [level for level in levels if low / 3.2 <= level <= high * 3.2]
    for level in seen:
        axes.axhline(level, color="#777777", lw=0.8, ls=(0, (1, 2)), zorder=1)
    where: Any = {"xycoords": ("axes fraction", "data"), "xytext": (-2, 2), "ha": "right"}
    return [
        write_note(axes, format_percent(level), (1.0, level), **where, path_effects=HALO)
        for level in (seen if named else ())
    ]


def draw_slopes(
    axes: Axes,
    groups: Mapping[str, tuple[Array, Array]],
    slopes: Sequence[float],
    sign: float,
    word: str = "order",
) -> None:
    """Draws guides of given orders above the coarsest and worst point of all groups."""
    x = np.concatenate([x for x, _ in groups.values()])
    y = np.concatenate([y for _, y in groups.values()])
    if not len(x):
        return
    coarse, fine = (x.min(), x.max()) if sign < 0.0 else (x.max(), x.min())
    limits = axes.get_ylim()
    ha, dx = ("right", -5) if sign > 0.0 else ("left", 5)
    for slope in slopes:
        ends = np.array([coarse, fine])
        levels = 2.0 * y.max() * (ends / coarse) ** (sign * slope)
        axes.plot(ends, levels, color="#999999", lw=0.8, ls=(0, (4, 3)), zorder=1)
        middle = np.sqrt(levels[0] * max(levels[1], 1.5 * limits[0]))
        at = coarse * (middle / levels[0]) ** (1.0 / (sign * slope))
        look: Any = {"va": "bottom", "path_effects": HALO, "zorder": 5, "ha": ha}
        write_note(axes, f"{word} {slope:g}", (at, middle), xytext=(dx, 2), **look)
    axes.set_ylim(limits[0], max(limits[1], 4.0 * y.max()))


def set_log(axes: Axes, x: bool, y: bool) -> None:
    """Makes axes logarithmic over whole decades' worth of room around the data."""
    for wanted, axis, limits in ((x, "x", axes.get_xlim), (y, "y", axes.get_ylim)):
        if not wanted:
            continue
        getattr(axes, f"set_{axis}scale")("log")
        axes.relim()
        axes.autoscale_view()
        low, high = limits()
        if high / low < 12.0:  # keep at least one decade in view, so that ticks have numbers
            room = np.sqrt(12.0 * low / high)
            getattr(axes, f"set_{axis}lim")(low / room, high * room)
        getattr(axes, f"{axis}axis").set_minor_formatter(NullFormatter())


def label_resolutions(axes: Axes, x: Array) -> None:
    """Ticks a logarithmic axis at the resolutions themselves where they are few."""
    values = np.unique(x)
    if 0 < len(values) <= 12 and np.all(np.diff(np.log(values)) > 0.12):
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xticks(values)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
        axes.set_xlim(values[0] / 1.12, values[-1] * 1.12)


def format_percent(fraction: float) -> str:
    """Returns "0.1 %"."""
    return f"{100.0 * fraction:.6g} %"


def format_seconds(seconds: float) -> str:
    """Returns a time with the unit that suits it: "10 ms"."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{1e9 * seconds:.3g} ns"


def choose_length_unit(size: float) -> tuple[str, float]:
    """Returns the unit for lengths up to `size` (m), and how many of it make a metre."""
    return ("mm", 1e3) if size < 0.3 else ("m", 1.0)


def is_positive(value: float) -> bool:
    """Says whether a logarithmic axis can show a value."""
    return bool(np.isfinite(value) and value > 0.0)


def check_some(name: str, values: Sized) -> None:
    """Raises `InputError` where there is nothing to draw."""
    if len(values) == 0:
        raise InputError(name, values, "at least one")


def check_pair(label: str, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Returns two vectors of one length."""
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if x.ndim != 1 or x.shape != y.shape or len(x) == 0:
        raise InputError(f"shapes of {label!r}", (x.shape, y.shape), "two of shape (k,), k >= 1")
    return x, y


def keep_positive(label: str, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Returns the pairs that logarithmic axes can show, by rising x."""
    x, y = check_pair(label, x, y)
    kept = np.isfinite(x) & np.isfinite(y) & (x > 0.0) & (y > 0.0)
    order = np.argsort(x[kept], kind="stable")
    return x[kept][order], y[kept][order]


def check_curve(label: str, points: ArrayLike) -> Array:
    """Returns snapshots (k, m, 3) of a curve given as (m, 3) or (k, m, 3)."""
    stack = np.asarray(points, dtype=np.float64)
    stack = stack[None] if stack.ndim == 2 else stack
    if stack.ndim != 3 or stack.shape[2] != 3 or 0 in stack.shape or not np.all(np.isfinite(stack)):
        valid = "finite points of shape (m, 3) or (k, m, 3)"
        raise InputError(f"curve {label!r}", np.shape(points), valid)
    return stack
