"""`findings`: what stands out in a piece, by itself and against last time, own best and usual values, for reports."""

from __future__ import annotations

from oarlock.rowing.analysis.features import Feature
from oarlock.rowing.findings.candidate import against, against_usual, beyond_chance, sides, within
from oarlock.rowing.findings.causes import by_cause
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.findings.rowed import Rowed, rowing_kind
from oarlock.rowing.findings.sentences import finding
from oarlock.rowing.findings.watched import LEAST, WATCHED
from oarlock.rowing.report.piece import Piece

FALSE_SHARE = 0.02
"""Probability that anything is named in a piece in which nothing differs, by chance alone."""


def findings(
    piece: Piece, last: Piece | None = None, best: Piece | None = None, other: Piece | None = None
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


def findings_of(rowed: Rowed, compared: dict[str, Rowed]) -> list[Finding]:
    """As `findings`, of strokes; `compared` by kind, such as "against last"."""
    if not len(rowed.numbers):
        return []
    candidates = [*sides(rowed), *within(rowed), *against_usual(rowed)]
    for kind, other in compared.items():
        candidates += against(rowed, other, kind)
    causes = by_cause(beyond_chance(candidates, FALSE_SHARE))
    return [finding(cause, rowed.kind) for cause in causes]


def compares_sides(piece: Piece) -> bool:
    """Whether right and left should agree; two hands on one oar move differently by design."""
    return bool(piece.sides) and rowing_kind(piece) != "sweep"


def least(feature: Feature) -> float:
    """The smallest reported difference, in the feature's own unit; NaN if none is defined."""
    watched = WATCHED.get(feature.name)
    shown = watched.least if watched else LEAST.get(feature.shown_unit, float("nan"))
    return shown / feature.shown_scale
