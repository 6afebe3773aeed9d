"""`Guide`: the course of a guided start, without clock, sockets or readings: presses and times in, orders out.

A step is shown (`ready`), counted down, done (`running`), judged (`checking`), and then passed or to be done again.
What a person presses means the same on every device: `go` is the next thing, `back` the one before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from oarlock.calibration.session.checks import KEPT, PASSED, REDO
from oarlock.calibration.session.plan import SessionPlan, SessionStep
from oarlock.live.guide.verdict import Verdict

SKIPPED = "skipped"
PRESSES = ("open", "go", "back", "skip", "swap", "leave")
PAD_S = 0.3
"""Readings before and after a step that are kept, too: they are interpolated to the times of others."""
LEAST_RUN_S = 3.0
"""A step that is ended sooner by a press shows too little."""


@dataclass(frozen=True)
class GuideDurations:
    """How long what lasts, s.

    Args:
        countdown_s: to take up the posture.
        seconds: of each kind of step.
        settle_s: after a step, for readings that are late.
        patience_s: so long the readings of slow units are awaited.
    """

    countdown_s: float = 5.0
    seconds: Mapping[str, float] = field(
        default_factory=lambda: {"still": 10.0, "turn": 45.0, "pose": 4.0, "move": 12.0}
    )
    settle_s: float = 0.5
    patience_s: float = 5.0


@dataclass(frozen=True)
class Send:
    """A command for the recording."""

    do: str
    keys: Mapping[str, object] = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class Listen:
    """Keep readings from now on: the countdown of a step has begun."""


@dataclass(frozen=True)
class Cut:
    """Keep the readings of a step that has ended."""

    name: str
    span_s: tuple[float, float]


@dataclass(frozen=True)
class CheckSteps:
    """Judge the steps that are done: a plan with their times."""

    number: int
    plan: SessionPlan


@dataclass(frozen=True)
class Swap:
    """Two streams take each other's device."""

    streams: tuple[str, str]


Order = Send | Listen | Cut | CheckSteps | Swap


@dataclass
class Progress:
    """How a step stands: its span if it was done, and what was said of it."""

    step: SessionStep
    span_s: tuple[float, float] | None = None
    outcome: str = ""
    sentence: str = ""

    @property
    def is_settled(self) -> bool:
        """Whether it need not be done."""
        return self.outcome in (PASSED, KEPT, SKIPPED)


@dataclass
class Guide:
    """The state of a guided start.

    Phases: `closed`, `offered`, `ready`, `countdown`, `running`, `checking`, `doubtful` (all is done, something
    remains uncertain), `calibrated`.

    Args:
        plan: the steps; `mark` and `sign` steps are left out.
        pace: how long what lasts.
        phase: at the beginning; `offered` where mounts are not known.
    """

    plan: SessionPlan
    pace: GuideDurations = field(default_factory=GuideDurations)
    phase: str = "offered"
    at: int = 0
    begins_s: float = 0.0
    ends_s: float = 0.0
    problem: str = ""
    """Why a press had no effect, or a step was broken off."""
    progress: list[Progress] = field(init=False)
    verdict: Verdict | None = field(init=False, default=None)
    tasks: int = field(init=False, default=0)
    judging: SessionPlan | None = field(init=False, default=None)
    """The plan of the last task."""

    def __post_init__(self) -> None:
        kinds = self.pace.seconds
        self.progress = [Progress(step) for step in self.plan.steps if step.kind in kinds]

    @property
    def is_open(self) -> bool:
        """Whether tracking waits for it."""
        return self.phase != "closed"

    def press(self, what: str, now_s: float, missing: Sequence[str] = ()) -> list[Order]:
        """What a person asked for.

        Args:
            what: one of `PRESSES`.
            now_s: the session's time.
            missing: units that are not heard.
        """
        self.problem = ""
        if what == "leave":
            self.phase = "closed"
            return []
        if what == "open":
            self.phase = "offered" if self.phase == "closed" else self.phase
            return []
        if what == "swap":
            return self._exchange()
        if what == "back":
            return self._back()
        if what == "skip":
            return self._skip() if self.phase in ("ready", "countdown") else []
        return self._go(now_s, missing)

    def tick(self, now_s: float, missing: Sequence[str] = (), heard_s: float = np.inf) -> list[Order]:
        """What the passing of time brings; called often.

        Args:
            now_s: the session's time.
            missing: units that are not heard.
            heard_s: all readings up to this time have come.
        """
        if self.phase in ("countdown", "running") and missing:
            self.phase = "ready"
            self.problem = f"{_listed(missing)} fell silent. Check battery and radio, then do the step again."
        if self.phase == "countdown" and now_s >= self.begins_s:
            self.phase = "running"
        late_s = now_s - self.ends_s
        has_all = late_s >= self.pace.settle_s and heard_s >= self.ends_s + PAD_S
        if self.phase == "running" and (has_all or late_s >= self.pace.patience_s):
            return self._cut()
        return []

    def judged(self, verdict: Verdict) -> list[Order]:
        """What is said of the steps so far; a verdict on older readings is ignored."""
        if verdict.number != self.tasks or self.phase != "checking":
            return []
        self.verdict = verdict
        for one in self.progress:
            if one.step.name in verdict.steps and one.span_s is not None:
                one.outcome, one.sentence = verdict.steps[one.step.name]
        if self.progress[self.at].outcome == REDO:
            self.phase = "ready"
            return []
        return self._next()

    def told(self) -> dict[str, Any]:
        """The state as the page has it, `guide` of messages.schema.json."""
        verdict = self.verdict
        is_counting = self.phase in ("countdown", "running")
        return {
            "type": "guide",
            "phase": self.phase,
            "at": self.at,
            "begins_s": round(self.begins_s, 3) if is_counting else None,
            "ends_s": round(self.ends_s, 3) if is_counting else None,
            "problem": self.problem,
            "doubts": list(verdict.doubts) if verdict is not None and self.phase == "doubtful" else [],
            "exchanged": list(verdict.exchanged) if verdict is not None else [],
            "steps": [{"outcome": one.outcome, "sentence": one.sentence} for one in self.progress],
        }

    # --- presses -----------------------------------------------------------------------------------

    def _go(self, now_s: float, missing: Sequence[str]) -> list[Order]:
        if self.phase == "offered":
            self._begin()
            return [Send("stop")]
        if self.phase == "ready":
            return self._count_down(now_s, missing)
        if self.phase == "countdown":
            self._run(now_s)
        elif self.phase == "running" and self.begins_s + LEAST_RUN_S <= now_s < self.ends_s:
            self.ends_s = now_s
        elif self.phase == "doubtful":
            return self._calibrate()
        elif self.phase == "calibrated":
            self.phase = "closed"
            return [Send("track")]
        return []

    def _begin(self) -> None:
        """From the first step, with nothing done."""
        for one in self.progress:
            one.span_s, one.outcome, one.sentence = None, "", ""
        self.phase, self.at, self.verdict = "ready", 0, None

    def _count_down(self, now_s: float, missing: Sequence[str]) -> list[Order]:
        if missing:
            self.problem = (
                f"Not heard: {_listed(missing)}. Switch on, or exchange the unit, then press again."
            )
            return []
        self.phase = "countdown"
        self._run(now_s + self.pace.countdown_s)
        return [Listen()]

    def _run(self, begins_s: float) -> None:
        self.begins_s = begins_s
        self.ends_s = begins_s + self.pace.seconds[self.progress[self.at].step.kind]

    def _back(self) -> list[Order]:
        if self.phase in ("countdown", "running", "checking"):
            self.phase = "ready"
        elif self.phase in ("ready", "doubtful", "calibrated"):
            self.at = max(0, self.at - (self.phase == "ready"))
            self.phase = "ready"
        return []

    def _skip(self) -> list[Order]:
        one = self.progress[self.at]
        was_done, one.span_s = one.span_s is not None, None
        one.outcome, one.sentence = SKIPPED, ""
        withdrawn = {"name": one.step.name, "begin_s": None, "end_s": None}
        orders: list[Order] = [Send("step", withdrawn)] if was_done else []
        return [*orders, *self._next()]

    def _exchange(self) -> list[Order]:
        """Two units take each other's place; what was measured before is of the wrong units."""
        pair = () if self.verdict is None else self.verdict.exchanged
        if len(pair) != 2 or self.phase not in ("ready", "doubtful"):
            return []
        withdrawn: list[Order] = [
            Send("step", {"name": one.step.name, "begin_s": None, "end_s": None})
            for one in self.progress
            if one.span_s is not None
        ]
        self._begin()
        return [Swap((pair[0], pair[1])), *withdrawn]

    # --- the course ---------------------------------------------------------------------------------

    def _cut(self) -> list[Order]:
        one = self.progress[self.at]
        one.span_s = (round(self.begins_s, 3), round(self.ends_s, 3))
        keys = {"name": one.step.name, "begin_s": one.span_s[0], "end_s": one.span_s[1]}
        return [Send("step", keys), Cut(one.step.name, one.span_s), self._judge()]

    def _judge(self) -> CheckSteps:
        self.phase, self.tasks, self.judging = "checking", self.tasks + 1, self._done()
        return CheckSteps(self.tasks, self.judging)

    def _done(self) -> SessionPlan:
        spans = {one.step.name: one.span_s for one in self.progress if one.span_s is not None}
        return timed(self.plan, spans)

    def _next(self) -> list[Order]:
        """To the first step that is to be done again, else the first that is not done, else to the end."""
        again = [k for k, one in enumerate(self.progress) if one.outcome == REDO]
        left = [k for k, one in enumerate(self.progress) if not one.is_settled]
        if again or left:
            self.at, self.phase = (again or left)[0], "ready"
            return []
        if all(one.span_s is None for one in self.progress) or self.verdict is None:
            self.problem, self.phase = "Nothing was measured: do at least one step.", "ready"
            return []
        if self.judging != self._done():
            return [self._judge()]
        self.phase = "doubtful"
        return self._calibrate() if self.verdict.passed else []

    def _calibrate(self) -> list[Order]:
        assert self.verdict is not None
        self.phase = "calibrated"
        return [Send("calibrate", {"toml": self.verdict.calibration})]


def timed(plan: SessionPlan, spans: Mapping[str, tuple[float, float]]) -> SessionPlan:
    """The steps of a plan that have times, with these."""
    steps = [
        replace(step, start_s=spans[step.name][0], end_s=spans[step.name][1])
        for step in plan.steps
        if step.name in spans
    ]
    return replace(plan, steps=tuple(steps))


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)
