"""`exchanged_units`: which units of a session sit in each other's place. For guided starts, when a step has failed.

A unit in another's place turns in the wrong movements, or gravity and axes in it contradict each other however it is
mounted: right and left are mirror images.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from oarlock.calibration.session.body import BodyKinematics
from oarlock.calibration.session.mounts import LEAST_SWEPT_RAD, MountSearch
from oarlock.calibration.session.plan import SessionPlan
from oarlock.calibration.session.unit_rows import UnitRows
from oarlock.calibration.session.wahba import solved_mount
from oarlock.recording.inertial_units import chosen_units
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.storage.arrays import Floats

CLEAR = 20.0
"""The exchange must lower the sum of squared residuals, in variances, by so much: two clear contradictions."""
MOST_OFF_STDS = 5.0
STAYS = 4.0
"""Cost of each unit in another's place, so that no more are named than must be."""
WRONG_TURN = 16.0
"""Cost of a unit that rests while its link turns, or turns while its link rests."""
TURNS, RESTS = 0.5, 0.25
"""Shares of the largest turn from which on a unit takes part, and below which it rests."""


def exchanged_units(model: Model, recording: Recording, plan: SessionPlan) -> tuple[str, ...]:
    """The units that sit in each other's place; empty if none do, or if that is not clear.

    Args:
        model: the body.
        recording: readings of the steps.
        plan: steps with their times.
    """
    names = chosen_units(model, recording, None, "session")
    units = {name: UnitRows.of(s) for name in names if isinstance(s := recording[name], ImuStream)}
    nominal = {s.name: np.asarray(s.mount.rotation) for s in model.describe().inertial_units}
    spans = {step.name: span for step in plan.steps if (span := step.span_s) is not None}
    search = MountSearch(BodyKinematics.of(model, names), plan, spans, units, nominal)
    costs = _contradictions(search) + _wrong_turns(search) + STAYS * (1.0 - np.eye(len(names)))
    from scipy.optimize import linear_sum_assignment  # the live page imports this module, and needs no scipy

    rows, columns = linear_sum_assignment(costs)
    if np.trace(costs) - costs[rows, columns].sum() < CLEAR:
        return ()
    return tuple(name for name, column in zip(names, columns, strict=True) if names[column] != name)


def _contradictions(search: MountSearch) -> Floats:
    """(unit, link): squared residuals of the best mount of a unit on a link."""
    found = np.zeros((len(search.units), len(search.units)))
    for i, unit in enumerate(search.units.values()):
        for j, link in enumerate(search.units):
            sights = search.sights(replace(unit, name=link))
            if sights:
                offs = solved_mount(sights, search.nominal[link]).off_stds
                found[i, j] = float((np.minimum(offs, MOST_OFF_STDS) ** 2).sum())
    return found


def _wrong_turns(search: MountSearch) -> Floats:
    """(unit, link): cost of turning in movements in which the link rests, and of resting where it turns."""
    body, found = search.body, np.zeros((len(search.units), len(search.units)))
    for step in (s for s in search.plan.steps if s.kind == "move" and s.name in search.spans):
        turned = _turned_rad(search.units, search.spans[step.name])
        most = max(turned.values(), default=0.0)
        if most < LEAST_SWEPT_RAD:
            continue
        moving = {c for joint in step.joints for c in body.joints[joint]}
        nearest = {unit for joint in step.joints for unit in search.turned(step, joint)}
        for i, unit in enumerate(search.units):
            for j, link in enumerate(search.units):
                share = turned[unit] / most
                rests = link in nearest and share < RESTS
                turns = not moving & body.turns_with[link] and share > TURNS
                found[i, j] += WRONG_TURN * (rests or turns)
    return found


def _turned_rad(units: Mapping[str, UnitRows], span_s: tuple[float, float]) -> dict[str, float]:
    """How far each unit turned in total, rad."""
    found = {}
    for name, unit in units.items():
        rows = unit.rows(span_s)
        rates = np.linalg.norm(unit.gyro[rows] - np.median(unit.gyro[rows], axis=0), axis=1)
        found[name] = float(np.trapezoid(rates, unit.time_s[rows])) if len(rates) > 1 else 0.0
    return found
