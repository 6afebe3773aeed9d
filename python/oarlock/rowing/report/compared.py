"""The comparison of two pieces in the report: differences, and whether they exceed both uncertainties."""

from __future__ import annotations

from html import escape

from oarlock.report import Column, sortable_table, value_cell
from oarlock.rowing.findings.find import least
from oarlock.rowing.findings.rowed import RATES_APART
from oarlock.rowing.report.averages import Average, Difference, difference
from oarlock.rowing.report.piece import Piece
from oarlock.rowing.report.shown import PLUS_MINUS, shown, spread, unit_of, with_unit
from oarlock.rowing.report.tables import beyond_words, link

MOST_TOLD = 4
_LIKE = "What stands out is compared at like rate."
_APART = f"Rates more than {RATES_APART:.0f}/min apart are not compared further."
SAME_RATE_PER_MIN = 1.0
"""Pieces whose rates differ by more are compared with a warning."""


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
    """The largest differences, as markup."""
    found = differences(this, other)
    names = f"<b>{escape(this.name)}</b> beside <b>{escape(other.name)}</b>"
    if not found:
        return [f"{names}: the pieces have no number in common."]
    sure = {
        name: held for name, held in found.items() if held[2].beyond and not name.startswith(("r_", "l_"))
    }
    weights = {name: abs(held[2].value) / least(held[0].feature) for name, held in sure.items()}
    telling = sorted((name for name in sure if weights[name] > 1.0), key=lambda name: -weights[name])
    beyond = sum(bool(held[2].beyond) for held in found.values())
    start = f"{names}: {beyond} of {len(found)} differences exceed both uncertainties"
    rates = found.get("rate_per_min")
    if rates is not None and abs(rates[2].value) >= SAME_RATE_PER_MIN:
        now, then = (with_unit(one.feature, one.over.mean) for one in rates[:2])
        return [
            f"{names}: stroke rate {now} against {then}. {beyond} of {len(found)} numbers differ by more than both "
            f"uncertainties, but many follow the rate. {_LIKE if abs(rates[2].value) <= RATES_APART else _APART}"
        ]
    if not telling:
        return [f"{start}; none is large enough to be relevant."]
    told = "; ".join(_told(*sure[name]) for name in telling[:MOST_TOLD])
    return [f"{start}. Most: {told}."]


def _told(mine: Average, theirs: Average, between: Difference) -> str:
    change = with_unit(between.feature, between.value, signed=True)
    now, then = (with_unit(one.feature, one.over.mean) for one in (mine, theirs))
    return escape(f"{mine.feature.label} {now} instead of {then} ({change})")


def _mean(one: Average) -> str:
    text = value_cell(one.over.mean * one.feature.shown_scale, shown(one.feature, one.over.mean))
    known = spread(one.feature, one.uncertainty)
    return f'{text} <span class="spread">{PLUS_MINUS} {known}</span>'
