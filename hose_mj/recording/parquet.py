"""Tables of records: Parquet as the durable form, CSV with the same columns and rows to read."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hose_mj.errors import InputError
from hose_mj.extras import require
from hose_mj.recording.files import write_atomically

Record = dict[str, Any]
_ARROW_TYPES = {bool: "bool", int: "int64", float: "double", str: "string"}


def load_pyarrow() -> Any:
    """Returns pyarrow with its parts for CSV and Parquet; the extra `report` brings it.

    Raises:
        MissingExtra: it is not installed.
    """
    require("pyarrow", "writing tables")
    import pyarrow.csv
    import pyarrow.parquet

    return pyarrow


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
    rows = [
        {str(k): v.item() if isinstance(v, np.generic) else v for k, v in record.items()}
        for record in records
    ]
    table = make_table(rows, dict(types or {}), dict(metadata or {}))
    _write_parquet(table, parquet_path)
    if csv_path is not None:
        text = io.BytesIO()
        load_pyarrow().csv.write_csv(table, text)
        write_atomically(Path(csv_path), text.getvalue())


def write_columns(columns: Mapping[str, npt.NDArray[Any]], parquet_path: Path) -> None:
    """Writes one-dimensional arrays of equal length as columns; the file is replaced at once."""
    _write_parquet(load_pyarrow().table(dict(columns)), parquet_path)


def make_table(rows: list[Record], types: dict[str, type], metadata: dict[str, str]) -> Any:
    """Builds the Arrow table of plain rows."""
    pa = load_pyarrow()
    names = list(dict.fromkeys([key for row in rows for key in row] + list(types)))
    if not names:
        raise InputError("records", rows, "at least one record with one key, or `types`")
    columns = {}
    for name in names:
        values = [row.get(name) for row in rows]
        kind = find_type(name, values, types.get(name))
        plain = [None if value is None else kind(value) for value in values]
        columns[name] = pa.array(plain, _ARROW_TYPES[kind])
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


def _write_parquet(table: Any, path: Path) -> None:
    pa = load_pyarrow()
    sink = pa.BufferOutputStream()
    pa.parquet.write_table(table, sink, compression="zstd")
    write_atomically(Path(path), sink.getvalue().to_pybytes())
