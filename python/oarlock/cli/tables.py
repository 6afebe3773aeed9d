"""Tables of a track and of an evaluation that several verbs print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from oarlock.cli.terminal import details, heading, number, pairs, say, table
from oarlock.evaluation.marker_scores import MarkerEvaluation
from oarlock.evaluation.scores import Evaluation, SensorScore, presentation
from oarlock.evaluation.summary import ReadingCounts, TrackSummary, rate_text, shares_text, summarize
from oarlock.evaluation.suspects.suspect import SUSPECT_NOTE
from oarlock.recording.session_info import session_text
from oarlock.tracking.counts import StreamCount
from oarlock.tracking.track import Track

# decimals of an error in this unit
_DIGITS = {"deg": ".3f", "mm": ".2f"}


def write_contradiction(notes: Sequence[str], recording: str = "") -> None:
    """Prints that joints contradict units, before anything else; nothing if none do."""
    from oarlock.report.trust import contradicted

    belief, where = contradicted(notes), f"{recording}: " if recording else ""
    if belief is not None:
        say(f"{where}{belief.words}: {belief.reason} {belief.remedy}", "bold red")


def write_summary(track: Track) -> None:
    """Prints rows, rates, readings, speed, observed joints and the health of each sensor."""
    summary = summarize(track)
    pairs(
        [
            ("session", session_text(summary.session)),
            ("model", summary.model),
            ("structure", summary.structure),
            (
                "rows",
                f"{summary.samples:,} in {number(summary.duration_s, '.4g')} s, {rate_text(summary.rate_hz)} Hz",
            ),
            ("streams", summary.stream_rates),
            ("readings", _readings(summary.readings)),
            ("start", summary.start),
            ("speed", speed(summary)),
            ("joints", f"{summary.joints_observed} of {summary.joints} observed"),
            ("smoothed", "yes" if summary.smoothed else "no"),
        ]
    )
    write_notes(summary.notes)
    write_sensors(summary.sensors)


def _readings(readings: ReadingCounts | None) -> str:
    return "" if readings is None else f"{100 * readings.used_share:.1f} % used, {readings.text()}"


def write_notes(notes: Sequence[str]) -> None:
    """Prints the notes, except those of suspects, which were printed before."""
    notes = [note for note in notes if not note.startswith(SUSPECT_NOTE)]
    if notes:
        heading("Notes")
    for note in notes:
        say(f"- {note}", indent=2)


def speed(summary: TrackSummary) -> str:
    """`2345 steps/s`; empty for a track that was not made by a filter."""
    return "" if summary.steps_per_s is None else f"{summary.steps_per_s:.0f} steps/s"


def write_sensors(sensors: Sequence[SensorScore]) -> None:
    """Prints sensor health: NIS per reading, and the readings of each stream."""
    if not sensors:
        return
    heading("Sensors", "NIS per reading: 1 = noise as stated, larger = disagrees with the model")
    table(
        [
            "sensor",
            ">NIS",
            ">Hz",
            ">expected",
            ">used",
            ">rejected",
            ">missing",
            ">not needed",
            "disturbed",
            "faults",
        ],
        [(s.name, number(s.nis, ".2f"), *_counted(s.count)) for s in sensors],
    )


def _counted(count: StreamCount | None) -> tuple[object, ...]:
    """The cells of a stream's counts; empty for a closure, which has no stream."""
    if count is None:
        return ("",) * 8
    return (
        rate_text(count.rate_hz),
        *(f"{n:,}" for n in (count.expected, count.used, count.rejected, count.missing)),
        f"{count.unused:,}" if count.unused else "",
        shares_text(count.disturbed),
        shares_text(count.faults),
    )


def write_evaluation(evaluation: Evaluation) -> None:
    """Prints errors of joints and positions, and consistency, with units."""
    heading("Joints against ground truth", f"from {evaluation.start_s:g} s on, {evaluation.samples:,} rows")
    _scores("joint", evaluation.rows)
    if evaluation.part_rows:
        heading(
            "Ball and free joints in detail", "errors about the child's axes; named angles except near poles"
        )
        _scores("component or angle", evaluation.part_rows)
    _positions(evaluation)
    _means(evaluation)
    with details():
        write_sensors(evaluation.sensors)


def _scores(what: str, rows: Sequence[Mapping[str, Any]]) -> None:
    table(
        [what, ">RMSE", ">bias", "unit", ">r", ">in 95 % band %", ">NEES", "note"],
        [
            (
                row["joint"],
                error(row["rmse"], row["unit"]),
                error(row["bias"], row["unit"], sign="+"),
                row["unit"],
                number(row["correlation"], ".4f"),
                number(row["coverage_percent"], ".1f"),
                number(row["nees"], ".2f"),
                row["note"],
            )
            for row in rows
        ],
    )


def error(value: float, unit: str, sign: str = "") -> str:
    """An error in deg or mm as text, with the decimals of its unit."""
    return number(value, sign + _DIGITS.get(unit, ".4g"))


def _positions(evaluation: Evaluation) -> None:
    if not evaluation.positions:
        return
    factor, unit = presentation("m")
    heading("Positions against ground truth", "root axes")
    table(
        ["frame", f">RMSE {unit}", f">x {unit}", f">y {unit}", f">z {unit}", ">in band %"],
        [
            (
                p.frame,
                *(number(value * factor, ".2f") for value in (p.rmse_m, *p.axis_rmse_m)),
                number(p.coverage * 100, ".1f"),
            )
            for p in evaluation.positions
        ],
    )


def write_marker_evaluation(evaluation: MarkerEvaluation) -> None:
    """Prints errors of points against markers in mm, and the alignment of clocks and axes."""
    heading(
        "Positions against markers",
        f"axes of {evaluation.relative_to}, from {evaluation.start_s:g} s on, r: correlation",
    )
    header, *rows = evaluation.table()
    table([*header[:2], *(f">{name}" for name in header[2:])], rows)
    say()
    drift = evaluation.clock_drift
    pairs(
        [
            ("mean RMSE", f"{1e3 * evaluation.mean_rmse_3d_m:.1f} mm"),
            (
                "markers' clock",
                f"{evaluation.clock_offset_s:+.4f} s" + (f", drift {1e6 * drift:+.0f} ppm" if drift else ""),
            ),
        ]
    )
    write_notes(evaluation.notes)


def _means(evaluation: Evaluation) -> None:
    say()
    turning = "hinges and rotations" if any(score.parts for score in evaluation.turning()) else "hinges"
    pairs(
        [
            (f"mean RMSE of {turning}", f"{number(evaluation.mean_rmse_deg(), '.3f')} deg"),
            ("worst RMSE", f"{number(evaluation.worst_rmse_deg(), '.3f')} deg"),
            ("mean share in the 95 % band", number(evaluation.mean_coverage(), ".1%").replace("%", " %")),
            ("NEES per state", number(evaluation.states.nees, ".2f") if evaluation.states else ""),
        ]
    )
