"""Sentences and key figures of a rower's report: strokes, rate, length, and what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from oarlock.report import KeyFigure
from oarlock.rowing.report.averages import Average, feature_of
from oarlock.rowing.report.piece import Counted, Piece
from oarlock.rowing.report.shown import joined_unit, shown, spread, with_unit

TILES = ("rate_per_min", "arc_rad", "catch_angle_rad", "finish_angle_rad", "rhythm")


def key_figures(piece: Counted, names: Sequence[str] = TILES) -> list[KeyFigure]:
    """The key figures: strokes, and those of `names` that are known."""
    left_out = int((~piece.counted).sum())
    detail = f"{left_out} left out of averages" if left_out else "all count in averages"
    figures = [KeyFigure("strokes", str(len(piece.table)), detail)]
    for name in names:
        found = piece.averages.get(name)
        if found is not None and found.known:
            figures.append(
                KeyFigure(
                    found.feature.label,
                    with_unit(found.feature, found.over.mean),
                    _scatter(found),
                    found.feature.in_words,
                )
            )
    return figures


def _scatter(found: Average) -> str:
    if np.isnan(found.over.sd):
        return "of a single stroke"
    return f"SD {spread(found.feature, found.over.sd)}{joined_unit(found.feature)} between strokes"


def strokes(piece: Piece) -> str:
    """How many strokes, how long, at which rates; text."""
    count = len(piece.table)
    duration = float(piece.track.time_s[-1] - piece.track.time_s[0])
    text = f"{count} {'stroke' if count == 1 else 'strokes'} in {duration:.0f} s"
    rate = piece.averages.get("rate_per_min")
    if rate is not None and rate.known:
        text += f" at {with_unit(rate.feature, rate.over.mean)}"
        if rate.over.count > 1:
            text += f", from {shown(rate.feature, rate.over.least)} to {shown(rate.feature, rate.over.most)}"
    if not piece.counted.all():
        text += f"; {int((~piece.counted).sum())} left out of all averages ({_why_left_out(piece)})"
    return f"{text}."


def _why_left_out(piece: Piece) -> str:
    reasons = piece.table.reason("in_averages")
    told = [reasons[row] or "left out" for row in np.flatnonzero(~piece.counted)]
    counts = {reason: told.count(reason) for reason in dict.fromkeys(told)}
    return "; ".join(f"{count} times {reason}" if count > 1 else reason for reason, count in counts.items())


def length(piece: Piece) -> str:
    """Arc, catch, finish and rhythm; text, empty if unknown."""
    arc, catch, finish, rhythm = (
        piece.averages.get(name) for name in ("arc_rad", "catch_angle_rad", "finish_angle_rad", "rhythm")
    )
    parts = []
    if arc is not None and arc.known and catch is not None and finish is not None:
        swept, caught = (with_unit(one.feature, one.over.mean) for one in (arc, catch))
        ended = with_unit(finish.feature, finish.over.mean, signed=True)
        parts.append(f"The oar sweeps {swept}, from {caught} at the catch to {ended} at the finish")
    if rhythm is not None and rhythm.known:
        share = with_unit(rhythm.feature, rhythm.over.mean)
        parts.append(f"{'the' if parts else 'The'} drive takes {share} of the stroke")
    return f"{'; '.join(parts)}." if parts else ""


def notes(piece: Piece) -> list[str]:
    """What was missing or left out, as markup: of the strokes, and targets without a number."""
    return [escape(note) for note in piece.technique.found.notes] + _unmet(piece)


def _unmet(piece: Piece) -> list[str]:
    """Targets for which this piece has no number."""
    known = {name for name, average in piece.averages.items() if average.known}
    missing = [feature_of(name).label for name in piece.technique.targets if name not in known]
    return [f"Targets without a number in this piece: {escape(', '.join(missing))}."] if missing else []
