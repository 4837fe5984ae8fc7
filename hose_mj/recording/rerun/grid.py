"""An episode on a grid as a Rerun recording."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from hose_mj.recording.grid import GridEpisode
from hose_mj.recording.rerun.parts import APPLICATION_ID


def encode_grid_episode(episode: GridEpisode) -> bytes:
    """Returns the .rrd of an episode on a grid; y is negated, as the viewer counts rows down."""
    stream = rr.RecordingStream(APPLICATION_ID)
    sink = rr.binary_stream(stream)
    down = np.array([1.0, -1.0])
    turns = [rr.TimeColumn("turn", sequence=episode.turns)]
    stream.send_blueprint(
        rrb.Horizontal(
            rrb.Spatial2DView(origin="/grid", name=episode.title),
            rrb.Vertical(
                rrb.TimeSeriesView(origin="/reward", name="reward"),
                rrb.TextLogView(origin="/events", name="events"),
            ),
            column_shares=[2.0, 1.0],
        )
    )
    lines = rr.LineStrips2D(episode.lines * down, colors=[(70, 74, 82)], radii=[0.02])
    stream.log("grid/lines", lines, static=True)
    if episode.hose is not None:
        style = rr.LineStrips2D.from_fields(colors=[(196, 165, 92)], radii=[0.12])
        stream.log("grid/hose", style, static=True)
        strips = rr.LineStrips2D.columns(strips=list(episode.hose * down))
        stream.send_columns("grid/hose", turns, strips)
    for track in episode.tracks:
        path = f"grid/{rr.escape_entity_path_part(track.name)}"
        look = rr.Points2D.from_fields(colors=[track.color], radii=[0.4], labels=[track.label])
        stream.log(path, look, static=True)
        stream.send_columns(path, turns, rr.Points2D.columns(positions=track.points * down))
    stream.send_columns("reward", turns, rr.Scalars.columns(scalars=episode.rewards))
    stream.send_columns("events", turns, rr.TextLog.columns(text=list(episode.events)))
    return bytes(sink.read(flush=True) or b"")
