"""Cost of faults in a study: the error with each fault relative to that of the same seed without it."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from oarlock.evaluation.study.rows import null_if_nan, scores_of, write_rows
from oarlock.evaluation.study.run import Row
from oarlock.evaluation.study.spec import Study
from oarlock.evaluation.study.sweeps import NO_FAULT, USUAL_SETTING, FaultSweep
from oarlock.storage.arrays import Floats
from oarlock.storage.write_file import write_file

LOST_DEG = 30.0
"""Mean error above which a run counts as lost, like a run that ended early."""
NOTICED_DEG, NOTICED_SHARE = 0.01, 0.1
"""An increase below both (in deg; as a share of the error without a fault) is within the variation of the seeds."""


@dataclass(frozen=True, eq=False)
class Dose:
    """One fault at one strength under one setting; (S,) over the seeds.

    Args:
        fault: the fault; None for the run without a fault.
        index: index of the strength.
        setting: the filter setting.
        error_deg: mean RMSE of the angles; infinite where the run failed.
        clean_deg: the same without the fault.
        place_mm: mean RMSE of the scored positions; NaN where none are scored or the run failed.
        clean_place_mm: the same without the fault.
        coverage: share of the angles inside their 95 % bands; NaN where the run failed.
        place_coverage: the same of single axes of the scored positions; NaN without scored positions.
    """

    fault: FaultSweep | None
    index: int
    setting: str
    error_deg: Floats
    clean_deg: Floats
    place_mm: Floats
    clean_place_mm: Floats
    coverage: Floats
    place_coverage: Floats

    @property
    def label(self) -> str:
        """The strength with its unit."""
        return self.fault.label(self.index) if self.fault else ""

    @property
    def median_deg(self) -> float:
        """Median over all seeds; infinite if half of them failed."""
        return float(np.median(self.error_deg))

    @property
    def range_deg(self) -> tuple[float, float]:
        """Best and worst seed."""
        return float(self.error_deg.min()), float(self.error_deg.max())

    @property
    def cost_deg(self) -> float:
        """Median over the seeds of the increase by the fault."""
        with np.errstate(invalid="ignore"):
            return float(np.median(np.nan_to_num(self.error_deg - self.clean_deg, nan=math.inf)))

    @property
    def place_cost_mm(self) -> float:
        """The same for the scored positions; NaN without scored positions."""
        return middle(self.place_mm - self.clean_place_mm)

    @property
    def lost(self) -> int:
        """Number of seeds that failed or were lost."""
        return int(np.sum(self.error_deg > LOST_DEG))

    @property
    def noticed(self) -> bool:
        """Whether the fault has a measurable effect."""
        return self.lost > 0 or self.cost_deg > max(
            NOTICED_DEG, NOTICED_SHARE * float(np.median(self.clean_deg))
        )

    def row(self) -> dict[str, Any]:
        """One row of a table."""
        least, greatest = self.range_deg
        fault = self.fault
        return {
            "fault": fault.name if fault else NO_FAULT,
            "key": fault.key if fault else "",
            "strength": self.label,
            "usual": bool(fault and self.index == fault.usual_index),
            "setting": self.setting,
            "seeds": len(self.error_deg),
            "lost": self.lost,
            "rmse_median_deg": self.median_deg,
            "rmse_least_deg": least,
            "rmse_greatest_deg": greatest,
            "cost_median_deg": self.cost_deg,
            "position_median_mm": middle(self.place_mm),
            "position_cost_median_mm": self.place_cost_mm,
            "coverage_95_median": middle(self.coverage),
            "position_coverage_95_median": middle(self.place_coverage),
        }


def doses(study: Study, rows: Sequence[Row]) -> tuple[Dose, ...]:
    """Every fault at every strength under every setting, in the order of the study."""
    errors = np.nan_to_num(scores_of(study, rows), nan=math.inf)
    coverage = scores_of(study, rows, score="coverage_95")
    place, place_coverage = (_of_places(study, rows, score) for score in ("rmse", "coverage_95"))
    faults = {fault.name: fault for fault in study.faults}
    found, clean, before = list[Dose](), 0, ("", 0)
    for scenario in study.expanded():
        name, setting = str(scenario.swept["fault"]), str(scenario.swept["setting"])
        before = (name, before[1] + 1 if before[0] == name else 0)
        here = scenario.index
        if name == NO_FAULT:
            clean = here
        found.append(
            Dose(
                fault=faults.get(name),
                index=before[1],
                setting=setting,
                error_deg=errors[here],
                clean_deg=errors[clean],
                place_mm=place[here],
                clean_place_mm=place[clean],
                coverage=coverage[here],
                place_coverage=place_coverage[here],
            )
        )
    return tuple(found)


def _of_places(study: Study, rows: Sequence[Row], score: str) -> Floats:
    """Mean of a score over the scored positions, (scenarios, seeds)."""
    places = np.array([scores_of(study, rows, frame, score, "frame") for frame in study.frames])
    return (
        places.mean(axis=0) if len(places) else np.full((len(study.expanded()), len(study.seeds)), math.nan)
    )


def ranked(found: Sequence[Dose]) -> list[FaultSweep]:
    """Faults by the increase at their typical strength in the first setting, the largest first."""
    setting = found[0].setting if found else USUAL_SETTING
    usual = [d for d in found if d.fault and d.setting == setting and d.index == d.fault.usual_index]
    usual.sort(key=lambda dose: -dose.cost_deg)
    return [dose.fault for dose in usual if dose.fault]


def middle(values: Floats) -> float:
    """Median of the finite values; NaN without any."""
    there = values[np.isfinite(values)]
    return float(np.median(there)) if len(there) else math.nan


def save_costs(study: Study, rows: Sequence[Row], folder: Path) -> None:
    """Write the increases as faults.csv, faults.parquet and faults.json; lost runs have no number."""
    costs = [dose.row() for dose in doses(study, rows)]
    write_rows(costs, folder / "faults")
    plain = [{name: null_if_nan(value) for name, value in row.items()} for row in costs]
    write_file(folder / "faults.json", json.dumps(plain, indent=1) + "\n")
