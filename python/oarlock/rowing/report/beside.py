"""The sections "Pace", "Heart rate" and "Force" of a track's page: what another device measured, beside the motion."""

from __future__ import annotations

from html import escape

from oarlock.report import Axis, Mark, Section, Series, course_chart, grid
from oarlock.rowing.alongside.align import Alignment, align_strokes
from oarlock.rowing.alongside.course import SpeedProfile, course_of
from oarlock.rowing.alongside.force_curves import LABELS, forces_on_strokes
from oarlock.rowing.alongside.monitor import is_one_clock, place_by_clock
from oarlock.rowing.analysis.technique import Technique
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.report.drawings import SPEEDS
from oarlock.rowing.report.export_force import BAND, force_section, force_series
from oarlock.rowing.report.export_pace import heart_section, pace_section
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.errors import DataError


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
        force = _force_beside(export, technique, alignment, course)
    sections = [one for one in (force, pace_section(course), heart_section(course)) if one is not None]
    if not sections:
        raise DataError(f"{export.source}: contains no speed, heart rate or force to show beside the track")
    return sections


def _force_beside(
    export: StrokeTable, technique: Technique, alignment: Alignment, course: SpeedProfile
) -> Section | None:
    stacks = forces_on_strokes(export, technique.strokes, alignment)
    related = "".join(f"<p>{escape(note)}.</p>" for note in alignment.notes)
    if not stacks:
        alone = force_section(export, course)
        content = (alone.markup if alone else "") + related
        return Section("force", "Force", content) if alone else None
    finish = next((curve.finish_percent for curve in technique.curves.values()), float("nan"))
    axis, marks = Axis("share of the stroke", "%", (0.0, 100.0)), [Mark(finish, "finish")]
    force = course_chart(
        "force-stroke",
        "Force",
        [force_series(LABELS[stack.name], stack) for stack in stacks],
        axis,
        Axis("", "N"),
        marks,
    )
    speeds = [
        Series(label, curve.percent, curve.mean)
        for name, label in SPEEDS.items()
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
        f"{BAND} {' '.join(dict.fromkeys(stack.how for stack in stacks if stack.how))}"
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
