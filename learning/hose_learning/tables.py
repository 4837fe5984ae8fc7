"""Tables of rows by an integer key: dense while that fits, hashed above, read and written alike.

A dense table has a row for every key. A hashed one holds the rows that were written, in open
addressing with linear probing; what was never written reads as zeros. `grow` doubles it; compiled
loops stop before it is full and leave that to their caller.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hose_mj.jit import compiled, jitable
from hose_mj.tasks.kernels import Integers

LARGEST_DENSE = 2**21
"""Most rows of a dense table; above that, visited rows side by side beat rows in their places."""
DENSE_WIDTH = 8  # longest rows of which there may be so many; of longer ones there may be fewer
FIRST_CAPACITY = 2**14
SLOTS_PER_KEY = 2  # slots for each key at least; with fewer the probes grow long
_FREE = 0


class Table(NamedTuple):
    """Rows by key."""

    # Key + 1 of each slot, 0 where it is free (capacity,), a power of two; none at all in a dense
    # table, whose keys are its rows.
    keys: Integers
    used: Integers  # number of slots taken (1,)
    rows: Any  # the rows (capacity + 1, width); the last one is zero and stands for all absent keys


def make_table(size: int, width: int, dtype: npt.DTypeLike, hashed: bool | None = None) -> Table:
    """Makes a table of zeros for the keys 0 .. size - 1, with rows of a width and a type.

    It is hashed, by default, where `LARGEST_DENSE` is exceeded.
    """
    if hashed is None:
        hashed = size * max(width, DENSE_WIDTH) > LARGEST_DENSE * DENSE_WIDTH
    capacity = FIRST_CAPACITY if hashed else size
    keys = np.zeros(capacity if hashed else 0, np.int64)
    return Table(keys, np.zeros(1, np.int64), np.zeros((capacity + 1, width), dtype))


@jitable
def probe(keys: Integers, key: int) -> int:
    """Returns the slot that holds the key, or the free one where it belongs."""
    last = keys.shape[0] - 1
    # Odd factors below 2^30, so that nothing overflows and plain Python finds the same slot.
    mixed = (key & 0xFFFFFFFF) * 0x2E3779B1 + (key >> 32) * 0x25EBCA77
    mixed = ((mixed ^ mixed >> 31) & 0x7FFFFFFF) * 0x2545F491
    slot = mixed >> 20 & last
    while keys[slot] != _FREE and keys[slot] != key + 1:
        slot = (slot + 1) & last
    return slot


@jitable
def find(table: Table, key: int) -> int:
    """Returns the row of a key to read from; the row of zeros if it was never written."""
    if table.keys.shape[0] == 0:
        return key
    slot = probe(table.keys, key)
    return slot if table.keys[slot] != _FREE else table.keys.shape[0]


@jitable
def claim(table: Table, key: int) -> int:
    """Returns the row of a key to write to, which is made if it is absent."""
    if table.keys.shape[0] == 0:
        return key
    slot = probe(table.keys, key)
    if table.keys[slot] == _FREE:
        table.keys[slot] = key + 1
        table.used[0] += 1
    return slot


@jitable
def count_free(table: Table) -> int:
    """Returns how many more keys may be claimed before the table has to grow."""
    if table.keys.shape[0] == 0:
        return 1 << 62
    return table.keys.shape[0] // SLOTS_PER_KEY - table.used[0]


def is_sound(table: Table) -> bool:
    """Whether the parts of a table fit together, as those of one read from a file may not."""
    capacity = len(table.keys)
    if capacity == 0:
        return True
    n_keys = int(np.count_nonzero(table.keys))
    fits = capacity & (capacity - 1) == 0 and len(table.rows) == capacity + 1
    return fits and int(table.used[0]) == n_keys < capacity


def grow(table: Table) -> Table:
    """Returns a hashed table of twice the capacity with the same rows."""
    capacity = 2 * len(table.keys)
    grown = Table(
        np.zeros(capacity, np.int64),
        np.zeros(1, np.int64),
        np.zeros((capacity + 1, table.rows.shape[1]), table.rows.dtype),
    )
    _copy(table, grown)
    return grown


@compiled
def _copy(table: Table, grown: Table) -> None:
    """Writes every row of one hashed table into another one."""
    for slot in range(table.keys.shape[0]):
        if table.keys[slot] != _FREE:
            row = claim(grown, table.keys[slot] - 1)
            grown.rows[row] = table.rows[slot]


@compiled
def write_rows(table: Table, keys: Integers, rows: Any, origins: Integers) -> None:
    """Writes under each key (n,) the row of `rows` that `origins` (n,) names; there is room."""
    for k in range(keys.shape[0]):
        row = claim(table, keys[k])
        for column in range(rows.shape[1]):
            table.rows[row, column] = rows[origins[k], column]
