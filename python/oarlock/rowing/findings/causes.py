"""`by_cause`: differences with one cause become one; the cause that explains most leads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from oarlock.rowing.findings.candidate import MetricComparison

_COMPARED = ("against last", "against best", "against other")
_EXPLAINED = 0.65
"""A difference is explained if this share of it follows from its cause, or all but half of the smallest size."""


@dataclass(frozen=True)
class Cause:
    """A leading difference with those that follow from it.

    Attributes:
        lead: the one that is named.
        followed: those whose size follows from it.
        others: those that go with it by no fixed amount.
        beside: those that may be a reason of it, named with it.
    """

    lead: MetricComparison
    followed: tuple[MetricComparison, ...]
    others: tuple[MetricComparison, ...]
    beside: tuple[MetricComparison, ...]

    @property
    def weight(self) -> float:
        """Sum of what is explained; reasons are not."""
        return sum(one.weight for one in (self.lead, *self.followed, *self.others))


def by_cause(candidates: Sequence[MetricComparison]) -> list[Cause]:
    """Causes, those that explain most first."""
    left, found = list(candidates), []
    while left:
        cause = max((_cause(lead, left) for lead in left), key=lambda one: (one.weight, one.lead.weight))
        found.append(cause)
        taken = (cause.lead, *cause.followed, *cause.others, *cause.beside)
        left = [one for one in left if one not in taken]
    return found


def _cause(lead: MetricComparison, candidates: Sequence[MetricComparison]) -> Cause:
    rest = [one for one in candidates if one is not lead and _same_matter(lead, one)]
    followed = tuple(one for one in rest if one.kind == lead.kind and _follows(lead, one))
    others = tuple(one for one in rest if one not in followed and _goes_with(lead, one))
    beside = tuple(
        one
        for one in rest
        if one.kind == lead.kind and one not in followed and one.watched.name in lead.watched.beside
    )
    return Cause(lead, followed, others, beside)


def _same_matter(lead: MetricComparison, one: MetricComparison) -> bool:
    """Whether one may follow from the other: of one comparison, or of a wider one that the lead shows in."""
    if lead.stroke or one.stroke:
        return lead.stroke == one.stroke
    wider = one.kind in _COMPARED and lead.kind in ("sides", "drift", "against last")
    return lead.kind == one.kind or wider or (one.kind == "against usual" and lead.kind in _COMPARED)


def _follows(lead: MetricComparison, one: MetricComparison) -> bool:
    gain = lead.watched.causes.get(one.watched.name)
    if gain is None:
        return False
    share = gain * lead.size / one.size
    # More than the whole: the rest is made up for elsewhere.
    return share > _EXPLAINED or (share > 0.0 and abs(one.size - gain * lead.size) < 0.5 * one.watched.least)


def _goes_with(lead: MetricComparison, one: MetricComparison) -> bool:
    name = one.watched.name
    if name == lead.watched.name or name in lead.watched.causes:
        return lead.kind != one.kind or bool(lead.stroke)
    return name in lead.watched.goes_with or bool(lead.stroke)
