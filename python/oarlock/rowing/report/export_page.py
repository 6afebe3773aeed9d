"""`write_strokes_report`: the page of an export alone, without any inertial unit."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType

from oarlock.report import (
    Column,
    Section,
    Trust,
    belief_markup,
    capital,
    fixed,
    front_markup,
    notes_list,
    plain_table,
    shell,
    who_and_when,
    who_in_words,
)
from oarlock.rowing.alongside.course import SpeedProfile, course_of
from oarlock.rowing.analysis.stroke_summary import summarise_strokes
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.exports.build import NAMED
from oarlock.rowing.findings.candidate import FALSE_SHARE
from oarlock.rowing.report.averages import feature_of
from oarlock.rowing.report.definitions import definitions, meanings
from oarlock.rowing.report.export_force import force_section
from oarlock.rowing.report.export_front import course_front, left_out_text, strokes_front
from oarlock.rowing.report.export_pace import heart_section, pace_section
from oarlock.rowing.report.export_piece import ExportPiece, device_of, fade_section
from oarlock.rowing.report.shown import places
from oarlock.rowing.report.tables import link
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.epoch import moment_text
from oarlock.storage.progress import Progress, mark, shown
from oarlock.storage.write_file import write_file

_NOBODY: Mapping[str, str] = MappingProxyType({})
_ASKED = ("athlete", "date", "place")
_CONCEPT2 = "Concept2 ergometers read 11 to 15 % less power than a reference (doi 10.3389/fphys.2021.758015)."
_PUBLISHED = {
    **dict.fromkeys(("Concept2", "Painsled", "ErgData", "ErgStick"), ("power_w", _CONCEPT2)),
    "Peach": (
        "power_w",
        "Peach reads 8 to 17 % less power than a reference (doi 10.3389/fphys.2021.758015).",
    ),
    "NK": ("wash_rad", "EmPower reads about 23 % less wash than a sensor on the handle (BioRow, 2017)."),
}
"""What is known of a device's errors, by the begin of its name: of which column, and the sentence."""


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
    if isinstance(found, StrokeTable):
        boat = session.get("boat", "")
        piece = ExportPiece(found, boat)
        course = piece.course
        front = strokes_front(piece, None if last is None else ExportPiece(last, boat))
        sections = [pace_section(course), fade_section(piece.faded, course), force_section(found, course)]
        others = [
            Section("numbers", "All numbers", _numbers(found)),
            Section("meanings", "What each number means", definitions(found.columns, meanings(found))),
        ]
    else:
        course = course_of(found)
        front, sections, others = course_front(found, course), [pace_section(course)], []
    others.append(Section("measured", "How it was measured", _measured(found, course)))
    heading, about = _heading(found, course, session)
    told = f"these are the numbers of the {device_of(found.source)}, not checked here."
    return shell(
        heading,
        about + belief_markup(Trust("care", (told,)), "measured-in") + front_markup(front),
        [(one.key, one.name, one.markup) for one in (*sections, heart_section(course), *others) if one],
        style=files(__package__).joinpath("style.css").read_text("utf-8"),
        folded=[one.key for one in others],
    )


def _heading(
    found: StrokeTable | Activity, course: SpeedProfile, session: Mapping[str, str]
) -> tuple[str, str]:
    """Who and what, and markup of what else is known of the session."""
    day = moment_text(found.epoch)[:10]
    known = {**({"date": day} if day else {}), **session}
    who, (_, rest) = who_in_words({"session": known}), who_and_when({"session": known})
    what = f"{int(course.counted.sum())} strokes" if isinstance(found, StrokeTable) else "Course"
    heading = ": ".join(filter(None, (who, f"{what}, {device_of(found.source)}")))
    named = next((note.removeprefix(NAMED) for note in found.notes if note.startswith(NAMED)), "")
    parts = ", ".join(filter(None, (rest, named, f"file {found.source.partition(': ')[0]}")))
    about = f"{capital(parts)}. "
    if missing := [name for name in _ASKED if not known.get(name)]:  # the commands say how to add it
        names = " and ".join(filter(None, (", ".join(missing[:-1]), missing[-1])))
        about += f"{capital(names)} not in the file."
    return heading, f'<p class="about">{escape(about)}</p>'


def _numbers(found: StrokeTable) -> str:
    rows = []
    for row in summarise_strokes(found):
        digits = places(feature_of(row.name))
        cells = [fixed(value, digits) for value in (row.median, row.low, row.high)]
        rows.append([link(row.name, row.label), escape(row.unit), str(row.strokes), *cells])
    heads = [Column(name) for name in ("quantity", "unit", "strokes", "median", "5 %", "95 %")]
    caption = "Over all rows of the file, waiting and paddling included: nothing is left out here."
    return plain_table("numbers-all", caption, heads, rows)


def _measured(found: StrokeTable | Activity, course: SpeedProfile) -> str:
    device = device_of(found.source)
    published = [
        text for name, (of, text) in _PUBLISHED.items() if device.startswith(name) and of in found.columns
    ]
    notes = [
        f"{found.source}.",
        "The numbers are those of the device. They were not compared with a reference here.",
        *published[:1],
        *(f"{note}." for note in found.notes),
    ]
    if isinstance(found, StrokeTable):
        if found.onset:
            notes.append(f"A stroke begins with {found.onset}.")
        notes += [
            f"{len(found)} rows: {int(course.counted.sum())} rowed strokes; left out: {left_out_text(course)}.",
            "A row is rowing at 14 to 50 strokes a minute, with at least half of the usual length and half of the "
            "usual speed; slower rows of a start count. A pause is longer than 8.6 s (two strokes at 14 a minute), "
            "unless the boat went on at 80 % of its speed for up to 30 s, where the device missed strokes. Fewer than "
            "6 strokes between two pauses are no piece. A piece begins where the device began to count, if it was "
            "rowed from there.",
            "A piece that begins below 80 % of the speed that follows (the median of 30 s) has a start: half of the "
            "power would hold this speed, the rest accelerates. The start ends with the last stroke before 90 % is "
            "reached, after 30 s at most; a piece that takes longer has none. It is a standing start if it begins "
            "below half of the speed, otherwise a rolling start. Pace, averages, fade and comparisons are of the "
            "strokes after it; time and distance of the whole contain it.",
            "The effect of the stroke rate is removed by a robust regression (Huber 1964). A change is named if it is "
            "larger than the smallest relevant size (force, work and power: 5 % of the usual value in this file, or "
            "the device's rounding) and if chance explains it in fewer than "
            f"{fixed(100.0 * FALSE_SHARE, 0)} % of pieces without any change (Holm 1979). Single strokes are not "
            "judged, since devices misread some.",
        ]
    return notes_list(notes)
