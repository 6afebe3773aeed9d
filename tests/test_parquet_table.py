"""Parquet files with a damaged footer are refused; none ends the process."""

import subprocess
import sys

import numpy as np
import pyarrow as pa
from pyarrow import parquet

import oarlock
from oarlock.storage.parquet_table import arrow_numbers, arrow_words, numbers_of

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
