"""`season_summary`: how much a season holds, of whom, and what failed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from oarlock.season.compact import known_now
from oarlock.season.entry import Entry
from oarlock.season.store import Season


@dataclass(frozen=True)
class AthleteCount:
    """What a season holds of one athlete; the days are of the first and last recording, UTC."""

    athlete: str
    recordings: int
    hours: float
    strokes: int
    first: str
    last: str


@dataclass(frozen=True)
class SeasonSummary:
    """What a season holds.

    Args:
        name: of the season.
        counts: numbers by what they count, in words.
        athletes: of each athlete who was recorded.
        faults: why a recording's current run failed, by recording.
    """

    name: str
    counts: Mapping[str, int]
    athletes: Sequence[AthleteCount]
    faults: Mapping[str, str]


def season_summary(season: Season) -> SeasonSummary:
    """Count what a season holds."""
    known = known_now(season)
    current = known.current(season)
    strokes = {name: record.strokes for name, record in current.items()}
    by_athlete: dict[str, list[Entry]] = {}
    for entry in known.entries.values():
        by_athlete.setdefault(entry.athlete, []).append(entry)
    status = Counter(current[name].status if name in current else "waiting" for name in known.entries)
    counts = {
        "athletes": len(season.athletes()),
        "recordings": len(known.entries),
        "with results": status["done"],
        "failed": status["failed"],
        "waiting for `oarlock season run`": status["waiting"],
        "strokes": sum(strokes.values()),
    }
    faults = {name: record.fault for name, record in sorted(current.items()) if record.status == "failed"}
    athletes = [_count(name, own, strokes) for name, own in sorted(by_athlete.items())]
    return SeasonSummary(season.name, counts, athletes, faults)


def _count(athlete: str, entries: Sequence[Entry], strokes: Mapping[str, int]) -> AthleteCount:
    days = sorted(f"{entry.start:%Y-%m-%d}" for entry in entries if entry.start is not None)
    hours = sum(entry.duration_s or 0.0 for entry in entries) / 3600.0
    found = sum(strokes.get(entry.recording, 0) for entry in entries)
    first, last = (days[0], days[-1]) if days else ("", "")
    return AthleteCount(athlete, len(entries), hours, found, first, last)
