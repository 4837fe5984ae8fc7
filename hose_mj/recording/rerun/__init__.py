"""Rerun recordings (.rrd): written, read, photographed. Only this package imports rerun.

Parquet is the durable record, the .rrd is the view of it. A comparison of hose models has

    /settings                            what it was made with (static)
    /<scene>/note                        title and note (static)
    /<scene>/hoses/<track>               the centre line; its ends are /<scene>/hoses/<track>/ends
    /<scene>/legend                      names in the tracks' colours (static)
    /<scene>/series/<unit>/<series>      numbers over time; .../limit is the series' bound

The one timeline is `sim_time`, simulated seconds. An episode on a grid has `turn` instead, and

    /grid/lines                          grid and walls (static)
    /grid/hose                           the hose
    /grid/<track>                        what stands on a cell
    /reward, /events                     of the step that led to a turn

An episode in a world has `sim_time`, and `turn` where agents move in turns; <name> is the hose
model's. docs/viewing.md lists its entities: /world (in space), /plots, /states, /log, /settings.
"""

# ruff: noqa: E402 - without rerun, one line says what to install

from hose_mj.extras import require

require("rerun", "Rerun recordings and their viewer")

from hose_mj.recording.rerun.comparison import write_recording
from hose_mj.recording.rerun.episodes import encode_grid_episode, open_sinks, write_world_recording
from hose_mj.recording.rerun.reading import read_outcomes, read_recording
from hose_mj.recording.rerun.viewer import open_recording, take_screenshot

__all__ = [
    "encode_grid_episode",
    "open_recording",
    "open_sinks",
    "read_outcomes",
    "read_recording",
    "take_screenshot",
    "write_recording",
    "write_world_recording",
]
