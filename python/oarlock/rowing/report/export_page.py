"""`write_strokes_report`: the page of an export alone, without any inertial unit."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType

import numpy as np

from oarlock.report import (
    Column,
    Front,
    KeyFigure,
    Trust,
    belief_markup,
    fixed,
    front_markup,
    notes_list,
    plain_table,
    shell,
    who_and_when,
)
from oarlock.rowing.alongside.course import clock_text, course_of, pace_text
from oarlock.rowing.analysis.stroke_summary import summarise_strokes
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.findings.candidate import FALSE_SHARE
from oarlock.rowing.findings.find import findings_of
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.findings.rowed import FEWEST_STROKES
from oarlock.rowing.report import words
from oarlock.rowing.report.averages import feature_of
from oarlock.rowing.report.beside import export_sections
from oarlock.rowing.report.definitions import definitions
from oarlock.rowing.report.earlier import compared, earlier_pieces
from oarlock.rowing.report.export_piece import ExportPiece, device_of
from oarlock.rowing.report.front import point
from oarlock.rowing.report.shown import places
from oarlock.rowing.report.tables import link
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.epoch import moment_text
from oarlock.storage.progress import Progress, mark, shown
from oarlock.storage.write_file import write_file

_ODD = ("leaves out", "comes again", "cut off")
"""Words of notes that say that strokes are missing or doubled."""
_TILES = ("rate_per_min", "heart_rate_per_min", "power_w", "peak_force_n", "handle_travel_m", "arc_rad")
_COMMAND = "oarlock strokes FILE --report PAGE --last EARLIER"
_OWN = "The numbers are the device's own and were not compared with a reference."
_NOBODY: Mapping[str, str] = MappingProxyType({})


def write_strokes_report(
    found: StrokeTable | Activity,
    path: str | Path,
    last: StrokeTable | None = None,
    session: Mapping[str, str] = _NOBODY,
    *,
    progress: Progress = None,
) -> Path:
    """Write the page of an export: who rowed what, what stands out, compared, can it be believed; then the sections.

    Args:
        found: of `load_export`.
        path: the file to write, or an existing folder, which gets ``strokes.html``.
        last: an export to compare with, such as last time's.
        session: who rowed, when and where, as `session.toml` has it; the file's own date if it gives none.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        Path: the file written.
    """
    target = Path(path)
    target = target / "strokes.html" if target.is_dir() else target
    target.parent.mkdir(parents=True, exist_ok=True)
    with shown(progress, "writing the report") as told:
        page = strokes_page(found, last, session)
        mark(told, 1.0)
    write_file(target, page)
    return target


def strokes_page(
    found: StrokeTable | Activity, last: StrokeTable | None = None, session: Mapping[str, str] = _NOBODY
) -> str:
    """The page as text."""
    sections = [(one.key, one.name, one.markup) for one in export_sections(found)]
    if isinstance(found, StrokeTable):
        front, trust = _front_of_strokes(found, last), _trust(found)
        sections.append(("numbers", "All numbers", _numbers(found)))
        sections.append(("meanings", "What each number means", definitions(found.columns)))
    else:
        front, trust = Front(did=_did(found), figures=_pace(found)), Trust("care", (_OWN,))
    sections.append(("measured", "How it was measured", _measured(found)))
    heading, rest = _heading(found, session)
    about = f'<p class="about">{escape(rest)}</p>' if rest else ""
    return shell(
        heading,
        about + belief_markup(trust, "measured-in") + front_markup(front),
        sections,
        style=files(__package__).joinpath("style.css").read_text("utf-8"),
        folded=("numbers", "meanings", "measured"),
    )


def _heading(found: StrokeTable | Activity, session: Mapping[str, str]) -> tuple[str, str]:
    day = moment_text(found.epoch)[:10]
    who, rest = who_and_when({"session": {**({"date": day} if day else {}), **session}})
    what = f"{len(found)} strokes" if isinstance(found, StrokeTable) else "Course"
    return ": ".join(filter(None, (who, f"{what}, {device_of(found.source)}"))), rest


def _front_of_strokes(found: StrokeTable, last: StrokeTable | None) -> Front:
    piece, earlier = ExportPiece(found), None if last is None else ExportPiece(last)
    apart = ""
    if earlier is not None and not piece.rowed().comparable(earlier.rowed()):
        devices = f"({piece.device}, {earlier.device})"
        apart = f" Differences from last time are not assessed, because the devices differ {devices}."
    return Front(
        did=_did(found),
        points=[point(one) for one in findings_of_export(found, last)],
        quiet=_quiet(piece) + apart,
        figures=_pace(found) + words.key_figures(piece, _TILES),
        compared=compared(piece, earlier_pieces(earlier, None), command=_COMMAND),
    )


def findings_of_export(found: StrokeTable, last: StrokeTable | None = None) -> list[Finding]:
    """What stands out of an export, by itself and against last time's; no single strokes, which devices misread."""
    compared_with = {} if last is None else {"against last": ExportPiece(last).rowed()}
    named = findings_of(ExportPiece(found).rowed(), compared_with)
    return [one for one in named if one.kind != "odd stroke"]


def _quiet(piece: ExportPiece) -> str:
    counted = int(piece.counted.sum())
    if counted < FEWEST_STROKES:
        return f"Not assessed: {counted} whole strokes, {FEWEST_STROKES} are needed."
    return "Nothing changed over the piece beyond the scatter of its strokes."


def _did(found: StrokeTable | Activity) -> str:
    course = course_of(found)
    parts = []
    if isinstance(found, StrokeTable):
        parts.append(f"{len(found)} strokes")
    intervals = len(set(course.interval[np.isfinite(course.interval)].tolist()))
    if intervals > 1:
        parts.append(f"{intervals} intervals")
    known = course.time_s[np.isfinite(course.time_s)]
    if len(known) > 1:
        parts.append(f"{clock_text(float(known[-1] - known[0]))} min")
    if np.isfinite(course.distance_m).any():
        parts.append(f"{fixed(float(np.nanmax(course.distance_m) - np.nanmin(course.distance_m)), 0)} m")
    begun = moment_text(found.epoch)[:16]
    return f"{', '.join(parts)}{f'; started {begun}' if begun else ''}."


def _pace(found: StrokeTable | Activity) -> list[KeyFigure]:
    course = course_of(found)
    speed = course.values.get("speed_m_s", np.zeros(len(course.counted)))[course.counted]
    speed = speed[speed > 0.0]
    if not len(speed):
        return []
    middle, slow, fast = (pace_text(float(v)) for v in np.percentile(speed, (50.0, 5.0, 95.0)))
    meaning = "Time for 500 m at the device's speed: median of the counted strokes."
    return [KeyFigure("pace, per 500 m", middle, f"90 % within {fast} to {slow}", meaning)]


def _trust(found: StrokeTable) -> Trust:
    share = float(ExportPiece(found).counted.mean())
    odd = [note for note in found.notes if any(word in note for word in _ODD)]
    why = f"{fixed(100.0 * share, 0)} % of the rows are whole strokes at a rate of rowing"
    return Trust("care", (f"{'; '.join([why, *odd[:1]])}. {_OWN}",))


def _numbers(found: StrokeTable) -> str:
    rows = []
    for row in summarise_strokes(found):
        digits = places(feature_of(row.name))
        cells = [fixed(value, digits) for value in (row.median, row.low, row.high)]
        rows.append([link(row.name, row.label), escape(row.unit), str(row.strokes), *cells])
    heads = [Column(name) for name in ("quantity", "unit", "strokes", "median", "5 %", "95 %")]
    return plain_table("numbers-all", "Over all rows of the file; nothing is left out.", heads, rows)


def _measured(found: StrokeTable | Activity) -> str:
    notes = [f"{found.source}.", *(f"{note}." for note in found.notes)]
    if isinstance(found, StrokeTable):
        if found.onset:
            notes.append(f"A stroke begins with {found.onset}.")
        notes += [
            "Strokes count at 14 to 50 a minute with at least half of the median length; others are paddling, "
            "starts or misread.",
            "The effect of the stroke rate is removed by a robust regression (Huber 1964). A change is named if it is "
            "larger than the smallest relevant size and if chance explains it in fewer than "
            f"{fixed(100.0 * FALSE_SHARE, 0)} % of pieces without any change (Holm 1979). Single strokes are not "
            "judged, since devices misread some.",
            "Published: Concept2 reads 11 to 15 % and Peach 8 to 17 % less power than a reference (doi "
            "10.3389/fphys.2021.758015); EmPower reads about 23 % less wash than a sensor on the "
            "handle (BioRow, 2017).",
        ]
    return notes_list(notes)
