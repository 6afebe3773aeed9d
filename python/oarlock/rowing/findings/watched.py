"""`WATCHED`: the numbers that may be findings, with words, usual values, reasons and advice, from `watched.toml`."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from types import MappingProxyType

from oarlock.rowing.analysis.features import FEATURES, Feature

LEAST = {
    "deg": 2.0,
    "deg/s": 20.0,
    "ms": 20.0,
    "s": 0.05,
    "%": 3.0,
    "cm": 2.0,
    "m": 0.02,
    "m/s": 0.1,
    "1/min": 1.0,
    "beats/min": 5.0,
}
"""In shown units. Smaller differences are not reported, even when statistically certain. The play of a swivel
alone is 1.3 deg (Kleshnev, biorow.com/rbn2025_10)."""


_TOLD = ("why", "try_grew", "try_fell", "advice")


@dataclass(frozen=True)
class SourcedText:
    """A text with its source; both "" if there is none."""

    text: str = ""
    source: str = ""


@dataclass(frozen=True)
class Watched:
    """A number that may be a finding; sizes in the feature's shown unit.

    Attributes:
        name: of the column.
        subject: in a sentence.
        grew: word for a larger value.
        fell: word for a smaller value.
        flipped: sentences give the value with the other sign.
        sides: sentence of a difference between right and left; "" for other numbers.
        own_least: smallest size that is named; 0 takes that of the unit.
        per_rate: prior standard deviation of the effect of one stroke per minute, in `least`.
        low: published lower limit.
        high: published upper limit.
        kinds: boat kinds to which it applies; empty for all.
        causes: gain by column: a change of this number changes that one by so much.
        goes_with: columns that change with it by no fixed amount.
        beside: columns that may be a reason of this change; they are named with it.
        usual: in words by boat kind, "" for all.
        usual_range: the same as lowest and highest value by boat kind, for a key figure.
        usual_source: of it.
        why: why it matters.
        tries: a drill or cue against a larger ("grew") or smaller value ("fell"), or "either".
    """

    name: str
    subject: str = ""
    grew: str = ""
    fell: str = ""
    flipped: bool = False
    sides: str = ""
    own_least: float = 0.0
    per_rate: float = 0.2
    low: float = float("-inf")
    high: float = float("inf")
    kinds: tuple[str, ...] = ()
    causes: Mapping[str, float] = field(default_factory=dict)
    goes_with: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()
    usual: Mapping[str, str] = field(default_factory=dict)
    usual_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    usual_source: str = ""
    why: SourcedText = SourcedText()
    tries: Mapping[str, SourcedText] = field(default_factory=dict)

    @property
    def feature(self) -> Feature:
        """Its definition."""
        return FEATURES[self.name]

    @property
    def least(self) -> float:
        """Smallest size that is named, in the shown unit."""
        return self.own_least or LEAST[self.feature.shown_unit]

    def to_try(self, size: float) -> SourcedText:
        """What to try against a change of this sign."""
        return self.tries["either"] if self.sides else self.tries["grew" if size > 0.0 else "fell"]

    def usual_of(self, kind: str) -> SourcedText:
        """Usual values of a boat kind; of all kinds if it is "", not known."""
        either = "" if kind else "; ".join(f"{boat}: {words}" for boat, words in self.usual.items())
        words = self.usual.get(kind, self.usual.get("", either))
        return SourcedText(words, self.usual_source if words else "")

    def beyond_usual(self, kind: str, value: float) -> float:
        """How far a value (shown unit) lies beyond the usual range of a boat kind; 0 within it or without one."""
        low, high = self.usual_range.get(kind, (-math.inf, math.inf))
        return min(value - low, 0.0) + max(value - high, 0.0)


def _read() -> Iterator[Watched]:
    text = files("oarlock.rowing.findings").joinpath("watched.toml").read_text(encoding="utf-8")
    for name, row in tomllib.loads(text).items():
        told = {key: SourcedText(row.pop(key, ""), row.pop(f"{key}_source", "")) for key in _TOLD}
        usual = row.pop("usual", {})
        yield Watched(
            name,
            own_least=row.pop("least", 0.0),
            usual={"": usual} if isinstance(usual, str) else usual,
            why=told["why"],
            tries={"grew": told["try_grew"], "fell": told["try_fell"], "either": told["advice"]},
            kinds=tuple(row.pop("kinds", ())),
            goes_with=tuple(row.pop("goes_with", ())),
            beside=tuple(row.pop("beside", ())),
            usual_range={boat: (span[0], span[1]) for boat, span in row.pop("usual_range", {}).items()},
            **row,
        )


WATCHED: Mapping[str, Watched] = MappingProxyType({one.name: one for one in _read()})
"""By column, in the order of the file."""
