"""The page of a fault study for `oarlock lab study`: ranking, each fault from weak to strong, all numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from oarlock.evaluation.study.costs import LOST_DEG, Dose, doses, middle, ranked
from oarlock.evaluation.study.result import StudyResult
from oarlock.report import fault_charts as charts
from oarlock.report.fault_words import Curves, findings
from oarlock.report.markup import grid, rendered, table
from oarlock.report.page import shell
from oarlock.report.study_sections import failures, settings_section
from oarlock.report.text import breakable, number, percent, plural

COLUMNS = 3
"""Number of charts into which a ranking is divided, so that they fit side by side."""
FEWEST = 8
"""Rows of such a chart, if there are so many."""


def fault_page(result: StudyResult) -> str:
    """The whole page as text; works offline, on paper and on a telephone."""
    study = result.study
    clean, curves = by_fault(result)
    scale = charts.Scale(doses(result.study, result.rows))
    legend = charts.legend(list(clean), len(study.seeds))
    sections = [
        ("ranking", "Largest errors", _ranking(clean, curves, scale, legend)),
        ("faults", "From weak to strong", _multiples(curves, scale, legend)),
        ("numbers", "All numbers", _numbers(clean, curves)),
    ]
    if result.complaints:
        sections.append(("failures", "What failed", failures(result)))
    sections.append(("settings", "What was run", settings_section(result)))
    lead = rendered(
        "findings",
        about=study.about,
        runs=plural(study.run_count, "run"),
        findings=findings(clean, curves),
    )
    return shell(study.title, lead, sections)


def by_fault(result: StudyResult) -> tuple[dict[str, Dose], Curves]:
    """Results without a fault, by setting; and strengths by fault and setting, the most harmful fault first."""
    found = doses(result.study, result.rows)
    clean = {dose.setting: dose for dose in found if dose.fault is None}
    curves: dict[str, dict[str, list[Dose]]] = {fault.name: {} for fault in ranked(found)}
    for dose in found:
        if dose.fault is not None:
            curves[dose.fault.name].setdefault(dose.setting, []).append(dose)
    return clean, curves


def usual_row(own: Mapping[str, Sequence[Dose]]) -> dict[str, Dose]:
    """The typical strength of a fault, by setting."""
    return {setting: row[row[0].fault.usual_index] for setting, row in own.items() if row[0].fault}


def _ranking(clean: Mapping[str, Dose], curves: Curves, scale: charts.Scale, legend: str) -> str:
    rows = [usual_row(own) for own in curves.values()]
    size = max(-(-len(rows) // COLUMNS), FEWEST)
    drawn = [
        charts.ranking(
            rows[first : first + size],
            scale,
            f"ranking-{first}",
            f"Ranks {first + 1} to {min(first + size, len(rows))}",
            next(iter(clean.values())).median_deg,
        )
        for first in range(0, len(rows), size)
    ]
    hint = (
        '<p class="hint">Each fault at its typical strength, the most harmful first: mean RMSE of '
        "the angles, deg, on the same logarithmic axis in all drawings; median over the seeds, and range from the best "
        "seed to the worst. On the right: the increase over the error of the same seed without the fault.</p>"
    )
    return f"{hint}{legend}{grid(drawn)}"


def _multiples(curves: Curves, scale: charts.Scale, legend: str) -> str:
    drawn = [
        charts.fault_chart(own[0].fault, by_setting, scale, f"fault-{k}")
        for k, by_setting in enumerate(curves.values())
        if (own := next(iter(by_setting.values()))) and own[0].fault
    ]
    hint = (
        '<p class="hint">Mean RMSE of the angles in deg over the strength of one fault; strengths are equally '
        "spaced, not to scale. The strip below: share of the angles inside their 95 % bands. A run is lost where it "
        f"ends early or the error is above {LOST_DEG:g} deg on average. Behind the name: the increase at the "
        "typical strength, of the angles and of the scored positions.</p>"
    )
    return f"{hint}{legend}{grid(drawn, 'tall')}"


def _numbers(clean: Mapping[str, Dose], curves: Curves) -> str:
    first, *others = clean
    head = ["fault", "strength", "deg", "range", "adds deg", "positions mm", "in 95 % band", "lost"]
    head += [f"{name}, deg" for name in others]
    rows = [_row("no fault", [clean[name] for name in clean])]
    for name, by_setting in curves.items():
        for same in zip(*by_setting.values(), strict=True):
            rows.append(_row(name, same))
    caption = (
        f"Setting {first} unless a column says otherwise; medians over the seeds. Tables with this page contain every "
        "setting in full: faults.csv, faults.parquet, faults.json."
    )
    return table("numbers", caption, head, rows)


def _row(name: str, same: Sequence[Dose]) -> list[str]:
    dose, *others = same
    least, greatest = dose.range_deg
    return [
        breakable(name),
        escape(dose.label),
        _degrees(dose.median_deg),
        f"{_degrees(least)} to {_degrees(greatest)}",
        "" if dose.fault is None else _degrees(dose.cost_deg),
        number(middle(dose.place_mm), 2),
        percent(middle(dose.coverage)),
        f"{dose.lost} of {len(dose.error_deg)}" if dose.lost else "",
        *(_degrees(other.median_deg) for other in others),
    ]


def _degrees(value: float) -> str:
    return number(value, 2) if np.isfinite(value) else "lost"
