"""The front of an export's page: what was rowed, what stands out, what to do next, and against last time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from oarlock.report import Front, KeyFigure, Point, fixed
from oarlock.rowing.alongside.course import SpeedProfile, starts_of
from oarlock.rowing.alongside.paces import clock_text, pace_text
from oarlock.rowing.analysis.features import Feature
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.findings.find import findings_of
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.report.averages import Average
from oarlock.rowing.report.earlier import compared, earlier_pieces
from oarlock.rowing.report.export_force import after_start
from oarlock.rowing.report.export_meanings import meanings
from oarlock.rowing.report.export_next import next_step, quiet_text
from oarlock.rowing.report.export_piece import ExportPiece
from oarlock.rowing.report.front import point
from oarlock.rowing.report.shown import joined_unit, spread, with_unit
from oarlock.rowing.report.words import against_usual
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.epoch import moment_text

_TILES = (
    "rate_per_min",
    "power_w",
    "peak_force_n",
    "arc_rad",
    "catch_angle_rad",
    "finish_angle_rad",
    "handle_travel_m",
    "heart_rate_per_min",
)
_PACE = (
    "Rowed distance over rowed time, for 500 m. Starts, pauses, waiting, drifting and paddling count in neither; "
    "the tables below show the parts."
)
_COMPARE = (
    "Compare with an earlier piece of the same device",
    "oarlock rowing strokes FILE --report PAGE --last EARLIER",
)
_NAME = (
    "Name the athlete, or put a session.toml beside the file",
    "oarlock rowing strokes FILE --report PAGE --athlete NAME --date DATE --boat BOAT --place PLACE",
)


def strokes_front(piece: ExportPiece, earlier: ExportPiece | None) -> Front:
    """The front of an export with strokes; `earlier` is the piece of last time."""
    apart = ""
    if earlier is not None and not piece.rowed.comparable(earlier.rowed):
        devices = f"({piece.device}, {earlier.device})"
        apart = f" Differences from last time are not assessed, because the devices differ {devices}."
    course, found = piece.course, _findings(piece, earlier)
    rate = piece.averages.get("rate_per_min")
    at = f" at {with_unit(rate.feature, rate.over.mean)}" if rate is not None and rate.known else ""
    defined = meanings(piece.table)
    return Front(
        did=_did(piece.table, course, at, _ends(piece)),
        points=[_point(one, defined) for one in found],
        quiet=quiet_text(piece) + apart,
        next_step=next_step(piece, found, earlier is not None),
        commands=[_COMPARE, _NAME] if earlier is None else [_NAME],
        figures=[*_pace(course), _strokes(course), *_tiles(piece)],
        compared=compared(piece, earlier_pieces(earlier, None)),
    )


def _point(found: Finding, defined: Mapping[str, Feature]) -> Point:
    """A finding with the definition that fits the device."""
    told = point(found)
    return replace(told, meaning=defined[found.name].in_words) if found.name in defined else told


def course_front(found: Activity, course: SpeedProfile) -> Front:
    """The front of points in time."""
    return Front(did=_did(found, course, "", ""), figures=_pace(course))


def findings_of_export(found: StrokeTable, last: StrokeTable | None = None) -> list[Finding]:
    """What stands out of an export, by itself and against last time's; no single strokes, which devices misread."""
    return _findings(ExportPiece(found), None if last is None else ExportPiece(last))


def _findings(piece: ExportPiece, earlier: ExportPiece | None) -> list[Finding]:
    compared_with = {} if earlier is None else {"against last": earlier.rowed}
    return [one for one in findings_of(piece.rowed, compared_with) if one.kind != "odd stroke"]


def left_out_text(course: SpeedProfile) -> str:
    """How many rows are no rowing, by reason."""
    return "; ".join(f"{count} {reason}" for reason, count in course.left_out.items()) or "none"


def _did(found: StrokeTable | Activity, course: SpeedProfile, at: str, ends: str) -> str:
    """What was rowed, the starts, and the pace after them; `at` is the rate."""
    count, rows = int(course.counted.sum()), len(course.counted)
    begun = moment_text(found.epoch)[:16]
    pieces = len(course.stretches)
    what = f"{count} {'stroke' if count == 1 else 'strokes'} rowed" if course.is_strokes else "Rowed"
    told = what + (f" in {pieces} pieces" if pieces > 1 else "")
    if pieces:
        told += f"{' in' if pieces == 1 else ','} {_lasted(course.duration_s)}"
    if course.distance_m > 0.0:
        told += f": {fixed(course.distance_m, 0)} m"
    if course.starts:
        told += f". {_starts(course)}"
    if course.distance_m > 0.0:
        told += "; then " if course.starts else ", "
        told += f"{pace_text(course.steady_m / course.steady_s)} for 500 m{at}"
    sentences = [f"{told}{f'; started {begun}' if begun else ''}."]
    if pieces and (rows > count or course.total_s > course.duration_s + 1.0):
        far = f" and {fixed(course.total_m, 0)} m" if np.isfinite(course.total_m) else ""
        left = (
            f"; {rows - count} of its {rows} lines are waiting, paddling or misread" if rows > count else ""
        )
        sentences.append(f"The whole file: {_lasted(course.total_s)}{far}{left}.")
    return " ".join([*sentences, ends]).strip()


def _starts(course: SpeedProfile) -> str:
    """The starts with their strokes, time and way: `Standing start: 5 strokes, 9.4 s, 24 m`."""
    parts = starts_of(course)
    names = {one.name for one in parts}
    name = parts[0].name if len(names) == 1 else "start"
    label = f"{name[0].upper()}{name[1:]}" if len(parts) == 1 else f"{len(parts)} {name}s"
    strokes = sum(one.strokes for one in parts)
    count = f"{strokes} {'stroke' if strokes == 1 else 'strokes'}, " if course.is_strokes else ""
    took_s, way_m = sum(one.duration_s for one in parts), sum(one.distance_m for one in parts)
    far = f", {fixed(way_m, 0)} m" if np.isfinite(way_m) else ""
    return f"{label}: {count}{fixed(took_s, 1)} s{far}"


def _lasted(duration_s: float) -> str:
    return f"{clock_text(duration_s)}\N{NO-BREAK SPACE}{'h' if duration_s >= 3600.0 else 'min'}"


def _ends(piece: ExportPiece) -> str:
    """The first and the last quarter in a sentence; "" if the piece is too short."""

    def quarter(which: str) -> str:
        values = {name: getattr(one, which) for name, one in piece.faded.items()}
        speed = values.get("speed_m_s", values.get("impeller_speed_m_s"))
        parts = [f"{pace_text(speed)} for 500 m"] if speed else []
        parts += [
            with_unit(piece.faded[name].feature, values[name])
            for name in ("power_w", "rate_per_min")
            if name in values
        ]
        return ", ".join(parts)

    if not piece.faded.keys() & {"speed_m_s", "impeller_speed_m_s", "power_w"}:
        return ""
    whose = " of the longest piece" if len(piece.course.stretches) > 1 else ""
    return f"First quarter{whose}: {quarter('first')}. Last quarter: {quarter('last')}."


def _pace(course: SpeedProfile) -> list[KeyFigure]:
    if course.distance_m > 0.0:
        speed = course.steady_m / course.steady_s
        time = clock_text(course.steady_s, tenths=True)
        detail = f"{fixed(course.steady_m, 0)} m in {time}{after_start(course)}"
        return [KeyFigure("pace, per 500 m", pace_text(speed), detail, _PACE)]
    known = course.values.get("speed_m_s", np.zeros(len(course.counted)))[course.steady]
    known = known[known > 0.0]
    if not len(known):
        return []
    meaning = "Time for 500 m at the device's speed: median of the rowed rows. The file gives no distance."
    return [KeyFigure("pace, per 500 m", pace_text(float(np.median(known))), "median of the speed", meaning)]


def _strokes(course: SpeedProfile) -> KeyFigure:
    rows, count = len(course.counted), int(course.counted.sum())
    left = f"{rows - count} of {rows} lines left out" if rows > count else "every line of the file"
    started = count - int(course.steady.sum())
    left = (
        f"{started} of them the {'start' if len(course.starts) == 1 else 'starts'}; {left}"
        if started
        else left
    )
    return KeyFigure("strokes rowed", str(count), left, f"Left out: {left_out_text(course)}.")


def _tiles(piece: ExportPiece) -> Iterator[KeyFigure]:
    defined = meanings(piece.table)
    whose = f"the rowed strokes{after_start(piece.course)}"
    how = f"Mean over {whose}. SD: standard deviation of single strokes, a fade included."
    for name in _TILES:
        one = piece.averages.get(name)
        if one is not None and one.known:
            meaning = f"{defined.get(name, one.feature).in_words} {how}"
            detail = "; ".join(filter(None, (_scatter(one), against_usual(piece, name, piece.kind))))
            yield KeyFigure(one.feature.label, with_unit(one.feature, one.over.mean), detail, meaning)


def _scatter(one: Average) -> str:
    if not np.isfinite(one.over.sd):
        return "of a single stroke"
    return f"SD {spread(one.feature, one.over.sd)}{joined_unit(one.feature)} from stroke to stroke"
