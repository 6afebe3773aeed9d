"""Checks of a session's mounts, postures and movements, each with a sentence for its page."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from oarlock.calibration.session.body import BodyKinematics
from oarlock.calibration.session.checks import KEPT, PASSED, REDO, Check, within
from oarlock.calibration.session.mounts import LEAST_PURITY, LEAST_SWEPT_RAD, MOUNT_LIMIT_RAD, Mounts
from oarlock.calibration.session.plan import SessionPlan
from oarlock.calibration.session.timing import EDGE_S
from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.model.rotation import quat_from_matrix, rotvec_from_quat
from oarlock.storage.arrays import Floats

REST_LIMIT_RAD_S = 0.25
"""Scatter of a gyroscope in a posture: a person sways by a fifth of it, and moves by four times as much."""
LEAST_ROWS = 4
OFF_LIMIT_STDS = 2.0
OFF_LIMIT_RAD = float(np.radians(10.0))
NORTH_LIMIT_RAD = float(np.radians(12.0))


def mount_checks(
    found: Mounts, plan: SessionPlan, body: BodyKinematics, nominal: Mapping[str, Floats]
) -> list[Check]:
    """Movements first, then postures, mounts, and north as a test."""
    return [
        *_movements(found, plan, body),
        *_postures(found, plan),
        *(_mount(name, found, nominal[name]) for name in found.solved),
        *_norths(found),
    ]


def rest_checks(plan: SessionPlan, spans: Mapping[str, Span], units: Mapping[str, UnitRows]) -> list[Check]:
    """Postures at given times in which a unit did not rest."""
    checks = []
    for step in plan.steps:
        if step.kind == "pose" and step.name in spans:
            restless = [name for name, unit in units.items() if not _rests(unit, spans[step.name])]
            sentence = f"{', '.join(restless)} did not rest: hold still for three seconds and do it again."
            if restless:
                checks.append(Check(step.name, "", "posture", "-", np.nan, np.nan, "", REDO, sentence))
    return checks


def _rests(unit: UnitRows, span_s: Span) -> bool:
    gyro = unit.gyro[unit.rows((span_s[0] + EDGE_S, span_s[1] - EDGE_S))]
    return len(gyro) >= LEAST_ROWS and float(gyro.std(axis=0).max()) < REST_LIMIT_RAD_S


def _movements(found: Mounts, plan: SessionPlan, body: BodyKinematics) -> list[Check]:
    checks = []
    for (step, unit), one in found.moved.items():
        if one is None:
            sentence = "The gyroscope was silent in it, or it is too short: do it again."
            checks.append(Check(step, unit, "movement", "-", np.nan, np.nan, "", REDO, sentence))
            continue
        text = f"{np.degrees(one.swept_rad):.0f} deg, {100 * one.purity:.0f} % about one axis"
        std = float(np.degrees(one.std_rad))
        if one.swept_rad < LEAST_SWEPT_RAD:
            sentence, outcome = "It was too small: move through the whole range and do it again.", REDO
        elif one.purity < LEAST_PURITY:
            sentence, outcome = (
                "It was not about one axis: hold the other joints still and do it again.",
                REDO,
            )
        else:
            sentence, outcome = "It was a clear turn about one axis.", PASSED
        checks.append(Check(step, unit, "movement", text, std, np.nan, "deg", outcome, sentence))
    missing = [(s.name, j) for s in plan.steps if s.kind == "move" for j in s.joints if not body.below(j)]
    for step, joint in missing:
        sentence = (
            f"No unit is distal to the joint {joint}, so this movement has no effect on the calibration."
        )
        checks.append(Check(step, joint, "movement", "-", np.nan, np.nan, "", KEPT, sentence))
    return checks


def _postures(found: Mounts, plan: SessionPlan) -> list[Check]:
    """Each posture against all other steps: the unit whose link is furthest from where the plan has it."""
    checks = []
    for step in plan.steps:
        offs = [
            (off, stds, unit)
            for unit, solved in found.solved.items()
            for sight, off, stds in zip(found.sights[unit], solved.off_rad, solved.off_stds, strict=True)
            if sight.step == step.name and sight.kind == "up" and step.kind == "pose"
        ]
        if not offs:
            continue
        off, _, unit = max(offs)
        wrong = [u for o, s, u in offs if o > OFF_LIMIT_RAD and s > OFF_LIMIT_STDS]
        text, limit = f"at most {np.degrees(off):.1f} deg off, {unit}", float(np.degrees(OFF_LIMIT_RAD))
        if wrong:
            sentence = (
                f"{', '.join(wrong)} disagree{'s' if len(wrong) == 1 else ''} with the other steps: the posture "
                "differed, or a unit slipped. Do it again, with care for that limb."
            )
            checks.append(Check(step.name, "", "posture", text, np.nan, limit, "deg", REDO, sentence))
        else:
            sentence = "Held still, and it agrees with the other steps."
            checks.append(Check(step.name, "", "posture", text, np.nan, limit, "deg", PASSED, sentence))
    return checks


def _mount(name: str, found: Mounts, nominal: Floats) -> Check:
    solved = found.solved[name]
    std, limit = float(np.degrees(solved.worst_std_rad)), float(np.degrees(MOUNT_LIMIT_RAD))
    turned = np.linalg.norm(rotvec_from_quat(quat_from_matrix(solved.link_from_sensor @ nominal.T)))
    text = f"turned by {np.degrees(turned):.0f} deg from the model's"
    kinds = [s.kind for s in found.sights[name]]
    seen = f"{kinds.count('up')} postures and {kinds.count('axis')} axes"
    outcome = within(std, limit)
    if name in found.by_north:
        seen += ", and by magnetic north"
    if outcome == PASSED:
        sentence = f"Determined by {seen}."
    elif std > 30.0:
        sentence = (
            f"{seen} do not determine one rotation: add a movement about another axis, or another posture."
        )
    else:
        sentence = (
            f"{seen} determine it with a large uncertainty: repeat the steps, with care for the postures."
        )
    return Check("mounts", name, "mount", text, std, limit, "deg", outcome, sentence)


def _norths(found: Mounts) -> list[Check]:
    """Whether the units agree on north once they are mounted so: a test of all mounts, magnetometers and postures."""
    turns = [np.exp(1j * np.array(list(n.values()))).mean() for n in found.norths_rad.values()]
    if len(turns) < 2:
        return []
    middle = np.angle(np.mean([t / abs(t) for t in turns]))
    checks = []
    for name, turn in zip(found.norths_rad, turns, strict=True):
        off = float(np.degrees(np.angle(turn * np.exp(-1j * middle))))
        good = abs(off) <= np.degrees(NORTH_LIMIT_RAD)
        sentence = (
            "Its magnetic north agrees with that of the other units."
            if good
            else "Its magnetic north differs from that of the other units: check for iron near it, and its mount."
        )
        outcome = PASSED if good else REDO
        limit = float(np.degrees(NORTH_LIMIT_RAD))
        checks.append(
            Check("north", name, "north", f"{off:+.1f} deg", np.nan, limit, "deg", outcome, sentence)
        )
    return checks
