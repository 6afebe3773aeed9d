"""The front of a rower's report: strokes and rate, findings with advice, and the change against earlier pieces."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from oarlock.report import Course, Front, Point, Sourced, fixed, plain_table
from oarlock.rowing.analysis.features import FEATURES
from oarlock.rowing.findings.find import comparisons, least, named
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.findings.rowed import Kept, Rowed, rowing_kind
from oarlock.rowing.report import words
from oarlock.rowing.report.averages import SIGMAS_95, Average, difference, feature_of
from oarlock.rowing.report.checked import HEADS, checked, next_sizes, outside_usual, quiet
from oarlock.rowing.report.compared import SAME_RATE_PER_MIN
from oarlock.rowing.report.drawings import SPEEDS, curve_drawings, speeds
from oarlock.rowing.report.piece import Counted, Piece
from oarlock.rowing.report.shown import DECIMALS, PLUS_MINUS, joined_unit, shown, spread, with_unit
from oarlock.rowing.report.tables import link

COMPARED = (
    "rate_per_min",
    "arc_rad",
    "catch_angle_rad",
    "finish_angle_rad",
    "handle_travel_m",
    "rhythm",
    "power_w",
    "peak_force_n",
    "speed_m_s",
    "slip_rad",
    "wash_rad",
    "heart_rate_per_min",
)
"""Numbers that the front compares with earlier pieces."""
_CLASS = {"sculling": "sculling_men", "sweep": "sweep_men", "ergometer": "ergometer"}
UNITS = {"deg": "°", "1/min": "/min", "cm2": " cm²", "1": ""}


def front_of(
    piece: Piece,
    last: Piece | Kept | None = None,
    best: Piece | Kept | None = None,
    other: Piece | None = None,
) -> Front:
    """The front of one piece, with up to two earlier ones of the same athlete, and any other one beside it."""
    others = {"against last": last, "against best": best, "against other": other}
    rowed = Rowed.of(piece)
    against = {kind: Rowed.of(one) for kind, one in others.items() if one is not None}
    candidates = comparisons(rowed, against)
    found = named(rowed, candidates)
    return Front(
        did=words.strokes(piece),
        points=[point(one) for one in found],
        quiet=quiet(candidates),
        remark=outside_usual(piece, rowed.kind),
        checked=checked(candidates),
        next_step=_next_step(piece, rowed, bool(found)),
        commands=_commands(piece, bool(against)),
        figures=words.key_figures(piece, kind=rowed.kind, calibrated=not _nominal(piece)),
        compared=compared(piece, last, best),
        changes=[text for name, one in _earlier(last, best) for text in [_change(piece, one, name)] if text],
        drawings=[*speeds([piece]), *curve_drawings([piece])],
        course=_course(piece),
    )


def _next_step(piece: Piece, rowed: Rowed, found: bool) -> str:
    """What to do next, in the words of rowing."""
    steps = []
    if _nominal(piece):
        steps.append("Calibrate the sensors: angles of trunk and arms then compare with usual values.")
    again = "Row this piece again"
    if found:
        again = "Try what the first finding says, then row this piece again"
    rate = f" at {rowed.rate_per_min:.0f}/min" if np.isfinite(rowed.rate_per_min) else ""
    sizes = next_sizes(rowed)
    shows = f": a difference of {sizes} will show" if sizes else ""
    return " ".join([*steps, f"{again}{rate} and compare{shows}."])


def _nominal(piece: Piece) -> bool:
    """Whether mounts of units were assumed, not calibrated."""
    return bool(piece.track.provenance.get("nominal_mounts"))


def _commands(piece: Piece, compared: bool) -> list[tuple[str, str]]:
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
    known = FEATURES.get(found.name) or FEATURES.get(f"r_{found.name}")
    return Point(
        head=HEADS.get(found.kind, found.kind),
        sentence=found.sentence,
        size=_size(found),
        usual=_sourced(found.usual, found.usual_source),
        why=_sourced(found.why, found.why_source),
        advice=_sourced(found.advice, found.advice_source),
        meaning=known.in_words if known else "",
    )


def _sourced(text: str, source: str) -> Sourced | None:
    return Sourced(text, source) if text else None


def _size(found: Finding) -> str:
    """`+3.2 ± 0.8°`, the 95 % interval; without ± if that is unknown."""
    digits = DECIMALS.get(found.unit, 2)
    unit = UNITS.get(found.unit, f" {found.unit}")
    sign = "+" if found.size > 0 else ""
    half = f" {PLUS_MINUS} {fixed(SIGMAS_95 * found.size_1sd, digits)}" if np.isfinite(found.size_1sd) else ""
    return f"{sign}{fixed(found.size, digits)}{half}{unit}"


def _earlier(last: Counted | None, best: Counted | None) -> list[tuple[str, Counted]]:
    return [(name, one) for name, one in (("last time", last), ("own best", best)) if one is not None]


def compared(
    piece: Counted,
    last: Counted | None,
    best: Counted | None = None,
    command: str = "",
) -> str:
    """Numbers beside those of earlier pieces, as markup; without one, the `command` that gives one, if any."""
    earlier = _earlier(last, best)
    if not earlier:
        return (
            f'<p class="hint">No earlier piece was given: <code>{escape(command)}</code>.</p>'
            if command
            else ""
        )
    names = [name for name in COMPARED if name in piece.averages and piece.averages[name].known]
    rows = [
        [
            link(name, feature_of(name).label),
            escape(with_unit(feature_of(name), piece.averages[name].over.mean)),
            *(_cell(piece.averages[name], one.averages.get(name)) for _, one in earlier),
        ]
        for name in names
    ]
    heads = ["number", "now", *(f"since {name}" for name, _ in earlier)]
    caption = f"Change since then, {PLUS_MINUS} its 95 % interval. Grey: within it, or too small to matter."
    table = plain_table("compared-earlier", caption, heads, rows)
    return f"<p>{_which(earlier)}</p>{table}{_rate_hint(piece, earlier)}"


def _which(earlier: Sequence[tuple[str, Counted]]) -> str:
    return ". ".join(f"{name.capitalize()}: <b>{escape(one.name)}</b>" for name, one in earlier) + "."


def _cell(now: Average, then: Average | None) -> str:
    if then is None or not then.known:
        return '<span class="mark">not known</span>'
    change = difference(now, then)
    half = spread(change.feature, SIGMAS_95 * change.uncertainty)
    text = (
        f"{shown(change.feature, change.value, signed=True)} {PLUS_MINUS} {half}{joined_unit(change.feature)}"
    )
    clear = change.beyond and abs(change.value) > least(change.feature)
    return f"<b>{escape(text)}</b>" if clear else f'<span class="mark">{escape(text)}</span>'


def _rate_hint(piece: Counted, earlier: Sequence[tuple[str, Counted]]) -> str:
    now = piece.averages.get("rate_per_min")
    then = [one.averages["rate_per_min"] for _, one in earlier if "rate_per_min" in one.averages]
    if now is None or all(abs(now.over.mean - one.over.mean) < SAME_RATE_PER_MIN for one in then):
        return ""
    return '<p class="hint">The stroke rates differ: a part of the other differences comes from the rate.</p>'


def _change(piece: Counted, earlier: Counted, name: str) -> str:
    """The largest certain change of the compared numbers in one sentence; "" if there is none."""
    changes = []
    for key in COMPARED[1:]:
        now, then = piece.averages.get(key), earlier.averages.get(key)
        if now is not None and then is not None and now.known and then.known:
            between = difference(now, then)
            if between.beyond and abs(between.value) > least(between.feature):
                changes.append((abs(between.value) / between.uncertainty, now, between))
    if not changes:
        return f"Against {name}: no change beyond its uncertainty."
    _, now, between = max(changes, key=lambda one: one[0])
    return f"Against {name}: {now.feature.label} {with_unit(between.feature, between.value, signed=True)}."


def _course(piece: Piece) -> Course | None:
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
