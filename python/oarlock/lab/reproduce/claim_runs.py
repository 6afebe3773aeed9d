"""The studies for the claims of section 5 of the paper, one for each question."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from oarlock import load_model
from oarlock.evaluation.study.pool import rows_of_studies
from oarlock.lab.reproduce.contents import Floats, Row, finite_mean
from oarlock.lab.reproduce.estimators import ELEVEN, ESTIMATORS
from oarlock.lab.reproduce.field_trials import POINTS
from oarlock.rowing.simulation import paper
from oarlock.rowing.simulation.simulators import SIMULATORS
from oarlock.storage.progress import Told
from oarlock.studies import Study, StudyResult

PLAIN = {e.key: e.values for e in ESTIMATORS}
SIDES_OFF = {"no back": ["back"], "no upper arms": ["r_upperarm", "l_upperarm"]}
SIDES_OFF |= {"no forearms": ["r_forearm", "l_forearm"], "no seat": ["seat"]}
SIDES_OFF |= {"no oars": ["r_oar_phi", "r_oar_alpha", "l_oar_phi", "l_oar_alpha"]}
HULL = {"usual, 0.3/1.5/0.5 deg": (0.3, 1.5, 0.5), "the bounds, 1/5/5 deg": (1.0, 5.0, 5.0)}
ABOARD = {"hull unit": ["waist"], "waist unit": ["hull"], "neither": ["hull", "waist"]}
RATES_HZ = (25.0, 50.0, 100.0, 125.0, 250.0)
BIASES = (0.0, 0.001, 0.01, 0.05)


@dataclass(frozen=True)
class ClaimStudies:
    """Results of the studies, by question."""

    results: Mapping[str, StudyResult] = field(default_factory=dict)

    def error(self, study: str, item: str | None = None, score: str = "rmse", **values: object) -> float:
        """Mean of one score over the seeds, in the scenario with these values, for the eleven angles or one item."""
        return finite_mean(self.over_seeds(study, item, score, **values))

    def over_seeds(
        self, study: str, item: str | None = None, score: str = "rmse", **values: object
    ) -> Floats:
        """The same for each seed."""
        result = self.results[study]
        wanted = {key.replace("__", "."): value for key, value in values.items()}
        name = wanted.pop("name", None)
        for scenario in result.study.expanded():
            named = name is None or scenario.name == name or scenario.name.startswith(f"{name}, ")
            if named and all(scenario.swept.get(key) == value for key, value in wanted.items()):
                found: Floats = result.scores(score=score) if item is None else result.scores(item, score)
                return np.asarray(found[scenario.index], dtype=np.float64)
        raise KeyError(f"{study}: no scenario {values}")

    @property
    def rows(self) -> list[Row]:
        """The summaries of all studies in one table; keys that a study lacks are empty."""
        return [{"study": name, **row} for name, result in self.results.items() for row in result.summary()]


def studies(seeds: Sequence[int], duration_s: float) -> dict[str, Study]:
    """The studies by name."""
    sculler, boat = load_model("sculler"), load_model("sculler_boat")
    fixed: dict[str, object] = {"duration_s": duration_s, "rate_spm": [20, 34]}

    def of(
        scenarios: Mapping[str, Mapping[str, object]], grid: Mapping[str, Sequence[object]], **more: object
    ) -> Study:
        return Study(
            sculler,
            SIMULATORS["sculling"],
            seeds,
            fixed={**fixed, **more},
            scenarios=scenarios,
            grid=grid,
            joints=ELEVEN,
        )

    turning = {
        name: dict(zip(("hull_pitch_deg", "hull_roll_deg", "hull_yaw_deg"), angles, strict=True))
        for name, angles in {"level": (0.0, 0.0, 0.0), **HULL}.items()
    }
    aboard = {
        f"{name}, {unit}": {**angles, "without": gone}
        for name, angles in turning.items()
        for unit, gone in ABOARD.items()
    }
    sets: dict[str, dict[str, object]] = {
        "all": {},
        "no magnetometers": {"without_quantity": ["mag_ut"]},
        "no closure": {"config.closures": False},
        **{name: {"without": gone} for name, gone in SIDES_OFF.items()},
    }
    filters = {key: PLAIN[key] for key in ("eq6", "jerk_closure", "tree", "shipped")}
    return {
        "conditions": of(filters, {"condition": list(paper.CONDITIONS)}),
        "biases": of(
            {key: PLAIN[key] for key in ("jerk_closure", "tree")},
            {"gyro_bias_rad_s": BIASES},
            accel_bias_m_s2=0.01,
        ),
        "rates": of({}, {"rate_hz": RATES_HZ}),
        "sensors": of(sets, {}),
        "hull unmodelled": of(turning, {}),
        "hull": Study(boat, SIMULATORS["sculling"], seeds, fixed=fixed, scenarios=aboard, joints=ELEVEN),
        "field": Study(
            sculler,
            SIMULATORS["field"],
            seeds,
            fixed={**fixed, "condition": "S-B"},
            scenarios={"closure": {}, "no closure": {"config.closures": False}},
            frames=POINTS,
        ),
    }


def asked(
    seeds: Sequence[int],
    duration_s: float,
    jobs: int | None,
    progress: Told | None,
    runs: Path | None = None,
) -> ClaimStudies:
    """Runs all studies; `runs` is a folder for finished runs."""
    wanted = studies(seeds, duration_s)
    rows = rows_of_studies(tuple(wanted.values()), jobs, runs, progress)
    return ClaimStudies(
        {name: StudyResult(wanted[name], tuple(own)) for name, own in zip(wanted, rows, strict=True)}
    )
