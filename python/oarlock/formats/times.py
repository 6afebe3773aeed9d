"""Converts time columns (seconds, epochs, clock times, ISO date-times) to seconds on a common axis.

For the CSV reader.
"""

import datetime
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np

from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.epoch import FIRST_S, LAST_S, epoch_text, moment_text
from oarlock.storage.errors import DataError

Family: TypeAlias = Literal["relative", "samples", "utc", "local", "clock"]

RELATIVE = MappingProxyType({"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9})
TICKS = "ticks"
SAMPLES = "samples"
EPOCH = MappingProxyType({"epoch_s": 10**9, "epoch_ms": 10**6, "epoch_us": 10**3, "epoch_ns": 1})
CLOCK = "HH:MM:SS"
ISO = "iso"
COUNTED = (*RELATIVE, TICKS, SAMPLES)
"""Units of numbers that count from an unknown start."""
TIME_UNITS = (*COUNTED, *EPOCH, CLOCK, ISO)

_CLOCK_TIME = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?")
_DAY_NS = 86_400 * 10**9
_EPOCH_UTC = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_EPOCH_LOCAL = datetime.datetime(1970, 1, 1)


@dataclass(frozen=True)
class Stamps:
    """Time stamps of one file before a common zero is chosen.

    Args:
        family: origin of the time stamps: an unknown start, the first sample, UTC, a local calendar, or midnight.
        seconds: (T,) s, for "relative" and "samples".
        nanoseconds: (T,) integers since 1970 or since midnight, for the others: float64 seconds since 1970
            would round to 0.2 us.
    """

    family: Family
    seconds: Floats
    nanoseconds: Ints


def plain_time_unit(unit: str) -> str:
    """A time unit as Oarlock spells it: "HH:MM:SS.fff" and "clock" give "HH:MM:SS"."""
    text = unit.strip()
    if text == "clock" or re.fullmatch(r"HH:MM:SS([.,]f*)?", text, re.IGNORECASE):
        return CLOCK
    return ISO if text.casefold() == ISO else text.replace("µ", "u")


def is_clock_time(cell: str) -> bool:
    """True for a time of day such as 14:03:27.250."""
    return _CLOCK_TIME.fullmatch(cell.strip()) is not None


def is_iso_time(cell: str) -> bool:
    """True for an ISO date-time; a date alone is none."""
    try:
        datetime.datetime.fromisoformat(cell.strip())
    except ValueError:
        return False
    return ":" in cell


def relative_stamps(values: Floats, unit: str, tick_s: float = 1.0) -> Stamps:
    """Time stamps in s, ms, us, ns, or ticks or samples of `tick_s`, from an unknown start."""
    seconds = values / RELATIVE[unit] if unit in RELATIVE else values * tick_s
    return Stamps("samples" if unit == SAMPLES else "relative", seconds, np.zeros(0, dtype=np.int64))


def parsed_stamps(cells: Sequence[str], places: Sequence[str], unit: str) -> Stamps:
    """Time stamps from texts: epochs, clock times, ISO date-times.

    Args:
        cells: the texts, in order.
        places: file, line and column of each, for errors.
        unit: one of EPOCH, CLOCK, ISO.

    Raises:
        DataError: A text does not match the unit, or date-times with and without a time zone are mixed.
    """
    if unit == ISO:
        return _iso_stamps(cells, places)
    parse = _clock_ns if unit == CLOCK else _epoch_ns
    ticks = EPOCH.get(unit, 1)
    found = np.array([parse(c, ticks, p) for c, p in zip(cells, places, strict=True)], dtype=np.int64)
    if unit == CLOCK:
        return Stamps("clock", np.zeros(0), _across_midnight(found))
    return Stamps("utc", np.zeros(0), found)


def on_one_axis(files: Sequence[Stamps], names: Sequence[str]) -> tuple[list[Floats], dict[str, object]]:
    """Times of all files in seconds on a common axis, and a note on its zero.

    Relative time stamps stay unchanged; for the others the earliest time stamp or sample becomes 0 s.

    Args:
        files: the time stamps of each file.
        names: the files' names, for errors.

    Returns:
        Arrays (T,) of s, one a file; the note for ``Recording.meta["clock"]``.

    Raises:
        DataError: the origins of the files' clocks differ.
    """
    family = files[0].family
    for stamps, name in zip(files, names, strict=True):
        if stamps.family != family:
            raise DataError(
                f"{name}: its time is {_FAMILY_TEXT[stamps.family]}, that of {names[0]} is {_FAMILY_TEXT[family]}. "
                "They have no common clock; import them separately, or export one of them again."
            )
    if family == "relative":
        return [s.seconds for s in files], {"kind": "relative"}
    if family == "samples":
        first_s = min(float(s.seconds.min()) for s in files)
        return [s.seconds - first_s for s in files], {"kind": "samples"}
    ticks = [s.nanoseconds for s in files]
    if family == "clock":
        ticks = [_nearest_day(t, int(ticks[0][0])) for t in ticks]
    zero = min(int(t.min()) for t in ticks)
    return [(t - zero) / 1e9 for t in ticks], {"kind": family, "zero": epoch_text(zero, family)}


_FAMILY_TEXT: MappingProxyType[Family, str] = MappingProxyType(
    {
        "relative": "counted from an unnamed start",
        "samples": "a count of samples",
        "utc": "UTC",
        "local": "a local date-time without time zone",
        "clock": "a time of day without date",
    }
)


def _epoch_ns(cell: str, ticks: int, place: str) -> int:
    text = cell.strip().replace(",", ".")
    try:
        value = Decimal(text) * ticks
        if not value.is_finite() or abs(value) >= 2**62:
            raise InvalidOperation
        return round(value)
    except InvalidOperation as error:
        raise DataError(f'{place}: "{cell}" is not an epoch time{_other_epoch(text)}') from error


def _other_epoch(text: str) -> str:
    """Words on the unit in which a number is a moment between 1990 and 2100; empty if there is none."""
    try:
        value = float(text)
    except ValueError:
        return ""
    found = [(unit, value * ns / 1e9) for unit, ns in EPOCH.items() if FIRST_S <= value * ns / 1e9 <= LAST_S]
    return "".join(
        f' in this unit; with unit = "{u}" it is {moment_text("1970-01-01T00:00:00Z", s)}' for u, s in found
    )


def _clock_ns(cell: str, _ticks: int, place: str) -> int:
    found = _CLOCK_TIME.fullmatch(cell.strip())
    if found is None or int(found[1]) > 23 or int(found[2]) > 59 or int(found[3]) > 59:
        raise DataError(f'{place}: "{cell}" is not a clock time such as 14:03:27.250')
    whole = (int(found[1]) * 60 + int(found[2])) * 60 + int(found[3])
    return whole * 10**9 + int((found[4] or "0").ljust(9, "0"))


def _iso_stamps(cells: Sequence[str], places: Sequence[str]) -> Stamps:
    found = [_iso(c, p) for c, p in zip(cells, places, strict=True)]
    zoned = [t.tzinfo is not None for t in found]
    if any(zoned) and not all(zoned):
        raise DataError(
            f"{places[zoned.index(not zoned[0])]}: date-times with and without a time zone are mixed"
        )
    start = _EPOCH_UTC if zoned and zoned[0] else _EPOCH_LOCAL
    steps = [t - start for t in found]
    ticks = [((d.days * 86_400 + d.seconds) * 10**6 + d.microseconds) * 1000 for d in steps]
    return Stamps("utc" if zoned and zoned[0] else "local", np.zeros(0), np.array(ticks, dtype=np.int64))


def _iso(cell: str, place: str) -> datetime.datetime:
    try:
        return datetime.datetime.fromisoformat(cell.strip())
    except ValueError as error:
        raise DataError(
            f'{place}: "{cell}" is not an ISO date-time such as 2024-05-01T14:03:27.250+02:00'
        ) from error


def _across_midnight(ticks: Ints) -> Ints:
    """Adds a day after each step back of more than twelve hours; later checks report smaller steps back."""
    days = np.cumsum(np.diff(ticks, prepend=ticks[:1]) < -_DAY_NS // 2)
    return ticks + days * _DAY_NS


def _nearest_day(ticks: Ints, reference: int) -> Ints:
    """Shifts by whole days so that the first stamp is within twelve hours of the reference."""
    return ticks - round((int(ticks[0]) - reference) / _DAY_NS) * _DAY_NS
