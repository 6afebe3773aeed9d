"""The comparison of two pieces in the report: one sentence for people, and every difference side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from html import escape

from oarlock.report import Column, capital, day_text, sortable_table, value_cell
from oarlock.rowing.findings.candidate import MetricComparison, against
from oarlock.rowing.findings.find import least
from oarlock.rowing.findings.rowed import RATES_APART, Rowed
from oarlock.rowing.findings.watched import WATCHED
from oarlock.rowing.report.averages import Average, Difference
from oarlock.rowing.report.earlier import (
    Other,
    at_like_rate,
    change_of,
    compared_changes,
    matters,
    same_rate,
    size_in_words,
)
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.report.shown import PLUS_MINUS, shown, spread, unit_of, with_unit
from oarlock.rowing.report.tables import NOT_CALIBRATED, VERDICT, is_uncalibrated, link, verdict

_OF_RATE = ("rate_per_min", "drive_time_s", "recovery_time_s")
"""Numbers that make up the stroke rate."""
_MOST_LED = 2
"""Changes that the first sentence names."""

Found = Mapping[str, tuple[Average, Average, Difference]]


def beside(this: ReportPiece, other: ReportPiece) -> Other:
    """The second piece with its comparisons at like rate."""
    tested = against(Rowed.of(this), Rowed.of(other), "against other")
    return Other(other.name, other, {one.watched.name: one for one in tested})


def differences(this: ReportPiece, other: ReportPiece) -> dict[str, tuple[Average, Average, Difference]]:
    """For every number of both pieces: this, the other, this minus the other.

    Without an uncertainty where an angle's unit was not calibrated in one of them.
    """
    second, found = beside(this, other), {}
    for name, mine in this.averages.items():
        if not mine.known or name not in other.averages or not other.averages[name].known:
            continue
        between = change_of(this, second, name)
        if is_uncalibrated(this, name) or is_uncalibrated(other, name):
            between = replace(between, uncertainty=float("nan"))
        found[name] = mine, other.averages[name], between
    return found


def comparison_table(key: str, this: ReportPiece, other: ReportPiece) -> str:
    """How many numbers differ, then one row per number with both means, their difference, and whether it is clear."""
    rows = []
    found = differences(this, other)
    for name in largest_first(found):
        *both, between = found[name]
        feature = between.feature
        bare = [is_uncalibrated(piece, name) for piece in (this, other)]
        means = []
        for one, unsure in zip(both, bare, strict=True):
            mean = value_cell(one.over.mean * feature.shown_scale, shown(feature, one.over.mean))
            half = f' <span class="spread">{PLUS_MINUS} {spread(feature, one.half)}</span>'
            means.append(mean if unsure else mean + half)
        size = value_cell(between.told * feature.shown_scale, shown(feature, between.told, signed=True))
        half = NOT_CALIBRATED if any(bare) else spread(feature, between.half)
        head = [link(name, feature.label), escape(unit_of(feature))]
        rows.append([*head, *means, size, half, verdict(between)])
    columns = [
        Column("number"),
        Column("unit"),
        Column(this.name),
        Column(other.name),
        Column("difference", meaning="Of the two shown means."),
        Column(PLUS_MINUS, meaning="Half of the 95 % interval of the difference."),
        Column("verdict", meaning=VERDICT),
    ]
    caption = (
        f"Means over the strokes; the difference is {this.name} minus {other.name}. {PLUS_MINUS}: half of the 95 % "
        "interval; the error of the track counts as constant over the piece, the scatter between strokes is "
        "divided by the square root of their number. If the sensors were not moved between the pieces, smaller "
        "differences may be real too."
    )
    counted = "".join(f"<p>{escape(text)}</p>" for text in counts(this, other))
    return counted + sortable_table(key, caption, columns, rows, style="stacked")


def first_sentence(this: ReportPiece, other: ReportPiece) -> str:
    """What changed between two pieces, for a coach; text."""
    second = beside(this, other)
    alike = same_rate(this, other)
    if not alike and not second.tested:
        rates = [
            with_unit(one.feature, one.over.mean)
            for one in (p.averages["rate_per_min"] for p in (this, other))
        ]
        return f"The stroke rates differ ({' and '.join(rates)}){_not_at_like_rate(Rowed.of(this), Rowed.of(other))}"
    every = compared_changes(this, second)
    found = [one for one in every if matters(one)]
    if found:
        told = []
        for one in found[:_MOST_LED]:
            watched = WATCHED.get(one.feature.name)
            subject = f"the {one.feature.label}" if watched is None else watched.subject
            told.append(f"{subject} is {size_in_words(one)}")
        day = day_text(other.date)
        by_day = other.date != this.date and other.name.startswith(f"{day}, ")
        when = f"on {day}" if by_day else f"in {other.name}"
        return f"{capital(' and '.join(told))} than {when}{'' if alike else ', also at like rate'}."
    small = any(one.beyond for one in every)
    rest = "large enough to matter" if small else "clear"
    left = any(is_uncalibrated(one, "catch_lean_rad") for one in (this, other))
    apart = " Trunk and arms cannot be compared: not both pieces were calibrated." if left else ""
    if alike:
        return f"No change of technique is {rest}.{apart}"
    return f"Only the stroke rate and what goes with it changed; no change of technique is {rest}.{apart}"


def counts(this: ReportPiece, other: ReportPiece) -> list[str]:
    """How many numbers differ, how many would by chance, and which of them the stroke rate explains; text."""
    found = differences(this, other)
    if not found:
        return ["The pieces have no number in common."]
    sure = [name for name in largest_first(found) if found[name][2].beyond]
    tested = sum(held[2].beyond is not None for held in found.values())
    told = [
        f"{len(sure)} of {tested} numbers differ by more than both uncertainties; "
        f"by chance about {0.05 * tested:.0f} would if they were independent."
    ]
    second = beside(this, other)
    if same_rate(this, other) or not second.tested:
        return told
    groups: dict[str, list[str]] = {}
    for name in sure:
        groups.setdefault(_of_rate(found[name][2], second.tested.get(name)), []).append(
            found[name][0].feature.label
        )
    told += [f"{head}: {'; '.join(dict.fromkeys(groups[head]))}." for head in _HEADS if head in groups]
    return told


_RATE = (
    "Explained by the stroke rate (at like rate the difference is smaller, its whole 95 % interval included)"
)
_TOO = "Different at like rate too"
_OPEN = "Not certain at like rate"
_NOT = "Not compared at like rate"
_HEADS = (_RATE, _TOO, _OPEN, _NOT)


def _of_rate(between: Difference, tested: MetricComparison | None) -> str:
    """What the stroke rate does to a difference that is clear. That it became uncertain explains nothing."""
    if between.feature.name in _OF_RATE:
        return _RATE
    if tested is None:
        return _NOT
    like = at_like_rate(tested)
    if like.beyond:
        return _TOO
    return _RATE if abs(like.value) + like.half < abs(between.value) else _OPEN


def largest_first(found: Found) -> list[str]:
    """Names, those beyond both uncertainties first, the largest relative to what matters before others."""

    def order(name: str) -> tuple[bool, float]:
        between = found[name][2]
        weight = abs(between.value) / least(between.feature)
        return not between.beyond, -(weight if weight == weight else 0.0)

    return sorted(found, key=order)


def _not_at_like_rate(mine: Rowed, theirs: Rowed) -> str:
    if abs(mine.rate_per_min - theirs.rate_per_min) > RATES_APART:
        why = f": over more than {RATES_APART:.0f}/min its effect is not known well enough to remove it"
    else:
        why = ", and its effect was not removed, because the boats or the sensors differ"
    return f"{why}. Each number is still that of its own piece; how much of a difference comes from the rate is open."
