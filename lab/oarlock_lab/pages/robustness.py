"""The section of docs/robustness.md: the error that each fault causes.

The rows of finished groups stay in `out/`, so that a run that was stopped goes on where it was.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import oarlock
from oarlock.evaluation.study.costs import Dose, middle
from oarlock.evaluation.study.result import StudyResult
from oarlock.evaluation.study.sweeps import NO_FAULT
from oarlock.report.fault_page import by_fault, fault_picture, findings, usual_row
from oarlock.report.study_page import study_page
from oarlock.report.text import number, percent
from oarlock.rowing import SIMULATORS

from .record import ROOT, Record, made_text
from .sculling import HANDS
from .sections import table

OUT = Path("out")
STUDY, PAGE, PICTURE = "robustness", "docs/robustness.md", "docs/pictures/robustness.svg"
HEAD = ("fault", "error of the angles in deg at each strength")
REFERENCE_DOSES = (
    "adds, deg (worst seed)",
    "in band",
    "hands, deg",
    "hands in band",
    "wrists add, mm",
    "wrists in band",
)
ON_PAGE = (*HEAD, REFERENCE_DOSES[0], "in band")
"""Columns of the page; the record has all."""
FINDINGS_ON_PAGE = ("Without a fault", "No gate:", "No learning:", "No closed loops:")
"""The table shows the others: it is sorted by the error."""


def measured(seeds: Sequence[int] | None = None, jobs: int | None = None) -> dict[str, Any]:
    """Runs the study, saves it with its page, draws the picture, and gives the table's cells."""
    study = oarlock.studies.load_study(STUDY, SIMULATORS, seeds)
    began, out = time.perf_counter(), OUT / STUDY
    result = oarlock.studies.run_study(study, jobs=jobs, folder=out)
    minutes = (time.perf_counter() - began) / 60.0
    result.save(out)
    (out / "report.html").write_text(study_page(result), encoding="utf-8")
    (ROOT / PICTURE).write_text(fault_picture(result), encoding="utf-8")
    how = {"runs": study.run_count, "seeds": list(study.seeds), "minutes": minutes, "cores": os.cpu_count()}
    return {"study": STUDY, **how, **cells(result)}


def cells(result: StudyResult) -> dict[str, Any]:
    """The findings, and a row for each fault: error at each strength, and more at the usual one."""
    clean, curves = by_fault(result)
    first, *others = clean
    rows = []
    for name, by_setting in curves.items():
        reference, *rest = usual_row(by_setting).values()
        steps = " · ".join(_step(dose, reference) for dose in by_setting[first])
        hands = _hands(result, reference)
        rows.append(
            [name, steps, *_reference_row(reference, hands), *(_degrees(dose.median_deg) for dose in rest)]
        )
    none = clean[first]
    steps = _degrees(none.median_deg)
    calm = [
        "no fault",
        steps,
        *_reference_row(none, _hands(result, none)),
        *(_degrees(clean[n].median_deg) for n in others),
    ]
    return {
        "findings": [list(pair) for pair in findings(clean, curves)],
        "columns": [*HEAD, *REFERENCE_DOSES, *others],
        "rows": [calm, *rows],
    }


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The section of the page."""
    words = "\n".join(f"- **{head}** {text}" for head, text in record["findings"] if head in FINDINGS_ON_PAGE)
    how = (
        f"{made_text(record)}. Study `{record['study']}`: {record['runs']} runs, seeds "
        f"{', '.join(map(str, record['seeds']))}; the last go took {record['minutes']:.0f} minutes on "
        f"{record['cores']} cores."
    )
    columns = [record["columns"].index(column) for column in ON_PAGE]
    rows = [[_short(row[i]) for i in columns] for row in record["rows"] if row[0] != NO_FAULT]
    text = table(ON_PAGE, rows)
    return {PAGE: {"figures": f"{how}\n\n{words}\n\n{text}"}}


def _short(cell: str) -> str:
    """Strengths separated by commas; those of the field simulator as multiples of its preset."""
    return cell.replace(" · ", ", ").replace(" x careful:", "x:")


def _hands(result: StudyResult, dose: Dose) -> tuple[float, float]:
    """Error of the hands' angles, deg, and the coverage of their bands: means over them, medians over the seeds."""
    own = {"fault": dose.fault.name if dose.fault else NO_FAULT, "setting": dose.setting}
    same = [s.index for s in result.study.expanded() if own.items() <= dict(s.swept).items()]
    scenario = same[dose.index if dose.fault else 0]
    errors = []
    for score in ("rmse", "coverage_95"):
        of_hands = np.array([result.scores(name, score, "joint")[scenario] for name in HANDS])
        errors.append(middle(of_hands.mean(axis=0)))
    return errors[0], errors[1]


def _step(dose: Dose, reference: Dose) -> str:
    text = f"{dose.label}: {_degrees(dose.median_deg)}"
    text += f" ({dose.lost} of {len(dose.error_deg)} lost)" if dose.lost else ""
    return f"**{text}**" if dose.index == reference.index else text


def _reference_row(dose: Dose, hands: tuple[float, float]) -> list[str]:
    adds = "–"
    if dose.fault is not None:
        worst = _degrees(float((dose.error_deg - dose.clean_deg).max()))
        adds = f"{_degrees(dose.cost_deg) if dose.noticed else 'nothing'} ({worst})"
    place = number(max(dose.place_cost_mm, 0.0), 2) if math.isfinite(dose.place_cost_mm) else "lost"
    return [
        adds,
        _share(middle(dose.coverage)),
        _degrees(hands[0]),
        _share(hands[1]),
        place,
        _share(middle(dose.place_coverage)),
    ]


def _share(value: float) -> str:
    return percent(value) if math.isfinite(value) else "lost"


def _degrees(value: float) -> str:
    return number(round(value, 3), 2) if math.isfinite(value) else "lost"
