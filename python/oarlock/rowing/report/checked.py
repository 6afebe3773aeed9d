"""What the findings of a piece compared, and from which size a difference is named: for the front of a report."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from html import escape

from oarlock.report import fixed, plain_table
from oarlock.rowing.findings.candidate import MetricComparison, against
from oarlock.rowing.findings.rowed import Rowed
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, places, shown, spread
from oarlock.rowing.report.tables import NOT_CALIBRATED, link
from oarlock.storage.statistics import NORMAL_95

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
_OTHERS = ("against last", "against best", "against other")
_LIKE = ", at like rate"
_OF_SIDES = ("catch_time_difference_s",)
_OF_DRIFT = ("arc_rad", "catch_angle_rad", "lean_swing_rad")
_USELESS = 4.0
"""A limit of so many times the smallest size that matters tells a rower nothing."""
_STEPS = {"ms": 5.0, "deg": 1.0, "cm": 1.0, "%": 1.0, "W": 5.0, "N": 5.0, "m": 0.01, "m/s": 0.05}
"""Sizes from which a difference is named are shown in these steps, by shown unit."""
_OF_NEXT = ("catch_angle_rad", "lean_swing_rad")


def quiet(candidates: Sequence[MetricComparison], is_ramp: bool = False) -> tuple[str, str]:
    """What agrees, and from which sizes differences would be named; `is_ramp`: whether the rate changes."""
    if not candidates:
        return "Too few strokes count, so nothing was compared.", ""
    total = _judged_with(candidates)
    useful = [one for one in candidates if is_useful(one, total)]
    late = sizes(useful, "sides", _OF_SIDES, total)
    changed = sizes(useful, "drift", _OF_DRIFT, total)
    told = ["No clear difference between both oars at the catch."] if late else []
    if changed:
        apart = "Apart from what goes with the stroke rate, no" if is_ramp else "No"
        told.append(f"{apart} clear change from start to end.")
    else:
        told.append("Too few strokes count to see small changes from start to end.")
    small = [f"differences below about {size} between both oars at the catch" for _, size in late]
    small += [f"changes from start to end below about {_listed(changed)}"] if changed else []
    limits = f"In this piece {' and '.join(small)} cannot be told from chance."
    return " ".join(told), limits if small else ""


def _judged_with(candidates: Sequence[MetricComparison]) -> int:
    """Comparisons among which chance is judged on a page with another piece, where limits are larger.

    Limits are stated with it on a page without one too: a reader of both pages sees one limit.
    """
    own = sum(one.kind not in _OTHERS for one in candidates)
    beside = sum(one.kind == "drift" for one in candidates)
    return max(len(candidates), own + beside)


def is_useful(one: MetricComparison, comparisons: int) -> bool:
    """Whether less than a very large difference would be named."""
    return one.named_from(comparisons) < _USELESS * one.watched.least


def next_sizes(rowed: Rowed, names: Sequence[str] = _OF_NEXT) -> str:
    """The differences that another piece like this one could show: "3° of catch angle or 6° of trunk swing".

    "" without any, and without a number of which only a very large difference would show.
    """
    again = list(against(rowed, rowed, "again"))
    useful = [one for one in again if is_useful(one, len(again))]
    return _listed(sizes(useful, "again", names, len(again)))


def sizes(
    candidates: Sequence[MetricComparison], kind: str, names: Iterable[str], comparisons: int | None = None
) -> list[tuple[str, str]]:
    """Label and size from which it is named, rounded, of those numbers that were compared.

    `comparisons` is how many there are in all, if more than `candidates`.
    """
    total = comparisons or len(candidates)
    found = {one.watched.name: one for one in candidates if one.kind == kind}
    return [
        (found[name].watched.feature.label, _limit(found[name], total)) for name in names if name in found
    ]


def _limit(one: MetricComparison, comparisons: int) -> str:
    """The size from which it is named, as every part of a page shows it."""
    feature = one.watched.feature
    step = _STEPS.get(feature.shown_unit, 10.0 ** -places(feature))
    size = step * round(one.named_from(comparisons) / step)
    return f"{fixed(size, 0 if step >= 1.0 else places(feature))}{joined_unit(feature)}"


def _listed(sizes: Sequence[tuple[str, str]]) -> str:
    told = [f"{size} of {label}" for label, size in sizes]
    return " or ".join(filter(None, (", ".join(told[:-1]), *told[-1:])))


def checked(candidates: Sequence[MetricComparison], unsure: Collection[tuple[str, str]] = ()) -> str:
    """A table of all comparisons with what was found and the size from which it is named; markup.

    `unsure` are the kinds and numbers of those in which a unit was not calibrated.
    """
    total = _judged_with(candidates)
    rows = []
    for one in sorted(candidates, key=lambda one: list(HEADS).index(one.kind)):
        feature = one.watched.feature
        size, half = (value / feature.shown_scale for value in (one.size, NORMAL_95 * one.sd))
        interval = (
            f"{shown(feature, size, signed=True)} {PLUS_MINUS} {spread(feature, half)}{joined_unit(feature)}"
        )
        what = f"Stroke {one.stroke}" if one.stroke else HEADS[one.kind] + (_LIKE if one.like_rate else "")
        found = NOT_CALIBRATED if (one.kind, one.watched.name) in unsure else escape(interval)
        rows.append([escape(what), link(one.watched.name, feature.label), found, escape(_limit(one, total))])
    caption = (
        "The differences that were compared. The stroke rate's effect is removed within the piece and between pieces "
        f"of different rates. {PLUS_MINUS}: half of the 95 % interval. A difference is named from about the size on "
        f"the right: more than chance among {total} comparisons, those of a page with another piece, and more than "
        "matters. Of true differences of that size, one in two is named."
    )
    heads = ["compared", "number", "difference", "named from"]
    return plain_table("checked", caption, heads, rows, style="stacked") if rows else ""
