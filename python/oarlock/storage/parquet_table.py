"""Reads and writes the Parquet files of recordings, tracks and live channels, with the engine.

Tables of a season have moments and maps, too: pyarrow reads them (`season.tables`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from oarlock._core import read_parquet, write_parquet
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular, shown_bytes

_NUMBER_BYTES = 8
EXPANSION = 100
"""Decoded bytes for each byte of the file, at most. Recordings and tracks have less than 10; equal rows any number."""
ALWAYS_READ_BYTES = 2**28
"""So many decoded bytes are read whatever the size of the file: constant signals are small."""


class Texts(NamedTuple):
    """A column of texts: the place of each row's text in `words`, (T,), -1 where there is none."""

    places: NDArray[np.int32]
    words: Sequence[str]

    @classmethod
    def of(cls, texts: Sequence[str | None]) -> Texts:
        """The texts of all rows, each stored once."""
        words = {text: place for place, text in enumerate(dict.fromkeys(t for t in texts if t is not None))}
        return cls(np.array([-1 if t is None else words[t] for t in texts], dtype=np.int32), list(words))

    def rows(self) -> list[str | None]:
        """The text of each row. Equal ones are one object: a small file can repeat a long text any number of times."""
        known = [*self.words, None]
        return [known[place] for place in self.places.tolist()]


Column = NDArray[Any] | Texts


@dataclass(frozen=True)
class ParquetTable:
    """The columns of a file by name, (T,) or (T, N), and the texts of its metadata; errors name the file."""

    where: str
    columns: Mapping[str, Column]
    about: Mapping[str, str] = field(default_factory=dict)
    advice: str = ""

    def numbers(self, name: str, dimensions: int = 1) -> Floats:
        """A column of numbers, (T,), or (T, N) with two dimensions; NaN where a number is missing.

        Raises:
            DataError: there is no such column, or it has no numbers, or another shape.
        """
        column = self._column(name)
        if isinstance(column, Texts) or column.dtype.kind not in "if" or column.ndim != dimensions:
            kind = "texts" if isinstance(column, Texts) else f"{column.dtype}, {column.ndim} dimensions"
            raise self._wrong_type(name, kind)
        return np.asarray(column, dtype=np.float64)

    def texts(self, name: str) -> Texts:
        """A column of texts.

        Raises:
            DataError: there is no such column, or it has no texts.
        """
        column = self._column(name)
        if not isinstance(column, Texts):
            raise self._wrong_type(name, str(column.dtype))
        return column

    def _column(self, name: str) -> Column:
        if name not in self.columns:
            raise DataError(f"{self.where}: column '{name}' is missing; the file is damaged{self.advice}")
        return self.columns[name]

    def _wrong_type(self, name: str, kind: str) -> DataError:
        return DataError(
            f"{self.where}: a column has the wrong type ('{name}': {kind}); the file is damaged{self.advice}"
        )


def read_table(
    file: Path | bytes, advice: str = "", where: str = "", without_lists: bool = False
) -> ParquetTable:
    """All columns.

    Args:
        file: the file, or its contents.
        advice: what to do, for errors.
        where: what errors begin with; the file.
        without_lists: whether columns of lists are left out; else lists of different lengths are refused.

    Raises:
        DataError: it is not there, no Parquet, or unpacks to far more than any recording would; with `advice`.
    """
    place = where or str(file)
    if isinstance(file, bytes):
        contents = file
    else:
        with open_regular(file) as stream:
            contents = stream.read()
    most = max(ALWAYS_READ_BYTES, EXPANSION * len(contents))
    try:
        columns, about = read_parquet(contents, most // _NUMBER_BYTES, without_lists)
    except OverflowError:
        raise DataError(
            f"{place}: has {shown_bytes(len(contents))} and unpacks to more than {shown_bytes(most)}. "
            "No measured signal is so regular: the file is damaged, or not a recording. "
            "If it is one, save it as CSV, or in parts."
        ) from None
    except ValueError as error:
        raise DataError(f"{place}: cannot be read as Parquet ({error}){advice}") from error
    named = {name: Texts(*c) if isinstance(c, tuple) else c for name, c in columns.items()}
    return ParquetTable(place, named, about, advice)


def write_table(columns: Mapping[str, Column], file: Path, about: Mapping[str, str] | None = None) -> None:
    """Write columns, (T,) or (T, N), and texts as metadata of the file.

    Raises:
        DataError: the columns have different lengths.
        OSError: the file cannot be written.
    """
    write_parquet(file, dict(columns), dict(about or {}))
