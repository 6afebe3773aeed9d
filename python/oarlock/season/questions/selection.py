"""`Selection`: of whom, when and which class of runs a question is; and the metrics by the names that people give."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

_UNIT = re.compile(r"_(rad|deg|per_min|m_s2|m_s|rad_s|m2|s|m|w|n|j)$")
_TO = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*(?:-|to|\.\.)\s*(\d+(?:\.\d+)?)\s*$")


@dataclass(frozen=True)
class Selection:
    """Which rows of a season are asked; None does not restrict.

    Args:
        athlete: pseudonym.
        boat: as in `session.toml`.
        comparable: class of runs.
        since: first day, UTC.
        until: last day, UTC.
        scope: only athletes who consent to this use: `coaching`, `research` or `sharing`.
    """

    athlete: str | None = None
    boat: str | None = None
    comparable: str | None = None
    since: datetime.date | None = None
    until: datetime.date | None = None
    scope: str | None = None

    def __str__(self) -> str:
        named = {"boat": self.boat, "class": self.comparable, "since": self.since, "until": self.until}
        parts = [self.athlete, *(f"{name} {value}" for name, value in named.items() if value is not None)]
        return ", ".join(part for part in parts if part) or "the season"


@dataclass(frozen=True)
class Rates:
    """Stroke rates, 1/min, both included; None does not restrict."""

    low: float | None = None
    high: float | None = None

    @classmethod
    def parsed(cls, text: str | None) -> Rates:
        """Rates of a text such as "20-24".

        Raises:
            DataError: it is none.
        """
        if text is None:
            return cls()
        found = _TO.match(text)
        if found is None or float(found[1]) >= float(found[2]):
            raise DataError(f'"{text}" is no range of stroke rates; expected one such as 20-24')
        return cls(float(found[1]), float(found[2]))


def metrics_among(columns: Iterable[str]) -> list[str]:
    """The numbers of strokes among columns: without their standard deviations."""
    return [name for name in columns if not name.endswith("_std")]


def metric_named(text: str, metrics: Sequence[str]) -> str:
    """The metric of a name, which may lack its unit: `catch_angle`, `Catch angle` and `catch_angle_rad` are the same.

    Raises:
        DataError: none has this name, or several have it.
    """
    asked = re.sub(r"[\s\-]+", "_", text.strip()).casefold()
    if asked in metrics:
        return asked
    found = [name for name in metrics if _UNIT.sub("", name) == _UNIT.sub("", asked)]
    if len(found) == 1:
        return found[0]
    if found:
        raise DataError(f'"{text}" may be {" or ".join(found)}; give one of them')
    raise DataError(
        f'"{text}" is no metric of this season. {did_you_mean(asked, (_UNIT.sub("", name) for name in metrics))}'
    )
