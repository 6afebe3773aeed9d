"""The error that each fault causes: writes the table and the picture of docs/robustness.md.

`python -m bench.robustness --page docs/robustness.md` runs the study `robustness`, puts the table between the page's
two marks and the picture where the page shows it. Stopped, it goes on where it was.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Sequence
from pathlib import Path

import oarlock
from oarlock.evaluation.study.costs import Dose, middle
from oarlock.evaluation.study.result import StudyResult
from oarlock.report.fault_page import by_fault, usual_row
from oarlock.report.fault_picture import fault_picture
from oarlock.report.fault_words import findings
from oarlock.report.study_page import study_page
from oarlock.report.text import number, percent
from oarlock.rowing import SIMULATORS

from .table import into_page

OUT = Path("out/robustness")
PICTURE = Path("pictures/robustness.svg")


def table(result: StudyResult) -> str:
    """The findings, and a row for each fault: error at each strength, and more at the usual one, in Markdown."""
    clean, curves = by_fault(result)
    words = "\n".join(f"- **{head}** {text}" for head, text in findings(clean, curves))
    others = list(clean)[1:]
    head = ["fault", "error in deg at each strength", "adds, deg (worst seed)", "adds, mm", "in band"]
    lines = [head + others, ["---"] * (len(head) + len(others))]
    for name, by_setting in curves.items():
        own = next(iter(by_setting.values()))
        usual, *rest = usual_row(by_setting).values()
        steps = " · ".join(_step(dose, usual) for dose in own)
        lines.append([name, steps, *_usual(usual), *(_degrees(dose.median_deg) for dose in rest)])
    rows = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return f"{words}\n\n{rows}\n"


def _step(dose: Dose, usual: Dose) -> str:
    text = f"{dose.label}: {_degrees(dose.median_deg)}"
    text += f" ({dose.lost} of {len(dose.error_deg)} lost)" if dose.lost else ""
    return f"**{text}**" if dose.index == usual.index else text


def _usual(dose: Dose) -> list[str]:
    worst = _degrees(float((dose.error_deg - dose.clean_deg).max()))
    adds = _degrees(dose.cost_deg) if dose.noticed else "nothing"
    inside = middle(dose.coverage)
    place = number(max(dose.place_cost_mm, 0.0), 2) if math.isfinite(dose.place_cost_mm) else "lost"
    return [f"{adds} ({worst})", place, percent(inside) if math.isfinite(inside) else "lost"]


def _degrees(value: float) -> str:
    return number(round(value, 3), 2) if math.isfinite(value) else "lost"


def measured(name: str, seeds: Sequence[int] | None, jobs: int | None, out: Path) -> tuple[StudyResult, str]:
    """The study, run, saved with its page; and a sentence on how."""
    study = oarlock.load_study(name, SIMULATORS, seeds)
    began = time.perf_counter()
    result = oarlock.study(study, jobs=jobs, folder=out)
    minutes = (time.perf_counter() - began) / 60.0
    result.save(out)
    (out / "report.html").write_text(study_page(result), encoding="utf-8")
    here = f"Oarlock {oarlock.__version__}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
    return result, (
        f"Study `{name}`: {study.run_count} runs, seeds {', '.join(map(str, study.seeds))}, "
        f"{minutes:.1f} minutes in this go ({here})."
    )


def main() -> None:
    """Reads the command line."""
    command = argparse.ArgumentParser(prog="python -m bench.robustness", description=__doc__)
    command.add_argument("--page", type=Path, help="the page whose table and picture are made anew")
    command.add_argument("--quick", action="store_true", help="the study robustness_quick: half a minute")
    command.add_argument("--seeds", type=int, help="seeds 0 to N-1 instead of the study's")
    command.add_argument("--jobs", type=int, help="processes; else all cores")
    asked = command.parse_args()
    name = "robustness_quick" if asked.quick else "robustness"
    out = OUT.with_name(name)
    seeds = None if asked.seeds is None else range(asked.seeds)
    result, how = measured(name, seeds, asked.jobs, out)
    text = f"{how}\n\n{table(result)}"
    (out / "table.md").write_text(text, encoding="utf-8")
    print(text)
    if asked.page is not None:
        picture = asked.page.parent / PICTURE
        picture.write_text(fault_picture(result), encoding="utf-8")
        page = asked.page.read_text(encoding="utf-8")
        asked.page.write_text(into_page(page, text), encoding="utf-8")
    print(f"Wrote {out}: report.html, table.md, tables" + (f"; {asked.page}" if asked.page else ""))


if __name__ == "__main__":
    main()
