"""Which recordings a synthetic season has: whose, when, in which boat and rig, and which of them failed."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.season.synthetic.squad import SyntheticAthlete

BEGIN = datetime.datetime(2025, 11, 1, tzinfo=datetime.UTC)
DAYS = 365
MONTH_DAYS = DAYS / 12.0
_RIGS = ("spread 1.59", "spread 1.61")
_RIG_CHANGE = 0.6
"""Share of the season after which some boats have their second rig."""
_FAILED = 0.008
_LAST_CLASS = 0.75
"""Share of the season after which a second class of runs begins, if there is one."""


@dataclass(frozen=True)
class Planned:
    """One recording.

    Args:
        index: its number.
        member: its athlete's number.
        outing: number of the outing, which all in the boat have in common.
        start: its first sample, UTC.
        rig: of the boat on that day.
        later: whether the boat has its second rig.
        calibrated: whether its run has a calibration.
        failed: whether its run failed.
    """

    index: int
    member: int
    outing: int
    start: datetime.datetime
    rig: str
    later: bool
    calibrated: bool
    failed: bool

    @property
    def months(self) -> float:
        """Time since the beginning of the season."""
        return (self.start - BEGIN).total_seconds() / 86_400.0 / MONTH_DAYS


def plan(seed: int, squad: Sequence[SyntheticAthlete], recordings: int, classes: int = 1) -> list[Planned]:
    """All recordings of a season.

    Args:
        seed: of the season.
        squad: its athletes.
        recordings: how many.
        classes: 2 for runs of which the later ones have a calibration, so that they are not comparable.
    """
    boats = list(dict.fromkeys(one.boat for one in squad))
    rounds = -(-recordings // len(squad))
    rng = np.random.default_rng([seed, 2])
    hours = rng.integers(6, 18, (rounds, len(boats)))
    minutes = rng.integers(0, 60, (rounds, len(boats)))
    failed = rng.uniform(size=recordings) < _FAILED
    found = []
    for index in range(recordings):
        turn, member = divmod(index, len(squad))
        boat = boats.index(squad[member].boat)
        share = turn / rounds
        clock = datetime.timedelta(
            days=int(share * DAYS), hours=int(hours[turn, boat]), minutes=int(minutes[turn, boat])
        )
        later = bool(squad[member].rig_step) and share >= _RIG_CHANGE
        found.append(
            Planned(
                index,
                member,
                turn * len(boats) + boat,
                BEGIN + clock,
                _RIGS[later],
                later,
                classes > 1 and share >= _LAST_CLASS,
                bool(failed[index]),
            )
        )
    return found
