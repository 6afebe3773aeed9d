"""Recognises files of rowing devices that contain no strokes, and explains what to export instead."""

from __future__ import annotations

from collections.abc import Sequence

from oarlock.rowing.exports.grid import CellGrid

_BY_HEADER = (
    (
        ("Interval", "Type", "Distance(m)", "Stroke", "Split(sec)"),
        "a SpeedCoach export with a row every few metres, not a row a stroke",
    ),
    (
        ("Date", "Description", "Work Time (Formatted)"),
        "a season's list of workouts of the Concept2 logbook: a row is a workout, not a stroke. In the logbook, open a "
        "workout and export its CSV",
    ),
)


def what_it_is(grids: Sequence[CellGrid]) -> str:
    """What a file is that no format reads; "" where it is not known."""
    found = [what for marks, what in _BY_HEADER for grid in grids if grid.header(marks) is not None]
    return found[0] if found else ""
