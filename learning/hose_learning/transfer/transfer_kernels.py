"""Writes many rows of a table at once."""

from __future__ import annotations

from hose_learning.tables import claim
from hose_mj.jit import compiled


@compiled
def write_rows(table, keys, rows, origins):  # type: ignore[no-untyped-def]
    """Writes a row under each key.

    Args:
        table: the table, with room for all keys.
        keys: where to write (n,).
        rows: what to write from (n_rows, width).
        origins: which row belongs under each key (n,).
    """
    for k in range(keys.shape[0]):
        row = claim(table, keys[k])
        for column in range(rows.shape[1]):
            table.rows[row, column] = rows[origins[k], column]
