"""Parquet files of recordings and tracks: read and written as pyarrow and DuckDB do; damaged ones are refused."""

import errno
import io
import subprocess
import sys

import duckdb
import numpy as np
import pyarrow as pa
import pytest
from hypothesis import strategies as st
from pyarrow import parquet

import oarlock
from fuzz_campaign import answered, campaign
from fuzz_wounds import byte_wounds, wounded_bytes
from oarlock.rowing.strokes.files import parsed_strokes
from oarlock.storage.parquet_table import Texts, read_table, write_table
from refusals import assert_refused

READ_EACH = """
import sys
from pathlib import Path
from oarlock.storage.errors import DataError
from oarlock.{reader}

file = Path(sys.argv[1])
whole = file.read_bytes()
footer = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
refused = 0
for place in range(footer, len(whole)):
    for bit in (1, 4, 64):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ bit]) + whole[place + 1:])
        try:
            read(file)
        except DataError:
            refused += 1
print(refused)
"""

READERS = (
    "storage.parquet_table import read_table as read",
    "season.tables import arrow_table; read = lambda file: arrow_table(file.read_bytes(), 'x')",
)
ROWS = 500
COLUMNS = {
    "time_s": np.arange(ROWS) / 100.0,
    "x": np.where(np.arange(ROWS) % 9 == 0, np.nan, np.random.default_rng(3).normal(size=ROWS)),
    "count": np.arange(ROWS) % 7 - 2**60,
    "still": np.arange(ROWS) % 3 == 0,
    "fault": Texts.of([("", "clipped", None, "märz")[i % 4] for i in range(ROWS)]),
    "mean": np.random.default_rng(4).normal(size=(ROWS, 3)),
}
ABOUT = {"oarlock": "belt", "notes": "[]"}

# What writers choose: pages of both versions, dictionaries, no compression, parts of rows, no schema of Arrow.
WRITTEN_AS = (
    {},
    {"data_page_version": "2.0"},
    {"use_dictionary": False},
    {"compression": "none"},
    {"row_group_size": 70, "data_page_size": 64},
    {"store_schema": False},
    {"data_page_size": 64, "use_dictionary": False, "data_page_version": "2.0"},
)


def arrow_of(columns):
    def array(column):
        if isinstance(column, Texts):
            return pa.array(column.rows(), pa.string())
        if column.ndim == 2:
            return pa.FixedSizeListArray.from_arrays(pa.array(column.ravel()), column.shape[1])
        return pa.array(column)

    return pa.table({name: array(column) for name, column in columns.items()})


def contents_of(table, **options):
    sink = io.BytesIO()
    parquet.write_table(table, sink, **options)
    return sink.getvalue()


def assert_same(found, expected):
    assert list(found) == list(expected)
    for name, column in expected.items():
        if isinstance(column, Texts):
            assert found[name].rows() == column.rows()
        else:
            assert found[name].dtype == column.dtype
            np.testing.assert_array_equal(found[name], column, name)


@pytest.mark.parametrize("options", WRITTEN_AS)
def test_what_pyarrow_wrote_is_read_to_the_bit(options):
    assert_same(read_table(contents_of(arrow_of(COLUMNS), **options)).columns, COLUMNS)


def test_missing_numbers_are_nan_and_narrow_ones_become_wide():
    table = pa.table(
        {
            "whole": pa.array([1, None, 3]),
            "yes": pa.array([True, None, False]),
            "real": pa.array([0.5, None, np.nan], pa.float32()),
            "byte": pa.array([200, 0, 7], pa.uint8()),
            "rows": pa.array([[1.0, None], [3.0, 4.0], [5.0, 6.0]]),
        }
    )
    found = read_table(contents_of(table)).columns
    np.testing.assert_array_equal(found["whole"], [1.0, np.nan, 3.0])
    np.testing.assert_array_equal(found["yes"], [1.0, np.nan, 0.0])
    np.testing.assert_array_equal(found["real"], [0.5, np.nan, np.nan])
    np.testing.assert_array_equal(found["byte"], [200, 0, 7])
    np.testing.assert_array_equal(found["rows"], [[1.0, np.nan], [3.0, 4.0], [5.0, 6.0]])


def test_pyarrow_and_duckdb_read_what_is_written(tmp_path):
    file = tmp_path / "table.parquet"
    write_table(COLUMNS, file, ABOUT)
    assert_same(read_table(file).columns, COLUMNS)
    assert read_table(file).about == ABOUT
    table = parquet.read_table(file)
    assert table.schema.metadata == {b"oarlock": b"belt", b"notes": b"[]"}
    for name in ("time_s", "x", "count", "still"):
        np.testing.assert_array_equal(table[name].to_numpy(), COLUMNS[name], name)
    assert table["fault"].to_pylist() == COLUMNS["fault"].rows()
    np.testing.assert_array_equal(np.array(table["mean"].to_pylist()), COLUMNS["mean"])
    row = duckdb.sql(
        f"SELECT count(fault), sum(time_s), max(count), mean[3] FROM '{file}' GROUP BY 4"
    ).fetchall()
    assert len(row) == ROWS
    (whole,) = duckdb.sql(f"SELECT count(*), count(fault), max(count), sum(time_s) FROM '{file}'").fetchall()
    assert whole[:3] == (ROWS, ROWS * 3 // 4, 6 - 2**60)
    assert whole[3] == pytest.approx(COLUMNS["time_s"].sum(), rel=1e-12)


def test_a_table_without_rows_is_one(tmp_path):
    file = tmp_path / "table.parquet"
    write_table({"time_s": np.zeros(0), "mean": np.zeros((0, 3)), "fault": Texts.of([])}, file)
    found = read_table(file)
    assert found.numbers("time_s").shape == (0,) and found.texts("fault").rows() == []


@pytest.mark.parametrize("size", [{}, {"mean": np.zeros((ROWS, 0))}, {"x": np.zeros(3)}])
def test_columns_that_are_no_table_are_refused(tmp_path, size):
    columns = {"time_s": np.zeros(ROWS), **size}
    if size:
        assert_refused(lambda: write_table(columns, tmp_path / "a.parquet"), next(iter(size)))
        return
    with pytest.raises(FileNotFoundError, match="absent") as error:
        write_table(columns, tmp_path / "absent/a.parquet")
    assert error.value.errno == errno.ENOENT


def test_numbers_and_texts_are_asked_for_by_name():
    table = read_table(contents_of(arrow_of(COLUMNS)), "; track again", "a.parquet")
    assert_refused(
        lambda: table.numbers("y"), "a.parquet: column 'y' is missing; the file is damaged; track again"
    )
    assert_refused(lambda: table.numbers("fault"), "a.parquet: a column has the wrong type ('fault'")
    assert_refused(lambda: table.numbers("mean"), "wrong type ('mean'")
    assert_refused(lambda: table.texts("x"), "wrong type ('x': float64)")
    np.testing.assert_array_equal(table.numbers("count"), COLUMNS["count"].astype(float))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (pa.array([[1.0], [2.0, 3.0]]), "lists of different lengths"),
        (pa.array([[1.0], None]), "lists of different lengths"),
        (pa.array([{"a": 1, "b": 2}, None]), "structures"),
        (pa.array([[[1.0]], [[2.0]]]), "lists of lists"),
        (pa.array([1, 2], pa.timestamp("us")), 'column "value" is of type INT64 (Timestamp'),
        (pa.array([2**63, 2], pa.uint64()), "an integer above"),
    ],
)
def test_columns_that_no_recording_has_are_refused(values, words):
    contents = contents_of(pa.table({"value": values}))
    assert_refused(lambda: read_table(contents, where="x"), "x: cannot be read as Parquet (", words)


def test_columns_of_lists_are_left_out():
    contents = contents_of(pa.table({"a": [1.0, 2.0], "curve": [[1.0], [2.0, 3.0]]}))
    assert list(read_table(contents, without_lists=True).columns) == ["a"]


def test_a_long_text_of_many_rows_is_one_object():
    reason = "no oar " * 100
    contents = contents_of(pa.table({"reason": [reason, None, reason] * 10, "a": [1.0] * 30}))
    first, missing, other = read_table(contents).texts("reason").rows()[:3]
    assert first == reason and missing is None and other is first


def test_more_than_any_signal_unpacks_to_is_refused():
    contents = contents_of(pa.table({"a": np.zeros(40_000_000)}))
    assert_refused(lambda: read_table(contents, where="x"), "x: has", "unpacks to more than 268.4 MB")


@pytest.mark.parametrize("reader", READERS)
def test_no_damaged_footer_ends_the_process(tmp_path, reader):
    file = tmp_path / "table.parquet"
    rows = pa.FixedSizeListArray.from_arrays(pa.array([0.0, 1.0, 2.0, 3.0]), 2)
    parquet.write_table(pa.table({"mean": rows, "name": ["a", "b"]}), file)
    read = subprocess.run(
        [sys.executable, "-c", READ_EACH.format(reader=reader), file], capture_output=True, text=True
    )
    assert read.returncode == 0, read.stderr
    assert int(read.stdout) > 100


def test_damaged_files_are_read_or_refused(tmp_path, capfd):
    write_table(COLUMNS, tmp_path / "own.parquet", ABOUT)
    files = [contents_of(arrow_of(COLUMNS), **options) for options in WRITTEN_AS]
    files.append((tmp_path / "own.parquet").read_bytes())

    def check(which, harm):
        table = answered(lambda: read_table(wounded_bytes(files[which], harm), where="a.parquet"))
        if table is not None:
            assert len({len(c.places if isinstance(c, Texts) else c) for c in table.columns.values()}) <= 1

    campaign(check, st.integers(0, len(files) - 1), byte_wounds, count=400)
    assert "panicked" not in capfd.readouterr().err


def test_strokes_whose_columns_have_damaged_names_are_refused():
    contents = contents_of(pa.table({"time_s": [1.0], "rate_per_min": [30.0]})).replace(
        b"rate_per", b"rate_\xffer"
    )
    assert_refused(lambda: parsed_strokes(contents, "strokes.parquet"), "cannot be read as Parquet")


def test_reading_and_writing_a_recording_imports_neither_pandas_nor_pyarrow(tmp_path):
    stream = oarlock.recording.ScalarStream("seat", np.arange(5.0), np.arange(5.0), "m")
    oarlock.Recording([stream]).save(tmp_path / "rec")
    asked = (
        "import sys, oarlock; oarlock.load_recording(sys.argv[1]).save(sys.argv[2]); "
        "print({'pandas', 'pyarrow', 'scipy'} & set(sys.modules))"
    )
    read = subprocess.run(
        [sys.executable, "-c", asked, tmp_path / "rec", tmp_path / "copy"], capture_output=True, text=True
    )
    assert read.stdout == "set()\n", read.stderr
