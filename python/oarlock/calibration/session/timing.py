"""Locates the steps of a session plan in a recording, from intervals of rest and movement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from oarlock.calibration.session.body import BodyKinematics
from oarlock.calibration.session.plan import SessionPlan, SessionStep
from oarlock.calibration.session.posture_match import of_another_posture
from oarlock.calibration.session.unit_rows import Span, UnitRows, common, joined

if TYPE_CHECKING:
    from oarlock.storage.arrays import Floats

LEAST_STILL_S = 1.0
LEAST_MOVE_S = 2.0
ROOM_S = 0.5
"""A movement is taken with so much of the rest before it: there its posture is known."""
EDGE_S = 0.3
"""A person comes to rest, and starts, slowly: so much of each end is no rest yet."""
QUIET_BREAK_S = 0.8
"""People pause at the ends of a movement; a shorter rest does not end it."""
MISSED, OPTIONAL_MISSED = -20.0, 2.0
"""Score of a step that was not found. An optional one is taken if a movement is clearly its own."""
UNMOVED = -6.0
SKIPPED = 0.2
"""Steps follow one another: what lies between two of them costs a little."""

NEVER = -1e6
Segment = tuple[str, float, float]


def located(plan: SessionPlan, body: BodyKinematics, units: Mapping[str, UnitRows]) -> dict[str, Span]:
    """Step -> (start, end) s. Steps that name their times keep them; those that are not found are left out.

    The others are sought: stillness of all units for postures, what lies between for movements. Among all ways to lay
    the steps over the segments, in order or in any order as the plan says, the best has long segments, and movements
    that turn their own units.
    """
    placed = {s.name: span for s in plan.steps if (span := s.span_s) is not None}
    sought = [s for s in plan.steps if s.span_s is None and s.kind in ("still", "pose", "move")]
    segments = segments_of(units) if sought else []
    scores = np.array([[_score(step, seg, body, units) for seg in segments] for step in sought])
    lay = _assigned if plan.any_order else _laid
    scores = scores.reshape(len(sought), len(segments))
    missed = np.array([OPTIONAL_MISSED if step.optional else MISSED for step in sought])
    found = lay(scores, missed)
    if plan.any_order:
        found = lay(_in_posture(scores, found, sought, segments, body, units), missed)
    for step, index in zip(sought, found, strict=True):
        if index is not None:
            _, start, end = segments[index]
            placed[step.name] = (start - ROOM_S, end) if step.kind == "move" else (start, end)
    return placed | _turns(plan, placed, units)


def _in_posture(
    scores: Floats,
    found: Sequence[int | None],
    sought: Sequence[SessionStep],
    segments: Sequence[Segment],
    body: BodyKinematics,
    units: Mapping[str, UnitRows],
) -> Floats:
    """The scores without rests in which gravity shows another posture than that of the step."""
    known = [
        (step, (segments[index][1] - ROOM_S, segments[index][1]))
        for step, index in zip(sought, found, strict=True)
        if step.kind == "move" and index is not None
    ]
    kept = scores.copy()
    for row, step in enumerate(sought):
        for column, (_, start, end) in enumerate(segments):
            possible = step.kind == "pose" and np.isfinite(scores[row, column])
            if possible and of_another_posture(step, (start, end), known, body, units):
                kept[row, column] = -np.inf
    return kept


def _turns(plan: SessionPlan, placed: Mapping[str, Span], units: Mapping[str, UnitRows]) -> dict[str, Span]:
    """Turning units is a to and fro of rests and movements: all that lies between its neighbours."""
    found = {}
    for k, step in enumerate(plan.steps):
        if step.kind == "turn" and step.name not in placed:
            before = [placed[s.name][1] for s in plan.steps[:k] if s.name in placed]
            after = [placed[s.name][0] for s in plan.steps[k + 1 :] if s.name in placed]
            start = max(before, default=min(float(u.time_s[0]) for u in units.values()))
            end = min(after, default=max(float(u.time_s[-1]) for u in units.values()))
            if end - start >= LEAST_MOVE_S:
                found[step.name] = (start, end)
    return found


def segments_of(units: Mapping[str, UnitRows]) -> list[Segment]:
    """Still and moving stretches of the whole, in order of time."""
    start = max(u.time_s[0] for u in units.values())
    end = min(u.time_s[-1] for u in units.values())
    stills = joined(common([u.still(worn=True) for u in units.values()]), gap_s=0.3)
    stills = [s for s in stills if s[1] - s[0] >= QUIET_BREAK_S]
    segments: list[Segment] = []
    before = float(start)
    for first, last in stills:
        if first - before > 0.3:
            segments.append(("moving", before, first))
        segments.append(("still", first, last))
        before = last
    if end - before > 0.3:
        segments.append(("moving", before, float(end)))
    return segments


def _score(step: SessionStep, segment: Segment, body: BodyKinematics, units: Mapping[str, UnitRows]) -> float:
    kind, start, end = segment
    length = end - start
    if step.kind in ("still", "pose"):
        return float(np.log(length)) if kind == "still" and length >= LEAST_STILL_S else -np.inf
    if kind != "moving" or length < LEAST_MOVE_S:
        return -np.inf
    moved = _moved(units, (start, end))
    own = {u for joint in step.joints for u in body.below(joint)}
    below = {u for u in body.units for j in step.joints if set(body.joints[j]) <= set(body.turns_with[u])}
    still = [moved[u] for u in units if u not in below]
    active = min((moved[u] for u in own if u in moved), default=0.0)
    if not own or active < 0.2:
        return UNMOVED
    share = active / (active + max(still, default=0.0))
    return float(np.log(length) + 6.0 * share + _swings(own, units, (start, end)))


def _moved(units: Mapping[str, UnitRows], span_s: Span) -> dict[str, float]:
    """Root mean square of each unit's turning, rad/s."""
    return {
        name: float(np.sqrt((u.gyro[u.rows(span_s)] ** 2).sum(axis=1).mean())) + 1e-9
        for name, u in units.items()
        if len(u.gyro[u.rows(span_s)])
    }


def _swings(names: set[str], units: Mapping[str, UnitRows], span_s: Span) -> float:
    """2 for units that turn to and fro about one axis, 0 for a turn to one side, as on the way to a posture."""
    shares = []
    for name in names & set(units):
        gyro: Floats = units[name].gyro[units[name].rows(span_s)]
        shares.append(1.0 - float(np.linalg.norm(gyro.sum(axis=0)) / np.linalg.norm(gyro, axis=1).sum()))
    return 2.0 * min(shares, default=0.0)


def _assigned(scores: Floats, missed: Floats) -> list[int | None]:
    """The best way to give each step (rows) a segment (columns) of its own in any order; a step may be missed."""
    steps, segments = scores.shape
    own_column = np.where(np.eye(steps, dtype=bool), missed, -np.inf)
    worth = np.nan_to_num(np.hstack([scores, own_column]), neginf=NEVER)
    _, columns = linear_sum_assignment(worth, maximize=True)
    return [int(column) if column < segments else None for column in columns]


def _laid(scores: Floats, missed: Floats) -> list[int | None]:
    """The best way to give steps (rows) segments (columns) in order; a step may be missed."""
    steps, segments = scores.shape
    best = np.full((steps + 1, segments + 1), -np.inf)
    best[0] = 0.0
    choice = np.zeros((steps + 1, segments + 1), dtype=int)
    for i in range(1, steps + 1):
        for j in range(segments + 1):
            options = [best[i - 1, j] + missed[i - 1]]
            options.append(best[i, j - 1] - (SKIPPED if i < steps else 0.0) if j else -np.inf)
            options.append(best[i - 1, j - 1] + scores[i - 1, j - 1] if j else -np.inf)
            choice[i, j] = int(np.argmax(options))
            best[i, j] = options[choice[i, j]]
    found: list[int | None] = [None] * steps
    i, j = steps, segments
    while i:
        if choice[i, j] == 2:
            found[i - 1] = j - 1
            i, j = i - 1, j - 1
        elif choice[i, j] == 1:
            j -= 1
        else:
            i -= 1
    return found


def stills_of(unit: UnitRows, plan: SessionPlan, spans: Mapping[str, Span]) -> list[tuple[Span, bool]]:
    """Where one unit rests: (stretch, whether it is worn then). Without the middle of movements."""
    found: list[tuple[Span, bool]] = []
    for step in plan.steps:
        if step.name in spans and step.kind in ("still", "turn", "pose"):
            worn = step.kind == "pose"
            edge = EDGE_S if worn else 0.0
            own = [(a + edge, b - edge) for a, b in unit.still(worn, spans[step.name])]
            found += [(s, worn) for s in own if s[1] - s[0] >= LEAST_STILL_S]
    return found
