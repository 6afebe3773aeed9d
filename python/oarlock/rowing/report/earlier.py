"""Main numbers of a piece beside another one: last time, own best or a second piece; for the front of a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple

from oarlock.report import capital, plain_table
from oarlock.rowing.alongside.paces import SPEEDS, pace_text
from oarlock.rowing.findings.candidate import MetricComparison
from oarlock.rowing.report.averages import Average, Difference, feature_of
from oarlock.rowing.report.calibrated import NOT_CALIBRATED, about, is_uncalibrated
from oarlock.rowing.report.changes import at_like_rate, change, in_words, matters, of_kind, same_rate
from oarlock.rowing.report.piece import Counted
from oarlock.rowing.report.shown import with_unit
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
    caption = _CAPTION.format(
        change=f"Change: how {piece.name} differs from {others[0].label}"
        if piece.name
        else "Change until now"
    )
    apart = [one for one in others if not same_rate(piece, one.piece)]
    if any(one.tested for one in apart):
        caption += _LIKE
    if any(not one.tested for one in apart):
        caption += _NOT_LIKE
    heads = ["number", now, *(head for one in others for head in (_dated(one), "change"))]
    # Six columns are too many for a telephone.
    style = "stacked" if others[1:] else ""
    changes = "" if piece.name else " ".join(largest_change(piece, one) for one in others)
    return _which(others, changes) + plain_table("compared-earlier", caption, heads, rows, style=style)


def _dated(other: Other) -> str:
    """The head of its column: what it is and its day, unless its own name has that already."""
    return (
        other.label
        if other.label == other.piece.name
        else ", ".join(filter(None, (other.label, other.piece.date)))
    )


def _which(others: Sequence[Other], changes: str) -> str:
    """Names of the earlier pieces, unless these are the heads of the table, and the largest changes in words."""
    told = " ".join(
        f"{capital(one.label)}: <b>{escape(one.piece.name)}</b>."
        for one in others
        if one.label != one.piece.name
    )
    said = " ".join(filter(None, (told, escape(changes))))
    return f"<p>{said}</p>" if said else ""


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
