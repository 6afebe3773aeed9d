"""What the findings of a piece compared, and from which size a difference is named: for the front of a report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

from oarlock.report import fixed, plain_table
from oarlock.rowing.findings.candidate import Candidate, against
from oarlock.rowing.findings.rowed import Rowed
from oarlock.rowing.report.averages import SIGMAS_95
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, places, shown, spread, with_unit
from oarlock.rowing.report.tables import link

HEADS = {
    "sides": "Right and left",
    "drift": "Over the piece",
    "odd stroke": "One stroke",
    "against usual": "Against usual values",
    "against last": "Against last time",
    "against best": "Against own best",
    "against other": "Against the other piece",
}
"""What was compared with what, by kind of finding."""
_OF_SIDES = ("catch_time_difference_s",)
_OF_DRIFT = ("arc_rad", "catch_angle_rad", "lean_swing_rad")
_USELESS = 4.0
"""A limit of so many times the smallest size that matters tells a rower nothing."""
_NEARLY = 1e-9
_OF_NEXT = ("catch_angle_rad", "lean_swing_rad")


def quiet(candidates: Sequence[Candidate], is_ramp: bool = False) -> str:
    """What agrees, and from which size a difference would have been named; `is_ramp`: whether the rate changes."""
    if not candidates:
        return "Too few strokes count, so nothing was compared."
    total, useful = len(candidates), [one for one in candidates if is_useful(one, len(candidates))]
    late = sizes(useful, "sides", _OF_SIDES, total)
    changed = sizes(useful, "drift", _OF_DRIFT, total)
    told = [f"Both oars turn together at the catch (a difference of {size} would show)." for _, size in late]
    if changed:
        shown = f"a change of {_listed(changed)} would show"
        apart = "Apart from what goes with the stroke rate, nothing" if is_ramp else "Nothing"
        told.append(f"{apart} changes from start to end ({shown}).")
    else:
        told.append("Too few strokes count to see small changes from start to end.")
    return " ".join(told)


def is_useful(one: Candidate, comparisons: int) -> bool:
    """Whether less than a very large difference would be named."""
    return one.named_from(comparisons) < _USELESS * one.watched.least


def next_sizes(rowed: Rowed) -> str:
    """The differences that another piece like this one could show: "3° of catch angle or 6° of trunk swing".

    "" without any, and without the trunk if only a very large difference would show.
    """
    again = list(against(rowed, rowed, "again"))
    useful = [one for one in again if is_useful(one, len(again))]
    return _listed(sizes(useful, "again", _OF_NEXT, len(again)))


def sizes(
    candidates: Sequence[Candidate], kind: str, names: Iterable[str], comparisons: int | None = None
) -> list[tuple[str, str]]:
    """Label and size from which it is named, rounded up, of those numbers that were compared.

    `comparisons` is how many there are in all, if more than `candidates`.
    """
    total = comparisons or len(candidates)
    found = {one.watched.name: one for one in candidates if one.kind == kind}
    return [
        (found[name].watched.feature.label, _rounded_up(found[name], found[name].named_from(total)))
        for name in names
        if name in found
    ]


def _rounded_up(one: Candidate, size: float) -> str:
    feature = one.watched.feature
    digits = max(places(feature) - 1, 0)
    return f"{fixed(math.ceil(size * 10.0**digits - _NEARLY) / 10.0**digits, digits)}{joined_unit(feature)}"


def _listed(sizes: Sequence[tuple[str, str]]) -> str:
    told = [f"{size} of {label}" for label, size in sizes]
    return " or ".join(filter(None, (", ".join(told[:-1]), *told[-1:])))


def _size(one: Candidate, size: float) -> str:
    feature = one.watched.feature
    return with_unit(feature, size / feature.shown_scale)


def checked(candidates: Sequence[Candidate]) -> str:
    """A table of all comparisons with what was found and the size from which it is named; markup."""
    rows = [
        [
            escape(f"Stroke {one.stroke}" if one.stroke else HEADS[one.kind]),
            link(one.watched.name, one.watched.feature.label),
            escape(_with_interval(one)),
            escape(_size(one, one.named_from(len(candidates)))),
        ]
        for one in sorted(candidates, key=lambda one: list(HEADS).index(one.kind))
    ]
    caption = (
        "The differences that were compared; the stroke rate's effect is removed. "
        f"{PLUS_MINUS}: 95 % interval. A difference is named from the size on the right: more than chance among "
        f"{len(candidates)} comparisons and more than matters."
    )
    heads = ["compared", "number", "difference", "named from"]
    return plain_table("checked", caption, heads, rows, style="stacked") if rows else ""


def _with_interval(one: Candidate) -> str:
    feature = one.watched.feature
    size, sd = one.size / feature.shown_scale, one.sd / feature.shown_scale
    half = spread(feature, SIGMAS_95 * sd)
    return f"{shown(feature, size, signed=True)} {PLUS_MINUS} {half}{joined_unit(feature)}"
