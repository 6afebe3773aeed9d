"""The summary sentences of a rower's report: strokes, rate, length, notable findings."""

from __future__ import annotations

from html import escape

import numpy as np

from oarlock.report import KeyFigure
from oarlock.rowing.findings.find import compares_sides, findings
from oarlock.rowing.report.averages import Average, feature_of
from oarlock.rowing.report.piece import Piece
from oarlock.rowing.report.shown import joined_unit, shown, spread, with_unit

MOST_FINDINGS = 4
TILES = ("rate_per_min", "arc_rad", "catch_angle_rad", "finish_angle_rad", "rhythm")


def summary(piece: Piece) -> list[str]:
    """Sentences as markup, the most important first."""
    return [text for text in (_strokes(piece), _length(piece), _standing_out(piece), *_notes(piece)) if text]


def key_figures(piece: Piece) -> list[KeyFigure]:
    """The key figures: strokes, rate and oar angles."""
    left_out = int((~piece.counted).sum())
    detail = f"{left_out} left out of averages" if left_out else "all count in averages"
    figures = [KeyFigure("strokes", str(len(piece.table)), detail)]
    for name in TILES:
        found = piece.averages.get(name)
        if found is not None and found.known:
            figures.append(
                KeyFigure(found.feature.label, with_unit(found.feature, found.over.mean), _scatter(found))
            )
    return figures


def _scatter(found: Average) -> str:
    if np.isnan(found.over.sd):
        return "of a single stroke"
    return f"SD {spread(found.feature, found.over.sd)}{joined_unit(found.feature)} between strokes"


def _strokes(piece: Piece) -> str:
    count = len(piece.table)
    duration = float(piece.track.time_s[-1] - piece.track.time_s[0])
    text = f"<b>{count} {'stroke' if count == 1 else 'strokes'}</b> in {duration:.0f} s"
    rate = piece.averages.get("rate_per_min")
    if rate is not None and rate.known:
        text += f" at <b>{escape(with_unit(rate.feature, rate.over.mean))}</b>"
        if rate.over.count > 1:
            text += f", from {shown(rate.feature, rate.over.least)} to {shown(rate.feature, rate.over.most)}"
    if not piece.counted.all():
        text += f"; {int((~piece.counted).sum())} left out of all averages ({escape(_why_left_out(piece))})"
    return f"{text}."


def _why_left_out(piece: Piece) -> str:
    reasons = piece.table.reason("in_averages")
    told = [reasons[row] or "left out" for row in np.flatnonzero(~piece.counted)]
    counts = {reason: told.count(reason) for reason in dict.fromkeys(told)}
    return "; ".join(f"{count} times {reason}" if count > 1 else reason for reason, count in counts.items())


def _length(piece: Piece) -> str:
    arc, catch, finish, rhythm = (
        piece.averages.get(name) for name in ("arc_rad", "catch_angle_rad", "finish_angle_rad", "rhythm")
    )
    parts = []
    if arc is not None and arc.known and catch is not None and finish is not None:
        swept, caught = (with_unit(one.feature, one.over.mean) for one in (arc, catch))
        ended = with_unit(finish.feature, finish.over.mean, signed=True)
        parts.append(f"The oar sweeps <b>{swept}</b>, from {caught} at the catch to {ended} at the finish")
    if rhythm is not None and rhythm.known:
        share = with_unit(rhythm.feature, rhythm.over.mean)
        parts.append(f"{'the' if parts else 'The'} drive takes {share} of the stroke")
    return f"{'; '.join(parts)}." if parts else ""


def _standing_out(piece: Piece) -> str:
    if not piece.counted.any():
        return (
            "<strong>Notable:</strong> all strokes are excluded from averages, so technique is not assessed."
        )
    found = findings(piece)
    if not found:
        sides = "Right and left agree, no" if compares_sides(piece) else "No"
        return (
            f"<strong>Notable:</strong> nothing. {sides} stroke is unusual, and no relevant drift was found."
        )
    told = " ".join(escape(finding.sentence) for finding in found[:MOST_FINDINGS])
    more = len(found) - MOST_FINDINGS
    rest = f" And {more} smaller {'finding' if more == 1 else 'findings'}; see below." if more > 0 else ""
    return f"<strong>Notable:</strong> {told}{rest}"


def _notes(piece: Piece) -> list[str]:
    return [escape(note) for note in piece.technique.found.notes] + _unmet(piece)


def _unmet(piece: Piece) -> list[str]:
    """Targets for which this piece has no number."""
    known = {name for name, average in piece.averages.items() if average.known}
    missing = [feature_of(name).label for name in piece.technique.targets if name not in known]
    return [f"Targets without a number in this piece: {escape(', '.join(missing))}."] if missing else []
