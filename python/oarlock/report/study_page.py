"""The page of `oarlock lab study`: errors over the varied settings, and the results of every scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from oarlock.evaluation.study.result import StudyResult
from oarlock.evaluation.study.run import MEAN
from oarlock.report import chart
from oarlock.report.fault_page import fault_page, last_sections
from oarlock.report.markup import grid, table
from oarlock.report.page import shell
from oarlock.report.text import DASH, breakable, fixed, number, percent, plural

MOST_LINES = 6
MOST_INTERVALS = 60
MOST_SMALL = 24


def study_page(result: StudyResult) -> str:
    """The whole page as text; works offline, on paper and on a telephone."""
    study = result.study
    if study.faults:
        return fault_page(result)
    summary = result.summary()
    sections = [("scenarios", "Scenarios", _scenarios(result, summary))]
    # keys with several numbers become axes
    if numeric := [
        key for key, values in study.grid.items() if len(values) > 1 and all(map(_is_number, values))
    ]:
        sections.append(("curves", "Error over the varied settings", _charts(summary, numeric)))
    sections += [("intervals", "All scenarios", _intervals(summary)), *last_sections(result)]
    about = f"<p>{escape(study.about)}</p>" if study.about else ""
    return shell(study.title, f'<div class="lead">{about}<p>{_sentence(result)}</p></div>', sections)


def _sentence(result: StudyResult) -> str:
    study = result.study
    count, seeds = len(study.expanded()), len(study.seeds)
    failed = f"; {plural(len(result.failures), 'run')} failed" if result.failures else ""
    return (
        f"{plural(count, 'scenario')} with {plural(seeds, 'seed')} each, {plural(study.run_count, 'run')}{failed}. "
        "Every scenario has the same seeds, so that differences come from the scenario."
    )


def _of_mean(summary: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    return [row for row in summary if row["kind"] == "mean"]


def _scenarios(result: StudyResult, summary: Sequence[Mapping[str, Any]]) -> str:
    found = {row["scenario"]: row for row in _of_mean(summary)}
    rows = []
    for scenario in result.study.expanded():
        row = found.get(scenario.index)
        if row is None:
            rows.append([escape(scenario.name), *[DASH] * 7])
            continue
        rows.append(
            [
                escape(scenario.name),
                number(row["rmse_mean"]),
                number(row["rmse_sd"]),
                f"{number(row['rmse_low_95'])} to {number(row['rmse_high_95'])}",
                number(row["rmse_worst"]),
                percent(row["coverage_95_mean"]),
                fixed(row["nees_mean"], 2),
                f"{row['seeds']}" + (f" ({row['failed']} failed)" if row["failed"] else ""),
            ]
        )
    return table(
        "scenarios",
        f"{MEAN[0].upper()}{MEAN[1:]}, RMSE in deg over the seeds; the interval is Student's t interval of the mean. "
        "In the 95 % band: share of samples; NEES per state is 1 for a consistent filter.",
        ["scenario", "mean deg", "SD", "95 % interval", "worst seed", "in 95 % band", "NEES", "seeds"],
        rows,
    )


# --- against a number ---------------------------------------------------------------------------------


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _charts(summary: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> str:
    blocks = []
    for key in keys:
        main = _of_mean(summary)
        drawn = [_chart(f"{key}-all", main, key, MEAN, "deg")]
        items = list(
            dict.fromkeys((r["item"], r["unit"]) for r in summary if r["kind"] in ("joint", "frame"))
        )
        if len(items) <= MOST_SMALL * 2:
            for k, (item, unit) in enumerate(items[:MOST_SMALL]):
                rows = [row for row in summary if row["item"] == item and row["unit"] == unit]
                drawn.append(_chart(f"{key}-{k}", rows, key, item, unit))
        blocks.append(f"<h3>{breakable(key)}</h3>{grid(drawn)}")
    hint = '<p class="hint">Mean over seeds; tinted: its 95 % interval. Lines are named below the first drawing.</p>'
    return hint + "".join(blocks)


def _chart(key: str, rows: Sequence[Mapping[str, Any]], axis: str, item: str, unit: str) -> str:
    lines: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        parts = str(row["name"]).split(", ")
        label = ", ".join(part for part in parts if not part.startswith(f"{axis} "))
        lines.setdefault(label, []).append(row)
    series = []
    for label, own in list(lines.items())[:MOST_LINES]:
        own = sorted(own, key=lambda row: float(row[axis]))
        x, y, low, high = (
            np.array([row[name] for row in own], dtype=np.float64)
            for name in (axis, "rmse_mean", "rmse_low_95", "rmse_high_95")
        )
        band = np.isfinite(low).all() and np.isfinite(high).all()
        series.append(chart.Series(label, x, y, low if band else None, high if band else None))
    left = len(lines) - len(series)
    caption = item + (f" (of {len(lines)} lines the first {MOST_LINES})" if left else "")
    safe = "".join(letter if letter.isalnum() else "-" for letter in key)
    return chart.line_chart(series, f"chart-{safe}", caption, axis, f"RMSE {unit}", named=item == MEAN)


def _intervals(summary: Sequence[Mapping[str, Any]]) -> str:
    drawn = []
    items = list(dict.fromkeys((r["kind"], r["item"], r["unit"]) for r in summary if r["kind"] != "sensor"))
    items.sort(key=lambda item: ("mean", "joint", "frame").index(item[0]))
    for k, (kind, item, unit) in enumerate(items):
        if kind == "frame" and "." in item:
            continue
        rows = [
            (str(row["name"]), row["rmse_mean"], row["rmse_low_95"], row["rmse_high_95"])
            for row in summary
            if (row["kind"], row["item"]) == (kind, item)
        ]
        drawn.append(chart.interval_chart(rows[:MOST_INTERVALS], f"intervals-{k}", item, unit))
    more = max((sum(r["item"] == MEAN for r in summary) - MOST_INTERVALS, 0))
    hint = (
        f'<p class="hint">The first {MOST_INTERVALS} scenarios; the table contains all.</p>' if more else ""
    )
    rest = f"<details><summary>Each joint and frame</summary>{grid(drawn[1:])}</details>"
    return hint + grid(drawn[:1]) + (rest if len(drawn) > 1 else "")
