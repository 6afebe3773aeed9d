"""Changes between two pieces: one size, one interval and one verdict for each number, wherever a page states it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from oarlock.report import fixed
from oarlock.rowing.alongside.paces import PER_500_M, SPEEDS, of_pace, slower_s
from oarlock.rowing.findings.candidate import MetricComparison, chance
from oarlock.rowing.findings.find import least
from oarlock.rowing.findings.watched import WATCHED
from oarlock.rowing.report.averages import Average, Difference, difference
from oarlock.rowing.report.piece import Counted
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, shown, spread

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
    said = _said(found)
    if found.beyond is None:
        return f"{size_in_words(found)}, uncertainty not known"
    if not found.beyond:
        return f"no clear change ({PLUS_MINUS}\N{NO-BREAK SPACE}{said.half}{said.unit})"
    return f"{said.size} {PLUS_MINUS} {said.half}{said.unit} {said.direction}"


def size_in_words(found: Difference) -> str:
    """A change without its interval: `1.4° shorter`."""
    said = _said(found)
    return f"{said.size}{said.unit} {said.direction}"


class _Said(NamedTuple):
    """The parts of a change in words."""

    size: str
    half: str
    unit: str
    direction: str


def _said(found: Difference) -> _Said:
    """Of a speed as pace, the difference of both paces as they are shown."""
    if found.feature.name in SPEEDS:
        late_s, half_s = slower_s(found.now, found.now - found.value), of_pace(found.now, found.half)
        word = "slower" if late_s > 0.0 else "faster"
        return _Said(fixed(abs(late_s), 1), fixed(half_s, 1), f" {PER_500_M}", word)
    size, half = shown(found.feature, abs(found.told)), spread(found.feature, found.half)
    return _Said(size, half, _unit(found), _direction(found))


def _direction(found: Difference) -> str:
    watched, up = WATCHED.get(found.feature.name), found.told > 0.0
    word = (watched.grew if up else watched.fell) if watched is not None else ""
    return word or ("more" if up else "less")


def _unit(found: Difference) -> str:
    unit = joined_unit(found.feature)
    return " points" if unit == " %" else unit
