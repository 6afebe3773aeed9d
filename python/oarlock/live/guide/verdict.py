"""What a guided start says of the steps done so far: the offline calibration of their readings, in another process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

import oarlock
from oarlock.calibration.session.checks import REDO
from oarlock.calibration.session.exchanged import exchanged_units
from oarlock.recording.calibration import Calibration, calibration_text
from oarlock.recording.streams import Stream
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.calibration.session.plan import SessionPlan
    from oarlock.recording.recording import Recording


@dataclass(frozen=True, eq=False)
class Task:
    """Steps to be judged.

    Args:
        number: of the task; its verdict has it, too.
        model: of the body.
        plan: the steps done so far, with their times.
        parts: readings of each step, in order of time.
        calibration: an earlier one, such as with lengths.
    """

    number: int
    model: Model
    plan: SessionPlan
    parts: Sequence[Recording]
    calibration: Calibration | None

    @property
    def newest(self) -> str:
        """The step that was done last."""
        return max(self.plan.steps, key=lambda step: step.end_s or 0.0).name


def prepared() -> None:
    """Does nothing, in a process that has loaded this module for it."""


@dataclass(frozen=True)
class Verdict:
    """What is said of the steps.

    Args:
        number: of the task.
        steps: name -> outcome (`pass`, `kept` or `redo`) and a sentence.
        passed: whether nothing has to be done again.
        doubts: sentences about what is no single step, such as a mount that stays uncertain.
        calibration: text of the calibration's file; empty if there is none.
        exchanged: two units that sit in each other's place; empty if none do.
    """

    number: int
    steps: Mapping[str, tuple[str, str]] = field(hash=False)
    passed: bool = False
    doubts: tuple[str, ...] = ()
    calibration: str = ""
    exchanged: tuple[str, ...] = ()


def judged(task: Task) -> Verdict:
    """Calibrates with the readings of all steps, as `oarlock calibrate session` does with a recording of them."""
    try:
        recording = joined(task.parts)
        found = oarlock.calibration.calibrate_session(
            task.model, recording, task.plan, calibration=task.calibration
        )
    except DataError as error:
        return Verdict(task.number, {task.newest: (REDO, f"{error}.")})
    noted: Any = found.noted["session"]
    steps = {step["name"]: (step["outcome"], step["sentence"]) for step in noted["step"]}
    again = any(outcome == REDO for outcome, _ in steps.values())
    exchanged = exchanged_units(task.model, recording, task.plan) if again else ()
    return Verdict(
        task.number,
        steps,
        noted["passed"],
        tuple(_doubts(noted["check"], set(steps))),
        calibration_text(found),
        exchanged,
    )


def _doubts(checks: Sequence[Mapping[str, Any]], steps: set[str]) -> list[str]:
    """Sentences on what must be done again and is not about one step."""
    own = [c for c in checks if c["outcome"] == REDO and not steps & set(c["step"].split(", "))]
    return list(
        dict.fromkeys(f"{c['subject']}: {c['sentence']}" if c["subject"] else c["sentence"] for c in own)
    )


def joined(parts: Sequence[Recording]) -> Recording:
    """One recording of several in order of time; what an earlier one has counts once."""
    streams: dict[str, list[Stream]] = {}
    for part in parts:
        for stream in part.streams:
            before = streams.setdefault(stream.name, [])
            rows = (
                stream.time_s > before[-1].time_s[-1] if before else np.ones(len(stream.time_s), dtype=bool)
            )
            if rows.any():
                before.append(stream.at_rows(rows))
    return oarlock.Recording([_in_one(own) for own in streams.values() if own])


def _in_one(parts: Sequence[Stream]) -> Stream:
    """The rows of all parts; a quantity that a part lacks is missing there."""
    first = parts[0]
    names = dict.fromkeys(name for part in parts for name in part.values)
    shapes = {name: part.values[name].shape[1:] for part in parts for name in part.values}
    values: dict[str, Any] = {
        name: np.concatenate(
            [part.values.get(name, np.full((len(part), *shapes[name]), np.nan)) for part in parts]
        )
        for name in names
    }
    return replace(first, time_s=np.concatenate([part.time_s for part in parts]), **values)
