"""Tables against a dict, dense and hashed."""

import numpy as np
import pytest
from hose_learning import tables
from hose_learning.tables import Table, claim, count_free, find, grow, is_sound, make_table
from hypothesis import given, settings
from hypothesis import strategies as st

LARGEST = 2**62
keys = st.one_of(
    st.integers(0, 7), st.integers(0, LARGEST - 1), st.integers(0, 40).map(lambda k: k << 52)
)
writes = st.lists(st.tuples(keys, st.integers(-5, 5)), max_size=60)


def make_small(capacity, width=1, dtype=np.int64):
    return Table(
        np.zeros(capacity, np.int64), np.zeros(1, np.int64), np.zeros((capacity + 1, width), dtype)
    )


@settings(deadline=None, max_examples=50)
@given(writes=writes, asked=st.lists(keys, max_size=10))
def test_a_hashed_table_is_a_dict_that_says_0(writes, asked):
    table, expected = make_small(4), {}
    for key, value in writes:
        table.rows[claim(table, key), 0] = value
        expected[key] = value
        assert table.used[0] == len(expected)
        assert is_sound(table)
        if count_free(table) <= 0:
            table = grow(table)
    for key in [*expected, *asked]:
        assert table.rows[find(table, key), 0] == expected.get(key, 0)
    assert table.rows[-1, 0] == 0
    assert len(table.keys) // 2 >= len(expected)


@given(writes=st.lists(st.tuples(st.integers(0, 30), st.integers(-5, 5))))
def test_a_dense_table_has_each_key_in_its_place(writes):
    table = make_table(31, 2, np.float64)
    for key, value in writes:
        table.rows[claim(table, key)] = value, -value
    for key, value in dict(writes).items():
        assert table.rows[find(table, key)].tolist() == [value, -value]
    assert count_free(table) > 2**61
    assert not table.rows[-1].any()


def test_a_table_is_hashed_where_its_rows_are_too_many():
    assert len(make_table(tables.LARGEST_DENSE, 1, np.int8).keys) == 0
    assert len(make_table(tables.LARGEST_DENSE + 1, 1, np.int8).keys) == tables.FIRST_CAPACITY
    assert len(make_table(10, 1, np.int8, hashed=True).keys) == tables.FIRST_CAPACITY
    assert make_table(10, 3, np.int8, hashed=False).rows.shape == (11, 3)


def test_half_of_a_hashed_table_stays_free():
    table = make_small(16)
    for n in range(8):
        assert count_free(table) == 8 - n
        claim(table, 5 * n)
        claim(table, 5 * n)
    assert count_free(table) == 0
    assert count_free(grow(table)) == 8


def test_growing_keeps_rows_of_any_type():
    table = make_small(8, 3, np.float64)
    for key in (0, LARGEST - 1, 77):
        table.rows[claim(table, key)] = key, 0.5, -float(key)
    grown = grow(grow(table))
    assert grown.rows.shape == (33, 3)
    for key in (0, LARGEST - 1, 77):
        assert grown.rows[find(grown, key)].tolist() == [float(key), 0.5, -float(key)]


def test_what_does_not_fit_together_is_not_sound():
    table = make_small(8)
    claim(table, 3)
    assert is_sound(table)
    assert is_sound(make_table(5, 1, np.int64))
    assert not is_sound(table._replace(rows=table.rows[:-1]))
    assert not is_sound(table._replace(used=table.used + 1))
    assert not is_sound(table._replace(keys=table.keys[:-1], rows=table.rows[:-1]))
    full = table._replace(keys=np.arange(1, 9), used=np.array([8]))
    assert not is_sound(full)


def test_neighbours_spread():
    """Keys that differ in few bits take nearly as many slots as there are keys."""
    table = make_small(2**12)
    for shift in (0, 5, 11, 20):
        slots = {int(tables.probe(table.keys, k << shift)) for k in range(512)}
        # 512 balls thrown into 4096 bins hit 4096 (1 - e^(-1/8)) = 481 of them.
        assert len(slots) > 440, shift


@pytest.mark.parametrize("key", [0, 1, LARGEST - 1])
def test_reading_makes_nothing(key):
    table = make_small(8)
    assert find(table, key) == 8
    assert table.used[0] == 0
