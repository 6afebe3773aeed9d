"""Main numbers of a piece beside another one: last time, own best or a second piece; for the front of a report."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from oarlock.report import fixed, plain_table
from oarlock.rowing.alongside.paces import PER_500_M, SPEEDS, of_pace, pace_text, slower_s
from oarlock.rowing.analysis.features import Feature
from oarlock.rowing.findings.candidate import Candidate
from oarlock.rowing.findings.find import least
from oarlock.rowing.findings.watched import WATCHED
from oarlock.rowing.report.averages import SIGMAS_95, Difference, difference, feature_of
from oarlock.rowing.report.piece import Counted
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, shown, spread, with_unit
from oarlock.rowing.report.tables import link

COMPARED = (
    "rate_per_min",
    "arc_rad",
    "catch_angle_rad",
    "finish_angle_rad",
    "catch_lean_rad",
    "finish_lean_rad",
    "seat_travel_m",
    "handle_travel_m",
    "rhythm",
    "power_w",
    "peak_force_n",
    "speed_m_s",
    "slip_rad",
    "wash_rad",
    "heart_rate_per_min",
)
"""Numbers that the front compares with other pieces."""
SAME_RATE_PER_MIN = 1.0
"""Pieces whose rates differ by more are compared with a warning."""
_CAPTION = (
    "{change}, with its 95 % interval. Bold: clear, and large enough to matter. Plain: clear, but small. "
    "Grey: not clear."
)
_LIKE = " At like rate: what the stroke rate does is removed."


class Other(NamedTuple):
    """A piece to compare with: what it is ("last time"), its strokes, and differences at like rate, by number."""

    label: str
    piece: Counted
    like_rate: Mapping[str, Candidate] = {}


def earlier_pieces(
    last: Counted | None, best: Counted | None, candidates: Sequence[Candidate] = ()
) -> list[Other]:
    """Last time and own best, where they are given; `candidates` have the differences at like rate."""
    named = (("last time", "against last", last), ("own best", "against best", best))
    return [
        Other(label, one, at_like_rate(candidates, kind)) for label, kind, one in named if one is not None
    ]


def at_like_rate(candidates: Sequence[Candidate], kind: str) -> dict[str, Candidate]:
    """The differences of one kind of comparison in which the stroke rate's effect was removed, by number."""
    return {one.watched.name: one for one in candidates if one.kind == kind and one.like_rate}


def compared(
    piece: Counted, others: Sequence[Other], incomparable: Collection[str] = (), now: str = "now"
) -> str:
    """Numbers beside those of others, as markup; "" without others.

    `incomparable` are those that another day's cannot be compared with, such as angles without calibration.
    """
    if not others:
        return ""
    names = [name for name in COMPARED if name in piece.averages and piece.averages[name].known]
    rows = [
        [
            link(name, feature_of(name).label),
            escape(_value(feature_of(name), piece.averages[name].over.mean)),
            *(cell for other in others for cell in _cells(piece, other, name, name in incomparable)),
        ]
        for name in names
    ]
    caption = _CAPTION.format(
        change=f"Change: how {piece.name} differs from {others[0].label}"
        if piece.name
        else "Change until now"
    )
    if any(_rates_differ(piece, one) for one in others):
        caption += _LIKE
    dated = (", ".join(filter(None, (one.label, one.piece.date))) for one in others)
    heads = ["number", now, *(head for name in dated for head in (name, "change"))]
    # Six columns are too many for a telephone.
    style = "stacked" if others[1:] else ""
    return _which(others) + plain_table("compared-earlier", caption, heads, rows, style=style)


def _which(others: Sequence[Other]) -> str:
    """Names of the earlier pieces; "" where these are the heads of the table."""
    told = " ".join(
        f"{one.label[:1].upper()}{one.label[1:]}: <b>{escape(one.piece.name)}</b>."
        for one in others
        if one.label != one.piece.name
    )
    return f"<p>{told}</p>" if told else ""


def _rates_differ(piece: Counted, other: Other) -> bool:
    rates = [one.averages.get("rate_per_min") for one in (piece, other.piece)]
    now, then = (np.nan if one is None else one.over.mean for one in rates)
    return bool(abs(now - then) >= SAME_RATE_PER_MIN)


def _cells(piece: Counted, other: Other, name: str, incomparable: bool) -> tuple[str, str]:
    """The value of the other piece, and the change from it; where the rates differ, at like rate too."""
    now, then = piece.averages[name], other.piece.averages.get(name)
    if then is None or not then.known:
        return '<span class="mark">not known</span>', ""
    if incomparable:
        return escape(with_unit(then.feature, then.over.mean)), '<span class="mark">not calibrated</span>'
    mean = now.over.mean
    change, like = _levelled(difference(now, then), mean), other.like_rate.get(name)
    if like is not None:
        scale = like.watched.feature.shown_scale
        at_like = Difference(now.feature, like.size / scale, like.sd / scale)
        change += f'<br><span class="mark">at like rate</span> {_levelled(at_like, mean)}'
    return escape(_value(then.feature, then.over.mean)), change


def _value(feature: Feature, mean: float) -> str:
    """A mean with its unit; a speed as pace."""
    return f"{pace_text(mean)} per 500 m" if feature.name in SPEEDS else with_unit(feature, mean)


def _levelled(change: Difference, now: float) -> str:
    """A change in words, bold if it is clear and matters, plain if it is clear, else grey; markup."""
    text = escape(in_words(change, now))
    if not change.beyond:
        return f'<span class="mark">{text}</span>'
    return f"<b>{text}</b>" if matters(change) else text


def matters(change: Difference) -> bool:
    """Whether a change is clear and not below the smallest size that is named."""
    return bool(change.beyond) and abs(change.value) > least(change.feature)


def in_words(change: Difference, now: float) -> str:
    """A change until a mean `now`, with its 95 % interval and direction: `1.4 ± 1.2° shorter`.

    Shares of 100 % in percentage points; speeds as pace: `3.2 ± 1.0 s per 500 m slower`.
    """
    if change.feature.name in SPEEDS:
        late_s, half_s = slower_s(now, now - change.value), of_pace(now, SIGMAS_95 * change.uncertainty)
        word = "different" if late_s == 0.0 else "slower" if late_s > 0.0 else "faster"
        return f"{fixed(abs(late_s), 1)} {PLUS_MINUS} {fixed(half_s, 1)} {PER_500_M} {word}"
    watched, up = WATCHED.get(change.feature.name), change.value > 0.0
    word = (watched.grew if up else watched.fell) if watched is not None else ""
    word = word or ("more" if up else "less")
    size = shown(change.feature, abs(change.value))
    if not size.strip("0."):
        word = "different"
    half = spread(change.feature, SIGMAS_95 * change.uncertainty)
    return f"{size} {PLUS_MINUS} {half}{_unit(change)} {word}"


def _unit(change: Difference) -> str:
    unit = joined_unit(change.feature)
    return " points" if unit == " %" else unit


def largest_change(piece: Counted, other: Other, incomparable: Collection[str] = ()) -> str:
    """The largest change that is clear and matters in one sentence, or that there is none."""
    changes = []
    for key in (key for key in COMPARED[1:] if key not in incomparable):
        now, then = piece.averages.get(key), other.piece.averages.get(key)
        if now is not None and then is not None and now.known and then.known:
            change = difference(now, then)
            if matters(change):
                changes.append((abs(change.value) / change.uncertainty, change))
    if not changes:
        return f"Against {other.label}: no clear change that matters."
    _, change = max(changes, key=lambda one: one[0])
    text = in_words(change, piece.averages[change.feature.name].over.mean)
    return f"Against {other.label}: {change.feature.label} {text}."
