"""The athletes of a synthetic season, each with the truth that its strokes are drawn from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi
from types import MappingProxyType

import numpy as np

from oarlock.season.athletes import PSEUDONYM_LENGTH, PSEUDONYM_LETTERS, Athlete

_DEG = pi / 180.0
REFERENCE_RATE = 20.0


@dataclass(frozen=True)
class Spread:
    """How a number of a stroke varies; all in its own unit.

    Args:
        mean: of all athletes at `REFERENCE_RATE`.
        athletes: standard deviation between athletes.
        per_rate: change with the stroke rate, per 1/min.
        sessions: standard deviation between sessions of one athlete.
        strokes: standard deviation between strokes of a session at `REFERENCE_RATE`.
        measured: standard deviation of the measurement, of a usual stroke and session.
    """

    mean: float
    athletes: float
    per_rate: float
    sessions: float
    strokes: float
    measured: float


BASES: Mapping[str, Spread] = MappingProxyType(
    {
        "catch_angle_rad": Spread(-62.0 * _DEG, 3.0 * _DEG, 0.25 * _DEG, 0.8 * _DEG, 1.2 * _DEG, 0.6 * _DEG),
        "finish_angle_rad": Spread(41.0 * _DEG, 2.0 * _DEG, -0.05 * _DEG, 0.6 * _DEG, 0.9 * _DEG, 0.6 * _DEG),
        "seat_travel_m": Spread(0.55, 0.03, -0.001, 0.006, 0.010, 0.004),
        "legs_share": Spread(0.45, 0.03, -0.001, 0.008, 0.02, 0.01),
        "catch_lean_rad": Spread(-26.0 * _DEG, 3.0 * _DEG, 0.1 * _DEG, 1.0 * _DEG, 1.5 * _DEG, 1.2 * _DEG),
        "finish_lean_rad": Spread(27.0 * _DEG, 3.0 * _DEG, -0.1 * _DEG, 1.0 * _DEG, 1.5 * _DEG, 1.2 * _DEG),
        "catch_factor_s": Spread(-0.012, 0.008, 0.0005, 0.003, 0.008, 0.003),
        "handle_peak_speed_m_s": Spread(1.9, 0.1, 0.03, 0.04, 0.05, 0.02),
    }
)
"""Numbers that are drawn; others follow from them."""


@dataclass(frozen=True)
class SyntheticAthlete:
    """One athlete with its truth, in the units of the columns.

    Args:
        athlete: what the season stores of it.
        boat: its boat; all in one boat train together.
        seat: from the bow.
        means: of each of `BASES` at `REFERENCE_RATE`, at the beginning of the season.
        sides: right minus left oar.
        drift: change a month over the whole season.
        fatigue: change from the first stroke to the last of each session.
        late_s: catch relative to the crew, s.
        late_drift_s: its change a month.
        rig_step: change with the second rig of the boat; empty if the rig stays.
    """

    athlete: Athlete
    boat: str
    seat: str
    means: Mapping[str, float]
    sides: Mapping[str, float]
    drift: Mapping[str, float] = field(default_factory=dict)
    fatigue: Mapping[str, float] = field(default_factory=dict)
    late_s: float = 0.0
    late_drift_s: float = 0.0
    rig_step: Mapping[str, float] = field(default_factory=dict)


def synthetic_squad(seed: int, athletes: int) -> list[SyntheticAthlete]:
    """The athletes of a seed.

    Every sixth drifts in catch angle and every seventh in catch factor; every fourth tires; every third boat gets
    another rig; every ninth of a crew is later at the catch each month.
    """
    seats = _boats(athletes)
    return [_one(seed, index, boat, seat) for index, (boat, seat) in enumerate(seats)]


def _boats(athletes: int) -> Sequence[tuple[str, str]]:
    """Boat and seat of each athlete: a third in singles, the others in doubles and quads."""
    rest = athletes - -(-athletes // 3)
    quads = rest // 8
    doubles = (rest - 4 * quads) // 2
    sizes = [1] * (athletes - 4 * quads - 2 * doubles) + [2] * doubles + [4] * quads
    return [
        (f"{size}x {number}", str(seat + 1))
        for number, size in enumerate(sizes, start=1)
        for seat in range(size)
    ]


def _one(seed: int, index: int, boat: str, seat: str) -> SyntheticAthlete:
    rng = np.random.default_rng([seed, 1, index])
    letters = rng.choice(list(PSEUDONYM_LETTERS), PSEUDONYM_LENGTH - 1)
    crew, number = boat.startswith(("2", "4")), int(boat.partition(" ")[2])
    body = {"stature_m": round(rng.normal(1.85, 0.07), 2), "mass_kg": round(rng.normal(80.0, 7.0), 1)}
    consent = {"coaching": "2025-10-01"} | ({"research": "2025-10-01"} if index % 4 != 3 else {})
    athlete = Athlete("S" + "".join(letters), body, consent, guardian=index % 15 == 0)
    means = {name: rng.normal(base.mean, base.athletes) for name, base in BASES.items()}
    sides = {name: rng.normal(0.0, 1.5 * _DEG) for name in ("catch_angle_rad", "finish_angle_rad")}
    late_s = rng.normal(0.0, 0.015) if crew else 0.0
    return SyntheticAthlete(
        athlete,
        boat,
        seat,
        means,
        sides,
        drift=({"catch_angle_rad": 0.25 * _DEG} if index % 6 == 2 else {})
        | ({"catch_factor_s": 0.002} if index % 7 == 3 else {}),
        fatigue={"catch_angle_rad": 1.2 * _DEG} if index % 4 == 1 else {},
        late_s=late_s,
        late_drift_s=0.004 if crew and index % 9 == 5 else 0.0,
        rig_step={"catch_angle_rad": 2.0 * _DEG} if number % 3 == 0 else {},
    )
