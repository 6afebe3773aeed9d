"""`Compared`: the piece of a report, and why a season's recordings do or do not compare with it, for `earlier`."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from oarlock import Calibration, Model, Track
from oarlock.model.description import ImuDescription
from oarlock.rowing import find_strokes
from oarlock.rowing.findings.rowed import FEWEST_STROKES, RATES_APART, Rowed, kind_of
from oarlock.season.store import Season

_NOON = datetime.time(12)


@dataclass(frozen=True)
class Compared:
    """The piece of a report.

    Attributes:
        season: where others are looked for.
        rowed: its strokes.
        start: the moment of its first sample, UTC.
        engine: version of Oarlock that tracked it.
        nominal: its units whose mounts are not calibrated.
    """

    season: Season
    rowed: Rowed
    start: datetime.datetime
    engine: str
    nominal: frozenset[str]

    @classmethod
    def of(cls, season: Season, track: Track, start: datetime.datetime) -> Compared:
        """Of a track of a rower.

        Raises:
            DataError: there are no strokes in it.
        """
        found = find_strokes(track)
        kind = kind_of(track.joint_names)
        rowed = Rowed.of_table(found.table(), found.in_averages, kind, found.source)
        about = track.provenance
        return cls(
            season, rowed, start, str(about.get("oarlock", "")), frozenset(about.get("nominal_mounts", ()))
        )

    def follows(self, row: Mapping[str, Any]) -> bool:
        """Whether a recording ended before this one; where only days are known, on a day before."""
        days = [self.local(row), self.start.astimezone(self.season.zone())]
        if any(map(is_day, days)):
            return days[0].date() < days[1].date()
        return bool(end_of(row) <= self.start)

    def local(self, row: Mapping[str, Any]) -> datetime.datetime:
        """The start of a recording in the season's zone."""
        moment: datetime.datetime = row["started"]
        return moment.astimezone(self.season.zone())

    def when(self, row: Mapping[str, Any]) -> str:
        """Day and time of a recording; only the day where the time is not known."""
        local = self.local(row)
        return f"{local:%Y-%m-%d}" if is_day(local) else f"{local:%Y-%m-%d %H:%M}"

    def differs(self, row: Mapping[str, Any]) -> str:
        """Why a recording does not compare, as far as the tables say; "" if it may."""
        if row["status"] != "done":
            return (
                "could not be computed"
                if row["status"] == "failed"
                else "is not computed yet: `oarlock season run`"
            )
        if not row["counted"] or row["counted"] < FEWEST_STROKES:
            return f"has {row['counted'] or 0} strokes that count, at least {FEWEST_STROKES} are needed"
        if row["rate"] is None or not abs(row["rate"] - self.rowed.rate_per_min) <= RATES_APART:
            rate = "an unknown rate" if row["rate"] is None else f"{row['rate']:.0f}/min"
            return f"has {rate}, this piece {self.rowed.rate_per_min:.0f}/min"
        if row["engine"] != self.engine:
            return (
                f"was computed by Oarlock {row['engine']}, this piece by {self.engine}: `oarlock season run`"
            )
        return ""


def end_of(row: Mapping[str, Any]) -> datetime.datetime:
    """When a recording ended; without a duration its start."""
    started: datetime.datetime = row["started"]
    return started + datetime.timedelta(seconds=row["duration_s"] or 0.0)


def is_day(local: datetime.datetime) -> bool:
    """Whether only the day of a recording is known; then `start_of` takes its noon."""
    return local.time() == _NOON


def mounts_differ(model: Model, calibration: Calibration | None, nominal: frozenset[str]) -> str:
    """Why mounts differ: errors of nominal ones, several degrees, would look like a change; "" if they are alike."""
    if calibration is None:
        units = any(isinstance(sensor, ImuDescription) for sensor in model.describe().sensors)
        return "is not calibrated, this piece is" if units and not nominal else ""
    return (
        "is calibrated, this piece is not: `oarlock calibrate`" if nominal & set(calibration.mounts) else ""
    )
