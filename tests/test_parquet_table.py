"""Parquet files with a damaged footer are refused; none ends the process."""

import subprocess
import sys

import numpy as np
import pyarrow as pa
from pyarrow import parquet

import oarlock
from oarlock.rowing.strokes.files import parsed_strokes
from oarlock.storage import parquet_table
from oarlock.storage.parquet_table import (
    arrow_numbers,
    arrow_words,
    numbers_of,
    read_table,
    texts_of,
    with_plain_texts,
)
from refusals import assert_refused

READ_EACH = """
import sys
from pathlib import Path
from oarlock.storage.errors import DataError
from oarlock.storage.parquet_table import read_table

file = Path(sys.argv[1])
whole = file.read_bytes()
footer = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
refused = 0
for place in range(footer, len(whole)):
    for bit in (1, 4, 64):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ bit]) + whole[place + 1:])
        try:
            read_table(file)
        except DataError:
            refused += 1
print(refused)
"""


def test_no_damaged_footer_ends_the_process(tmp_path):
    file = tmp_path / "table.parquet"
    rows = pa.FixedSizeListArray.from_arrays(pa.array([0.0, 1.0, 2.0, 3.0]), 2)
    parquet.write_table(pa.table({"mean": rows, "name": ["a", "b"]}), file)
    read = subprocess.run([sys.executable, "-c", READ_EACH, file], capture_output=True, text=True)
    assert read.returncode == 0, read.stderr
    assert int(read.stdout) > 100


def contents_of(table):
    sink = pa.BufferOutputStream()
    parquet.write_table(table, sink)
    return sink.getvalue().to_pybytes()


def test_columns_of_lists_are_refused_left_out_or_named():
    contents = contents_of(pa.table({"a": [1.0, 2.0], "curve": [[1.0], [2.0, 3.0]]}))
    assert_refused(lambda: read_table(contents, where="x"), "x: cannot be read as Parquet (a column of lists")
    assert read_table(contents, without_lists=True).column_names == ["a"]
    assert read_table(contents, columns=["curve", "gone"]).to_pydict() == {"curve": [[1.0], [2.0, 3.0]]}


def test_a_long_text_of_many_rows_is_one_object(monkeypatch):
    reason = "no oar " * 100
    table = read_table(contents_of(pa.table({"reason": [reason, None, reason] * 10, "a": [1.0] * 30})))
    first, missing, other = texts_of(table["reason"])[:3]
    assert first == reason and missing is None and other is first
    plain = with_plain_texts(table, "x")
    assert plain.schema.field("reason").type == pa.string() and plain["reason"].to_pylist()[2] == reason
    monkeypatch.setattr(parquet_table, "_MOST_TEXT_BYTES", 20_000)
    assert_refused(lambda: with_plain_texts(table, "x"), "x: its texts unpack to more than 20.0 kB")


def test_strokes_whose_columns_have_damaged_names_are_refused():
    contents = contents_of(pa.table({"time_s": [1.0], "rate_per_min": [30.0]})).replace(
        b"rate_per", b"rate_\xffer"
    )
    assert_refused(lambda: parsed_strokes(contents, "strokes.parquet"), "cannot be read as Parquet")


def test_numbers_are_the_same_in_parts_and_missing_ones_are_nan():
    whole = pa.chunked_array([[0.5, np.nan], [2.5]])
    np.testing.assert_array_equal(numbers_of(whole), [0.5, np.nan, 2.5])
    np.testing.assert_array_equal(numbers_of(pa.chunked_array([[0.5, None], [2.5]])), [0.5, np.nan, 2.5])
    np.testing.assert_array_equal(numbers_of(pa.chunked_array([[1, 2], [3]])), [1, 2, 3])
    assert numbers_of(pa.chunked_array([], pa.float64())).shape == (0,)


def test_columns_are_what_pyarrow_makes_of_arrays():
    table = np.arange(12.0).reshape(4, 3)
    assert arrow_numbers(table[:, 1]).equals(pa.array(np.ascontiguousarray(table[:, 1])))
    for places in (np.array([2, 0, 2, 1]), np.array([1, 1]), np.array([], dtype=np.int64)):
        words = ("", "märz", "field")
        made = arrow_words(places, words)
        assert made.equals(pa.array([words[place] for place in places], pa.string()).dictionary_encode())


def test_reading_and_writing_a_recording_does_not_import_pandas(tmp_path):
    stream = oarlock.ScalarStream("seat", np.arange(5.0), np.arange(5.0), "m")
    oarlock.Recording([stream]).save(tmp_path / "rec")
    asked = "import sys, oarlock; oarlock.load_recording(sys.argv[1]).save(sys.argv[2]); print('pandas' in sys.modules)"
    read = subprocess.run(
        [sys.executable, "-c", asked, tmp_path / "rec", tmp_path / "copy"], capture_output=True, text=True
    )
    assert read.stdout == "False\n", read.stderr
