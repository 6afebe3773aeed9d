"""Summary of each step of a session: its time interval, its outcome and a sentence. Shown on the session's page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from oarlock.calibration.session.checks import KEPT, PASSED, REDO, Check
from oarlock.calibration.session.plan import SessionPlan, SessionStep
from oarlock.calibration.session.unit_rows import Span

OF_REST = ("accelerometer", "magnetometer", "gyroscope's bias", "field")
"""What is looked for while units lie or are turned."""


def missing_steps(plan: SessionPlan, spans: Mapping[str, Span]) -> list[Check]:
    """A line for each step that lies nowhere: to do again, unless it is optional."""
    missing = [s for s in plan.steps if s.name not in spans and s.kind not in ("sign", "mark")]
    return [Check(s.name, "", s.kind, "-", np.nan, np.nan, "", *_missing(s)) for s in missing]


def _missing(step: SessionStep) -> tuple[str, str]:
    if step.optional:
        return KEPT, f'"{step.name}" was not found in the recording; it is optional.'
    return REDO, f'"{step.name}" was not found in the recording: do it again.'


def step_note(
    step: SessionStep, plan: SessionPlan, spans: Mapping[str, Span], checks: Sequence[Check]
) -> dict[str, object]:
    """The step for the calibration's notes."""
    own = [c for c in checks if step.name in _steps_of(c, plan)]
    if step.kind in ("turn", "still") and step.name in spans:
        own += [c for c in checks if c.what in OF_REST]
    outcome, sentence = _in_words(step, own)
    note: dict[str, object] = {"name": step.name, "kind": step.kind, "say": step.say}
    if step.name in spans:
        note |= {"start_s": float(spans[step.name][0]), "end_s": float(spans[step.name][1])}
    return note | {"outcome": outcome, "sentence": sentence}


def _steps_of(check: Check, plan: SessionPlan) -> list[str]:
    """The steps that a check is about: one, whose name may have a comma, or several with commas between them."""
    is_one = any(check.step == step.name for step in plan.steps)
    return [check.step] if is_one else check.step.split(", ")


def _in_words(step: SessionStep, own: Sequence[Check]) -> tuple[str, str]:
    again = [c for c in own if c.outcome == REDO]
    if again:
        units = list(dict.fromkeys(c.subject for c in again if c.subject))
        about = f"{', '.join(units)}: " if units else ""
        return REDO, about + again[0].sentence
    kept = [c for c in own if c.outcome == KEPT]
    if kept:
        units = list(dict.fromkeys(c.subject for c in kept if c.subject))
        return KEPT, f"{', '.join(units)}: {kept[0].sentence}"
    if step.kind in ("turn", "still"):
        return PASSED, "All units rested long enough."
    return PASSED, own[0].sentence if own else "This step has no check."
