import csv

import numpy as np
import pyarrow.parquet
import pytest

from hose_mj.errors import InputError
from hose_mj.recording.parquet import write_records

RECORDS = [
    {"case": "tip-load", "resolution": 8, "error": 1, "clamp_corrected": None},
    {"case": "", "resolution": np.int64(16), "error": 0.1 + 0.2, "clamp_corrected": True},
    {"case": 'a "quoted", one', "error": np.float64(1e-300), "note": "µ\nline"},
]


def read_records(path):
    table = pyarrow.parquet.read_table(path)
    kept = {k.decode(): v.decode() for k, v in (table.schema.metadata or {}).items()}
    return table.to_pylist(), kept


@pytest.fixture
def written(tmp_path):
    paths = tmp_path / "records.parquet", tmp_path / "records.csv"
    write_records(RECORDS, *paths, metadata={"revision": "abc"}, types={"fallbacks": int})
    return paths


def test_records_come_back(written):
    rows, metadata = read_records(written[0])
    names = ["case", "resolution", "error", "clamp_corrected", "note", "fallbacks"]
    assert list(rows[0]) == names
    assert rows == [{name: record.get(name) for name in names} for record in RECORDS]
    assert [type(row["error"]) for row in rows] == [float] * 3
    assert metadata == {"revision": "abc"}


def test_the_csv_has_the_same_columns_and_rows(written):
    rows, _ = read_records(written[0])
    with written[1].open(newline="", encoding="utf-8") as stream:
        header, *lines = list(csv.reader(stream))
    assert header == list(rows[0])
    assert len(lines) == len(rows)
    for line, row in zip(lines, rows, strict=True):
        for text, value in zip(line, row.values(), strict=True):
            if isinstance(value, bool):
                assert text == str(value).lower()
            elif isinstance(value, float):
                assert float(text) == value
            else:
                assert text == ("" if value is None else str(value))


def test_no_records_still_make_a_table(tmp_path):
    write_records([], tmp_path / "a.parquet", tmp_path / "a.csv", types={"error": float})
    assert read_records(tmp_path / "a.parquet") == ([], {})
    assert (tmp_path / "a.csv").read_text().split() == ['"error"']


@pytest.mark.parametrize(
    ("records", "types"),
    [
        ([{"a": 1}, {"a": "x"}], None),
        ([{"a": True}, {"a": 1}], None),
        ([{"a": [1]}], None),
        ([{"a": 1.5}], {"a": int}),
        ([{"a": None}], {"a": list}),
        ([], None),
    ],
)
def test_what_no_column_can_hold_is_refused(tmp_path, records, types):
    with pytest.raises(InputError):
        write_records(records, tmp_path / "a.parquet", types=types)
    assert not list(tmp_path.iterdir())
