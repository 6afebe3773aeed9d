"""The front of a rower's report: strokes and rate, findings with advice, and the change against earlier pieces."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from html import escape

import numpy as np

from oarlock.report import (
    Course,
    Front,
    KeyFigure,
    Point,
    Sourced,
    belief_of,
    capital,
    doubtful_sensors,
    fixed,
)
from oarlock.rowing.analysis.features import FEATURES
from oarlock.rowing.findings.candidate import MetricComparison
from oarlock.rowing.findings.find import comparisons, named
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.findings.rowed import Rowed, StoredStrokes, rowing_kind
from oarlock.rowing.report import words
from oarlock.rowing.report.by_rate import by_rate, range_over_rate
from oarlock.rowing.report.checked import HEADS, checked, next_sizes, quiet
from oarlock.rowing.report.drawings import SPEEDS, curve_drawings, speeds
from oarlock.rowing.report.earlier import (
    SAME_RATE_PER_MIN,
    Other,
    as_told,
    compared,
    earlier_pieces,
    largest_change,
    of_kind,
)
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.report.shown import DECIMALS, PLUS_MINUS
from oarlock.rowing.report.tables import is_uncalibrated
from oarlock.rowing.report.usual import Beyond, beyond_usual, remark
from oarlock.storage.statistics import NORMAL_95

_MEASURED = {
    "sculling": "oars, seat and stroke rate",
    "sweep": "oar, seat and stroke rate",
    "ergometer": "handle, seat and stroke rate",
}
"""What encoders measure, by kind of rowing."""
_CLASS = {"sculling": "sculling_men", "sweep": "sweep_men", "ergometer": "ergometer"}
UNITS = {"deg": "°", "1/min": "/min", "cm2": " cm²", "1": ""}


def front_of(
    piece: ReportPiece,
    last: ReportPiece | StoredStrokes | None = None,
    best: ReportPiece | StoredStrokes | None = None,
    other: ReportPiece | None = None,
) -> Front:
    """The front of one piece, with up to two earlier ones of the same athlete, and any other one beside it."""
    others = {"against last": last, "against best": best, "against other": other}
    rowed = Rowed.of(piece)
    against = {kind: Rowed.of(one) for kind, one in others.items() if one is not None}
    tested = comparisons(rowed, against)
    candidates = as_told(tested, piece, {kind: one for kind, one in others.items() if one is not None})
    found = named(rowed, candidates)
    outside = beyond_usual(piece, rowed.kind)
    agrees, limits = quiet(candidates, words.is_ramp(piece))
    unusual, whose = remark(outside)
    doubted = doubtful_sensors(piece.track)
    pieces = [piece] if other is None else [piece, other]
    beside = earlier_pieces(last, best, tested)
    if other is not None:
        beside.insert(0, Other(other.name, other, of_kind(tested, "against other")))
    trust_in_other = ""
    if other is not None:  # the line above the page is on the first piece
        belief = belief_of(other.track, _MEASURED.get(rowing_kind(other), ""))
        text = f"{other.name}: {belief.mark} {belief.words}. {capital(belief.reason)} {belief.remedy}"
        trust_in_other = f'<p class="second-trust">{escape(text.strip())}</p>'
    return Front(
        did=words.strokes(piece)
        if other is None
        else " ".join(f"{one.name}: {words.strokes(one)}" for one in (piece, other)),
        points=[point(one) for one in found],
        quiet=agrees,
        limits=" ".join(filter(None, (limits, whose))),
        remark=unusual,
        checked=checked(candidates, _not_calibrated(candidates, piece, others)),
        next_step=_next_step(piece, rowed, found, outside, against.get("against other")),
        sensors_step=_sensors_step(piece, doubted),
        direct=_MEASURED.get(rowed.kind, ""),
        commands=_commands(piece, bool(against)),
        by_rate=by_rate(piece),
        figures=_figures(piece, rowed.kind, doubted),
        compared=compared(piece, beside, now=piece.name if other else "now") + trust_in_other,
        compared_head="Both pieces" if other is not None else "Compared with earlier",
        compared_first=other is not None,
        changes=[largest_change(piece, one) for one in beside],
        drawings=[*speeds(pieces), *curve_drawings(pieces)],
        course=_course(piece),
    )


def _figures(piece: ReportPiece, kind: str, doubted: Collection[str]) -> list[KeyFigure]:
    """The key figures; that of a doubtful seat says so."""
    found = words.key_figures(
        piece,
        kind=kind,
        calibrated=not _nominal(piece),
        over_rate={name: range_over_rate(piece, name) for name in words.TILES},
    )
    if "seat" not in doubted:
        return found
    label = FEATURES["seat_travel_m"].label
    return [
        one._replace(detail=f"{one.detail}; sensor doubtful") if one.name == label else one for one in found
    ]


def _not_calibrated(
    candidates: Sequence[MetricComparison],
    piece: ReportPiece,
    others: Mapping[str, ReportPiece | StoredStrokes | None],
) -> set[tuple[str, str]]:
    """Comparisons with other pieces and usual values that a mount which was not calibrated may have made."""
    return {
        (one.kind, one.watched.name)
        for one in candidates
        if one.kind == "against usual" or one.kind in others
        for each in (piece, others.get(one.kind))
        if each is not None and is_uncalibrated(each, one.watched.name)
    }


def _next_step(
    piece: ReportPiece,
    rowed: Rowed,
    found: Sequence[Finding],
    outside: Sequence[Beyond],
    other: Rowed | None = None,
) -> str:
    """What to do next in the boat."""
    drills = [one for one in outside if one.matters and one.to_try.text]
    if any(one.advice for one in found):
        start = "Try the exercises above."
    elif drills and not found:
        start = f"{drills[0].to_try.text.rstrip('.')} ({drills[0].to_try.source})."
    else:
        little = ": what is outside of usual values is too little to act on" if outside else ""
        start = "" if found else f"These numbers ask for no change of technique{little}."
    if other is not None and abs(rowed.rate_per_min - other.rate_per_min) >= SAME_RATE_PER_MIN:
        return f"{start} To compare technique, row both pieces at the same rate.".strip()
    rate = " at the same rates" if words.is_ramp(piece) else f" at {rowed.rate_per_min:.0f}/min"
    tried = drills and not found
    sizes = "" if found else next_sizes(rowed, [drills[0].watched.name]) if tried else next_sizes(rowed)
    shows = (
        f"a change of {sizes} {'towards usual shows that it worked' if tried else 'can be named'}"
        if sizes
        else ""
    )
    again = "Then row" if tried or found else "Row"
    return f"{start} {again} this piece again{rate} and compare{f': {shows}' if shows else ''}.".strip()


def _sensors_step(piece: ReportPiece, doubted: Collection[str]) -> str:
    """What to do next with the sensors; "" if nothing."""
    steps = [f"Check how the sensor {name} is mounted." for name in doubted]
    if not _nominal(piece):
        return " ".join(steps)
    steps.append(
        "Calibrate before the next outing (two minutes of movements); this piece can be calibrated afterwards, from "
        "its own rowing. Without that, angles of trunk and arms cannot be compared with usual values or other days."
    )
    return " ".join(steps)


def _nominal(piece: ReportPiece) -> bool:
    """Whether mounts of units were assumed, not calibrated."""
    return bool(piece.track.provenance.get("nominal_mounts"))


def _commands(piece: ReportPiece, compared: bool) -> list[tuple[str, str]]:
    """What each further step is for, and its command."""
    told = []
    if _nominal(piece):
        told += [
            ("Calibrate with two minutes of movements", "oarlock calibrate session --help"),
            ("Calibrate from ordinary rowing", "oarlock calibrate motion --help"),
        ]
    if not compared:
        told.append(("Compare with an earlier piece", "oarlock report TRACK --last EARLIER"))
    if not piece.technique.targets:
        example = _CLASS[rowing_kind(piece)]
        told.append(("Compare with a boat class", f"oarlock report TRACK --targets {example}"))
    return told


def point(found: Finding) -> Point:
    """A finding for the front."""
    return Point(
        head=HEADS.get(found.kind, found.kind),
        sentence=found.sentence,
        size=_size(found),
        usual=_sourced(found.usual, found.usual_source),
        why=_sourced(found.why, found.why_source),
        advice=_sourced(found.advice, found.advice_source),
        meaning=FEATURES[found.name].in_words,
    )


def _sourced(text: str, source: str) -> Sourced | None:
    return Sourced(text, source) if text else None


def _size(found: Finding) -> str:
    """`+3.2 ± 0.8°`, the 95 % interval; without ± if that is unknown."""
    digits = DECIMALS.get(found.unit, 2)
    unit = UNITS.get(found.unit, f" {found.unit}")
    sign = "+" if found.size > 0 else ""
    half = f" {PLUS_MINUS} {fixed(NORMAL_95 * found.size_1sd, digits)}" if np.isfinite(found.size_1sd) else ""
    return f"{sign}{fixed(found.size, digits)}{half}{unit}"


def _course(piece: ReportPiece) -> Course | None:
    """The speeds of handle, legs, trunk and arms over a stroke; None without them."""
    found = {
        label: piece.technique.curves[name]
        for name, label in SPEEDS.items()
        if name in piece.technique.curves
    }
    curves = {
        label: (
            list(curve.percent),
            list(curve.mean),
            list(curve.mean - curve.sd),
            list(curve.mean + curve.sd),
        )
        for label, curve in found.items()
    }
    return (
        Course("Who moves the handle", "m/s", "% of the stroke; 0 is the catch", curves) if curves else None
    )
