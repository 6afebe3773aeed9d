"""The sections "Pace", "Heart rate" and "Force" of a page, from an export alone or beside a track's motion."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from oarlock.report import Axis, Column, Mark, Section, Series, course_chart, fixed, plain_table
from oarlock.rowing.alongside.align import Alignment, align_strokes
from oarlock.rowing.alongside.clock_match import Places
from oarlock.rowing.alongside.counted import counted_strokes
from oarlock.rowing.alongside.course import Course, Part, clock_text, course_of, pace_text, parts_of
from oarlock.rowing.alongside.force_curves import LABELS, SPEED, ForceStack, force_stacks, forces_on_strokes
from oarlock.rowing.alongside.monitor import is_one_clock, place_by_clock
from oarlock.rowing.analysis.technique import Technique
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.report.averages import feature_of
from oarlock.rowing.report.drawings import grid
from oarlock.rowing.report.shown import shown
from oarlock.rowing.strokes.table import Floats, StrokeTable
from oarlock.storage.errors import DataError

_SPEEDS = {SPEED: "handle", "legs_speed_m_s": "legs", "trunk_speed_m_s": "trunk", "arms_speed_m_s": "arms"}
_PAUSE_MIN = 0.5
"""Charts over time have a gap there."""
_SMOOTH = 5
"""Strokes of a running median in charts of heart rate and pace: single outliers of receivers would set the scale."""


def export_sections(found: StrokeTable | Activity) -> list[Section]:
    """The sections of an export alone; those without data are left out."""
    course = course_of(found)
    sections = [_pace(course), _heart(course)]
    if isinstance(found, StrokeTable):
        sections.append(_force_alone(found))
    return [section for section in sections if section is not None]


def alongside_sections(
    export: StrokeTable | Activity, technique: Technique, offset_s: float | None = None
) -> list[Section]:
    """The sections of an export beside the motion of a track: force over the strokes that the track has.

    Args:
        export: what another device measured during the same piece.
        technique: of the track.
        offset_s: what to add to the export's times to get the track's, if it is known.

    Raises:
        DataError: the export has nothing to show, or no times.
    """
    course = course_of(export)
    force = None
    if isinstance(export, StrokeTable):
        strokes = technique.strokes
        is_one = offset_s is None and is_one_clock(export, strokes)
        alignment = place_by_clock(export, strokes) if is_one else align_strokes(export, strokes, offset_s)
        force = _force_beside(export, technique, alignment)
    sections = [one for one in (force, _pace(course), _heart(course)) if one is not None]
    if not sections:
        raise DataError(f"{export.source}: contains no speed, heart rate or force to show beside the track")
    return sections


def _pace(course: Course) -> Section | None:
    if "speed_m_s" not in course.values and not np.isfinite(course.distance_m).any():
        return None
    charts = []
    if "speed_m_s" in course.values:
        speed = course.values["speed_m_s"]
        usual = float(np.nanmedian(speed[course.counted]))
        caption = f"Speed; {fixed(usual, 2)} m/s is {pace_text(usual)} for 500 m"
        charts.append(_over_time("pace-speed", caption, course, "speed_m_s", "m/s"))
    for name, caption, unit in (("rate_per_min", "Stroke rate", "1/min"), ("power_w", "Power", "W")):
        if name in course.values:
            charts.append(_over_time(f"pace-{name.partition('_')[0]}", caption, course, name, unit))
    return Section("pace", "Pace", grid([chart for chart in charts if chart]) + _parts_table(course))


def _heart(course: Course) -> Section | None:
    if "heart_rate_per_min" not in course.values:
        return None
    heart = course.values["heart_rate_per_min"]
    known = heart[np.isfinite(heart)]
    share = 100.0 * len(known) / len(heart)
    said = (
        f"Mean {fixed(float(known.mean()), 0)}, highest {fixed(float(known.max()), 0)} beats a minute, as the device "
        f"received it, in {fixed(share, 0)} % of the {'strokes' if course.is_strokes else 'points'}."
    )
    chart = _over_time("heart-rate-course", "Heart rate", course, "heart_rate_per_min", "1/min")
    return Section("heart-rate", "Heart rate", f"<p>{escape(said)}</p>{grid([chart])}") if chart else None


def _over_time(key: str, caption: str, course: Course, name: str, unit: str) -> str:
    good = np.isfinite(course.time_s) & np.isfinite(course.values[name]) & course.counted
    if good.sum() < 2:
        return ""
    minutes = (course.time_s[good] - course.time_s[good][0]) / 60.0
    middle = _running_median(course.values[name][good])
    pauses = np.flatnonzero(np.diff(minutes) > _PAUSE_MIN) + 1
    minutes, middle = np.insert(minutes, pauses, minutes[pauses]), np.insert(middle, pauses, np.nan)
    return course_chart(
        key, caption, [Series(caption, minutes, middle)], Axis("time", "min"), Axis("", unit, least=1.0)
    )


def _running_median(values: Floats) -> Floats:
    """Of `_SMOOTH` neighbours; the ends repeat."""
    padded = np.pad(values, _SMOOTH // 2, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, _SMOOTH), axis=1))


_HEADS = {
    "rate_per_min": ("rate", "1/min", 1),
    "heart_rate_per_min": ("heart rate", "1/min", 0),
    "power_w": ("power", "W", 0),
    "peak_force_n": ("peak force", "N", 0),
    "curve_peak_force_n": ("peak force", "N", 0),
}


def _parts_table(course: Course) -> str:
    parts = parts_of(course)
    if not parts:
        return ""
    held = [name for name in _HEADS if name in course.values]
    heads = [Column("part"), Column("pace", "/ 500 m")]
    heads += [Column(_HEADS[name][0], _HEADS[name][1]) for name in held]
    heads += [Column("time", "min:s"), Column("distance", "m")]
    if course.is_strokes:
        heads.append(Column("strokes"))
    caption = (
        "Pace is distance over time where both are known, else the median of the device's speed; "
        "the other numbers are medians of the counted strokes."
    )
    return plain_table("pace-parts", caption, heads, [_row(part, held, course.is_strokes) for part in parts])


def _row(part: Part, held: Sequence[str], is_strokes: bool) -> list[str]:
    rowed = part.distance_m / part.duration_s if part.duration_s > 0.0 else float("nan")
    speed = rowed if np.isfinite(rowed) and rowed > 0.0 else part.medians.get("speed_m_s", float("nan"))
    cells = [escape(part.name), pace_text(speed)]
    cells += [fixed(part.medians[name], _HEADS[name][2]) for name in held]
    cells += [clock_text(part.duration_s), fixed(part.distance_m, 0)]
    return [*cells, *([str(part.strokes)] if is_strokes else [])]


def _force_alone(export: StrokeTable) -> Section | None:
    stacks, counted = force_stacks(export), np.flatnonzero(counted_strokes(export))
    table = _force_table(export, counted)
    if not stacks:
        missing = '<p class="hint">The export contains no force curves, only numbers for each stroke.</p>'
        return Section("force", "Force", table + missing) if table else None
    charts = [_force_chart(stack, counted, f"force-{k}") for k, stack in enumerate(stacks)]
    said = " ".join(dict.fromkeys(stack.how for stack in stacks if stack.how))
    hint = f"Means over the counted strokes. {_BAND} {said}"
    onset = f" A stroke begins with {export.onset}." if export.onset else ""
    content = f'{_peaks(stacks, counted)}{grid(charts)}<p class="hint">{escape(hint + onset)}</p>{table}'
    return Section("force", "Force", content)


_FORCE_NUMBERS = (
    "peak_force_n",
    "curve_peak_force_n",
    "r_peak_gate_force_n",
    "l_peak_gate_force_n",
    "peak_gate_force_n",
    "mean_force_n",
    "peak_force_position_m",
    "peak_force_angle_rad",
    "peak_force_travel_rad",
    "work_j",
    "curve_work_j",
)


def _force_table(export: StrokeTable, counted: Places) -> str:
    """Forces and work: over all counted strokes, over their first and last third."""
    third = len(counted) // 3
    held = [name for name in _FORCE_NUMBERS if name in export and np.isfinite(export[name][counted]).any()]
    if not third or not any(name.endswith("_force_n") for name in held):
        return ""
    rows = []
    for name in held:
        feature = feature_of(name)
        cells = [
            shown(
                feature,
                float(np.nanmean(export[name][part])) if np.isfinite(export[name][part]).any() else np.nan,
            )
            for part in (counted, counted[:third], counted[-third:])
        ]
        scatter = shown(feature, float(np.nanstd(export[name][counted])))
        rows.append([escape(feature.label), escape(feature.shown_unit), cells[0], scatter, *cells[1:]])
    heads = [Column(name) for name in ("number", "unit", "mean", "SD", "first third", "last third")]
    return plain_table("force-numbers", "Means over the counted strokes; SD: between strokes.", heads, rows)


_BAND = "Tinted: plus and minus one standard deviation between strokes."


def _force_chart(stack: ForceStack, counted: Places, key: str) -> str:
    third = len(counted) // 3
    groups = (
        [("first third", counted[:third]), ("last third", counted[-third:])]
        if third >= 4
        else [("all strokes", counted)]
    )
    series = [_series(name, stack, rows) for name, rows in groups]
    return course_chart(
        key, LABELS[stack.name].capitalize(), series, Axis(stack.axis, stack.unit), Axis("", "N")
    )


def _series(name: str, stack: ForceStack, rows: Places | None = None) -> Series:
    mean, sd = stack.mean_and_sd(rows)
    return Series(name, stack.at, mean, mean - sd, mean + sd)


_PLACES = {"%": "of the drive", "m": "of handle travel", "s": "after the catch"}


def _peaks(stacks: Sequence[ForceStack], counted: Places) -> str:
    """A sentence on each curve's peak: its size and its place."""
    told = []
    for stack in stacks:
        chosen = stack.force_n[counted]
        chosen = chosen[np.isfinite(chosen).any(axis=1)]
        if not len(chosen):
            continue
        peak, place = np.nanmax(chosen, axis=1), stack.peak_at()[counted]
        digits = 0 if stack.unit == "%" else 2
        size, spread = (f"{fixed(float(of(peak)), 0)} N" for of in (np.mean, np.std))
        at, varies = (f"{fixed(float(of(place)), digits)} {stack.unit}" for of in (np.nanmean, np.nanstd))
        text = (
            f"{LABELS[stack.name].capitalize()}: the peak is {size} (SD between strokes {spread}), at {at} "
            f"{_PLACES[stack.unit]} (SD {varies})."
        )
        told.append(f"<p>{escape(text)}</p>")
    return "".join(told)


def _force_beside(export: StrokeTable, technique: Technique, alignment: Alignment) -> Section | None:
    stacks = forces_on_strokes(export, technique.strokes, alignment)
    related = "".join(f"<p>{escape(note)}.</p>" for note in alignment.notes)
    if not stacks:
        alone = _force_alone(export)
        content = (alone.markup if alone else "") + related
        return Section("force", "Force", content) if alone else None
    finish = next((curve.finish_percent for curve in technique.curves.values()), float("nan"))
    axis, marks = Axis("share of the stroke", "%", (0.0, 100.0)), [Mark(finish, "finish")]
    force = course_chart(
        "force-stroke",
        "Force",
        [_series(LABELS[stack.name], stack) for stack in stacks],
        axis,
        Axis("", "N"),
        marks,
    )
    speeds = [
        Series(label, curve.percent, curve.mean)
        for name, label in _SPEEDS.items()
        if (curve := technique.curves.get(name)) is not None
    ]
    motion = (
        course_chart(
            "force-motion", "Handle, legs, trunk, arms", speeds, axis, Axis("toward the bow", "m/s"), marks
        )
        if speeds
        else ""
    )
    hint = (
        f"Force of {export.source} above the motion of the track, over the same strokes; 0 % is the track's catch. "
        f"{_BAND} {' '.join(dict.fromkeys(stack.how for stack in stacks if stack.how))}"
    )
    onset = (
        f"<p>The device's begin of a stroke is placed at the catch on average: {escape(export.onset)}. "
        "A constant difference between the two cannot be distinguished from an offset of the clocks.</p>"
        if export.onset and alignment.matches
        else ""
    )
    how = f"<details><summary>How force and motion were aligned</summary>{related}{onset}</details>"
    return Section(
        "force",
        "Force beside the motion",
        f'<p class="hint">{escape(hint)}</p>{grid([force, motion])}{how}',
    )
