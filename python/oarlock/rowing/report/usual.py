"""Means outside of usual values, as a remark and as one thing to try: for the front of a rower's report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from oarlock.report import capital, fixed
from oarlock.rowing.findings.watched import WATCHED, SourcedText, Watched
from oarlock.rowing.report.averages import Average
from oarlock.rowing.report.piece import Counted, ReportPiece
from oarlock.rowing.report.shown import PLUS_MINUS, joined_unit, shown, spread
from oarlock.storage.statistics import NORMAL_95

_FAR = 3.0
"""So many times the smallest size that is named are far outside."""


@dataclass(frozen=True)
class Beyond:
    """A mean clearly outside of its usual range.

    Attributes:
        watched: the number.
        found: its average.
        by: how far it lies outside, in the shown unit; positive above.
        kind: of rowing.
    """

    watched: Watched
    found: Average
    by: float
    kind: str

    @property
    def matters(self) -> bool:
        """Whether it is farther outside than the smallest size that is named."""
        return abs(self.by) > self.watched.least

    @property
    def words(self) -> str:
        """`slightly shorter than usual`."""
        word = self.watched.grew if self.by > 0.0 else self.watched.fell
        far = abs(self.by) > _FAR * self.watched.least
        return f"{'far ' if far else '' if self.matters else 'slightly '}{word} than usual"

    @property
    def sentence(self) -> str:
        """The value with its 95 % interval, which values are usual, and what it means where it matters."""
        feature, found = self.watched.feature, self.found
        value = f"{shown(feature, found.over.mean)} {PLUS_MINUS} {spread(feature, found.half)}{joined_unit(feature)}"
        told = (
            f"{capital(self.watched.subject)}: {value}, {self.words} ({usual_span(self.watched, self.kind)})."
        )
        return f"{told} {self.watched.why.text}".strip() if self.matters else told

    @property
    def to_try(self) -> SourcedText:
        """A drill or cue; "" if none was found in the literature."""
        return self.watched.to_try(self.by)


def beyond_usual(piece: ReportPiece, kind: str) -> list[Beyond]:
    """All, the farthest outside first, relative to the smallest size that is named; empty if targets were chosen."""
    if piece.technique.targets:
        return []
    all_of = (beyond_of(piece, name, kind) for name in WATCHED)
    return sorted(
        (one for one in all_of if one is not None), key=lambda one: -abs(one.by) / one.watched.least
    )


def beyond_of(piece: Counted, name: str, kind: str) -> Beyond | None:
    """How far the mean of one number is outside of its usual range; None within its uncertainty."""
    watched, found = WATCHED.get(name), piece.averages.get(name)
    if watched is None or found is None or not found.known:
        return None
    scale = watched.feature.shown_scale
    by = watched.beyond_usual(kind, scale * found.over.mean)
    return Beyond(watched, found, by, kind) if abs(by) > NORMAL_95 * scale * found.uncertainty else None


def remark(outside: Sequence[Beyond]) -> tuple[str, str]:
    """All of them in sentences, and whose usual values these are; both "" without any."""
    if not outside:
        return "", ""
    cited = [one.watched.usual_source for one in outside]
    cited += [one.watched.why.source for one in outside if one.matters]
    sources = "; ".join(dict.fromkeys(filter(None, cited)))
    told = " ".join(one.sentence for one in outside)
    return told, f"Usual values: {sources}; they change with body height, rig and boat class."


def usual_span(watched: Watched, kind: str) -> str:
    """Usual values of a boat kind in short, such as `105 to 110°`; "" without a source."""
    if kind not in watched.usual_range:
        return ""
    low, high = sorted(watched.usual_range[kind], key=abs)
    if low == 0.0:
        return f"up to {fixed(high, 0)}{joined_unit(watched.feature)}".replace(" ", "\N{NO-BREAK SPACE}")
    digits = 0 if low == round(low) and high == round(high) else 2
    span = f"about {fixed(low, digits)}" if low == high else f"{fixed(low, digits)} to {fixed(high, digits)}"
    return f"{span}{joined_unit(watched.feature)}".replace(" ", "\N{NO-BREAK SPACE}")
