"""Parquet files with a damaged footer are refused; none ends the process."""

import subprocess
import sys

import pyarrow as pa
from pyarrow import parquet

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
