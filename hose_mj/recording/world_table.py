"""An episode in a world as a table: one row a sample, to be read by a spreadsheet."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from hose_mj.recording.files import write_atomically
from hose_mj.recording.parquet import load_pyarrow
from hose_mj.recording.world_episode import NO_TURN, WorldEpisode

_AXES = "xyz"


def write_csv(path: Path, episode: WorldEpisode) -> None:
    """Writes an episode's numbers as CSV; the file is replaced at once.

    Columns: `time_s`; `turn`, `owner`, `vetoed`, `events`; `reward`; each robot's place (`_m`) and
    the force on the hose there (`_N`), the source's likewise; the least and largest tension of the
    hose; each margin with its unit. An empty field is a margin that has no value.
    """
    pa, out = load_pyarrow(), io.BytesIO()
    pa.csv.write_csv(pa.table(make_columns(episode)), out)
    write_atomically(Path(path), out.getvalue())


def make_columns(episode: WorldEpisode) -> dict[str, Any]:
    """Returns the columns by name, in order."""
    pa, scene, samples = load_pyarrow(), episode.scene, episode.samples
    rows = samples.rows
    columns: dict[str, Any] = {"time_s": samples.times}
    if samples.has_turns:
        columns["turn"] = pa.array(rows["turn"], mask=rows["turn"] == NO_TURN)
    columns |= {"owner": samples.owners, "vetoed": samples.vetoed, "events": samples.events}
    columns["reward"] = rows["reward"]
    for i, name in enumerate((*scene.robots, "source")):
        for k, axis in enumerate(_AXES):
            columns[f"{name} {axis}_m"] = rows["attachments"][:, i, k]
        for k, axis in enumerate(_AXES):
            columns[f"{name} force_{axis}_N"] = rows["forces"][:, i, k]
    columns["tension_min_N"] = rows["tension"].min(axis=1)
    columns["tension_max_N"] = rows["tension"].max(axis=1)
    for i, margin in enumerate(scene.margins):
        values = rows["margins"][:, i]
        columns[f"margin {margin.name}_{margin.unit}"] = pa.array(values, mask=np.isnan(values))
    return {
        name: pa.array(list(column)) if isinstance(column, tuple) else column
        for name, column in columns.items()
    }
