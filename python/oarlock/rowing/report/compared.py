"""The comparison of two pieces in the report: differences, and whether they exceed both uncertainties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

from oarlock.report import Column, sortable_table, value_cell
from oarlock.rowing.findings.candidate import against
from oarlock.rowing.findings.find import least
from oarlock.rowing.findings.rowed import RATES_APART, Rowed
from oarlock.rowing.report.averages import SIGMAS_95, Average, Difference, difference
from oarlock.rowing.report.earlier import SAME_RATE_PER_MIN, in_words, matters
from oarlock.rowing.report.piece import Piece
from oarlock.rowing.report.shown import PLUS_MINUS, shown, spread, unit_of, with_unit
from oarlock.rowing.report.tables import beyond_words, link

_OF_RATE = ("rate_per_min", "drive_time_s", "recovery_time_s")
"""Numbers that make up the stroke rate."""
MOST_TOLD = 5
"""Numbers that a sentence names."""


def differences(this: Piece, other: Piece) -> dict[str, tuple[Average, Average, Difference]]:
    """For every number of both pieces: this, the other, this minus the other."""
    return {
        name: (mine, other.averages[name], difference(mine, other.averages[name]))
        for name, mine in this.averages.items()
        if mine.known and name in other.averages and other.averages[name].known
    }


def comparison_table(key: str, this: Piece, other: Piece) -> str:
    """One row per number with both means, their difference, and whether it exceeds both uncertainties; those first."""
    rows = []
    found = differences(this, other)
    for name in largest_first(found):
        mine, theirs, between = found[name]
        feature = mine.feature
        rows.append(
            [
                link(name, feature.label),
                escape(unit_of(feature)),
                _mean(mine),
                _mean(theirs),
                value_cell(between.value * feature.shown_scale, shown(feature, between.value, signed=True)),
                spread(feature, between.uncertainty),
                beyond_words(between.beyond),
            ]
        )
    columns = [
        Column("number"),
        Column("unit"),
        Column(this.name),
        Column(other.name),
        Column("difference"),
        Column(PLUS_MINUS, meaning="One standard deviation of the difference."),
        Column("exceeds both uncertainties"),
    ]
    caption = (
        f"Means over the strokes, each {PLUS_MINUS} one standard deviation; the difference is {this.name} "
        f"minus {other.name}. Exceeds both uncertainties: larger than 1.96 standard deviations of the "
        "difference. In these the error of the track is assumed constant over the piece, and the scatter "
        "between strokes is divided by the square root of their number. If the sensors were not moved between "
        "the pieces, smaller differences may be real too. Differences are taken before rounding."
    )
    return sortable_table(key, caption, columns, rows, style="stacked")


def sentences(this: Piece, other: Piece) -> list[str]:
    """Which numbers differ, how many would by chance, and what the rate does; markup."""
    found = differences(this, other)
    if not found:
        return ["The pieces have no number in common."]
    sure = [name for name in largest_first(found) if found[name][2].beyond]
    tested = sum(held[2].beyond is not None for held in found.values())
    counted = (
        f"<b>{len(sure)} of {len(found)} numbers differ</b> by more than both uncertainties; "
        f"by chance about {0.05 * tested:.0f} would if they were independent."
    )
    table = '<a href="#compared-pieces-in">Side by side</a> has all.'
    rates = _rates(found, this, other, sure)
    return [
        *([f"<b>{escape(rates[0])}</b>"] if rates else []),
        f"{counted} {escape(' '.join(rates[1:]) or _largest(found, sure))} {table}",
    ]


def _largest(found: Mapping[str, tuple[Average, Average, Difference]], sure: Sequence[str]) -> str:
    telling = [name for name in sure if matters(found[name][2])]
    if not telling:
        return "None is large enough to matter."
    named = [
        f"{found[name][0].feature.label} ({in_words(found[name][2], found[name][0].over.mean)})"
        for name in telling
    ]
    return f"Largest: {_listed(named)}."


def largest_first(found: Mapping[str, tuple[Average, Average, Difference]]) -> list[str]:
    """Names, those beyond both uncertainties first, the largest relative to what matters before others."""

    def order(name: str) -> tuple[bool, float]:
        between = found[name][2]
        weight = abs(between.value) / least(between.feature)
        return not between.beyond, -(weight if weight == weight else 0.0)

    return sorted(found, key=order)


def _rates(
    found: Mapping[str, tuple[Average, Average, Difference]], this: Piece, other: Piece, sure: Sequence[str]
) -> list[str]:
    """What differs at like rate in one sentence, then what follows the rate; text, [] if the rates are alike."""
    rates = found.get("rate_per_min")
    if rates is None or abs(rates[2].value) < SAME_RATE_PER_MIN:
        return []
    now, then = (with_unit(one.feature, one.over.mean) for one in rates[:2])
    start = f"The stroke rates differ ({now} and {then})"
    mine, theirs = Rowed.of(this), Rowed.of(other)
    if not mine.comparable(theirs):
        return [f"{start}{_not_at_like_rate(mine, theirs)}"]
    like = {one.watched.name: one for one in against(mine, theirs, "against other")}
    remain = [name for name in sure if name in like and abs(like[name].size) > SIGMAS_95 * like[name].sd]
    follow = [name for name in sure if name in _OF_RATE or (name in like and name not in remain)]
    untested = len(sure) - len(follow) - len(remain)
    told = [
        f"{start}. At the same rate no other number would clearly differ, of those that can be compared so."
    ]
    if remain:
        told = [f"{start}. At the same rate these would differ too: {_labels(found, remain)}."]
    labels = _labels(found, [name for name in follow if name != "rate_per_min"])
    if labels:
        told.append(f"With the rate go: {labels}.")
    if untested:
        told.append(f"The other {untested} cannot be compared at like rate.")
    return told


def _labels(found: Mapping[str, tuple[Average, Average, Difference]], names: Sequence[str]) -> str:
    return _listed([found[name][0].feature.label for name in names])


def _not_at_like_rate(mine: Rowed, theirs: Rowed) -> str:
    if abs(mine.rate_per_min - theirs.rate_per_min) > RATES_APART:
        why = f": over more than {RATES_APART:.0f}/min its effect is not known well enough to remove it"
    else:
        why = ", and its effect was not removed, because the boats or the sensors differ"
    return f"{why}. Each number is still that of its own piece; how much of a difference comes from the rate is open."


def _listed(names: Sequence[str]) -> str:
    """The first few, and how many more."""
    named = list(dict.fromkeys(names))
    more = len(named) - MOST_TOLD
    return "; ".join(named[:MOST_TOLD]) + (f" and {more} more" if more > 0 else "")


def _mean(one: Average) -> str:
    text = value_cell(one.over.mean * one.feature.shown_scale, shown(one.feature, one.over.mean))
    known = spread(one.feature, one.uncertainty)
    return f'{text} <span class="spread">{PLUS_MINUS} {known}</span>'
