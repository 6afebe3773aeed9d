"""The summary of the report in sentences and key figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from oarlock.evaluation.scores import Evaluation, SensorScore
from oarlock.evaluation.summary import observed_joints, rate_text, row_rate_hz, stream_rates, summarize
from oarlock.evaluation.suspects.suspect import SUSPECT_NOTE
from oarlock.report.section import KeyFigure
from oarlock.report.text import fixed, listing, number, percent, plural
from oarlock.storage.epoch import moment_text
from oarlock.tracking.track import Track

NARROW_COVERAGE, WIDE_COVERAGE = 0.93, 0.995
"""Share of samples in the 95 % band below which a band is too narrow, above which it is wider than needed."""
MISLEADING_COVERAGE = 0.8
"""Share below which a band is not usable."""
NIS_TOO_LARGE = 1.25
"""NIS per reading above which the innovations of a sensor are clearly larger than expected."""
NIS_QUIET = 0.25
"""NIS per reading below which innovations are half as large as expected, or smaller."""


def sentences(track: Track, evaluation: Evaluation | None, sensors: tuple[SensorScore, ...]) -> list[str]:
    """What was tracked, its errors, and the coverage of the bands; markup each."""
    parts = filter(None, [_bands(evaluation), _readings(sensors) if sensors else ""])
    reliable = " ".join(parts)
    verdict = [f"<strong>Reliability.</strong> {reliable}"] if reliable else []
    return [_what(track), _how_well(evaluation), *verdict]


def suspect_sentences(notes: Sequence[str]) -> list[str]:
    """The notes about suspects."""
    found = [note.removeprefix(SUSPECT_NOTE) for note in notes if note.startswith(SUSPECT_NOTE)]
    return [f"<strong>Suspect:</strong> {escape(text)}" for text in found]


def key_figures(track: Track, evaluation: Evaluation | None) -> list[KeyFigure]:
    """The key figures of the report."""
    whole = summarize(track)
    missed = len(whole.not_observed)
    figures = [
        KeyFigure(
            "duration",
            f"{number(whole.duration_s, 4)} s",
            f"{whole.samples:,} rows at {rate_text(whole.rate_hz)} Hz",
        ),
        KeyFigure(
            "joints observed",
            f"{whole.joints_observed} of {whole.joints}",
            f"{missed} not observed" if missed else "all of the model",
        ),
    ]
    if evaluation and evaluation.turning():
        worst = max(evaluation.turning(), key=lambda score: score.rmse)
        detail = f"worst {number(math.degrees(worst.rmse), 2)}°, {worst.name}"
        figures.append(KeyFigure("mean angle RMSE", f"{number(evaluation.mean_rmse_deg(), 2)}°", detail))
        expected = "95 % is expected" if evaluation.reference == "truth" else evaluation.reference
        name = "truth" if evaluation.reference == "truth" else "reference"
        figures.append(KeyFigure(f"{name} in the 95 % band", percent(evaluation.mean_coverage()), expected))
    if whole.readings is not None:
        figures.append(KeyFigure("readings used", percent(whole.readings.used_share), whole.readings.text()))
    if whole.steps_per_s is not None and whole.real_time_factor is not None:
        speed = f"real time, {whole.steps_per_s:,.0f} steps/s"
        figures.append(KeyFigure("computed", f"{number(whole.real_time_factor, 2)} ×", speed))
    return figures


def _what(track: Track) -> str:
    seen, total = len(observed_joints(track)), len(track.joint_names)
    observed = "All joints were observed."
    if seen < total:
        observed = f"{seen} of {total} joints were observed, the others for less than half of the time."
    name = escape(str(getattr(track.model, "name", "") or track.provenance.get("model", "")))
    body = f"the model <b>{name}</b>" if name else "the model"
    duration = float(track.time_s[-1] - track.time_s[0])
    rate = f" at {rate_text(row_rate_hz(track))} Hz" if len(track.time_s) > 1 else ""
    rates = stream_rates(track.counts)
    streams = f"; the sensors' rates: {escape(rates)}" if rates else ""
    how = (
        "smoothed over the whole recording"
        if track.smoothed
        else "filtered: each estimate uses only earlier and current readings"
    )
    begin = moment_text(track.provenance.get("epoch"), float(track.time_s[0]))
    since = f", from {begin}" if begin else ""
    return (
        f"{plural(len(track.joint_names), 'joint')} of {body} over {number(duration, 4)} s{since} "
        f"({plural(len(track.time_s), 'row')}{rate}{streams}), {how}. {observed}"
    )


def _how_well(evaluation: Evaluation | None) -> str:
    if evaluation is None:
        return "Without a reference we can show the expected error (the 95 % bands), not the actual one."
    turning = evaluation.turning()
    if not turning:
        return "No observed hinge or rotation can be compared with the ground truth."
    worst = max(turning, key=lambda score: score.rmse)
    noun = "joint" if any(score.parts for score in turning) else "hinge"
    if evaluation.reference != "truth":
        return (
            f"The angles differ from {escape(evaluation.reference)}, which also have errors, by "
            f"<b>{number(evaluation.mean_rmse_deg(), 2)}°</b> (RMSE, mean over {plural(len(turning), noun)}, "
            f"without the first {evaluation.start_s:g} s). The largest difference is at {escape(worst.name)}: "
            f"{number(math.degrees(worst.rmse), 2)}°."
        )
    return (
        f"The error of the angles is <b>{number(evaluation.mean_rmse_deg(), 2)}°</b> (RMSE against ground truth, mean "
        f"over {plural(len(turning), noun)}, without the first {evaluation.start_s:g} s); the largest is "
        f"{number(math.degrees(worst.rmse), 2)}° at {escape(worst.name)}."
    )


def _bands(evaluation: Evaluation | None) -> str:
    if evaluation is None or math.isnan(evaluation.mean_coverage()):
        return ""
    share = evaluation.mean_coverage()
    shown = percent(share)
    if evaluation.reference != "truth":
        return (
            f"The 95 % bands contain the reference {shown} of the time. They do not include errors of the reference "
            "and of the mounts."
        )
    if share < MISLEADING_COVERAGE:
        return f"The 95 % bands are far too narrow: they contain the truth only {shown} of the time. Do not use them."
    if share < NARROW_COVERAGE:
        return f"The 95 % bands are too narrow: they contain the truth only {shown} of the time."
    narrow = [s.name for s in evaluation.turning() if s.coverage < NARROW_COVERAGE]
    wide = share > WIDE_COVERAGE
    lead = "The 95 % bands are wider than needed" if wide else "The 95 % bands are correct"
    but = f" Too narrow for single joints: {escape(listing(narrow))}." if narrow else ""
    return f"{lead}: they contain the truth {shown} of the time.{but}"


def _readings(sensors: Sequence[SensorScore]) -> str:
    loud = [f"{s.name} ({fixed(s.nis, 1)})" for s in sensors if s.nis > NIS_TOO_LARGE]
    if loud:
        return (
            f"Innovations are larger than the filter expects (NIS per reading above {NIS_TOO_LARGE}) for "
            f"{escape(listing(loud))}: a mount, a length or a noise level may be wrong. Run oarlock calibrate."
        )
    known = [s.nis for s in sensors if s.nis > 0.0]
    if known and max(known) < NIS_QUIET:
        return (
            f"Innovations are much smaller than the filter expects (NIS per reading below {NIS_QUIET}): the model file "
            "states more noise than these sensors have, as for units on clothes. The bands are an upper estimate."
        )
    return "All sensors agree: no innovations are larger than the filter expects."
