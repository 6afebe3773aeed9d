"""Which way units face, from the ranges of joints: signs of sagittal turns for `calibrate_sagittal`.

Between a unit and the one above it lie joints that turn about the lateral axis, with limits. Of the two signs of each
unit, those are taken with which the joints stay inside their limits: a minimum over the tree of units, pair by pair.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from oarlock.calibration.session.body import BodyKinematics
from oarlock.storage.arrays import Floats

Turns = Mapping[str, tuple[Floats, Floats]]

LATERAL = 0.8
"""Smallest cosine between a joint's axis and the lateral one."""
BALL_RANGE_RAD = (-1.0, 3.0)
"""Flexion of shoulder and hip: 60 deg backwards, 170 deg forwards (Norkin and White 2016)."""
NOMINAL = 1e-4
"""Cost of the opposite of the nominal mount, rad2: it decides where the limits do not."""
SIGNS = (1, -1)
TIMES, LEAST_RAD2 = 4.0, 0.003
"""A sign is sure if the other one takes joints beyond their limits by twice as much (RMS), and by 3 deg at least."""


@dataclass(frozen=True)
class _UnitPair:
    """A unit and the one above it.

    Args:
        above: the nearest unit above of those whose turns are known; None is a root at rest.
        beyond_rad2: (sign of the unit above, own sign) -> mean square of what the joints between turn beyond their
            limits; the sign of a root at rest is 0.
    """

    above: str | None
    beyond_rad2: Mapping[tuple[int, int], float]


def facing(body: BodyKinematics, q: Floats, turns: Turns) -> tuple[dict[str, int], set[str]]:
    """Whether each unit's turn about its axis is that about the lateral axis (+1) or its opposite (-1).

    Args:
        body: links of the units, and the limits.
        q: (n,) the posture at angle 0.
        turns: unit -> its times (T,) s and angles (T,) rad about its axis.

    Returns:
        The signs, and the units that could as well face the other way, alone or with all units below them.
    """
    links = {name: _link(body, q, turns, name) for name in turns}
    signs: dict[str, int] = {}
    for root in (name for name, link in links.items() if link.above is None):
        signs |= _best(links, root, 0)[1]
    best, unsure = _cost(links, signs), set()
    for name in turns:
        below = {n for n in turns if n == name or body.turns_with[name] < body.turns_with[n]}
        for turned in ({name}, below):
            other = {n: -sign if n in turned else sign for n, sign in signs.items()}
            if _cost(links, other) < TIMES * best + LEAST_RAD2:
                unsure |= turned
    return signs, unsure


def _best(links: Mapping[str, _UnitPair], name: str, above: int) -> tuple[float, dict[str, int]]:
    """The least cost of a unit with all units below it, for a sign of the unit above, and their signs."""
    found = []
    for own in SIGNS:
        cost, signs = links[name].beyond_rad2[above, own] + NOMINAL * (own < 0), {name: own}
        for child in (n for n, link in links.items() if link.above == name):
            below, chosen = _best(links, child, own)
            cost, signs = cost + below, signs | chosen
        found.append((cost, signs))
    return min(found, key=lambda option: option[0])


def _cost(links: Mapping[str, _UnitPair], signs: Mapping[str, int]) -> float:
    above = {name: 0 if link.above is None else signs[link.above] for name, link in links.items()}
    return sum(link.beyond_rad2[above[name], signs[name]] for name, link in links.items())


def _link(body: BodyKinematics, q: Floats, turns: Turns, name: str) -> _UnitPair:
    above = body.unit_above(name, turns)
    time_s, angle = turns[name]
    carried = np.zeros(len(time_s)) if above is None else np.interp(time_s, *turns[above])
    low, high = _range(body, q, name, frozenset() if above is None else body.turns_with[above])
    beyond = {}
    for parent, own in product((0,) if above is None else SIGNS, SIGNS):
        relative = own * angle - parent * carried
        off = np.maximum(0.0, np.maximum(low - relative, relative - high))
        beyond[parent, own] = float((off**2).mean())
    return _UnitPair(above, beyond)


def _range(body: BodyKinematics, q: Floats, name: str, above: frozenset[str]) -> tuple[float, float]:
    """How far a unit may turn about the lateral axis against the unit above it, rad from the posture."""
    right = np.cross(body.forward, body.up)
    low = high = 0.0
    for joint in body.model.describe().joints:
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
