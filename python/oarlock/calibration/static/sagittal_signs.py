"""Which way units face, from the ranges of joints: signs of sagittal turns for `calibrate_sagittal`.

Between a unit and the one above it lie joints that turn about the lateral axis, with limits. Of the two signs of each
unit, those are taken with which the joints stay inside their limits: a minimum over the tree of units, pair by pair.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from oarlock.calibration.session.body import Body
from oarlock.storage.array_gate import FloatArray

if TYPE_CHECKING:
    from oarlock._core import Model

Turns = Mapping[str, tuple[FloatArray, FloatArray]]

LATERAL = 0.8
"""Smallest cosine between a joint's axis and the lateral one."""
BALL_RANGE_RAD = (-1.0, 3.0)
"""Flexion of shoulder and hip: 60 deg backwards, 170 deg forwards (Norkin and White 2016)."""
NOMINAL = 1e-4
"""Cost of the opposite of the nominal mount, rad2: it decides where the limits do not."""
SIGNS = (1, -1)
TIMES, LEAST_RAD2 = 4.0, 0.003
"""A sign is sure if the other one takes joints beyond their limits by twice as much (RMS), and by 3 deg at least."""


def flexion_signs(model: Model, body: Body, q: FloatArray, turns: Turns) -> dict[str, int]:
    """+1 or -1 for each unit: whether its turn about its axis is that about the lateral axis, or its opposite.

    Args:
        model: with the limits.
        body: links of the units.
        q: (n,) the posture at angle 0.
        turns: unit -> its times (T,) s and angles (T,) rad about its axis.
    """
    parents = {name: _above(body, name, turns) for name in turns}
    below = {name: [n for n, parent in parents.items() if parent == name] for name in turns}
    costs: dict[str, dict[int, float]] = {}
    choice: dict[tuple[str, int], dict[str, int]] = {}

    def solve(name: str) -> None:
        costs[name] = {}
        for child in below[name]:
            solve(child)
        for sign in SIGNS:
            chosen, cost = {}, NOMINAL * (sign < 0)
            for child in below[name]:
                options = {
                    s: costs[child][s] + _beyond(model, body, q, turns, (name, sign), (child, s))
                    for s in SIGNS
                }
                chosen[child] = min(options, key=lambda s: (options[s], -s))
                cost += options[chosen[child]]
            costs[name][sign], choice[name, sign] = cost, chosen

    found: dict[str, int] = {}

    def take(name: str, sign: int) -> None:
        found[name] = sign
        for child, own in choice[name, sign].items():
            take(child, own)

    for root in (name for name, parent in parents.items() if parent is None):
        solve(root)
        alone = {s: costs[root][s] + _beyond(model, body, q, turns, None, (root, s)) for s in SIGNS}
        take(root, min(alone, key=lambda s: (alone[s], -s)))
    return found


def _above(body: Body, name: str, turns: Turns) -> str | None:
    """The nearest unit above, of those whose turns are known."""
    above = [u for u in turns if u != name and body.turns_with[u] < body.turns_with[name]]
    return max(above, key=lambda u: len(body.turns_with[u]), default=None)


def _beyond(
    model: Model,
    body: Body,
    q: FloatArray,
    turns: Turns,
    parent: tuple[str, int] | None,
    child: tuple[str, int],
) -> float:
    """Mean square of what the joints between two units turn beyond their limits, rad2; no parent is one at rest."""
    name, sign = child
    time_s, angle = turns[name]
    relative = sign * angle
    above: frozenset[str] = frozenset()
    if parent is not None:
        other_s, other = turns[parent[0]]
        relative = relative - parent[1] * np.interp(time_s, other_s, other)
        above = body.turns_with[parent[0]]
    low, high = _range(model, body, q, name, above)
    beyond = np.maximum(0.0, np.maximum(low - relative, relative - high))
    return float((beyond**2).mean())


def _range(model: Model, body: Body, q: FloatArray, name: str, above: frozenset[str]) -> tuple[float, float]:
    """How far a unit may turn about the lateral axis against the unit above it, rad from the posture."""
    right = np.cross(body.forward, body.up)
    low = high = 0.0
    for joint in model.describe().joints:
        own = set(joint.coordinates) & body.turns_with[name] - above
        if not own:
            continue
        if joint.kind == "free":
            return -np.inf, np.inf
        if joint.kind == "ball":
            low, high = low + BALL_RANGE_RAD[0], high + BALL_RANGE_RAD[1]
        elif joint.kind == "hinge":
            axis, _ = body.axis_in_link(joint.name, None, name, q)
            along = float(body.root_from_link(name, q) @ axis @ right)
            if abs(along) >= LATERAL:
                ends = [limit - float(np.ravel(joint.rest)[0]) for limit in joint.limits]
                low, high = (low + ends[0], high + ends[1]) if along > 0 else (low - ends[1], high - ends[0])
    return low, high


def unsure_signs(model: Model, body: Body, q: FloatArray, turns: Turns, signs: Mapping[str, int]) -> set[str]:
    """Units that could as well face the other way, alone or with all units below them: their joints allow both."""

    def cost(chosen: Mapping[str, int]) -> float:
        pairs = [(name, _above(body, name, turns)) for name in turns]
        return sum(
            _beyond(
                model, body, q, turns, None if above is None else (above, chosen[above]), (name, chosen[name])
            )
            for name, above in pairs
        )

    best, unsure = cost(signs), set()
    for name in turns:
        below = {n for n in turns if n == name or body.turns_with[name] < body.turns_with[n]}
        for turned in ({name}, below):
            other = {n: -sign if n in turned else sign for n, sign in signs.items()}
            if cost(other) < TIMES * best + LEAST_RAD2:
                unsure |= turned
    return unsure
