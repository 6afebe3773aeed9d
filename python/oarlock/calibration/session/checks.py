"""`Check`: one result of a session with its value, standard deviation, limit and advice. Shown on its page."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np

PASSED, REDO, KEPT = "pass", "redo", "kept"


@dataclass(frozen=True)
class Check:
    """One line of a session's page.

    Args:
        step: of the plan, or the part of the search.
        subject: a unit, a stream, or empty.
        what: what was looked for.
        found: its value with unit, as text.
        std: how sure, in `unit`; NaN if it has none.
        limit: the std or deviation that still passes, in `unit`; NaN if there is none.
        unit: of std and limit.
        outcome: `pass`, `redo`, or `kept`: the session does not determine the value, the previous one is kept.
        sentence: one plain sentence.
    """

    step: str
    subject: str
    what: str
    found: str
    std: float
    limit: float
    unit: str
    outcome: str
    sentence: str

    def as_dict(self) -> dict[str, object]:
        """For a file: without what is not a number."""
        values = {k: v for k, v in asdict(self).items() if not (isinstance(v, float) and not np.isfinite(v))}
        return {k: float(v) if isinstance(v, float) else v for k, v in values.items()}


def within(std: float, limit: float) -> str:
    """`pass` where std does not exceed the limit."""
    return PASSED if std <= limit else REDO


def numbers(values: Iterable[float], digits: int) -> str:
    """`+0.012, -0.003, +0.020`."""
    return ", ".join(f"{v:+.{digits}f}" for v in values)
