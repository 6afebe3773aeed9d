"""Bands of the questions to a season over several seeds: how often they contain the truth, and false changes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from oarlock.season import Database
from oarlock.season.questions import answer
from oarlock_lab.synthetic_season import BASES, Synthetic, SyntheticAthlete
from season_answers import answered

pytestmark = pytest.mark.long


def _inside(row: Mapping[str, float], true: float) -> bool:
    return row["low"] <= true <= row["high"]


@pytest.mark.parametrize("sessions", [12, 36])
def test_bands_contain_the_truth_and_unchanged_athletes_are_not_named(tmp_path: Path, sessions: int) -> None:
    changes: list[bool] = []
    drifts: list[bool] = []
    false_alarms = missed = 0
    for seed in (31, 32, 33):
        season, current, squad = answered(
            tmp_path / str(seed), Synthetic(40 * sessions, 40, seed=seed, strokes=36)
        )
        named: dict[str, SyntheticAthlete] = {one.athlete.pseudonym: one for one in squad}
        with Database(season, tables=current) as database:
            for metric in BASES:
                for row in answer(database, "changes", metric).to_pylist():
                    one = named[row["athlete"]]
                    if metric in one.rig_step:
                        continue
                    true = one.drift.get(metric, 0.0)
                    changes.append(_inside(row, true))
                    false_alarms += row["changed"] and true == 0.0
                    missed += not row["changed"] and true != 0.0
                for row in answer(database, "drift", metric).to_pylist():
                    true = named[row["athlete"]].fatigue.get(metric, 0.0) * 2.0 / 3.0
                    drifts.append(_inside(row, true))
                    false_alarms += row["changed"] and true == 0.0
    # 95 %, within three standard deviations of a binomial count; bands of few sessions may be wider
    slack = 3.0 * np.sqrt(0.95 * 0.05 / len(changes))
    assert 0.95 - slack < np.mean(changes) < 0.95 + slack
    assert 0.95 - slack < np.mean(drifts) < 0.985
    assert false_alarms <= 0.003 * (len(changes) + len(drifts))  # 0.001 is what the band promises
    if sessions == 36:
        assert missed == 0
