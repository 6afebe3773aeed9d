"""Which columns of a table belong to which inertial unit, time and counter; from their names."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from oarlock.formats.table.header import InertialColumn, Quantity, channel_of, unit_name
from oarlock.formats.table.layout import TableStart
from oarlock.storage.errors import DataError

_TIME_WORDS = frozenset(
    [
        "time",
        "timestamp",
        "zeit",
        "uhrzeit",
        "zeitstempel",
        "temps",
        "tiempo",
        "tijd",
        "tempo",
        "t",
        "datetime",
        "epoch",
        "elapsed",
        "timecode",
        "ts",
    ]
)
_COUNT_WORDS = frozenset(
    [
        "frame",
        "frames",
        "sample",
        "samples",
        "index",
        "packetcounter",
        "counter",
        "packet",
        "count",
        "seq",
        "sequence",
    ]
)
_COUNTER_WORDS = frozenset(["packetcounter", "counter", "seq", "sequence"])
_X_IN_SECONDS = re.compile(r"x\s*[\[(]\s*(s|ms|us|µs)\s*[\])]", re.IGNORECASE)
_INERTIAL: tuple[Quantity, ...] = ("gyro", "accel", "mag")
_QUATERNIONS = ("wxyz", "0123", "1234")


@dataclass(frozen=True)
class QuantityColumns:
    """Columns of a quantity.

    Args:
        places: positions of x, y, z.
        measured_in: unit of measurement; None if the names say none.
        time: position of the time column; None if the table has none.
    """

    places: tuple[int, int, int]
    measured_in: str | None
    time: int | None


@dataclass(frozen=True)
class UnitColumns:
    """Columns of one inertial unit.

    Args:
        name: of the unit.
        quantities: gyro, accel and mag, of what it has.
        orientation: positions of w, x, y, z; empty if the table has none.
    """

    name: str
    quantities: Mapping[Quantity, QuantityColumns]
    orientation: tuple[int, ...]


@dataclass(frozen=True)
class TableColumns:
    """Columns of a table by their meaning; positions count from 0.

    Args:
        units: the inertial units.
        times: columns of time stamps.
        counts: columns that count rows or packets.
        counter: the device's count of packets, if there is one beside the time.
        incomplete: sentences on quantities that were left out because an axis is missing.
    """

    units: tuple[UnitColumns, ...]
    times: tuple[int, ...]
    counts: tuple[int, ...]
    counter: int | None
    incomplete: tuple[str, ...]


def table_columns(start: TableStart) -> TableColumns:
    """The columns by their meaning.

    Raises:
        DataError: No column belongs to an inertial unit.
    """
    channels = {
        place: channel
        for place, (name, unit) in enumerate(zip(start.names, start.units, strict=True))
        if (channel := channel_of(name, unit)) is not None
    }
    times = tuple(p for p, n in enumerate(start.names) if p not in channels and _is_time(n))
    counts = tuple(
        p for p, n in enumerate(start.names) if p not in (*channels, *times) and _words(n) & _COUNT_WORDS
    )
    owners = _time_of(channels, times)
    found: dict[str, dict[Quantity, dict[str, int]]] = {}
    for place, name in _named(start, channels).items():
        channel = channels[place]
        axes = found.setdefault(name, {}).setdefault(channel.quantity, {})
        if channel.axis not in axes or (channel.is_raw and not channels[axes[channel.axis]].is_raw):
            axes[channel.axis] = place
    incomplete = tuple(
        f"{start.file.name}: {name} has no {quantity} along {', '.join(missing)}; its {quantity} was left out."
        for name, quantities in found.items()
        for quantity, axes in quantities.items()
        if quantity != "quat" and (missing := [axis for axis in "xyz" if axis not in axes])
    )
    units = tuple(
        unit for name, axes in found.items() if (unit := _unit(name, axes, channels, owners)).quantities
    )
    # A magnetometer alone is no inertial unit, and Mx, My, Mz are moments too.
    units = tuple(unit for unit in units if {"gyro", "accel"} & unit.quantities.keys())
    if not units:
        raise DataError(f"{start.file}: {_nothing_text(start)}")
    counter = next((p for p in counts if times and _words(start.names[p]) & _COUNTER_WORDS), None)
    return TableColumns(units, times, counts, counter, incomplete)


def _unit(
    name: str,
    quantities: Mapping[Quantity, Mapping[str, int]],
    channels: Mapping[int, InertialColumn],
    owners: Mapping[int, int | None],
) -> UnitColumns:
    whole: dict[Quantity, QuantityColumns] = {}
    for quantity in _INERTIAL:
        axes = quantities.get(quantity, {})
        if all(axis in axes for axis in "xyz"):
            places = (axes["x"], axes["y"], axes["z"])
            unit = channels[places[0]].measured_in
            whole[quantity] = QuantityColumns(places, unit, owners[places[0]])
    turned = quantities.get("quat", {})
    letters = next((letters for letters in _QUATERNIONS if set(letters) <= set(turned)), "")
    return UnitColumns(name, whole, tuple(turned[letter] for letter in letters))


def _named(start: TableStart, channels: Mapping[int, InertialColumn]) -> dict[int, str]:
    """Name of the unit of each column; equal columns of several units are named by a line above, or numbered."""
    seen: dict[tuple[str, Quantity, str, bool], int] = {}
    repeats: dict[int, int] = {}
    for place, one in channels.items():
        key = (one.unit, one.quantity, one.axis, one.is_raw)
        seen[key] = seen.get(key, 0) + 1
        repeats[place] = seen[key]
    several = {key[0] for key, count in seen.items() if count > 1}
    if several and (above := _named_above(start, repeats)):
        return {place: above[repeats[place] - 1] for place in channels}
    return {
        place: f"{one.unit or 'imu'}_{repeats[place]}" if one.unit in several else one.unit or "imu"
        for place, one in channels.items()
    }


def _named_above(start: TableStart, repeats: Mapping[int, int]) -> list[str]:
    """Names of repeated units from a line above that has each over the first of its columns; empty without one."""
    count = max(repeats.values())
    spans = [[place for place, k in repeats.items() if k == wanted] for wanted in range(1, count + 1)]
    for line in start.above:
        cells = next(csv.reader([line], delimiter=start.dialect.delimiter), [])
        filled = [place for place, cell in enumerate(cells) if cell.strip()]
        names = [unit_name(cells[place]) for place in filled]
        ends = [*filled[1:], len(start.names)]
        if (
            len(filled) == count == len(set(names))
            and all(names)
            and all(
                first <= min(own) and max(own) < end
                for first, own, end in zip(filled, spans, ends, strict=True)
            )
        ):
            return names
    return []


def _time_of(channels: Mapping[int, InertialColumn], times: Sequence[int]) -> dict[int, int | None]:
    """Time column of each channel: the one to its left if each time column has channels, otherwise the first."""
    left = {place: max((t for t in times if t < place), default=None) for place in channels}
    if len(times) > 1 and None not in left.values() and len(set(left.values())) > 1:
        return left
    return dict.fromkeys(channels, times[0] if times else None)


def _is_time(name: str) -> bool:
    return bool(_words(name) & _TIME_WORDS) or _X_IN_SECONDS.fullmatch(name.strip()) is not None


def _words(name: str) -> set[str]:
    whole = {word.lower() for word in re.findall(r"[^\W\d_]+", name)}
    return whole | {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)}


def _nothing_text(start: TableStart) -> str:
    shown = ", ".join(name for name in start.names[:8] if name)
    more = f" and {len(start.names) - 8} more" if len(start.names) > 8 else ""
    return f"no three columns are an accelerometer or a gyroscope (columns: {shown}{more})"
