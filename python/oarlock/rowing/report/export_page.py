"""`write_strokes_report`: the page of an export alone, without any inertial unit."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from oarlock.report import Column, KeyFigure, fixed, notes_list, plain_table, shell, tiles
from oarlock.rowing.alongside.changes import (
    SIGMAS,
    USUAL,
    Change,
    changes_between,
    changes_within,
    counted_strokes,
)
from oarlock.rowing.alongside.course import clock_text, course_of, pace_text
from oarlock.rowing.analysis.features import FEATURES, Feature
from oarlock.rowing.analysis.stroke_summary import summarise_strokes
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.report.averages import feature_of
from oarlock.rowing.report.beside import export_sections
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, places, with_unit
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.epoch import moment_text
from oarlock.storage.progress import Progress, mark, shown
from oarlock.storage.write_file import write_file

_MOST_FINDINGS = 3
_ENOUGH = 0.9
"""Share of counted strokes from which on a page says that its numbers can be believed."""


def write_strokes_report(
    found: StrokeTable | Activity,
    path: str | Path,
    other: StrokeTable | None = None,
    who: str = "",
    *,
    progress: Progress = None,
) -> Path:
    """Write the page of an export: who rowed what, what stands out, compared, can it be believed; then the sections.

    Args:
        found: of `load_export`.
        path: the file to write, or an existing folder, which gets ``strokes.html``.
        other: an export to compare with, such as last time's.
        who: who rowed, when and where, in one line.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        Path: the file written.
    """
    target = Path(path)
    target = target / "strokes.html" if target.is_dir() else target
    target.parent.mkdir(parents=True, exist_ok=True)
    with shown(progress, "writing the report") as told:
        page = strokes_page(found, other, who)
        mark(told, 1.0)
    write_file(target, page)
    return target


def strokes_page(found: StrokeTable | Activity, other: StrokeTable | None, who: str) -> str:
    """The page as text."""
    lead = [("Rowed", _rowed(found))]
    if isinstance(found, StrokeTable):
        lead.append(("Stands out", _stands_out(changes_within(found))))
        if other is not None:
            lead.append(("Compared", _compared(found, other)))
        lead.append(("Can it be believed?", _believed(found)))
    told = "".join(f"<p><b>{head}.</b> {text}</p>".replace("?.", "?") for head, text in lead)
    sections = [(one.key, one.name, one.markup) for one in export_sections(found)]
    if isinstance(found, StrokeTable):
        sections.append(("numbers", "All numbers", _numbers(found)))
    sections.append(("measured", "How it was measured", _measured(found)))
    return shell(
        _heading(found, who),
        f'<div class="lead">{told}</div>{tiles(_figures(found))}',
        sections,
        folded=("numbers", "measured"),
    )


def _heading(found: StrokeTable | Activity, who: str) -> str:
    day = moment_text(found.epoch)[:10]
    when = "" if day in who else day
    kind = (found.source.partition(": ")[2] or found.source).partition(",")[0]
    rows = f"{int(counted_strokes(found).sum())} strokes" if isinstance(found, StrokeTable) else "course"
    return ": ".join(part for part in (", ".join(filter(None, (who, when))), f"{rows}, {kind}") if part)


def _rowed(found: StrokeTable | Activity) -> str:
    course = course_of(found)
    parts = []
    if isinstance(found, StrokeTable):
        counted = int(counted_strokes(found).sum())
        parts.append(f"{counted} strokes" + (f" of {len(found)} in the file" if counted < len(found) else ""))
    intervals = len(set(course.interval[np.isfinite(course.interval)].tolist()))
    if intervals > 1:
        parts.append(f"{intervals} intervals")
    known = course.time_s[np.isfinite(course.time_s)]
    if len(known) > 1:
        parts.append(f"{clock_text(float(known[-1] - known[0]))} min")
    if np.isfinite(course.distance_m).any():
        parts.append(f"{fixed(float(np.nanmax(course.distance_m) - np.nanmin(course.distance_m)), 0)} m")
    begun = moment_text(found.epoch)[:16]
    return escape(f"{', '.join(parts)}{f'; started {begun}' if begun else ''}.")


def _stands_out(found: list[Change]) -> str:
    if not found:
        return (
            "Nothing: between the first and the last third nothing changed beyond the scatter of strokes, once the "
            "effect of the rate is removed."
        )
    return f"From the first to the last third, at equal rate:{_listed(found)}"


def _compared(found: StrokeTable, other: StrokeTable) -> str:
    changes = changes_between(found, other)
    beside = f"With {escape(other.source.partition(': ')[0])}, at equal rate"
    if not changes:
        return f"{beside}: no difference beyond the scatter of strokes."
    return f"{beside}:{_listed(changes)}"


def _listed(changes: list[Change]) -> str:
    items = "".join(f"<li>{_sentence(change)}</li>" for change in changes[:_MOST_FINDINGS])
    return f"<ul>{items}</ul>"


def _sentence(change: Change) -> str:
    feature = change.feature
    verb = "rose" if change.size > 0 else "fell"
    texts = [
        _size(feature, v) for v in (abs(change.size), 1.96 * change.size_1sd, change.before, change.after)
    ]
    size, width, before, after = (escape(text) for text in texts)
    return (
        f"<b>{escape(feature.label.capitalize())}</b> {verb} by {size} ({PLUS_MINUS} {width}, 95 %), from {before} "
        f"to {after}. {escape(USUAL.get(change.name, ''))}".rstrip()
    )


def _size(feature: Feature, value: float) -> str:
    """A value with its unit; heart rates without decimals."""
    if feature.name == "heart_rate_per_min":
        return f"{fixed(value, 0)} beats/min"
    return with_unit(feature, value)


def _believed(found: StrokeTable) -> str:
    share = float(counted_strokes(found).mean())
    odd = [
        note for note in found.notes if any(word in note for word in ("leaves out", "comes again", "cut off"))
    ]
    good = share >= _ENOUGH and not odd
    mark = '<span class="mark good">✓</span> Yes' if good else '<span class="mark warn">▲</span> In part'
    why = f"{fixed(100.0 * share, 0)} % of the rows are whole strokes at a rate of rowing"
    more = f"; {escape(odd[0])}" if odd else ""
    return (
        f"{mark}: {why}{more}. The numbers are the device's own and were not compared with a reference: "
        '<a href="#measured-in">how it was measured</a>.'
    )


_TILES = {
    "speed_m_s": "pace, per 500 m",
    "rate_per_min": "stroke rate",
    "heart_rate_per_min": "heart rate",
    "power_w": "power",
    "peak_force_n": "peak force",
    "handle_travel_m": "handle travel",
    "arc_rad": "arc",
}


def _figures(found: StrokeTable | Activity) -> list[KeyFigure]:
    rows = counted_strokes(found) if isinstance(found, StrokeTable) else np.ones(len(found), dtype=bool)
    figures = []
    for name, label in _TILES.items():
        values = found[name][rows] if name in found else np.zeros(0)
        values = values[np.isfinite(values)]
        if not len(values):
            continue
        middle, low, high = (float(v) for v in np.percentile(values, (50.0, 5.0, 95.0)))
        if name == "speed_m_s":
            ends = sorted((pace_text(low), pace_text(high)))
            figures.append(KeyFigure(label, pace_text(middle), f"90 % within {ends[0]} to {ends[1]}"))
            continue
        feature, digits = FEATURES[name], 0 if name == "heart_rate_per_min" else places(FEATURES[name])
        texts = [fixed(value * feature.shown_scale, digits) for value in (middle, low, high)]
        figures.append(
            KeyFigure(label, texts[0] + joined_unit(feature), f"90 % within {texts[1]} to {texts[2]}")
        )
    return figures


def _numbers(found: StrokeTable) -> str:
    rows = []
    for row in summarise_strokes(found):
        digits = places(feature_of(row.name))
        cells = [fixed(value, digits) for value in (row.median, row.low, row.high)]
        rows.append([escape(row.label), escape(row.unit), str(row.strokes), *cells])
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
            f"A change is reported if it is larger than {SIGMAS:.0f} standard deviations of the scatter between "
            "strokes, and than 2 deg, 2 cm, 0.03 s, 5 % of force and power, 5 beats. The effect of the stroke rate is "
            "removed by least squares.",
            "Published: Concept2 reads 11 to 15 % and Peach 8 to 17 % less power than a reference (doi "
            "10.3389/fphys.2021.758015); EmPower reads about 23 % less wash than a sensor on the "
            "handle (BioRow, 2017).",
        ]
    return notes_list(notes)
