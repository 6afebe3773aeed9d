"""The comparison of two pieces in the report: differences, and whether they exceed both uncertainties."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from oarlock.report import Column, sortable_table, value_cell
from oarlock.rowing.findings.find import least
from oarlock.rowing.findings.rowed import RATES_APART
from oarlock.rowing.report.averages import Average, Difference, difference
from oarlock.rowing.report.earlier import SAME_RATE_PER_MIN, matters
from oarlock.rowing.report.piece import Piece
from oarlock.rowing.report.shown import PLUS_MINUS, shown, spread, unit_of, with_unit
from oarlock.rowing.report.tables import beyond_words, link

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
    """One row per number with both means, their difference, and whether it exceeds both uncertainties."""
    rows = []
    for name, (mine, theirs, between) in differences(this, other).items():
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
    return sortable_table(key, caption, columns, rows)


def sentences(this: Piece, other: Piece) -> list[str]:
    """How many numbers differ, which most, and how many would by chance, as markup."""
    found = differences(this, other)
    if not found:
        return ["The pieces have no number in common."]
    sure = [held for held in found.values() if held[2].beyond]
    chance = f"by chance about {0.05 * len(found):.0f} would"
    counted = f"{len(sure)} of {len(found)} numbers differ by more than both uncertainties; {chance}"
    telling = sorted(
        (held[0].feature for held in sure if matters(held[2])),
        key=lambda feature: -abs(found[feature.name][2].value) / least(feature),
    )
    labels = list(dict.fromkeys(feature.label for feature in telling))
    most = "None is large enough to matter."
    if labels:
        more = ", …" if len(labels) > MOST_TOLD else ""
        most = f"Largest: {escape(', '.join(labels[:MOST_TOLD]))}{more}."
    table = '<a href="#compared-pieces-in">Side by side</a> has all.'
    return [f"{counted}. {most} {table}{_rates(found)}"]


def _rates(found: Mapping[str, tuple[Average, Average, Difference]]) -> str:
    """What different stroke rates mean for the comparison; "" if they are alike."""
    rates = found.get("rate_per_min")
    if rates is None or abs(rates[2].value) < SAME_RATE_PER_MIN:
        return ""
    now, then = (with_unit(one.feature, one.over.mean) for one in rates[:2])
    start = f" The stroke rates differ ({now} and {then}), and many numbers follow the rate:"
    if abs(rates[2].value) <= RATES_APART:
        return f"{start} what stands out is compared at like rate."
    return f"{start} more than {RATES_APART:.0f}/min apart, nothing is compared at like rate."


def _mean(one: Average) -> str:
    text = value_cell(one.over.mean * one.feature.shown_scale, shown(one.feature, one.over.mean))
    known = spread(one.feature, one.uncertainty)
    return f'{text} <span class="spread">{PLUS_MINUS} {known}</span>'
