"""`findings`: what stands out in a piece, by itself and against last time, own best and usual values, for reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from oarlock.rowing.analysis.features import Feature
from oarlock.rowing.findings.candidate import (
    MetricComparison,
    against,
    against_usual,
    beyond_chance,
    sides,
    within,
)
from oarlock.rowing.findings.causes import by_cause
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.findings.rowed import Rowed, StoredStrokes
from oarlock.rowing.findings.sentences import finding
from oarlock.rowing.findings.watched import LEAST, WATCHED
from oarlock.rowing.report.piece import ReportPiece


def findings(
    piece: ReportPiece,
    last: ReportPiece | StoredStrokes | None = None,
    best: ReportPiece | StoredStrokes | None = None,
    other: ReportPiece | None = None,
) -> list[Finding]:
    """What stands out, the most important first; empty if nothing does.

    A difference is named if it is larger than the smallest relevant size and beyond chance among all comparisons of
    the piece, the uncertainty of mounts and lengths included. Effects of the stroke rate are removed; several
    differences with one cause are one finding.

    Args:
        piece: what was rowed.
        last: the piece of last time, of the same rower; None, or one that is not comparable, is left out.
        best: the rower's best piece, likewise.
        other: any piece beside it, likewise.
    """
    others = {"against last": last, "against best": best, "against other": other}
    compared = {kind: Rowed.of(one) for kind, one in others.items() if one is not None}
    return findings_of(Rowed.of(piece), compared)


def findings_of(rowed: Rowed, compared: Mapping[str, Rowed]) -> list[Finding]:
    """As `findings`, of strokes; `compared` by kind, such as "against last"."""
    return named(rowed, comparisons(rowed, compared))


def comparisons(rowed: Rowed, compared: Mapping[str, Rowed]) -> list[MetricComparison]:
    """Every difference that is looked at, named or not; `compared` as in `findings_of`."""
    if not len(rowed.numbers):
        return []
    others = [one for kind, other in compared.items() for one in against(rowed, other, kind)]
    return [*sides(rowed), *within(rowed), *against_usual(rowed), *others]


def named(rowed: Rowed, candidates: Sequence[MetricComparison]) -> list[Finding]:
    """Findings among all comparisons of a piece, the most important first."""
    return [finding(cause, rowed.kind) for cause in by_cause(beyond_chance(candidates))]


def least(feature: Feature) -> float:
    """The smallest reported difference, in the feature's own unit; NaN if none is defined."""
    watched = WATCHED.get(feature.name)
    shown = watched.least if watched else LEAST.get(feature.shown_unit, float("nan"))
    return shown / feature.shown_scale
