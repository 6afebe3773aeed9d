"""The epoch of a recording or track: the moment of `time_s` = 0, as ISO text. For readers, terminal, report and player.

Three texts are possible: `2024-05-01T16:59:58.020000000Z` (UTC), the same without `Z` (a local date-time without a time
zone) and `16:59:58.020000000` (a time of day without a date).
"""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

Kind: TypeAlias = Literal["utc", "local", "clock"]

ZONE_WORDS: MappingProxyType[Kind, str] = MappingProxyType(
    {"utc": "UTC", "local": "local time", "clock": "time of day"}
)
FIRST_S, LAST_S = 631_152_000.0, 4_102_444_800.0
"""1990 and 2100 in seconds since 1970: numbers between these are taken for seconds of an epoch."""
_DAY_S = 86_400.0
_UNIX = datetime.datetime(1970, 1, 1)


@dataclass(frozen=True)
class Moment:
    """A moment as seconds.

    Args:
        seconds: since 1970 in UTC or in local time; since midnight for a time of day.
        kind: which of them.
    """

    seconds: float
    kind: Kind

    def text(self) -> str:
        """Such as "2024-05-01 16:59:58.02 UTC"; hundredths of a second."""
        hundredths = round(100.0 * (self.seconds % _DAY_S if self.kind == "clock" else self.seconds))
        found = _UNIX + datetime.timedelta(milliseconds=10 * hundredths)
        style = "%H:%M:%S" if self.kind == "clock" else "%Y-%m-%d %H:%M:%S"
        return f"{found:{style}}.{hundredths % 100:02d} {ZONE_WORDS[self.kind]}"


def epoch_text(zero_ns: int, kind: Kind) -> str:
    """The epoch of a whole number of ns since 1970 or midnight, exactly."""
    whole, rest = divmod(zero_ns, 10**9)
    moment = _UNIX + datetime.timedelta(seconds=whole)
    if kind == "clock":
        return f"{moment:%H:%M:%S}.{rest:09d}"
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{rest:09d}" + ("Z" if kind == "utc" else "")


def epoch_of_stamps(first_s: float, last_s: float) -> str | None:
    """The epoch of `first_s`, if stamps between these are seconds since 1970 (UTC); None if they are not."""
    if not FIRST_S <= first_s <= last_s <= LAST_S:
        return None
    whole = int(first_s)
    return epoch_text(whole * 10**9 + round((first_s - whole) * 1e9), "utc")


def shifted_text(epoch: object) -> str:
    """The sentence on stamps that were seconds since 1970 and were shifted to this epoch."""
    return f"The time stamps were seconds since 1970; they now start at 0 s, which is {moment_text(epoch)}."


def apart_s(epoch: object, other: object) -> float | None:
    """How much later an epoch is than another, s, to the ns; None if one is not known or their kinds differ."""
    here, there = _exact(epoch), _exact(other)
    if here is None or there is None or here[1] != there[1]:
        return None
    return (here[0] - there[0]) / 1e9


def _exact(epoch: object) -> tuple[int, Kind] | None:
    """The ns since 1970 or midnight; `datetime` has only microseconds."""
    moment = moment_of(epoch)
    if moment is None or not isinstance(epoch, str):
        return None
    fraction = epoch.removesuffix("Z").partition(".")[2]
    return math.floor(moment.seconds) * 10**9 + int(f"{fraction:0<9}"[:9]), moment.kind


def moment_of(epoch: object, at_s: float = 0.0) -> Moment | None:
    """The moment `at_s` after an epoch; None if the epoch is not known or not readable."""
    if not isinstance(epoch, str):
        return None
    kind: Kind = "utc" if epoch.endswith("Z") else "local" if "T" in epoch else "clock"
    day = "" if "T" in epoch else "1970-01-01T"
    try:
        begin = datetime.datetime.fromisoformat(day + epoch.removesuffix("Z"))
        seconds = (begin - _UNIX).total_seconds() + at_s
        _UNIX + datetime.timedelta(seconds=seconds, days=1)
    except (ValueError, OverflowError, TypeError):
        return None
    return Moment(seconds, kind)


def moment_text(epoch: object, at_s: float = 0.0) -> str:
    """The moment `at_s` after an epoch as text; empty if it is not known."""
    moment = moment_of(epoch, at_s)
    return "" if moment is None else moment.text()
