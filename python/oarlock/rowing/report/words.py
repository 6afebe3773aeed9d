"""Sentences and key figures of a rower's report: strokes, rate, length, and what was left out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from html import escape
from types import MappingProxyType

import numpy as np

from oarlock.report import KeyFigure
from oarlock.rowing.findings.watched import WATCHED, SourcedText, Watched
from oarlock.rowing.report.averages import Average, feature_of
from oarlock.rowing.report.piece import Counted, ReportPiece
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, shown, spread, with_unit
from oarlock.rowing.report.tables import about, which_left_out
from oarlock.rowing.report.usual import beyond_of, usual_span
from oarlock.storage.arrays import Floats
from oarlock.storage.statistics import NORMAL_95

_NONE: Mapping[str, str] = MappingProxyType({})
_SHARE = {"rhythm": "drive of the stroke"}
TILES = (
    "rate_per_min",
    "arc_rad",
    "catch_angle_rad",
    "finish_angle_rad",
    "rhythm",
    "catch_lean_rad",
    "finish_lean_rad",
    "seat_travel_m",
)
OF_UNITS = ("catch_lean_rad", "finish_lean_rad")
"""Key figures that inertial units measure; encoders measure the others."""
_RAMP_PER_MIN = 2.0
"""A rate that differs by less between start and end of a piece is called steady, 1/min."""
_AT_THE_ENDS = 3
"""Strokes at start and end whose mean rates are compared."""


def key_figures(
    piece: Counted,
    names: Sequence[str] = TILES,
    kind: str = "",
    calibrated: bool = True,
    over_rate: Mapping[str, str] = _NONE,
) -> list[KeyFigure]:
    """The key figures: strokes, and those of `names` that are known.

    `kind` of rowing, for usual values; `calibrated`: whether the mounts of the inertial units are; `over_rate`: of a
    ramp, what a number that follows the rate is from its lowest to its highest rates, instead of a mean.
    """
    left_out = int((~piece.counted).sum())
    detail = f"{left_out} not in averages" if left_out else "all in averages"
    why = f"Left out of all averages: {which_left_out(piece)}." if left_out else ""
    figures = [KeyFigure("strokes", str(len(piece.table)), detail, why)]
    known = (one for name in names if (one := piece.averages.get(name)) is not None and one.known)
    unsure = () if calibrated else OF_UNITS
    figures += (_figure(piece, one, kind, unsure, over_rate.get(one.feature.name, "")) for one in known)
    return figures


def _figure(piece: Counted, found: Average, kind: str, unsure: Collection[str], over_rate: str) -> KeyFigure:
    name = found.feature.name
    if name == "rate_per_min" and is_ramp(piece):  # a mean says little
        first, last = rates_at_ends(piece)
        mean = f"mean {with_unit(found.feature, found.over.mean)}"
        return KeyFigure(found.feature.label, f"{first:.0f} to {last:.0f}/min", mean, found.feature.in_words)
    if over_rate and name not in unsure:
        meaning = " ".join(filter(None, (found.feature.in_words, _scatter(found))))
        mean = f"with the rate; mean {with_unit(found.feature, found.over.mean)}"
        return KeyFigure(found.feature.label, over_rate, mean, meaning)
    return _key_figure(found, WATCHED.get(name), kind, against_usual(piece, name, kind), name in unsure)


def _key_figure(found: Average, watched: Watched | None, kind: str, against: str, unsure: bool) -> KeyFigure:
    """A number with its uncertainty, `against` usual values; `unsure`: the error of a mount comes on top."""
    usual = watched.usual_of(kind) if watched is not None else SourcedText()
    meaning = [found.feature.in_words, _within(found, unsure), _scatter(found)]
    if usual.text:
        meaning.append(f"Usual: {usual.text} ({usual.source}).")
    share = _SHARE.get(found.feature.name, "")
    known = "not calibrated: can be several degrees off" if unsure else _half(found)
    detail = "; ".join(filter(None, (share, known, against)))
    value = about(found) if unsure else with_unit(found.feature, found.over.mean)
    return KeyFigure(found.feature.label, value, detail, " ".join(filter(None, meaning)))


def against_usual(piece: Counted, name: str, kind: str) -> str:
    """`usual 105 to 110°`, and whether the mean is outside."""
    span = usual_span(WATCHED[name], kind) if name in WATCHED else ""
    outside = beyond_of(piece, name, kind)
    if not span or outside is None:
        return span and f"usual {span}"
    return f"{outside.words} ({span})"


def _half(found: Average) -> str:
    """Half of the 95 % interval of the mean; where only the scatter is known, that."""
    if np.isfinite(found.uncertainty):
        half = spread(found.feature, NORMAL_95 * found.uncertainty)
        return f"{PLUS_MINUS}\N{NO-BREAK SPACE}{half}{joined_unit(found.feature)}"
    if np.isnan(found.over.sd):
        return "of a single stroke"
    return f"SD {spread(found.feature, found.over.sd)}{joined_unit(found.feature)}"


def _within(found: Average, unsure: bool) -> str:
    if not np.isfinite(found.uncertainty):
        return ""
    if not found.over.std:
        return (
            f"{PLUS_MINUS}: 95 % interval of the mean from its strokes; the device's own error is not known."
        )
    top = " The unit was not calibrated: several degrees come on top." if unsure else ""
    return (
        f"{PLUS_MINUS}: 95 % interval of the mean, with the known errors of sensors, mounts and lengths.{top}"
    )


def _scatter(found: Average) -> str:
    if np.isnan(found.over.sd):
        return ""
    scatter = spread(found.feature, found.over.sd) + joined_unit(found.feature)
    return f"Standard deviation from stroke to stroke: {scatter}."


def strokes(piece: ReportPiece) -> str:
    """How many strokes, how long, at which rates; text."""
    count = len(piece.table)
    duration = float(piece.track.time_s[-1] - piece.track.time_s[0])
    text = f"{count} {'stroke' if count == 1 else 'strokes'} in {duration:.0f} s"
    rate = piece.averages.get("rate_per_min")
    if rate is not None and rate.known:
        text += _course_of_rate(piece, rate)
    return f"{text}."


def _course_of_rate(piece: ReportPiece, rate: Average) -> str:
    """How the stroke rate went: ", the rate rising from 21 to 34/min"."""
    if is_ramp(piece):
        first, last = rates_at_ends(piece)
        return f", the rate {'rising' if last > first else 'falling'} from {first:.0f} to {last:.0f}/min"
    text = f" at {with_unit(rate.feature, rate.over.mean)}"
    if rate.over.count > 1:
        text += f", between {shown(rate.feature, rate.over.least)} and {shown(rate.feature, rate.over.most)}"
    return text


def is_ramp(piece: Counted) -> bool:
    """Whether the stroke rate rises or falls from the start of the piece to its end."""
    first, last = rates_at_ends(piece)
    rates = counted_rates(piece)
    low, high = sorted((first, last))
    between = bool(rates.size and rates.max() <= high + _RAMP_PER_MIN and rates.min() >= low - _RAMP_PER_MIN)
    return high - low >= _RAMP_PER_MIN and between


def rates_at_ends(piece: Counted) -> tuple[float, float]:
    """Mean stroke rates of the first and of the last strokes that count; NaN of a short piece."""
    rates = counted_rates(piece)
    if len(rates) < 2 * _AT_THE_ENDS:
        return float("nan"), float("nan")
    return float(rates[:_AT_THE_ENDS].mean()), float(rates[-_AT_THE_ENDS:].mean())


def counted_rates(piece: Counted) -> Floats:
    """Stroke rates of the strokes that count, where known."""
    rates = piece.table["rate_per_min"][piece.counted]
    return rates[np.isfinite(rates)]


def notes(piece: ReportPiece) -> list[str]:
    """What was missing or left out, as markup: of the strokes, and targets without a number."""
    told = list(piece.technique.found.notes)
    if count := int((~piece.counted).sum()):
        why = which_left_out(piece)
        told.append(f"{count} of {len(piece.table)} strokes left out of all averages: {why}.")
    known = {name for name, average in piece.averages.items() if average.known}
    missing = [feature_of(name).label for name in piece.technique.targets if name not in known]
    told += [f"Targets without a number in this piece: {', '.join(missing)}."] if missing else []
    return [escape(text) for text in told]
