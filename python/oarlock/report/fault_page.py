"""The page of a fault study for `oarlock lab study`, and its charts as one SVG file for pages that show only pictures.

The last sections of the page, failures and settings, are those of every study page.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape

import numpy as np

from oarlock.evaluation.study.costs import LOST_DEG, Dose, doses, middle, ranked
from oarlock.evaluation.study.result import StudyResult
from oarlock.evaluation.study.spec import shown
from oarlock.report import fault_charts as charts
from oarlock.report import markup, plot
from oarlock.report.fault_charts import cost_text
from oarlock.report.markup import grid, notes_list, rendered, table
from oarlock.report.page import shell
from oarlock.report.text import breakable, number, percent, plural

MOST_ERRORS, MOST_NAMED, EXAMPLES = 8, 12, 3
NOTABLE_RATIO = 1.5
"""A safeguard is mentioned if the error without it is larger or smaller by this factor."""

Curves = Mapping[str, Mapping[str, Sequence[Dose]]]
"""Strengths by fault and setting, the most harmful fault first."""


def findings(clean: Mapping[str, Dose], curves: Curves) -> list[tuple[str, str]]:
    """The summary: headings with their sentences."""
    first = next(iter(clean))
    own = [doses[first] for doses in curves.values()]
    usual = [dose for doses in own for dose in doses if dose.fault and dose.index == dose.fault.usual_index]
    broken = (next((dose for dose in doses if dose.lost), None) for doses in own)
    lost = [f"{_sentence(dose)} ({dose.lost} of {len(dose.error_deg)})" for dose in broken if dose]
    found = [
        ("Without a fault", _clean(clean[first])),
        (
            "Largest errors at typical strength:",
            _listed(
                [f"{_sentence(dose)} ({cost_text(dose)})" for dose in usual if dose.noticed], MOST_ERRORS
            ),
        ),
        ("No measurable effect:", _listed(_free(own), MOST_NAMED)),
        ("Track lost in at least one seed:", _listed(lost, MOST_NAMED) or "no fault."),
    ]
    found += [_setting(name, first, curves) for name in clean if name != first]
    return [(head, text) for head, text in found if text]


def _clean(dose: Dose) -> str:
    inside = middle(dose.coverage)
    least, greatest = dose.range_deg
    bands = f", and {percent(inside)} of them lie inside their 95 % bands" if math.isfinite(inside) else ""
    return (
        f"the error of the angles is {number(dose.median_deg, 2)} deg "
        f"({number(least, 2)} to {number(greatest, 2)} over the seeds){bands}."
    )


def _free(own: Sequence[Sequence[Dose]]) -> list[str]:
    """The largest strength of each fault without measurable effect."""
    quiet = [(doses, next((k for k, d in enumerate(doses) if d.noticed), len(doses))) for doses in own]
    return [_sentence(doses[count - 1]) for doses, count in reversed(quiet) if count]


def _setting(name: str, first: str, curves: Curves) -> tuple[str, str]:
    """The faults at which a setting differs most from the first one, in both directions."""
    pairs = [
        (other, usual)
        for doses in curves.values()
        for other, usual in zip(doses[name], doses[first], strict=True)
        if math.isfinite(usual.median_deg)
    ]
    texts = []
    for word, sign in (("worse", 1.0), ("better", -1.0)):
        if most := _most(pairs, sign):
            examples = []
            for other, usual in most:
                left = f"{number(other.median_deg, 2)} deg" if math.isfinite(other.median_deg) else "lost"
                examples.append(f"{_sentence(other)} ({left} instead of {number(usual.median_deg, 2)})")
            texts.append(f"{word} under {_listed(examples, EXAMPLES)}")
    text = " ".join(f"{t[0].upper()}{t[1:]}" if k else t for k, t in enumerate(texts))
    return f"{name[0].upper()}{name[1:]}:", text or "no relevant difference with any fault."


def _most(pairs: Sequence[tuple[Dose, Dose]], sign: float) -> list[tuple[Dose, Dose]]:
    """The pairs that differ most, one for each fault."""

    def ratio(pair: tuple[Dose, Dose]) -> float:
        other, usual = pair
        return sign * math.log(min(other.median_deg, 1e9) / max(usual.median_deg, 1e-9))

    found: dict[str, tuple[Dose, Dose]] = {}
    for pair in sorted(pairs, key=ratio, reverse=True):
        if ratio(pair) < math.log(NOTABLE_RATIO):
            break
        found.setdefault(pair[0].fault.name if pair[0].fault else "", pair)
    return list(found.values())[:EXAMPLES]


def _sentence(dose: Dose) -> str:
    return dose.fault.sentence(dose.index) if dose.fault else ""


def _listed(texts: Iterable[str], most: int) -> str:
    given = list(texts)
    more = f"; and {len(given) - most} more" if len(given) > most else ""
    return "; ".join(given[:most]) + more + "." if given else ""


COLUMNS = 3
"""Number of charts into which a ranking is divided, so that they fit side by side."""
FEWEST = 8
"""Rows of such a chart, if there are so many."""


def fault_page(result: StudyResult) -> str:
    """The whole page as text; works offline, on paper and on a telephone."""
    study = result.study
    clean, curves = by_fault(result)
    scale = charts.Scale(doses(result.study, result.rows))
    legend = markup.legend(charts.legend_entries(list(clean), len(study.seeds)))
    sections = [
        ("ranking", "Largest errors", _ranking(clean, curves, scale, legend)),
        ("faults", "From weak to strong", _multiples(curves, scale, legend)),
        ("numbers", "All numbers", _numbers(clean, curves)),
        *last_sections(result),
    ]
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


def last_sections(result: StudyResult) -> list[tuple[str, str, str]]:
    """The runs that failed, and why; the varied keys with their values, model, simulator and seeds."""
    failed = [f"{row['name']}, seed {row['seed']}: {row['error']}" for row in result.complaints[:50]]
    sections = [("failures", "What failed", notes_list(failed))] if failed else []
    return [*sections, ("settings", "What was run", _settings(result))]


def _settings(result: StudyResult) -> str:
    study = result.study
    rows = [
        ["model", escape(study.model.name), ""],
        ["simulator", escape(repr(study.simulator)), ""],
        ["seeds", escape(", ".join(map(str, study.seeds))), ""],
        ["scored from", f"{study.start_s:g} s on", ""],
    ]
    used = (key for scenario in study.expanded() for key in scenario.values)
    for key in dict.fromkeys([*study.fixed, *study.swept, *used]):
        values = [scenario.values[key] for scenario in study.expanded() if key in scenario.values]
        about = study.keys[key].about if key in study.keys else ""
        if values:
            texts = ", ".join(dict.fromkeys(map(shown, values)))
            rows.append([breakable(key), escape(texts), escape(about)])
    caption = "Keys that were set; all others are at their defaults."
    return table("settings", caption, ["key", "values", ""], rows) + (
        '<p class="hint">Tables beside this page, as CSV and Parquet: <code>runs</code>, <code>summary</code>; '
        "run.toml contains the study.</p>"
    )


PICTURE_COLUMNS = 4
TILE = (252.0, 214.0)
INSIDE = (36.0, 26.0, 208.0, 100.0)
MARGIN, HEAD = 10.0, 30.0
LETTER, SIGN = 5.6, 58.0
"""Approximate width of a letter of the legend, and of a symbol with its margin."""

_STYLE = """
text { font: 10.5px system-ui, "Segoe UI", "Liberation Sans", Arial, sans-serif; fill: #4a5562; }
.strip-name { font-weight: 650; font-size: 12px; fill: #16202b; }
.grid { stroke: #dde2e8; fill: none; } .tick { stroke: #566270; }
.clean { stroke: #566270; stroke-dasharray: 2 3; fill: none; }
.series { fill: none; stroke-width: 1.4; stroke-linejoin: round; } .series.s0 { stroke-width: 2.2; }
.series-band { fill-opacity: .18; } .seeds { stroke: #0072b2; stroke-width: 6; stroke-opacity: .25; }
.cross { fill: none; stroke-width: 1.8; }
.small { font-size: 9px; }
"""
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
_DASHES = ("", "8 2", "4 2", "9 2 2 2")


def fault_picture(result: StudyResult) -> str:
    """All faults from weak to strong, the most harmful first, as an SVG file on white."""
    clean, curves = by_fault(result)
    scale = charts.Scale(doses(result.study, result.rows))
    rows = -(-len(curves) // PICTURE_COLUMNS)
    size = (2 * MARGIN + PICTURE_COLUMNS * TILE[0], MARGIN + HEAD + rows * TILE[1])
    parts = [_legend(charts.legend_entries(list(clean), len(result.study.seeds)))]
    for k, by_setting in enumerate(curves.values()):
        own = next(iter(by_setting.values()))
        fault = own[0].fault
        if fault is None:
            continue
        x, y = MARGIN + (k % PICTURE_COLUMNS) * TILE[0], HEAD + (k // PICTURE_COLUMNS) * TILE[1]
        inside = charts.panel_of(fault, by_setting, scale, INSIDE)
        name = plot.label(INSIDE[0], 16.0, fault.name, "strip-name")
        parts.append(f'<g transform="translate({x:g} {y:g})">{name}{inside}</g>')
    title = escape(f"{result.study.title}: error of the angles in deg against the strength of each fault")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size[0]:g} {size[1]:g}" width="{size[0]:g}" '
        f'height="{size[1]:g}" role="img"><title>{title}</title><style>{_STYLE}{_colours()}</style>'
        f'<rect width="100%" height="100%" fill="#fff"/>{"".join(parts)}</svg>\n'
    )


def _colours() -> str:
    return "".join(
        f".series.s{k}, .cross.s{k} {{ stroke: {colour}; }} .dot.s{k}, .series-band.s{k} {{ fill: {colour}; }} "
        + (f".series.s{k} {{ stroke-dasharray: {dash}; }} " if dash else "")
        for k, (colour, dash) in enumerate(zip(_COLOURS, _DASHES, strict=True))
    )


def _legend(entries: list[tuple[str, str]]) -> str:
    places = np.cumsum([MARGIN, *(LETTER * len(name) + SIGN for _, name in entries[:-1])])
    return "".join(
        f'<g transform="translate({x:.1f} 10)">{drawn}{plot.label(34.0, 10.0, name)}</g>'
        for x, (drawn, name) in zip(places, entries, strict=True)
    )
