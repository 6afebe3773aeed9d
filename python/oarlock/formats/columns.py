"""Reads whole columns of a delimited file by name, and names the places of cells. For the readers of this room."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.delimited import ColumnLayout, numbers
from oarlock.storage.errors import DataError


class Places(Sequence[str]):
    """File, line and column of each row, as text for errors."""

    def __init__(self, layout: ColumnLayout, lines: Ints, index: int) -> None:
        self._layout, self._lines, self._index = layout, lines, index

    def __len__(self) -> int:
        return len(self._lines)

    def __getitem__(self, row: Any) -> Any:
        return f"{self._layout.file}:{self._lines[row]}, {self._layout.label(self._index)}"


def read_columns(layout: ColumnLayout, names: Sequence[str | int]) -> Floats:
    """The columns of these names or numbers from 1, (T, len(names)); NaN where a cell is empty.

    Raises:
        DataError: A column is missing, a cell is not a number (file, line, column), or there are no rows.
    """
    wanted = [layout.index(name) for name in names]
    parts = [
        np.column_stack([numbers(layout, batch, position, index) for position, index in enumerate(wanted)])
        for batch in layout.batches(wanted)
    ]
    if not parts:
        raise DataError(f"{layout.file}: has a header but no rows of data")
    return np.concatenate(parts)
