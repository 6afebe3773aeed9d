"""Channels: what devices of a live session sent and no sensor of the model takes, such as speed or heart rate.

A table for each source and part of its devices: `Channels` collects and writes them when a session ends,
`channels(folder)` reads them. A folder has one Parquet file for each table.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oarlock.live.intake import Spare
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import read_manifest, replaced_folder
from oarlock.storage.names import file_names
from oarlock.storage.parquet_table import Column, ParquetTable, Texts, read_table, write_table
from oarlock.storage.paths import place_of

FOLDER, KIND = "channels", "channels"
"""The folder within that of the session, and its kind in the manifest."""
MOST_TABLES, MOST_QUANTITIES, MOST_NUMBERS = 200, 100, 512
"""Tables, quantities of a table, numbers of a value: what is beyond is in the packets only."""
_STAMPS = ("time_s", "arrival_s", "clock_s")
_OWN = (*_STAMPS, "address")
_TITLE = "oarlock"


@dataclass(frozen=True, eq=False)
class Channel:
    """What the devices of one source, or one part of them, sent beside the sensors' readings; a row a message.

    Args:
        name: of the source in the rig file, and the part of the device behind a "/": `pm5/drive`.
        time_s: (T,) s from the session's start by this machine's clock, as in the recording and the track; NaN while
            the device's clock was not known yet. Without a clock of the device it is `arrival_s`.
        arrival_s: (T,) when the message was received.
        clock_s: (T,) the device's own stamps; NaN without.
        address: (T,) of the device, as the transport knows it.
        values: quantity -> (T,) numbers, NaN where the message has none; (T, N) for vectors and curves, NaN behind
            their end; (T,) texts, "" where the message has none.
    """

    name: str
    time_s: Floats
    arrival_s: Floats
    clock_s: Floats
    address: NDArray[Any]
    values: Mapping[str, NDArray[Any]]

    def of(self, quantity: str) -> tuple[Floats, NDArray[Any]]:
        """Times and values of one quantity, without the messages that do not have it or have no time.

        Raises:
            DataError: there is no such quantity.
        """
        if quantity not in self.values:
            known = ", ".join(self.values)
            raise DataError(f"the channel {self.name} has no {quantity}; it has {known}")
        values = self.values[quantity]
        is_there = (
            values != "" if values.dtype.kind in "OU" else np.isfinite(values.reshape(len(values), -1)).any(1)
        )
        rows = is_there & np.isfinite(self.time_s)
        return self.time_s[rows], values[rows]


def channels(folder: str | PathLike[str]) -> dict[str, Channel]:
    """The channels of a live session that has ended, by name: `gps`, `belt`, `pm5/drive`.

    Args:
        folder: that `oarlock live run` wrote, or `oarlock live recover`.

    Raises:
        DataError: it has no channels, or a file is damaged.
    """
    place = place_of(folder) / FOLDER
    if not place.is_dir():
        raise DataError(
            f"{folder}: has no folder {FOLDER}. It is written when a session ends in which a device sent more than the "
            "model's sensors take; after a kill, run `oarlock live recover`"
        )
    manifest = read_manifest(place)
    files = sorted(place.glob("*.parquet"))
    manifest.check([file.name for file in files])
    found = [_read(file) for file in files]
    return {channel.name: channel for channel in sorted(found, key=lambda channel: channel.name)}


@dataclass
class Channels:
    """Collects what feeds no sensor."""

    _tables: dict[str, _ChannelRows] = field(default_factory=dict)

    def take(self, spare: Spare) -> None:
        """Adds the values of a message."""
        if spare.channel not in self._tables and len(self._tables) >= MOST_TABLES:
            return
        self._tables.setdefault(spare.channel, _ChannelRows()).take(spare)

    def __len__(self) -> int:
        return len(self._tables)

    def save(self, folder: Path) -> None:
        """Write the tables; those of the same session before are replaced.

        Raises:
            DataError: they cannot be written.
        """
        names = list(self._tables)
        with replaced_folder(folder, KIND) as root:
            for name, file in zip(names, file_names([_plain(n) for n in names], "parquet"), strict=True):
                write_table(self._tables[name].columns_by_name(), root / file, {_TITLE: _plain(name)})


@dataclass
class _Column:
    """Values of one quantity and their rows; the first value decides of which kind all are."""

    kind: type
    rows: array[int] = field(default_factory=lambda: array("q"))
    values: list[Any] = field(default_factory=list)

    def column(self, count: int) -> Column:
        if self.kind is str:
            texts = [""] * count
            for row, text in zip(self.rows, self.values, strict=True):
                texts[row] = text
            return Texts.of(texts)
        if self.kind is float:
            numbers = np.full(count, np.nan)
            numbers[self.rows] = self.values
            return numbers
        width = max(map(len, self.values))
        wide = np.full((count, width), np.nan)
        for row, value in zip(self.rows, self.values, strict=True):
            wide[row, : len(value)] = value
        return wide


@dataclass
class _ChannelRows:
    stamps: tuple[array[float], ...] = field(default_factory=lambda: tuple(array("d") for _ in _STAMPS))
    addresses: list[str] = field(default_factory=list)
    columns: dict[str, _Column] = field(default_factory=dict)

    def take(self, spare: Spare) -> None:
        row = len(self.addresses)
        self.addresses.append(spare.address)
        for column, name in zip(self.stamps, _STAMPS, strict=True):
            stamp = getattr(spare, name)
            column.append(np.nan if stamp is None else stamp)
        for name, value in spare.values.items():
            if isinstance(value, tuple) and not 0 < len(value) <= MOST_NUMBERS:
                continue
            kind = type(value) if isinstance(value, str | tuple) else float
            if name not in self.columns and len(self.columns) < MOST_QUANTITIES:
                self.columns[name] = _Column(kind)
            of_name = self.columns.get(name)
            if of_name is not None and of_name.kind is kind:
                of_name.rows.append(row)
                of_name.values.append(_plain(value) if isinstance(value, str) else value)

    def columns_by_name(self) -> dict[str, Column]:
        count = len(self.addresses)
        own: dict[str, Column] = {
            name: np.array(column) for name, column in zip(_STAMPS, self.stamps, strict=True)
        }
        own["address"] = Texts.of([_plain(address) for address in self.addresses])
        return own | {
            _column_name(n): column.column(count) for n, column in self.columns.items() if column.rows
        }


def _plain(text: str) -> str:
    """Half of a character is none that a file could contain."""
    return text.encode("utf-8", "replace").decode()


def _column_name(quantity: str) -> str:
    plain = _plain(quantity)
    return f"{plain}_of_device" if plain in _OWN else plain


def _read(file: Path) -> Channel:
    table = read_table(file)
    if _TITLE not in table.about:
        raise DataError(f"{file}: was not written by a live session")
    time_s, arrival_s, clock_s = (table.numbers(name) for name in _STAMPS)
    return Channel(
        table.about[_TITLE],
        time_s,
        arrival_s,
        clock_s,
        _objects(table.texts("address")),
        dict(_values(table)),
    )


def _values(table: ParquetTable) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, column in table.columns.items():
        if name not in _OWN:
            yield name, _objects(column) if isinstance(column, Texts) else column


def _objects(texts: Texts) -> NDArray[Any]:
    return np.array(texts.rows(), dtype=object)
