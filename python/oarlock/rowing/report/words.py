"""Sentences and key figures of a rower's report: strokes, rate, length, and what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from oarlock.report import KeyFigure
from oarlock.rowing.findings.watched import WATCHED, Told, Watched
from oarlock.rowing.report.averages import Average, feature_of
from oarlock.rowing.report.piece import Counted, Piece
from oarlock.rowing.report.shown import joined_unit, shown, spread, with_unit

_SHARE = {"rhythm": "drive of the stroke"}
SCATTER = "SD: standard deviation between strokes."
TILES = ("rate_per_min", "arc_rad", "catch_angle_rad", "finish_angle_rad", "rhythm")


def key_figures(piece: Counted, names: Sequence[str] = TILES, kind: str = "") -> list[KeyFigure]:
    """The key figures: strokes, and those of `names` that are known; `kind` of rowing, for usual values."""
    left_out = int((~piece.counted).sum())
    detail = f"{left_out} not in averages" if left_out else "all in averages"
    figures = [KeyFigure("strokes", str(len(piece.table)), detail)]
    for name in names:
        found = piece.averages.get(name)
        if found is not None and found.known:
            figures.append(_key_figure(found, WATCHED.get(name), kind))
    return figures


def _key_figure(found: Average, watched: Watched | None, kind: str) -> KeyFigure:
    """A number with its scatter and usual values; their source is in the definition."""
    usual = watched.usual_of(kind) if watched is not None else Told()
    short = (
        watched.usual_range.get(kind, "").replace(" ", "\N{NO-BREAK SPACE}") if watched is not None else ""
    )
    meaning = f"{found.feature.in_words} {SCATTER}"
    if usual.text:
        meaning += f" Usual: {usual.text} ({usual.source})."
    return KeyFigure(
        found.feature.label,
        with_unit(found.feature, found.over.mean),
        "; ".join(
            filter(None, (_SHARE.get(found.feature.name), _scatter(found), f"usual {short}" if short else ""))
        ),
        meaning,
    )


def _scatter(found: Average) -> str:
    if np.isnan(found.over.sd):
        return "of a single stroke"
    return f"SD {spread(found.feature, found.over.sd)}{joined_unit(found.feature)}"


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
    return f"{text}."


def _left_out(piece: Piece) -> list[str]:
    count = int((~piece.counted).sum())
    if not count:
        return []
    return [
        escape(f"{count} of {len(piece.table)} strokes left out of all averages: {_why_left_out(piece)}.")
    ]


def _why_left_out(piece: Piece) -> str:
    reasons = piece.table.reason("in_averages")
    told = [reasons[row] or "left out" for row in np.flatnonzero(~piece.counted)]
    counts = {reason: told.count(reason) for reason in dict.fromkeys(told)}
    return "; ".join(f"{count} times {reason}" if count > 1 else reason for reason, count in counts.items())


def notes(piece: Piece) -> list[str]:
    """What was missing or left out, as markup: of the strokes, and targets without a number."""
    return [*map(escape, piece.technique.found.notes), *_left_out(piece), *_unmet(piece)]


def _unmet(piece: Piece) -> list[str]:
    """Targets for which this piece has no number."""
    known = {name for name, average in piece.averages.items() if average.known}
    missing = [feature_of(name).label for name in piece.technique.targets if name not in known]
    return [f"Targets without a number in this piece: {escape(', '.join(missing))}."] if missing else []
