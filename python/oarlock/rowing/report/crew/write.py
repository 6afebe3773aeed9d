"""`write_crew_report`: the timing of a crew as one HTML file, and every stroke as CSV beside it."""

from __future__ import annotations

import csv
import io
from html import escape
from importlib.resources import files
from os import PathLike
from pathlib import Path

import numpy as np

from oarlock.report import Front, KeyFigure, Point, belief_markup, front_markup, notes_list, shell
from oarlock.rowing.crew.findings import crew_findings
from oarlock.rowing.crew.overlays import crew_overlays
from oarlock.rowing.crew.timing import CrewTiming
from oarlock.rowing.report.crew import words
from oarlock.rowing.report.crew.sections import (
    overlay_charts,
    strokes_charts,
    timing_chart,
    timing_table,
    who_table,
)
from oarlock.storage.progress import Progress, mark, shown
from oarlock.storage.write_file import write_file

HEADS = {
    "catch": "At the catch",
    "finish": "At the finish",
    "drive": "Length of the drive",
    "scatter": "Evenness",
}
FOLDED = ("each", "overlays", "who", "measured")


def write_crew_report(
    timing: CrewTiming,
    path: str | PathLike[str],
    title: str | None = None,
    *,
    progress: Progress = None,
) -> tuple[Path, Path]:
    """Write a page that works offline, and a CSV file with every stroke beside it.

    Args:
        timing: from `crew_timing`.
        path: the file to write, or an existing folder, which gets ``crew.html``. Missing parents are made.
        title: heading.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        The page and the CSV file.
    """
    target = Path(path)
    target = target / "crew.html" if target.is_dir() else target
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_suffix(".csv")
    with shown(progress, "writing the report") as told:
        page = crew_page(timing, title or "Crew: timing between seats", beside.name)
        mark(told, 1.0)
    write_file(target, page)
    write_file(beside, _csv(timing))
    return target, beside


def crew_page(timing: CrewTiming, title: str, csv_name: str) -> str:
    """The page as text."""
    than = words.reference(timing.against)
    shown = (
        ""
        if timing.clocks.known
        else " The clocks are not known: only changes from stroke to stroke mean something."
    )
    each = (
        f'<p class="hint">Later than {than}, stroke by stroke. Bars: 95 % interval of the measurement.{shown} '
        f"All numbers are in <code>{escape(csv_name)}</code> beside this page.</p>"
    )
    shifted = (
        ""
        if timing.clocks.known
        else " Each seat is shifted so that the mean catches agree, because clocks are not known."
    )
    over = f'<p class="hint">Means over the strokes that belong together.{shifted}</p>'
    overlays = crew_overlays(timing)
    sections = [
        ("timing", "Catch and finish", timing_chart(timing) + timing_table(timing)),
        ("each", "Stroke by stroke", each + strokes_charts(timing)),
        ("overlays", "Over a stroke", over + overlay_charts(timing, overlays) if overlays else ""),
        ("who", "Who rowed", who_table(timing)),
        ("measured", "How it was measured", notes_list(words.basis(timing))),
    ]
    lead = belief_markup(words.trust(timing), "measured-in") + front_markup(_front(timing))
    heading = ": ".join(filter(None, (words.about(timing), title)))
    style = files("oarlock.rowing.report").joinpath("style.css").read_text("utf-8")
    return shell(heading, lead, [one for one in sections if one[2]], style=style, folded=FOLDED)


def _front(timing: CrewTiming) -> Front:
    return Front(
        did=words.did(timing),
        points=[Point(HEADS[one.kind], words.finding(one, timing.against)) for one in crew_findings(timing)],
        quiet=words.nothing(timing),
        figures=_figures(timing),
    )


def _figures(timing: CrewTiming) -> list[KeyFigure]:
    figures = [KeyFigure("Strokes together", str(int(timing.complete.sum())), f"{len(timing.seats)} seats")]
    for event in ("catch", "finish") if timing.clocks.known else ():
        means = [one.mean_s for one in timing.delays if one.event == event]
        if timing.against != "crew mean":
            means.append(0.0)
        if np.isfinite(means).all():
            figures.append(
                KeyFigure(
                    f"First to last at the {event}", f"{1e3 * np.ptp(means):.0f} ms", "difference of means"
                )
            )
    scatter = [one.strokes.own_sd for one in timing.delays if one.event == "catch"]
    if np.isfinite(scatter).any():
        figures.append(
            KeyFigure(
                "Scatter at the catch",
                f"{1e3 * np.nanmedian(scatter):.0f} ms",
                "SD of a stroke, median of seats",
            )
        )
    worst = timing.clocks.worst_std_s
    told = "not known" if not timing.clocks.known else "0 ms" if worst == 0.0 else f"{words.ms(worst)} ms"
    figures.append(
        KeyFigure(
            "Clocks", told, {"one": "one logger", "unknown": "of the loggers"}.get(timing.clocks.kind, "SD")
        )
    )
    return figures


def _csv(timing: CrewTiming) -> str:
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    names = [seat.name for seat in timing.seats]
    heads = [f"{name}_{event}_late_s" for event in ("catch", "finish") for name in names]
    writer.writerow(["stroke", "catch_time_s", *heads, *(f"{head}_std" for head in heads)])
    values = np.hstack([timing.late_s["catch"], timing.late_s["finish"]])
    stds = np.hstack([timing.late_std_s["catch"], timing.late_std_s["finish"]])
    for row, catch in enumerate(timing.catch_s):
        cells = [*values[row], *np.where(np.isfinite(values[row]), stds[row], np.nan)]
        writer.writerow([row + 1, f"{catch:.6f}", *("" if np.isnan(one) else f"{one:.6f}" for one in cells)])
    return text.getvalue()
