"""Reads whole columns of a delimited file by name, for the readers of this folder."""

from collections.abc import Sequence

import numpy as np

from oarlock.storage.array_gate import FloatArray
from oarlock.storage.delimited import Layout, numbers
from oarlock.storage.errors import DataError


def read_columns(layout: Layout, names: Sequence[str | int]) -> FloatArray:
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
