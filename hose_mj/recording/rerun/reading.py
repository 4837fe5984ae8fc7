"""Reads Rerun recordings back."""

from pathlib import Path
from typing import Any

import rerun as rr

from hose_mj.errors import HoseError, InputError
from hose_mj.recording.rerun.parts import FACTS, OUTCOME


def read_recording(path: Path) -> dict[str, Any]:
    """Summarises a recording.

    Returns:
        `application_id`, `recording_id`, `timelines` (sorted), `n_blueprints`, and `entities`: path
        to `{rows, static, components}`, where `rows` counts the rows on a timeline, `static` the
        others.

    Raises:
        InputError: no such file, or nothing recorded in it.
    """
    try:
        reader = _open_reader(path)
        store = reader.recordings()[0]
        chunks = list(reader.stream(store=store))
        n_blueprints = len(reader.blueprints())
    except HoseError:
        raise
    except Exception as error:  # rerun raises its own, undocumented kinds
        raise InputError("recording", str(path), "a readable .rrd file with a recording") from error
    entities: dict[str, dict[str, Any]] = {}
    timelines: set[str] = set()
    for chunk in chunks:
        entity = entities.setdefault(
            str(chunk.entity_path), {"rows": 0, "static": 0, "components": set()}
        )
        entity["static" if chunk.is_static else "rows"] += chunk.num_rows
        timelines.update(chunk.timeline_names)
        entity["components"].update(
            name for name in chunk.to_record_batch().schema.names if ":" in name
        )
    for entity in entities.values():
        entity["components"] = sorted(entity["components"])
    return {
        "application_id": store.application_id,
        "recording_id": store.recording_id,
        "timelines": sorted(timelines),
        "n_blueprints": n_blueprints,
        "entities": entities,
    }


def read_outcomes(path: Path) -> dict[str, dict[str, Any]]:
    """Returns how the episodes of a recording ended, by the name of the hose model.

    Each has `ended_by`, and where a constraint broke `break_kind`, `break_time` (s) and
    `break_text`. Empty for a recording without episodes in a world. `InputError` is raised for no
    such file, or nothing recorded in it.
    """
    read_recording(path)
    reader = _open_reader(path)
    prefix = f"/__properties/{OUTCOME}"
    found: dict[str, dict[str, Any]] = {}
    for chunk in reader.stream(store=reader.recordings()[0]):
        entity = str(chunk.entity_path)
        if entity.startswith(prefix):
            row = chunk.to_record_batch().to_pylist()[0]
            name = entity[len(prefix) :].replace("\\", "").strip()
            found[name] = {key: row[key][0] for key in FACTS if row.get(key)}
    return found


def _open_reader(path: Path) -> Any:
    try:
        from rerun.chunk import RrdReader  # may move or change with any minor version
    except ImportError:
        raise HoseError(
            f"rerun {rr.__version__} has no rerun.chunk.RrdReader, which reads recordings; "
            "rerun-sdk 0.41 has it"
        ) from None
    return RrdReader(path)
