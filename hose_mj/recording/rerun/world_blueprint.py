"""The layout that makes an episode in a world readable at first sight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from hose_mj.recording.captions import name_quantity
from hose_mj.recording.framing import round_spacing
from hose_mj.recording.rerun.parts import DARK, TIMELINE
from hose_mj.recording.rerun.world_stage import SCALE, path_of
from hose_mj.recording.scene_description import SceneDescription

_HALF_VIEW = float(np.tan(np.radians(27.5)))
"""The viewer's vertical field of view is 55 degrees."""
_LOOKS = {True: (0.25, -0.8, 0.95), False: (0.45, -1.0, 0.5)}
"""Where the eye is, seen from the middle of a flat scene or of a high one."""


def make_world_blueprint(scenes: Sequence[SceneDescription], follow: bool = False) -> rrb.Blueprint:
    """Lays out one or more overlaid episodes.

    Args:
        scenes: the first one's scene is shown.
        follow: keep up with a run that goes on, instead of playing from the start.
    """
    scene = scenes[0]
    contents = ["/world/**"]
    unnamed = [*contents, *(f"- /{path_of(one, 'names')}" for one in scenes)]
    hidden = {
        f"/{path_of(one, 'control_points')}": rrb.EntityBehavior(visible=False)
        for one in scenes
        if one.n_control_points
    }
    views = rrb.Horizontal(
        _make_view(scene, "In space", contents, hidden, _place_eye(scene)),
        _make_view(scene, "From above", unnamed, hidden, _place_top(scene)),
        column_shares=[1.35, 1.0],
    )
    left = rrb.Vertical(views, _make_scale(scene), _make_plots(scenes), row_shares=[3.4, 0.5, 1.5])
    side = rrb.Vertical(
        rrb.TextDocumentView(origin="/settings", name="Settings"),
        rrb.StateTimelineView(origin="/states", name="Turns, vetoes, breaks"),
        _make_log(),
        row_shares=[1.6, 1.0, 1.0],
    )
    return rrb.Blueprint(
        rrb.Horizontal(left, side, column_shares=[3.4, 1.0]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline=TIMELINE,
            play_state="following" if follow else "playing",
            loop_mode="off" if follow else "all",
        ),
    )


def _make_log() -> rrb.TextLogView:
    """Time, level and text: whose entity it is says little."""
    columns = rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin="/log", name="Events", columns=columns)


def _make_view(
    scene: SceneDescription, name: str, contents: list[str], hidden: Any, eye: rrb.EyeControls3D
) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="/world",
        name=name,
        contents=contents,
        overrides=hidden,
        background=rrb.Background(color=DARK),
        line_grid=rrb.LineGrid3D(
            visible=True,
            spacing=round_spacing(0.1 * scene.size),
            plane=rr.components.Plane3D([0.0, 0.0, 1.0], scene.low[2] - 0.01 * scene.size),
            color=(255, 255, 255, 12),
        ),
        eye_controls=eye,
    )


def _place_eye(scene: SceneDescription) -> rrb.EyeControls3D:
    """Looks from above at an angle, the whole scene in view."""
    middle = 0.5 * (scene.low + scene.high)
    outward = np.array(_LOOKS[scene.is_planar])
    outward /= np.linalg.norm(outward)
    radius = 0.5 * float(np.linalg.norm(scene.high - scene.low))
    eye = middle + radius / _HALF_VIEW * outward
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=eye, look_target=middle, eye_up=[0.0, 0.0, 1.0]
    )


def _place_top(scene: SceneDescription) -> rrb.EyeControls3D:
    """Looks straight down, x to the right and y upwards."""
    middle = 0.5 * (scene.low + scene.high)
    room = np.max((scene.high - scene.low)[:2]) / 2.0
    height = np.array([0.0, 0.0, scene.high[2] - middle[2] + 1.12 * room / _HALF_VIEW])
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=middle + height,
        look_target=middle,
        eye_up=[0.0, 1.0, 0.0],
    )


def _make_scale(scene: SceneDescription) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=f"/{SCALE}",
        name=f"Tension of the hose: red at its limit, {scene.tension_limit:.3g} N",
        background=rrb.Background(color=DARK),
        visual_bounds=rrb.VisualBounds2D(x_range=[-30, 430], y_range=[-5, 31]),
    )


def _make_plots(scenes: Sequence[SceneDescription]) -> rrb.Horizontal:
    """One plot for each unit of the margins, and the reward."""
    names = [rr.escape_entity_path_part(scene.name) for scene in scenes]
    units = dict.fromkeys(margin.unit for scene in scenes for margin in scene.margins)
    plots = [
        rrb.TimeSeriesView(
            origin="/plots",
            name=f"Margins: {name_quantity(unit)}, broken below 0",
            contents=[f"/plots/{name}/{unit}/**" for name in names],
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=True),
        )
        for unit in units
    ]
    reward = rrb.TimeSeriesView(
        origin="/plots",
        name="Reward",
        contents=[f"/plots/{name}/reward" for name in names],
        plot_legend=rrb.PlotLegend(visible=len(scenes) > 1),
    )
    return rrb.Horizontal(*plots, reward, column_shares=[1.4] * len(plots) + [1.0])
