"""CSV of plain numbers is read as cell by cell, or not at all."""

import numpy as np
import pytest

from oarlock.storage.csv_cells import plain_columns
from oarlock.storage.delimited import ColumnLayout, Dialect, numbers

NAMES = ("time_s", "value")
EXTREMES = (5e-324, 2.2250738585072011e-308, 1.7976931348623157e308, -0.0, 0.1 + 0.2, 9007199254740993.0)


def cell_by_cell(file):
    layout = ColumnLayout.of(file, Dialect())
    batches = list(layout.batches(range(len(NAMES))))
    return {name: np.concatenate([numbers(layout, b, i, i) for b in batches]) for i, name in enumerate(NAMES)}


def test_numbers_have_the_bits_of_cell_by_cell(tmp_path):
    random = np.random.default_rng(6).integers(0, 2**64, 20_000, dtype=np.uint64).view(np.float64)
    values = [*EXTREMES, *random[np.isfinite(random)]]
    file = tmp_path / "plain.csv"
    rows = [f"{i},{'' if i % 7 == 0 else repr(float(value))}" for i, value in enumerate(values)]
    file.write_text("\n".join([",".join(NAMES), *rows, "", "1e5, 2.5 ", "1E6,NaN"]), encoding="utf-8")
    found, expected = plain_columns(file, NAMES), cell_by_cell(file)
    assert found is not None
    for name in NAMES:
        np.testing.assert_array_equal(found[name].view(np.uint64), expected[name].view(np.uint64), name)


@pytest.mark.parametrize(
    "row",
    [
        "1,inf",
        "1,-Infinity",
        "1,1e999",
        "1,---",
        "1,two",
        '1,"2"',
        "1,1_0",
        "1",
        "1,2,3",
        "1,0x10",
        "1,nan(2)",
    ],
)
def test_what_needs_a_closer_look_is_left(tmp_path, row):
    file = tmp_path / "odd.csv"
    file.write_text(f"time_s,value\n0,1\n{row}\n", encoding="utf-8")
    assert plain_columns(file, NAMES) is None


def test_another_header_is_left(tmp_path):
    file = tmp_path / "odd.csv"
    file.write_text("time_s, value\n0,1\n", encoding="utf-8")
    assert plain_columns(file, NAMES) is None
