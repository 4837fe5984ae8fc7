"""Tables of records: Parquet as the durable form, CSV with the same columns and rows to read."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from hose_mj.errors import InputError
from hose_mj.recording.files import write_atomically

Record = dict[str, Any]
_ARROW_TYPES = {
    bool: pa.bool_(),
    int: pa.int64(),
    float: pa.float64(),
    str: pa.string(),
}


def write_records(
    records: Sequence[Mapping[str, Any]],
    parquet_path: Path,
    csv_path: Path | None = None,
    metadata: Mapping[str, str] | None = None,
    types: Mapping[str, type] | None = None,
) -> None:
    """Writes one row per record.

    Columns are the union of the records' keys in the order they first appear; a missing key is
    None. A column is bool, int, float or str; int and float together make float.

    Args:
        records: plain or numpy scalars and None.
        parquet_path: replaced atomically.
        csv_path: likewise, or None for no CSV. An empty field is None, `""` an empty text.
        metadata: kept in the Parquet schema.
        types: the type of a column where the values alone may not tell it (all None: str). These
            columns exist even when no record has them.

    Raises:
        InputError: a value or a mixture of types that no column can hold.
    """
    rows = [{str(key): _to_plain(value) for key, value in record.items()} for record in records]
    table = make_table(rows, dict(types or {}), dict(metadata or {}))
    sink = pa.BufferOutputStream()
    pyarrow.parquet.write_table(table, sink, compression="zstd")
    write_atomically(Path(parquet_path), sink.getvalue().to_pybytes())
    if csv_path is not None:
        text = io.BytesIO()
        pyarrow.csv.write_csv(table, text)
        write_atomically(Path(csv_path), text.getvalue())


def write_columns(columns: Mapping[str, npt.NDArray[Any]], parquet_path: Path) -> None:
    """Writes one-dimensional arrays of equal length as columns; the file is replaced at once."""
    sink = pa.BufferOutputStream()
    pyarrow.parquet.write_table(pa.table(dict(columns)), sink, compression="zstd")
    write_atomically(Path(parquet_path), sink.getvalue().to_pybytes())


def read_records(parquet_path: Path) -> tuple[list[Record], dict[str, str]]:
    """Returns the records and the metadata of a file that `write_records` made.

    Raises:
        InputError: no such file, or not Parquet.
    """
    try:
        table = pyarrow.parquet.read_table(Path(parquet_path))
    except (OSError, pa.ArrowException) as error:
        raise InputError("Parquet file", str(parquet_path), "a readable Parquet file") from error
    metadata = {
        key.decode(): value.decode()
        for key, value in (table.schema.metadata or {}).items()
        if not key.startswith((b"ARROW:", b"pandas"))
    }
    return table.to_pylist(), metadata


def make_table(rows: list[Record], types: dict[str, type], metadata: dict[str, str]) -> pa.Table:
    """Builds the Arrow table of plain rows."""
    names = list(dict.fromkeys([key for row in rows for key in row] + list(types)))
    if not names:
        raise InputError("records", rows, "at least one record with one key, or `types`")
    columns = {}
    for name in names:
        values = [row.get(name) for row in rows]
        kind = find_type(name, values, types.get(name))
        columns[name] = pa.array(
            [None if value is None else kind(value) for value in values], _ARROW_TYPES[kind]
        )
    return pa.table(columns).replace_schema_metadata(metadata)


def find_type(name: str, values: list[Any], wanted: type | None = None) -> type:
    """Returns the type of a column: bool, int, float or str."""
    found = {type(value) for value in values if value is not None}
    valid = "one of bool, int, float, str per column (int and float make float)"
    if not found <= set(_ARROW_TYPES):
        raise InputError(f"column {name!r}", sorted(t.__name__ for t in found), valid)
    if found == {int, float}:
        found = {float}
    if wanted is float and found == {int}:
        found = {float}
    if len(found) > 1 or (wanted is not None and found - {wanted}):
        expected = valid if wanted is None else f"{wanted.__name__} or None"
        raise InputError(f"column {name!r}", sorted(t.__name__ for t in found), expected)
    if wanted is not None and wanted not in _ARROW_TYPES:
        raise InputError(f"type of column {name!r}", wanted, valid)
    return wanted or (found.pop() if found else str)


def _to_plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
