"""`Finding`: one thing that stands out in a piece, for the first page and the terminal."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One thing that stands out in a piece.

    Attributes:
        name: column of the stroke table that says it best; of two sides the name without the side.
        kind: "sides", "drift", "odd stroke", "against usual", "against last", "against best"
            or "against other".
        sentence: what, in plain words with sizes.
        size: in `unit`; with its sign.
        size_1sd: standard deviation of `size`; 95 % is 1.96 times this. NaN if unknown.
        unit: of `size`, as shown: "deg", "ms", "cm".
        usual: usual values with numbers in words; "" if none is on record.
        usual_source: of them; "" if none.
        why: why it matters, one sentence; "" without a source.
        why_source: of it.
        advice: one thing to try; "" without a source.
        advice_source: of it.
        weight: the order, largest first.
    """

    name: str
    kind: str
    sentence: str
    size: float
    size_1sd: float
    unit: str
    usual: str = ""
    usual_source: str = ""
    why: str = ""
    why_source: str = ""
    advice: str = ""
    advice_source: str = ""
    weight: float = 0.0
