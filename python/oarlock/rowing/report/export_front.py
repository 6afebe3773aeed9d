"""The front of an export's page: what was rowed, what stands out, what to do next, and against last time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from oarlock.report import Front, KeyFigure, fixed
from oarlock.rowing.alongside.course import SpeedProfile, starts_of
from oarlock.rowing.alongside.paces import PER_500_M, SPEEDS, clock_text, of_pace, pace_text
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.findings.candidate import MetricComparison, against
from oarlock.rowing.findings.find import comparisons, findings_of
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.findings.rowed import FEWEST_STROKES
from oarlock.rowing.report.checked import is_useful, sizes
from oarlock.rowing.report.definitions import meanings
from oarlock.rowing.report.earlier import compared, earlier_pieces
from oarlock.rowing.report.export_force import after_start
from oarlock.rowing.report.export_piece import FORCES, LENGTHS, ExportPiece, where_lost
from oarlock.rowing.report.front import point
from oarlock.rowing.report.shown import joined_unit, spread, with_unit
from oarlock.rowing.report.usual import beyond_of, usual_span
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
    course, found = piece.course, findings_of_export(piece, earlier)
    rate = piece.averages.get("rate_per_min")
    at = f" at {with_unit(rate.feature, rate.over.mean)}" if rate is not None and rate.known else ""
    defined = meanings(piece.table)
    return Front(
        did=_did(piece.table, course, at, _ends(piece)),
        # with the definitions that fit the device
        points=[replace(point(one), meaning=defined[one.name].in_words) for one in found],
        quiet=quiet_text(piece) + apart,
        next_step=next_step(piece, found, earlier is not None),
        commands=[_COMPARE, _NAME] if earlier is None else [_NAME],
        figures=[*_pace(course), _strokes(course), *_tiles(piece)],
        compared=compared(piece, earlier_pieces(earlier, None)),
    )


def course_front(found: Activity, course: SpeedProfile) -> Front:
    """The front of points in time."""
    return Front(did=_did(found, course, "", ""), figures=_pace(course))


def findings_of_export(piece: ExportPiece, earlier: ExportPiece | None = None) -> list[Finding]:
    """What stands out of an export, by itself and against last time's; no single strokes, which devices misread."""
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
            scatter = f"SD {spread(one.feature, one.over.sd)}{joined_unit(one.feature)} from stroke to stroke"
            scatter = scatter if np.isfinite(one.over.sd) else "of a single stroke"
            detail = "; ".join(filter(None, (scatter, against_usual(piece, name, piece.kind))))
            yield KeyFigure(one.feature.label, with_unit(one.feature, one.over.mean), detail, meaning)


_GROUPS = (SPEEDS, ("power_w",), FORCES, LENGTHS[1:])
_FOR_CHANGES = 60
"""Strokes at one rate that show a change which tells something, about a fifth of the power or 8 deg of arc: in the
sample files of rowingdata, of windows of 60 strokes 96 % for power, 94 % for speed and 88 % for arc; of windows of 12
strokes 65, 79 and 58 %."""
_IN_THE_BOAT = {
    "slip_rad": "The oar turns that far at the catch before the blade is loaded.",
    "wash_rad": "The oar turns that far at the finish without load on the blade.",
    "arc_rad": "",
}
"""What a number beyond usual values means in the boat; exercises come from `watched.toml`."""


def quiet_text(piece: ExportPiece) -> str:
    """What is said if nothing stands out: the size from which a change would, or that too few strokes count."""
    count, after = int(piece.counted.sum()), after_start(piece.course)
    if count < FEWEST_STROKES:
        return f"Not assessed: {count} whole strokes{after}, {FEWEST_STROKES} are needed."
    shown = could_show(piece, comparisons(piece.rowed, {}), "drift")
    if not shown:
        return (
            f"Not assessed: the {count} strokes{after} are too few, or differ too much from each other, to show "
            "a change from start to end."
        )
    return (
        "No change in the last third is larger than chance and large enough to matter. "
        f"It would have to be larger than about {', '.join(shown)}."
    )


def next_step(piece: ExportPiece, found: Sequence[Finding], is_compared: bool) -> str:
    """What to do in the boat where the numbers say so, and what the same piece again could show."""
    if int(piece.counted.sum()) < FEWEST_STROKES:
        return _record(piece)
    boat = where_lost(piece.faded, piece.course) or beyond_usual(piece)
    tries = "Try the exercises above." if any(one.advice for one in found) else ""
    if not (boat or found):
        few = int(piece.counted.sum()) < 4 * FEWEST_STROKES
        if few or not could_show(piece, comparisons(piece.rowed, {}), "drift"):
            return f"These strokes are too few to show what to change in the boat. {_record(piece)}"
        boat = "These numbers ask for no change in the boat."
    return " ".join(filter(None, (boat, tries, "" if is_compared else _again(piece))))


def beyond_usual(piece: ExportPiece) -> str:
    """The length, slip or wash that lies clearly beyond usual values, with their source and where to look."""
    for name, means in _IN_THE_BOAT.items():
        one = beyond_of(piece, name, piece.kind)
        if one is None or not one.matters or one.found.over.count < FEWEST_STROKES:
            continue
        tries, watched = one.to_try, one.watched
        told = f"Try: {tries.text}" if tries.text else means
        if not told:
            continue
        size = with_unit(watched.feature, one.found.over.mean)
        sources = "; ".join(filter(None, (watched.usual_source, tries.source)))
        return (
            f"Look at the {watched.feature.label} first: {size}, usual is {usual_span(watched, piece.kind)}. "
            f"{told} Source: {sources}."
        )
    return ""


def _again(piece: ExportPiece) -> str:
    """The same piece again, and what it could show; a longer one where it could show nothing."""
    shown = could_show(piece, list(against(piece.rowed, piece.rowed, "again")), "again")[:2]
    if not shown:
        return _record(piece)
    rate = piece.averages.get("rate_per_min")
    at = f" at {with_unit(rate.feature, rate.over.mean)}" if rate is not None and rate.known else ""
    pieces = "pieces" if len(piece.course.stretches) > 1 else "piece"
    wind = "" if piece.kind == "ergometer" else "; on the water wind and stream come on top"
    return (
        f"Row the same {pieces} again{at} and compare: differences from about {' and '.join(shown)} "
        f"can be shown{wind}."
    )


def _record(piece: ExportPiece) -> str:
    fewer = int(piece.counted.sum()) < _FOR_CHANGES
    size = f"at least {_FOR_CHANGES} strokes" if fewer else "a piece"
    return f"Record {size} at one rate without a pause: then a change and a difference from this piece can be shown."


def could_show(piece: ExportPiece, candidates: Sequence[MetricComparison], kind: str) -> list[str]:
    """The smallest differences that would be named, of speed, power, force and length, without useless ones."""
    useful = [one for one in candidates if is_useful(one, len(candidates))]
    told = []
    for group in _GROUPS:
        for one in useful:
            if one.kind == kind and one.watched.name in group and one.watched.name in SPEEDS:
                values = piece.rowed.columns[one.watched.name][piece.rowed.good(one.watched.name)]
                late_s = of_pace(float(np.median(values)), one.named_from(len(candidates)))
                told.append(f"{math.ceil(late_s)} {PER_500_M}")
                break
        else:
            told += [f"{size} {label}" for label, size in sizes(useful, kind, group, len(candidates))[:1]]
    return told
