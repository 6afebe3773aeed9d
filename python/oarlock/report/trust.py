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
    """A level ("good", "care" or "bad") with its reason, one sentence, and what to do about it, with its command."""

    level: str
    reason: str
    remedy: str = ""
    command: str = ""

    @property
    def words(self) -> str:
        """The level in words."""
        return WORDS[self.level]

    @property
    def mark(self) -> str:
        """A sign that is readable without colour."""
        return MARKS[self.level]


def trust(track: Track, evaluation: Evaluation | None, sensors: Sequence[SensorScore]) -> Trust:
    """The worst of what is known about sensors, mounts and bands, as one line."""
    bad = _worst(track, evaluation)
    if bad:
        return Trust("bad", bad[0] + _more(bad), "Check this sensor and its cable, then record again.")
    reasons = _reasons(track, evaluation, sensors)
    if reasons:
        return Trust("care", reasons[0] + _more(reasons), "Calibrate:", f"oarlock calibrate {_how(track)}")
    return Trust("good", "the sensors agree with each other and with the calibration.")


def _how(track: Track) -> str:
    """`calibrate motion` needs closed loops, which hold the hands of a rower; other bodies have a session."""
    closed = track.model is None or track.model.describe().closures
    return "motion" if closed else "session"


def _more(reasons: Sequence[str]) -> str:
    others = len(reasons) - 1
    named = "one more reason" if others == 1 else f"{others} more reasons"
    return f" The last section names {named}." if others else ""


def _worst(track: Track, evaluation: Evaluation | None) -> list[str]:
    found = [
        f"{_short(note.removeprefix(SUSPECT_NOTE))}" for note in track.notes if note.startswith(SUSPECT_NOTE)
    ]
    share = evaluation.mean_coverage() if evaluation else math.nan
    if share < MISLEADING_COVERAGE:
        found.append(f"the 95 % bands contain the reference only {percent(share)} of the time.")
    return found


def _reasons(track: Track, evaluation: Evaluation | None, sensors: Sequence[SensorScore]) -> list[str]:
    found = []
    loud = sorted((s for s in sensors if s.nis > NIS_TOO_LARGE), key=lambda s: -s.nis)
    if loud:
        found.append(
            f"{len(loud)} of {len(sensors)} sensors disagree with the assumed mounts and lengths, "
            f"{loud[0].name} most."
        )
    if track.provenance.get("nominal_mounts"):
        found.append(
            "the sensors were not calibrated: angles can be off by several degrees, changes by less."
        )
    share = evaluation.mean_coverage() if evaluation else math.nan
    if share < NARROW_COVERAGE:
        found.append(f"the 95 % bands contain the reference only {percent(share)} of the time.")
    if any(note.startswith("uncertainty was increased") for note in track.notes):
        found.append("the sensors disagreed with the assumed mounts or lengths for several seconds.")
    total = readings(track.counts)
    if total is not None and total.used_share < FEW_USED:
        found.append(f"only {percent(total.used_share)} of the readings could be used.")
    if not sensors:
        found.append("no sensor readings are kept with this track, so nothing could be checked.")
    return found


def _short(text: str) -> str:
    """The first sentence of a note."""
    return text.split(". ")[0].rstrip(".") + "."
