"""Whether a track can be believed, in one line: for the front of a report, its summary and its picture."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from oarlock.evaluation.scores import Evaluation, SensorScore
from oarlock.evaluation.summary import readings
from oarlock.evaluation.suspects.suspect import SUSPECT_NOTE
from oarlock.report.text import capital, listing, percent
from oarlock.report.verdict import MISLEADING_COVERAGE, NARROW_COVERAGE
from oarlock.tracking.notes import contradicted_units
from oarlock.tracking.track import Track

FEW_USED = 0.9
"""Share of used readings below which a page says so."""
LOUD = 4.0
"""NIS per reading above which a sensor is named: innovations twice as large as expected."""
WORDS = {"good": "Can be believed", "care": "Read with care", "bad": "Do not rely on it"}
MARKS = {"good": "✓", "care": "!", "bad": "✗"}
MOST_SHOWN = 2
"""Reasons to read with care that fit into the line."""

_CONTORTED = re.compile(r"[^:]+: beyond its soft limits \([^)]*\) in [^,]+, by up to [\d.]+ \w+")
"""A joint that is far beyond its limits for more than a tenth of the time (the engine's note)."""


@dataclass(frozen=True)
class Trust:
    """A level ("good", "care" or "bad") with its reasons, the most important first, and what to do about it.

    `shown`: how many of the reasons stand on the front; all stand in "How it was measured".
    """

    level: str
    reasons: tuple[str, ...]
    remedy: str = ""
    shown: int = 1

    @property
    def words(self) -> str:
        """The level in words."""
        return WORDS[self.level]

    @property
    def reason(self) -> str:
        """The most important reasons, a sentence each, after the words."""
        first, *others = self.reasons[: self.shown]
        return " ".join([first, *map(capital, others)])

    @property
    def sentences(self) -> str:
        """All reasons."""
        return " ".join(map(capital, self.reasons))

    @property
    def mark(self) -> str:
        """A sign that is readable without colour."""
        return MARKS[self.level]


def trust(
    track: Track,
    evaluation: Evaluation | None,
    sensors: Sequence[SensorScore],
    direct: str = "",
    caution: str = "",
) -> Trust:
    """The worst of what is known about sensors, mounts and bands, as one line; all reasons after it.

    `direct`: what encoders measure, in the words of a field of application: "oars and seat". `caution`: a reason of the
    field to read with care.
    """
    bad, contradiction = _worst(track, evaluation), contradicted(track.notes)
    if contradiction is not None:
        return replace(contradiction, reasons=(*contradiction.reasons, *bad))
    if bad:
        return Trust("bad", tuple(bad), "Check this sensor and its cable, then record again.")
    contorted = [found[0] for note in track.notes if (found := _CONTORTED.match(note))]
    if contorted:
        told = (f"{note}: the estimate may have settled in a wrong posture." for note in contorted)
        return Trust(
            "bad", tuple(told), "Calibrate and track again, or correct the limits in the model file."
        )
    reasons = [*filter(None, [caution]), *_reasons(track, evaluation, sensors, direct)]
    if reasons:
        return Trust("care", tuple(reasons), shown=min(len(reasons), MOST_SHOWN))
    return Trust("good", (_good(evaluation),))


def contradicted(notes: Sequence[str]) -> Trust | None:
    """The first line of page and terminal if joints contradict units, by the notes of a track; else None."""
    units = contradicted_units(notes)
    if not units:
        return None
    reason = (
        f"joints contradict the readings of {listing(units)}, so angles of adjacent joints are not reliable."
    )
    remedy = "Check segment (oarlock calibrate units) and mount (oarlock calibrate), then track again."
    return Trust("bad", (reason,), remedy)


def _good(evaluation: Evaluation | None) -> str:
    """Why a track can be believed."""
    share = evaluation.mean_coverage() if evaluation else math.nan
    if not math.isnan(share):
        return f"the 95 % bands contain the reference {percent(share)} of the time."
    return "the sensors fit together within the ± (95 % intervals); no second system has checked them."


def _worst(track: Track, evaluation: Evaluation | None) -> list[str]:
    suspects = [note.removeprefix(SUSPECT_NOTE) for note in track.notes if note.startswith(SUSPECT_NOTE)]
    found = [text.split(". ")[0].rstrip(".") + "." for text in suspects]
    share = evaluation.mean_coverage() if evaluation else math.nan
    if share < MISLEADING_COVERAGE:
        found.append(f"the 95 % bands contain the reference only {percent(share)} of the time.")
    return found


def _reasons(
    track: Track, evaluation: Evaluation | None, sensors: Sequence[SensorScore], direct: str
) -> list[str]:
    share = evaluation.mean_coverage() if evaluation else math.nan
    suspicious = doubtful(sensors)
    found = [_not_calibrated(track, direct, is_sure=not suspicious)]
    found += [
        f"the sensor {loud.name} is doubtful: it differs from the prediction by {math.sqrt(loud.nis):.1f} times the "
        "expected error. Check how it is mounted."
        for loud in suspicious[:1]
    ]
    if share < NARROW_COVERAGE:
        found.append(f"the 95 % bands contain the reference only {percent(share)} of the time.")
    total = readings(track.counts)
    if total is not None and total.used_share < FEW_USED:
        found.append(f"only {percent(total.used_share)} of the readings could be used.")
    if not sensors:
        found.append("no sensor readings are kept with this track, so nothing could be checked.")
    return [reason for reason in found if reason]


def doubtful(sensors: Sequence[SensorScore]) -> list[SensorScore]:
    """The sensors that differ from the prediction by more than twice what is expected, the most first."""
    return sorted((one for one in sensors if one.count and one.nis > LOUD), key=lambda one: -one.nis)


def _not_calibrated(track: Track, direct: str, is_sure: bool) -> str:
    """`is_sure`: whether nothing speaks against what encoders measure."""
    units = len(track.provenance.get("nominal_mounts") or ())
    if not units:
        return ""
    if direct:
        sure = f"{direct} are within their ±; " if is_sure else ""
        return (
            f"{sure}angles of the body can be several degrees off, because its sensors were not calibrated."
        )
    what = "the unit on the body was" if units == 1 else f"the {units} units on the body were"
    return f"angles can be several degrees off, because {what} not calibrated; changes of an angle are better known."
