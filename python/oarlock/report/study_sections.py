"""Sections of every study page: the settings, and the failed runs."""

from __future__ import annotations

from html import escape

from oarlock.evaluation.study.result import StudyResult
from oarlock.evaluation.study.spec import shown
from oarlock.report.markup import notes_list, table
from oarlock.report.text import breakable


def failures(result: StudyResult) -> str:
    """A list of the runs that failed, and why."""
    return notes_list(f"{row['name']}, seed {row['seed']}: {row['error']}" for row in result.complaints[:50])


def settings_section(result: StudyResult) -> str:
    """Varied keys with their values, model, simulator and seeds."""
    study = result.study
    keys = study.keys
    rows = []
    used = (key for scenario in study.expanded() for key in scenario.values)
    for key in dict.fromkeys([*study.fixed, *study.swept, *used]):
        values = [scenario.values[key] for scenario in study.expanded() if key in scenario.values]
        texts = list(dict.fromkeys(shown(value) for value in values))
        if not texts:
            continue
        about = keys[key].about if key in keys else ""
        rows.append([breakable(key), escape(", ".join(texts)), escape(about)])
    facts = [
        ["model", escape(study.model.name), ""],
        ["simulator", escape(repr(study.simulator)), ""],
        ["seeds", escape(", ".join(map(str, study.seeds))), ""],
        ["scored from", f"{study.start_s:g} s on", ""],
    ]
    tables = "<code>runs</code>, <code>summary</code>"
    return table(
        "settings",
        "Keys that were set; all others are at their defaults.",
        ["key", "values", ""],
        [*facts, *rows],
    ) + (
        f'<p class="hint">Tables beside this page, as CSV and Parquet: {tables}; run.toml contains the study.</p>'
    )
