"""Main numbers of a piece beside another one, with one size, interval and verdict for each change; for the front."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import NamedTuple

from oarlock.report import capital, fixed, plain_table
from oarlock.rowing.alongside.paces import PER_500_M, SPEEDS, of_pace, pace_text, slower_s
from oarlock.rowing.findings.candidate import MetricComparison, chance
from oarlock.rowing.findings.find import least
from oarlock.rowing.findings.watched import WATCHED
from oarlock.rowing.report.averages import Average, Difference, difference, feature_of
from oarlock.rowing.report.piece import Counted
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, shown, spread, with_unit
from oarlock.rowing.report.tables import NOT_CALIBRATED, about, is_uncalibrated, link

SAME_RATE_PER_MIN = 1.0
"""Pieces whose mean rates differ by less are compared as they are, others at like rate too."""


def same_rate(piece: Counted, other: Counted) -> bool:
    """Whether the mean stroke rates are alike, or one of them is unknown."""
    rates = [one.averages.get("rate_per_min") for one in (piece, other)]
    now, then = (math.nan if one is None else one.over.mean for one in rates)
    return not abs(now - then) >= SAME_RATE_PER_MIN


def of_kind(candidates: Sequence[MetricComparison], kind: str) -> dict[str, MetricComparison]:
    """The comparisons of one kind, by number."""
    return {one.watched.name: one for one in candidates if one.kind == kind}


def change(now: Average, then: Average, tested: MetricComparison | None = None) -> Difference:
    """The difference of the means. `tested` is the comparison of findings, if the rates are alike.

    Its interval contains that neighbouring strokes are alike, and its size is robust against single strokes; by how
    much the means differ from that size is doubt about the means.
    """
    plain = difference(now, then)
    if tested is None:
        return plain
    scale = plain.feature.shown_scale
    doubt = math.hypot(tested.sd / scale, tested.size / scale - plain.value)
    return replace(plain, uncertainty=doubt)


def at_like_rate(tested: MetricComparison) -> Difference:
    """What remains of a difference when the stroke rate's effect is removed."""
    feature = tested.watched.feature
    size, sd, now = (value / feature.shown_scale for value in (tested.size, tested.sd, tested.now))
    return Difference(feature, size, sd, size, now)


def as_told(
    candidates: Sequence[MetricComparison], piece: Counted, others: Mapping[str, Counted]
) -> list[MetricComparison]:
    """The comparisons as a page states them: differences of the means from pieces of the same rate, else at like rate.

    Args:
        candidates: all comparisons of a piece.
        piece: it.
        others: the other pieces, by kind of comparison.
    """
    alike = {kind: same_rate(piece, other) for kind, other in others.items()}
    return [
        one
        if one.kind not in others
        else _of_means(one, piece, others[one.kind])
        if alike[one.kind]
        else replace(one, like_rate=True)
        for one in candidates
    ]


def _of_means(one: MetricComparison, piece: Counted, other: Counted) -> MetricComparison:
    now, then = (each.averages[one.watched.name] for each in (piece, other))
    scale, found = one.watched.feature.shown_scale, change(now, then, one)
    size, sd = found.told * scale, found.uncertainty * scale
    # Named only if the robust comparison would name it too.
    likely = max(one.chance, chance(size, sd, one.freedom))
    return replace(one, size=size, sd=sd, chance=likely, now=now.over.mean * scale, like_rate=False)


def matters(found: Difference) -> bool:
    """Whether a change is clear and not below the smallest size that is named."""
    return bool(found.beyond) and abs(found.told) > least(found.feature)


def in_words(found: Difference) -> str:
    """A change with its 95 % interval and direction: `1.4 ± 1.2° shorter`; shares of 100 % in percentage points.

    Speeds as pace: `3.2 ± 1.0 s per 500 m slower`. What is not clear has no direction: `no clear change (± 1.2°)`.
    """
    size, half, unit, direction = _said(found)
    if found.beyond is None:
        return f"{size_in_words(found)}, uncertainty not known"
    if not found.beyond:
        return f"no clear change ({PLUS_MINUS}\N{NO-BREAK SPACE}{half}{unit})"
    return f"{size} {PLUS_MINUS} {half}{unit} {direction}"


def size_in_words(found: Difference) -> str:
    """A change without its interval: `1.4° shorter`."""
    size, _, unit, direction = _said(found)
    return f"{size}{unit} {direction}"


def _said(found: Difference) -> tuple[str, str, str, str]:
    """Size, half of its interval, unit and direction; of a speed the difference of both paces as they are shown."""
    if found.feature.name in SPEEDS:
        late_s, half_s = slower_s(found.now, found.now - found.value), of_pace(found.now, found.half)
        word = "slower" if late_s > 0.0 else "faster"
        return fixed(abs(late_s), 1), fixed(half_s, 1), f" {PER_500_M}", word
    size, half = shown(found.feature, abs(found.told)), spread(found.feature, found.half)
    watched, up = WATCHED.get(found.feature.name), found.told > 0.0
    word = (watched.grew if up else watched.fell) if watched is not None else ""
    unit = joined_unit(found.feature)
    return size, half, " points" if unit == " %" else unit, word or ("more" if up else "less")


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
    "style_factor",
    "power_w",
    "peak_force_n",
    "speed_m_s",
    "slip_rad",
    "wash_rad",
    "heart_rate_per_min",
)
"""Numbers that the front compares with other pieces."""
_CAPTION = (
    "{change}, ± half of its 95 % interval. Bold: clear, and large enough to matter. Plain: clear, but small. "
    "Grey: not clear."
)
_LIKE = " At like rate: what the stroke rate does is removed."
_NOT_LIKE = " The stroke rates differ, and what the rate does could not be removed."


class Other(NamedTuple):
    """A piece to compare with: what it is ("last time"), its strokes, and the comparisons of findings, by number."""

    label: str
    piece: Counted
    tested: Mapping[str, MetricComparison] = {}


def earlier_pieces(
    last: Counted | None, best: Counted | None, candidates: Sequence[MetricComparison] = ()
) -> list[Other]:
    """Last time and own best, where they are given; `candidates` has the comparisons of findings."""
    named = (("last time", "against last", last), ("own best", "against best", best))
    return [Other(label, one, of_kind(candidates, kind)) for label, kind, one in named if one is not None]


def compared(piece: Counted, others: Sequence[Other], now: str = "now") -> str:
    """Numbers beside those of others, as markup; "" without others."""
    if not others:
        return ""
    names = [name for name in COMPARED if name in piece.averages and piece.averages[name].known]
    rows = [
        [
            link(name, feature_of(name).label),
            escape(_value(piece, name, piece.averages[name])),
            *(cell for other in others for cell in _cells(piece, other, name)),
        ]
        for name in names
    ]
    from_other = f"Change: how {piece.name} differs from {others[0].label}"
    caption = _CAPTION.format(change=from_other if piece.name else "Change until now")
    apart = [one for one in others if not same_rate(piece, one.piece)]
    if any(one.tested for one in apart):
        caption += _LIKE
    if any(not one.tested for one in apart):
        caption += _NOT_LIKE
    heads = ["number", now]
    for one in others:
        # what it is and its day, unless its own name has that already
        day = one.piece.date if one.label != one.piece.name else ""
        heads += [f"{one.label}, {day}" if day else one.label, "change"]
    # Six columns are too many for a telephone.
    style = "stacked" if others[1:] else ""
    changes = "" if piece.name else " ".join(largest_change(piece, one) for one in others)
    # names of the earlier pieces, unless these are the heads of the table
    told = " ".join(
        f"{capital(one.label)}: <b>{escape(one.piece.name)}</b>."
        for one in others
        if one.label != one.piece.name
    )
    said = " ".join(filter(None, (told, escape(changes))))
    lead = f"<p>{said}</p>" if said else ""
    return lead + plain_table("compared-earlier", caption, heads, rows, style=style)


def _cells(piece: Counted, other: Other, name: str) -> tuple[str, str]:
    """The value of the other piece, and the change from it; where the rates differ, at like rate too."""
    then = other.piece.averages.get(name)
    if then is None or not then.known:
        return '<span class="mark">not known</span>', ""
    value = escape(_value(other.piece, name, then))
    if is_uncalibrated(piece, name) or is_uncalibrated(other.piece, name):
        return value, NOT_CALIBRATED
    found, tested = change_of(piece, other, name), other.tested.get(name)
    if tested is None or same_rate(piece, other.piece):
        return value, _levelled(found)
    like = at_like_rate(tested)
    if found.beyond is False and like.beyond is False:
        widest = max(found, like, key=lambda one: one.half)
        return value, f'{_levelled(widest)}<span class="mark">, also at like rate</span>'
    return value, f'{_levelled(found)}<br><span class="mark">at like rate:</span> {_levelled(like)}'


def _value(piece: Counted, name: str, found: Average) -> str:
    """A mean with its unit; a speed as pace; without decimals if it is not calibrated."""
    if is_uncalibrated(piece, name):
        return about(found)
    mean = found.over.mean
    return f"{pace_text(mean)} per 500 m" if name in SPEEDS else with_unit(found.feature, mean)


def change_of(piece: Counted, other: Other, name: str) -> Difference:
    """The change of a number that both have."""
    tested = other.tested.get(name) if same_rate(piece, other.piece) else None
    return change(piece.averages[name], other.piece.averages[name], tested)


def _levelled(found: Difference) -> str:
    """A change in words, bold if it is clear and matters, plain if it is clear, else grey; markup."""
    text = escape(in_words(found))
    if not found.beyond:
        return f'<span class="mark">{text}</span>'
    return f"<b>{text}</b>" if matters(found) else text


def compared_changes(piece: Counted, other: Other) -> list[Difference]:
    """Changes of the compared numbers but the rate, the clearest first.

    Between pieces of different rates at like rate; numbers that cannot be compared so are left out.
    """
    alike, found = same_rate(piece, other.piece), []
    for name in COMPARED[1:]:
        now, then = piece.averages.get(name), other.piece.averages.get(name)
        known = now is not None and then is not None and now.known and then.known
        if not known or is_uncalibrated(piece, name) or is_uncalibrated(other.piece, name):
            continue
        if alike:
            found.append(change_of(piece, other, name))
        elif name in other.tested:
            found.append(at_like_rate(other.tested[name]))
    return sorted(found, key=lambda one: -abs(one.value) / one.uncertainty if one.beyond else 0.0)


def largest_change(piece: Counted, other: Other) -> str:
    """The clearest change that matters in one sentence, or that there is none."""
    alike = same_rate(piece, other.piece)
    if not alike and not other.tested:
        return f"Against {other.label}: the stroke rates differ too much to compare technique."
    found = [one for one in compared_changes(piece, other) if matters(one)]
    like = "" if alike else " at like rate"
    if not found:
        return f"Against {other.label}: no clear change{like} that matters."
    return f"Against {other.label}: {found[0].feature.label} {in_words(found[0])}{like}."
