"""The samples of an episode in a world as Rerun entities; the paths stand in the package."""

from typing import Any

import numpy as np
import rerun as rr

from hose_mj.recording.episode import Array
from hose_mj.recording.palette import OTHERS, Rgb, color_tension, lighten
from hose_mj.recording.rerun.parts import OUTCOME, TIMELINE, TURNS, make_time
from hose_mj.recording.rerun.world_scene import (
    Look,
    drawn_radius,
    log_robots,
    path_of,
    scale_forces,
)
from hose_mj.recording.scene_description import Margin, SceneDescription
from hose_mj.recording.world_episode import BreakMark, EpisodeEnding, Samples

BREAK_COLOR: Rgb = (255, 40, 50)
FORCE_COLOR: Rgb = (190, 120, 255)
CONTROL_COLOR: Rgb = (120, 230, 255)
LIVELY: tuple[Rgb, ...] = ((240, 150, 50), (80, 160, 240), (90, 200, 140), (220, 110, 190))
"""Colours of the robots' turns."""


class WorldLog:
    """Logs one episode to a stream, stretch by stretch.

    Args:
        stream: where to.
        scene: what stands still in it.
        look: how it is told apart from others in the same recording.

    Attributes:
        stream, scene: as given.
    """

    def __init__(self, stream: rr.RecordingStream, scene: SceneDescription, look: Look) -> None:
        self.stream, self.scene, self._look = stream, scene, look
        self._owner = self._vetoed = ""
        self._log_styles()

    def add(self, samples: Samples) -> None:
        """Logs the next stretch."""
        index = [make_time(samples.times)]
        if samples.has_turns:
            index.append(rr.TimeColumn(TURNS, sequence=samples.rows["turn"]))
        self._add_robots(samples, index)
        self._add_hose(samples, index)
        self._add_forces(samples, index)
        self._add_margins(samples, index)
        path = f"plots/{self._name}/reward"
        self.stream.send_columns(path, index, rr.Scalars.columns(scalars=samples.rows["reward"]))
        self._add_states(samples)
        self._add_events(samples)

    def end(self, ending: EpisodeEnding) -> None:
        """Logs how it ended; a recording says so in its properties, see `read_outcome`."""
        mark = ending.mark
        facts: dict[str, Any] = {"ended_by": ending.ended_by}
        if mark is not None:
            self._mark_break(mark)
            facts |= {"break_kind": mark.kind, "break_time": mark.time, "break_text": mark.text}
        self.stream.send_property(f"{OUTCOME} {self.scene.name}", rr.AnyValues(**facts))

    @property
    def _name(self) -> str:
        return str(rr.escape_entity_path_part(self.scene.name))

    def _log_styles(self) -> None:
        """Logs what stays the same of entities that change."""
        scene, stream = self.scene, self.stream
        log_robots(stream, scene, self._look)
        style: dict[str, Any] = {"radii": [drawn_radius(scene)]}
        if self._look.rank:
            style["colors"] = [(*self._look.color, 150)]
        hose = path_of(scene, "hose")
        stream.log(hose, rr.LineStrips3D.from_fields(**style), static=True)
        points = rr.Points3D.from_fields(radii=[1.5 * drawn_radius(scene)], colors=[CONTROL_COLOR])
        if scene.n_control_points:
            stream.log(path_of(scene, "control_points"), points, static=True)
        colors: Any = style.get("colors", [FORCE_COLOR])
        arrows = rr.Arrows3D.from_fields(colors=colors, radii=[0.003 * scene.size])
        stream.log(path_of(scene, "forces"), arrows, static=True)
        if not self._look.rank:
            said: Any = {"labels": list(scene.robots), "show_labels": True}
            names = rr.Points3D.from_fields(radii=[0.0], colors=[(235, 238, 242)], **said)
            stream.log(path_of(scene, "names"), names, static=True)
        self._log_line_styles()

    def _log_line_styles(self) -> None:
        scene, stream = self.scene, self.stream
        styles = {kind.name: kind.color for kind in scene.kinds}
        for place, (unit, kind) in enumerate(list_kinds(scene)):
            lines = [margin for margin in scene.margins if margin.kind == kind]
            share = np.linspace(0.0, 0.55, len(lines))
            base = self._look.tint((*styles.get(kind, OTHERS[place % len(OTHERS)]), 255))[:3]
            colors = [lighten(base, float(part)) for part in share]
            names = [self._label(margin.name) for margin in lines]
            style = rr.SeriesLines(colors=colors, names=names, widths=[1.5] * len(lines))
            stream.log(self._margin_path(unit, kind), style, static=True)
        for unit in dict.fromkeys(margin.unit for margin in scene.margins):
            style = rr.SeriesLines(colors=[BREAK_COLOR], names=["limit"], widths=[2.5])
            stream.log(self._margin_path(unit, "limit"), style, static=True)
        green = self._look.tint((120, 200, 120, 255))[:3]
        reward = rr.SeriesLines(colors=[green], names=[self._label("reward")], widths=[2])
        stream.log(f"plots/{self._name}/reward", reward, static=True)
        owners = rr.StateConfiguration(
            values=list(scene.robots), colors=[LIVELY[i % 4] for i in range(len(scene.robots))]
        )
        stream.log(f"states/{self._name}/turn", owners, static=True)

    def _label(self, name: str) -> str:
        return f"{self.scene.name}: {name}" if self._look.rank else name

    def _margin_path(self, unit: str, kind: str) -> str:
        return f"plots/{self._name}/{unit}/{rr.escape_entity_path_part(kind)}"

    def _add_robots(self, samples: Samples, index: list[rr.TimeColumn]) -> None:
        for i, body in enumerate(self.scene.bodies):
            columns = rr.Transform3D.columns(
                translation=samples.rows["positions"][:, i],
                quaternion=np.roll(samples.rows["quaternions"][:, i], -1, axis=1),
            )
            self.stream.send_columns(path_of(self.scene, "robots", body), index, columns)
        if not self._look.rank:
            lift = np.array([0.0, 0.0, 0.06 * self.scene.size])
            places = samples.rows["attachments"][:, :-1] + lift.astype(np.float32)
            self._send_points("names", places, index)

    def _add_hose(self, samples: Samples, index: list[rr.TimeColumn]) -> None:
        points, tension = samples.rows["hose"], samples.rows["tension"]
        k, n = points.shape[0], points.shape[1] - 1
        pieces = np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)
        styles: dict[str, Any] = {}
        if not self._look.rank:
            middle = 0.5 * (tension[:, :-1] + tension[:, 1:])
            colors = color_tension(middle, self.scene.tension_limit).reshape(-1, 3)
            red, green, blue = colors.astype(np.uint32).T  # Rerun keeps one integer, opaque
            styles["colors"] = (red << 24) | (green << 16) | (blue << 8) | np.uint32(255)
        columns = rr.LineStrips3D.columns(strips=pieces, **styles).partition([n] * k)
        self.stream.send_columns(path_of(self.scene, "hose"), index, columns)
        if self.scene.n_control_points:
            self._send_points("control_points", samples.rows["control_points"], index)

    def _add_forces(self, samples: Samples, index: list[rr.TimeColumn]) -> None:
        places, forces = samples.rows["attachments"], samples.rows["forces"]
        k, n = places.shape[:2]
        columns = rr.Arrows3D.columns(
            vectors=scale_forces(self.scene, forces).reshape(-1, 3), origins=places.reshape(-1, 3)
        )
        path = path_of(self.scene, "forces")
        self.stream.send_columns(path, index, columns.partition([n] * k))

    def _add_margins(self, samples: Samples, index: list[rr.TimeColumn]) -> None:
        scene, margins = self.scene, samples.rows["margins"]
        k = len(samples)
        for unit, kind in list_kinds(scene):
            chosen = [i for i, margin in enumerate(scene.margins) if margin.kind == kind]
            columns = rr.Scalars.columns(scalars=margins[:, chosen].ravel())
            columns = columns.partition([len(chosen)] * k)
            self.stream.send_columns(self._margin_path(unit, kind), index, columns)
        ends = [make_time(samples.times[[0, -1]] if k > 1 else samples.times)]
        for unit in dict.fromkeys(margin.unit for margin in scene.margins):
            zeros = rr.Scalars.columns(scalars=np.zeros(min(k, 2)))
            self.stream.send_columns(self._margin_path(unit, "limit"), ends, zeros)

    def _add_states(self, samples: Samples) -> None:
        """Logs changes only: a state lasts until the next."""
        for kind, texts, last in (
            ("turn", samples.owners, self._owner),
            ("vetoed", samples.vetoed, self._vetoed),
        ):
            befores = (last, *texts[:-1])
            new = [i for i, before in enumerate(befores) if texts[i] != before]
            if new:
                columns = rr.StateChange.columns(state=[texts[i] for i in new])
                path = f"states/{self._name}/{kind}"
                self.stream.send_columns(path, [make_time(samples.times[new])], columns)
        self._owner, self._vetoed = samples.owners[-1], samples.vetoed[-1]

    def _add_events(self, samples: Samples) -> None:
        told = [i for i, event in enumerate(samples.events) if event]
        if told:
            texts = [samples.events[i] for i in told]
            columns = rr.TextLog.columns(text=texts, level=["INFO"] * len(told))
            times = [make_time(samples.times[told])]
            self.stream.send_columns(f"log/{self._name}", times, columns)

    def _send_points(self, name: str, points: Array, index: list[rr.TimeColumn]) -> None:
        k, n = points.shape[:2]
        columns = rr.Points3D.columns(positions=points.reshape(-1, 3)).partition([n] * k)
        self.stream.send_columns(path_of(self.scene, name), index, columns)

    def _mark_break(self, mark: BreakMark) -> None:
        """Logs a red ball in space, a red state, and an error in the log, from its time on."""
        stream, scene = self.stream, self.scene
        stream.set_log_time_enabled(False)
        stream.set_time(TIMELINE, duration=mark.time)
        top = mark.place + np.array([0.0, 0.0, (0.16 + 0.06 * self._look.rank) * scene.size])
        ball = rr.Points3D([mark.place], colors=[BREAK_COLOR], radii=[0.014 * scene.size])
        stream.log(path_of(scene, "break"), ball)
        line = [[mark.place, top]]
        pin = rr.LineStrips3D(line, colors=[BREAK_COLOR], radii=[0.0035 * scene.size])
        stream.log(path_of(scene, "break", "pin"), pin)
        words = f"{self._label(mark.kind)}, {mark.time:.2f} s"
        style: Any = {"radii": 0.0, "colors": [BREAK_COLOR], "show_labels": True}
        label = rr.Points3D([top], labels=[words], **style)
        stream.log(path_of(scene, "break", "label"), label)
        state = rr.StateConfiguration(values=[mark.kind], colors=[BREAK_COLOR])
        stream.log(f"states/{self._name}/break", state, static=True)
        stream.log(f"states/{self._name}/break", rr.StateChange(state=mark.kind))
        stream.log(f"log/{self._name}", rr.TextLog(mark.text, level=rr.TextLogLevel.ERROR))
        stream.reset_time()


def list_kinds(scene: SceneDescription) -> list[tuple[str, str]]:
    """Lists unit and kind of the scene's margins, each pair once."""
    margins: tuple[Margin, ...] = scene.margins
    return list(dict.fromkeys((margin.unit, margin.kind) for margin in margins))
