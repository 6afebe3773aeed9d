"""The moment at which the clock of an export began, for those formats that name it. For `load_export`."""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

from oarlock.rowing.exports.grid import CellGrid, TableRows
from oarlock.storage.epoch import FIRST_S, LAST_S, epoch_text

_FIRST = datetime.datetime(1970, 1, 1)
_UTC = datetime.UTC
_CLOCK = re.compile(r"(?:(\d{1,3}):)?(\d{1,3}):(\d{1,2}(?:\.\d*)?)")
_OFFSET = re.compile(r"^(.*\d)\s*(?:GMT|UTC)?\s*([+-]\d\d):?(\d\d)$")
_STYLES = (
    "%m/%d/%Y %H:%M",
    "%m/%d/%y %I:%M%p",
    "%m/%d/%Y %I:%M%p",
    "%m/%d/%y %H:%M",
    "%m/%d/%Y %H:%M:%S",
)
"""As NK LiNK and RowPro write dates: the month comes first in all files whose day is above 12."""


def epoch_of_export(name: str, grid: CellGrid, header: int) -> str:
    """The moment of 0 s of the times of a file of this format, as `Recording.epoch`; "" if the file does not say."""
    find = _FINDERS.get(name)
    try:
        return "" if find is None else find(grid, header)
    except (ValueError, OverflowError, OSError):
        return ""  # a date that cannot be read is no reason to refuse the strokes


def epoch_of_seconds(seconds: float) -> str:
    """The epoch of a Unix time, to the microsecond; "" unless it lies between 1990 and 2100."""
    if not FIRST_S <= seconds <= LAST_S:
        return ""
    return epoch_text(round(seconds * 1e6) * 1000, "utc")


def epoch_of_text(text: str, back_s: float = 0.0) -> str:
    """The epoch `back_s` before a moment that is written out; local without a zone.

    Raises:
        ValueError: it is no moment.
    """
    found = _parsed(text.strip()) - datetime.timedelta(seconds=back_s)
    plain = found if found.tzinfo is None else found.astimezone(_UTC).replace(tzinfo=None)
    nanoseconds = round((plain - _FIRST).total_seconds() * 1e6) * 1000
    return epoch_text(nanoseconds, "local" if found.tzinfo is None else "utc")


def _parsed(text: str) -> datetime.datetime:
    zoned = _OFFSET.match(text)
    plain = f"{zoned[1].strip()}{zoned[2]}:{zoned[3]}" if zoned else text
    try:
        return datetime.datetime.fromisoformat(plain)
    except ValueError:
        pass
    for style in _STYLES:
        try:
            return datetime.datetime.strptime(text.upper(), style)
        except ValueError:
            continue
    raise ValueError(f"{text} is no moment")


def _rows(grid: CellGrid, header: int, *names: str) -> Iterator[list[str]]:
    """The named cells of each row; rows that lack one are left out."""
    rows = TableRows(grid.file, tuple(grid.cells[header]), (), ())
    places = [rows.place(name) for name in names]
    for cells in grid.cells[header + 1 :]:
        known = [place for place in places if place is not None and place < len(cells)]
        if len(known) == len(names) and all(cells[place] for place in known):
            yield [cells[place] for place in known]


def _stamps(stamp: str, elapsed: str, unit_s: float, elapsed_s: float) -> Callable[[CellGrid, int], str]:
    """Unix times in one column, the clock of the session in another."""

    def find(grid: CellGrid, header: int) -> str:
        found = [
            float(at) * unit_s - float(after) * elapsed_s for at, after in _rows(grid, header, stamp, elapsed)
        ]
        return epoch_of_seconds(min(found)) if found else ""

    return find


def _first_stamp(name: str) -> Callable[[CellGrid, int], str]:
    """Unix times in a column, from which the clock counts."""
    return lambda grid, header: epoch_of_seconds(min(float(at) for (at,) in _rows(grid, header, name)))


def _speedcoach(grid: CellGrid, header: int) -> str:
    for row in grid.cells[:header]:
        if "Start Time:" in row[:-1]:
            return epoch_of_text(row[row.index("Start Time:") + 1])
    return ""


def _boatcoach(grid: CellGrid, header: int) -> str:
    for row in grid.cells[:header]:
        found = re.search(r"Date:\s*(\d{4}-\d\d-\d\d \d\d:\d\d)", row[0] if row else "")
        if found:
            return epoch_of_text(found[1])
    return ""


def _boatcoach_water(grid: CellGrid, header: int) -> str:
    at, after = next(_rows(grid, header, "DateTime", "TOTAL Time Since Start BoatCoach"), ["", ""])
    return epoch_of_text(at, _clock_s(after))


def _below(name: str) -> Callable[[CellGrid, int], str]:
    """A cell below one of the head of the file."""

    def find(grid: CellGrid, header: int) -> str:
        for place, row in enumerate(grid.cells[: max(header - 1, 0)]):
            if name in row:
                return epoch_of_text(grid.cells[place + 1][row.index(name)])
        return ""

    return find


def _clock_s(text: str) -> float:
    found = _CLOCK.fullmatch(text)
    if not found:
        raise ValueError(f"{text} is no time")
    return 3600.0 * float(found[1] or 0) + 60.0 * float(found[2]) + float(found[3])


_FINDERS: Mapping[str, Callable[[CellGrid, int], str]] = MappingProxyType(
    {
        "quiske": _first_stamp("timestamp(s)"),
        "rowingdata": _first_stamp("TimeStamp (sec)"),
        "nk-speedcoach": _speedcoach,
        "nk-logbook": _stamps("timestamp", "elapsedTime", 1e-3, 1e-3),
        "painsled": _stamps("TimeStamp (sec)", "ElapsedTime (sec)", 1.0, 1.0),
        "painsled-desktop": lambda grid, header: epoch_of_text(
            next(_rows(grid, header, "workout.rowStartMs"), [""])[0]
        ),
        "boatcoach": _boatcoach,
        "boatcoach-water": _boatcoach_water,
        "hero": _below("Date"),
        "rowpro": _below("Date"),
    }
)
