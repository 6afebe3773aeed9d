"""Whether a track can be believed, in one line: for the front of a report, its summary and its picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from oarlock.evaluation.scores import Evaluation, SensorScore
from oarlock.evaluation.summary import readings
from oarlock.evaluation.suspects.text import SUSPECT_NOTE
from oarlock.report.text import percent
from oarlock.report.verdict import MISLEADING_COVERAGE, NARROW_COVERAGE, NIS_TOO_LARGE
from oarlock.tracking.track import Track

FEW_USED = 0.9
"""Share of used readings below which a page says so."""
WORDS = {"good": "Can be believed", "care": "Read with care", "bad": "Do not rely on it"}
MARKS = {"good": "✓", "care": "!", "bad": "✗"}


@dataclass(frozen=True)
class Trust:
    """A level ("good", "care" or "bad") with its reasons, the most important first, and what to do about it."""

    level: str
    reasons: tuple[str, ...]
    remedy: str = ""

    @property
    def words(self) -> str:
        """The level in words."""
        return WORDS[self.level]

    @property
    def reason(self) -> str:
        """The most important reason, one sentence."""
        return self.reasons[0]

    @property
    def mark(self) -> str:
        """A sign that is readable without colour."""
        return MARKS[self.level]


def trust(track: Track, evaluation: Evaluation | None, sensors: Sequence[SensorScore]) -> Trust:
    """The worst of what is known about sensors, mounts and bands, as one line."""
    bad = _worst(track, evaluation)
    if bad:
        return Trust("bad", tuple(bad), "Check this sensor and its cable, then record again.")
    reasons = _reasons(track, evaluation, sensors)
    if reasons:
        return Trust("care", tuple(reasons))
    return Trust("good", ("the sensors agree with each other and with the calibration.",))


def _worst(track: Track, evaluation: Evaluation | None) -> list[str]:
    found = [
        f"{_short(note.removeprefix(SUSPECT_NOTE))}" for note in track.notes if note.startswith(SUSPECT_NOTE)
    ]
    share = evaluation.mean_coverage() if evaluation else math.nan
    if share < MISLEADING_COVERAGE:
        found.append(f"the 95 % bands contain the reference only {percent(share)} of the time.")
    return found


def _reasons(track: Track, evaluation: Evaluation | None, sensors: Sequence[SensorScore]) -> list[str]:
    share = evaluation.mean_coverage() if evaluation else math.nan
    found = [_loud(sensors), _not_calibrated(track)]
    if any(note.startswith("uncertainty was increased") for note in track.notes):
        found.append("because sensors disagreed for several seconds, the uncertainty was increased.")
    if share < NARROW_COVERAGE:
        found.append(f"the 95 % bands contain the reference only {percent(share)} of the time.")
    total = readings(track.counts)
    if total is not None and total.used_share < FEW_USED:
        found.append(f"only {percent(total.used_share)} of the readings could be used.")
    if not sensors:
        found.append("no sensor readings are kept with this track, so nothing could be checked.")
    return [reason for reason in found if reason]


def _loud(sensors: Sequence[SensorScore]) -> str:
    """Which sensors differ from the prediction by more than expected, and by how much."""
    loud = sorted((s for s in sensors if s.nis > NIS_TOO_LARGE), key=lambda s: -s.nis)
    if not loud:
        return ""
    return (
        f"{len(loud)} of {len(sensors)} sensors disagree with the assumed mounts and lengths; {loud[0].name} misses "
        f"the prediction by {math.sqrt(loud[0].nis):.1f} times the expected error. Check where they sit and the "
        "lengths that were entered."
    )


def _not_calibrated(track: Track) -> str:
    units = len(track.provenance.get("nominal_mounts") or ())
    if not units:
        return ""
    what = (
        "the inertial unit on the body was" if units == 1 else f"the {units} inertial units on the body were"
    )
    return f"{what} not calibrated: their angles can be several degrees wrong; changes of an angle are better known."


def _short(text: str) -> str:
    """The first sentence of a note."""
    return text.split(". ")[0].rstrip(".") + "."
