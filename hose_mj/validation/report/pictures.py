"""Pictures and scenes of `hose-mj compare`: what is drawn of which case, with which words."""

import re
from collections.abc import Iterable

import numpy as np

from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.registry import MODELS, find_model
from hose_mj.recording.episode import HoseTrack, Scene, Series
from hose_mj.recording.palette import find_color
from hose_mj.recording.plots.curves import plot_convergence, plot_series
from hose_mj.recording.plots.shapes import Fan, plot_fan, plot_shapes
from hose_mj.recording.plots.statics import ErrorPoint, plot_errors
from hose_mj.recording.plots.style import choose_length_unit, format_seconds
from hose_mj.recording.plots.work import Gap, WorkPoint, plot_overview, plot_work_precision
from hose_mj.validation.compare import CaseResult, Ratio, find_cheapest
from hose_mj.validation.run import RunResult
from hose_mj.validation.study import SHOWN_WITHIN, Study
from hose_mj.validation.trial import LinePlot, ShapePlot

Pictures = dict[str, bytes]  # PNG by file name without its suffix
N_SNAPSHOTS = 6  # instants drawn into one picture of shapes
PLANAR = tuple(model for model, entry in MODELS.items() if entry.is_planar)
"""Peers that move in a plane, and are held against GEDS in a plane."""
PARAMETERS = {
    "heavy-cantilever": ("gamma-", "\u0393 = "),
    "tip-load": ("", "PL\u00b2/EI = "),
    "end-moment": ("", "ML/EI = "),
}
"""Family -> what its ids put before the parameter, and what plots put there."""
FANS = ("heavy-cantilever", "tip-load", "end-moment")
HERO = "released-rod"  # the case of the overview
COMMITTED = "cable (committed)"  # the series of the cable's committed runs
_N_DIRECTIONS = 96
"""Directions in which the farthest point of an obstacle is sought for its outline."""


def draw_all(study: Study) -> Pictures:
    """Returns the PNG of every plot by file name."""
    pictures: Pictures = {}
    for result in study.results:
        if result.case.motion is not None and result.outcomes:
            pictures.update(_draw_motion(result, study))
            models = {outcome.setting.model for outcome in result.outcomes}
            if result.case.id == HERO and models & {"geds", "cable"}:
                pictures["overview"] = draw_overview(result, study)
    for family, members in group_statics(study.results).items():
        pictures.update(_draw_statics(family, members))
    for findings in study.findings.values():
        pictures.update({name: _draw_finding(plot) for name, plot in findings.plots.items()})
    pictures.update(_draw_numerics(study))
    if study.user is not None and study.user.hose.duration is None and study.outcomes:
        # The rest shape that each model finds where it comes closest.
        result = study.results[0]
        shown = choose_shown(result, study.shown_within).values()
        curves = {describe_setting(outcome): outcome.points for outcome in shown}
        picture = plot_shapes(result.case.title, curves, choose_plane(curves.values()))
        pictures[f"{result.case.id}-shapes"] = picture
    return pictures


def group_statics(results: list[CaseResult]) -> dict[str, list[CaseResult]]:
    """Static results by family, in order."""
    groups: dict[str, list[CaseResult]] = {}
    for result in results:
        if result.case.motion is None:
            groups.setdefault(result.case.family, []).append(result)
    return groups


def choose_shown(result: CaseResult, within: float) -> dict[str, RunResult]:
    """The run of each model that pictures show: the cheapest within an error, or the best."""
    shown = {}
    for model in dict.fromkeys(outcome.setting.model for outcome in result.outcomes):
        best = find_cheapest(result.outcomes, model, within)
        if best is None:
            mine = [outcome for outcome in result.outcomes if outcome.setting.model == model]
            best = min(mine, key=lambda outcome: outcome.error)
        shown[model] = best
    return shown


def compute_distance(one: RunResult, other: RunResult) -> np.ndarray:
    """Largest distance between two centre lines at each instant, (k,), m."""
    return np.asarray(np.max(np.linalg.norm(one.points - other.points, axis=2), axis=1))


def name_setting(outcome: RunResult) -> str:
    """Resolution and time step, short: "12, 2.5 ms"."""
    setting = outcome.setting
    step = "" if setting.timestep is None else f", {format_seconds(setting.timestep)}"
    return f"{setting.resolution}{step}"


def describe_setting(outcome: RunResult) -> str:
    """A model at a setting, for legends: "geds, 12 control points, 2.5 ms"."""
    size = find_model(outcome.setting.model).resolution.replace("_", " ")
    resolution, comma, step = name_setting(outcome).partition(",")
    return f"{outcome.setting.model}, {resolution} {size}{comma}{step}"


def choose_ratios(ratios: Iterable[Ratio], case_id: str) -> list[Ratio]:
    """The ratios of a case that compare like with like."""
    return [
        ratio
        for ratio in ratios
        if ratio.case == case_id and ratio.planar == (ratio.against in PLANAR)
    ]


def draw_overview(result: CaseResult, study: Study) -> bytes:
    """The motion at the left, errors and costs at the right: the picture of the README."""
    shown = {m: o for m, o in choose_shown(result, SHOWN_WITHIN).items() if m in ("geds", "cable")}
    curves, times = _pick_snapshots(shown)
    names = [o.setting.resolution for o in shown.values()]
    left = "A rod is let go"
    if len(shown) == 2:
        left += f"\n{names[0]} control points of GEDS over {names[1]} segments of MuJoCo's cable"
    gaps = _list_gaps(result, study.ratios)
    best = max((gap for gap in gaps if gap.against == "cable"), key=_ratio_of, default=None)
    right = "What accuracy costs\nbest settings of each model; lower left is better"
    if best is not None:
        level, factor = f"{100 * best.at_error:g} %", f"{_ratio_of(best):.0f} times"
        right = (
            f"At {level} error the cable takes {factor} as long"
            "\nbest settings of each model; labels: control points or segments, time step"
        )
    return plot_overview(curves, times, _list_work(result, study), gaps, (left, right))


def _ratio_of(gap: Gap) -> float:
    return gap.cost_against / gap.cost


def _list_work(result: CaseResult, study: Study) -> list[WorkPoint]:
    """A point for each run, and for each committed one of the cable where it cannot run."""
    points = []
    for o in result.outcomes:
        # GEDS in a plane is a series of its own.
        model, cost = o.setting.model, o.wall_s_per_sim_s or np.nan
        series = "geds planar" if model == "geds" and o.setting.planar else model
        clamp = o.setting.clamp_corrected
        points.append(WorkPoint(series, name_setting(o), o.error, cost, clamp))
    for record in study.committed.records if study.committed else ():
        if record["case"] == result.case.id and record["timestep"] is not None:
            label = f"{record['resolution']}, {format_seconds(record['timestep'])}"
            cost, clamp = record["wall_s_per_sim_s"], record["clamp_corrected"]
            points.append(WorkPoint(COMMITTED, label, record["error"], cost, clamp))
    return points


def _list_gaps(result: CaseResult, ratios: Iterable[Ratio]) -> list[Gap]:
    """The arrows of a picture: above a level the cable's, below it the hinge chain's."""
    costs = {outcome.setting.label: outcome.wall_s_per_sim_s for outcome in result.outcomes}
    gaps = []
    for ratio in choose_ratios(ratios, result.case.id):
        if ratio.against == "flex":
            continue
        cost, against = costs.get(ratio.model_setting), costs.get(ratio.against_setting)
        if cost is not None and against is not None:
            gaps.append(Gap(ratio.at_error, ratio.against, cost, against))
    return gaps


def _pick_snapshots(shown: dict[str, RunResult]) -> tuple[dict[str, np.ndarray], list[float]]:
    """Centre lines by legend entry, (N_SNAPSHOTS, m, 3), and their times (s)."""
    one = next(iter(shown.values()))
    picks = np.linspace(0, len(one.times) - 1, N_SNAPSHOTS).round().astype(int)
    curves = {describe_setting(outcome): outcome.points[picks] for outcome in shown.values()}
    return curves, [float(one.times[k]) for k in picks]


def _draw_motion(result: CaseResult, study: Study) -> Pictures:
    case = result.case
    pictures = {
        f"{case.id}-work-precision": plot_work_precision(
            case.title, _list_work(result, study), _list_gaps(result, study.ratios)
        )
    }
    shown = choose_shown(result, study.shown_within)
    curves, times = _pick_snapshots(shown)
    plane = choose_plane(curves.values())
    outlines = compute_outlines(case.obstacles, plane)
    pictures[f"{case.id}-shapes"] = plot_shapes(case.title, curves, plane, times, outlines)
    if "geds" in shown and len(shown) > 1:
        gaps, unit = _measure_gaps(shown)
        title = f"Largest distance from GEDS {name_setting(shown['geds'])}"
        t = shown["geds"].times
        series = {f"{m} {name_setting(shown[m])}": (t, gap) for m, gap in gaps.items()}
        pictures[f"{case.id}-distance"] = plot_series(title, f"distance ({unit})", series)
    return pictures


def choose_plane(curves: Iterable[np.ndarray]) -> tuple[int, int]:
    """The two coordinates that show most of curves (..., 3): x or y over z, or x over y if flat."""
    extent = np.ptp(np.concatenate([curve.reshape(-1, 3) for curve in curves]), axis=0)
    if extent[2] < 0.1 * min(extent[:2]):
        return 0, 1
    return (0, 2) if extent[0] >= extent[1] else (1, 2)


def _measure_gaps(shown: dict[str, RunResult]) -> tuple[dict[str, np.ndarray], str]:
    """Distances from GEDS over time by model, in a unit that suits the largest; and that unit."""
    gaps = {m: compute_distance(shown["geds"], o) for m, o in shown.items() if m != "geds"}
    largest = max((float(gap.max()) for gap in gaps.values()), default=0.0)
    unit, factor = choose_length_unit(largest)
    return {model: factor * gap for model, gap in gaps.items()}, unit


def _draw_statics(family: str, members: list[CaseResult]) -> Pictures:
    points = [
        ErrorPoint(
            outcome.setting.model,
            _parameter(result) if len(members) > 1 else "",
            outcome.setting.resolution,
            outcome.error,
            outcome.setting.clamp_corrected,
        )
        for result in members
        for outcome in result.outcomes
    ]
    if not points:
        return {}
    title = members[0].case.title if len(members) == 1 else family.replace("-", " ").capitalize()
    of = "reference" if members[0].case.scale is None else "length"
    pictures = {family: plot_errors(title, points, f"error (of the {of})")}
    case = members[0].case
    if case.obstacles or not case.planar:
        ours = max(members[0].outcomes, key=lambda outcome: outcome.setting.resolution)
        curve = ours.points[0]
        plane = choose_plane([curve])
        across = np.sort(np.ptp(curve, axis=0))
        if across[1] > 0.01 * across[2]:  # a straight line is no picture
            outlines = compute_outlines(case.obstacles, plane)
            curves = {describe_setting(ours): curve}
            pictures[f"{family}-shapes"] = plot_shapes(title, curves, plane, outlines=outlines)
    if family in FANS and len(members) > 1:
        fans = [_make_fan(members, "geds", None), _make_fan(members, "cable", False)]
        pictures[f"{family}-shapes"] = plot_fan(title, [fan for fan in fans if fan])
    return pictures


def _make_fan(members: list[CaseResult], model: str, corrected: bool | None) -> Fan | None:
    """Equilibria of a model: GEDS at its finest, a chain at about 20 segments as documented."""
    curves: dict[str, np.ndarray] = {}
    resolution = 0
    for result in members:
        mine = [
            outcome
            for outcome in result.outcomes
            if (outcome.setting.model, outcome.setting.clamp_corrected) == (model, corrected)
        ]
        if mine:
            about_20 = [abs(outcome.setting.resolution - 20.0) for outcome in mine]
            ranks = about_20 if corrected is not None else [outcome.error for outcome in mine]
            best = mine[ranks.index(min(ranks))]
            curves[_parameter(result)] = best.points[0]
            resolution = best.setting.resolution
    if not curves:
        return None
    if corrected is None:
        return Fan(model, curves)
    name = f"{model}, {resolution} segments, clamp as documented"
    return Fan(name, curves, dotted=True)


def _parameter(result: CaseResult) -> str:
    """The parameter of a case for people: "\u0393 = 10"."""
    tail = result.case.id.removeprefix(result.case.family).lstrip("-")
    prefix, text = PARAMETERS.get(result.case.family, ("", ""))
    return text + re.sub(r"^(\d*)pi$", "\\1\u03c0", tail.removeprefix(prefix))


def _draw_finding(plot: LinePlot | ShapePlot) -> bytes:
    if isinstance(plot, LinePlot):
        return plot_series(
            plot.title, plot.ylabel, plot.lines, plot.limits, plot.xlabel, plot.is_log
        )
    outlines = compute_outlines(plot.obstacles, (0, 2))
    return plot_shapes(plot.title, plot.shapes, outlines=outlines)


def _draw_numerics(study: Study) -> Pictures:
    pictures: Pictures = {}
    for title, curves in study.curves.items():
        if title.startswith("Wall"):
            pictures["cost"] = plot_convergence(
                title, "control points", curves, (1.0,), ylabel="wall time", in_seconds=True
            )
            continue
        slopes = (4.0,) if "frequencies" in title else (3.0,) if "swing" in title else (1.0, 2.0)
        xlabel = "time step (s)" if "time step" in title else "span length (m)"
        name = title.lower().replace(" ", "-")
        pictures[name] = plot_convergence(title, xlabel, curves, slopes, finer_is_larger=False)
    if study.energy is not None:
        times, energies = study.energy
        change = 100.0 * (np.asarray(energies) - 1.0)
        pictures["energy"] = plot_series(
            "Energy of the released rod over ten seconds, BDF2 at 5 ms",
            "change of energy (% of its start)",
            {"geds, 12 points": (times, change)},
            limits={"bound, +0.1 %": 0.1},
        )
    return pictures


def make_scene(result: CaseResult, within: float) -> Scene | None:
    """The models of a motion overlaid, with their distances from GEDS; None without a run."""
    shown = choose_shown(result, within)
    if not shown:
        return None
    case = result.case
    tracks = tuple(
        HoseTrack(
            f"{model} {name_setting(outcome)}",
            np.linspace(0.0, case.spec.length, outcome.points.shape[1]),
            outcome.times,
            outcome.points,
            case.spec.outer_radius,
            find_color(model),
        )
        for model, outcome in shown.items()
    )
    errors = "\n".join(
        f"- {outcome.setting.label}: error {100 * outcome.error:.2g} %"
        for outcome in shown.values()
    )
    return Scene(case.id, case.title, tracks, _list_distances(shown), f"{case.about}\n\n{errors}")


def _list_distances(shown: dict[str, RunResult]) -> tuple[Series, ...]:
    """Distances from GEDS, in millimetres where they are small."""
    if "geds" not in shown:
        return ()
    gaps, unit = _measure_gaps(shown)
    return tuple(Series(f"{m} to GEDS", shown[m].times, gap, unit) for m, gap in gaps.items())


def compute_outline(obstacle: Obstacle, view: tuple[int, int]) -> np.ndarray | None:
    """Outline (k, 2) of a shape as seen along the third axis: its farthest points all around.

    None for a plane, which has none.
    """
    if obstacle.kind == "plane":
        return None
    angle = np.linspace(0.0, 2.0 * np.pi, _N_DIRECTIONS, endpoint=False)
    directions = np.zeros((_N_DIRECTIONS, 3))
    directions[:, view[0]], directions[:, view[1]] = np.cos(angle), np.sin(angle)
    rotation = np.asarray(obstacle.rotation)
    radius, half, _ = np.asarray(obstacle.size)
    local = directions @ rotation
    if obstacle.kind == "box":
        far = np.sign(local) * obstacle.size
    elif obstacle.kind == "cylinder":
        far = np.zeros_like(local)
        across = np.linalg.norm(local[:, :2], axis=1, keepdims=True)
        far[:, :2] = radius * local[:, :2] / np.maximum(across, 1e-12)
        far[:, 2] = half * np.sign(local[:, 2])
    else:
        far = radius * local
        far[:, 2] += half * np.sign(local[:, 2])
    points = far @ rotation.T + obstacle.position
    return np.asarray(points[:, list(view)])


def compute_outlines(obstacles: tuple[Obstacle, ...], view: tuple[int, int]) -> list[np.ndarray]:
    """Outlines of all that have one."""
    found = (compute_outline(obstacle, view) for obstacle in obstacles)
    return [outline for outline in found if outline is not None]
