"""Writes the files of `oarlock rowing strokes`, and shows activities, which have no strokes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from oarlock.cli.terminal import UsageError, free_file, heading, number, output_folder, print_json, say, table

if TYPE_CHECKING:
    from oarlock.rowing import Activity, StrokeTable

_SHOWN = ("speed_m_s", "rate_per_min", "heart_rate_per_min", "power_w")


@dataclass(frozen=True)
class OutputPaths:
    """What to write: a folder, a FIT file, a RowingData CSV; and whether other files may be replaced."""

    out: Path | None
    fit: Path | None
    rowingdata: Path | None
    force: bool


def given_epoch(text: str) -> str:
    """The epoch that `--start` gives.

    Raises:
        UsageError: it is no moment in UTC or with an offset.
    """
    from oarlock.rowing.exports.starts import epoch_of_text

    try:
        epoch = epoch_of_text(text)
    except (ValueError, OverflowError):
        epoch = ""
    if not epoch.endswith("Z"):
        raise UsageError(f"--start {text}: expected a moment with its zone, such as 2026-05-01T07:30:00Z")
    return epoch


def write_strokes(found: StrokeTable, wanted: OutputPaths) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Write what is wanted; the files, and what was left out of them."""
    from oarlock.rowing import save_fit, save_rowingdata, save_strokes

    single = [
        (file, save) for file, save in ((wanted.fit, save_fit), (wanted.rowingdata, save_rowingdata)) if file
    ]
    for file, _ in single:
        if file.exists() and not wanted.force:
            raise UsageError(f"{file}: exists. Choose another name, or replace it with --force")
    notes = [note for file, save in single for note in save(found, file)]
    files = [file for file, _ in single]
    if wanted.out is not None:
        with output_folder(wanted.out, "strokes", wanted.force) as stage:
            files += [wanted.out / file.name for file in save_strokes(found, stage)]
    return tuple(files), tuple(notes)


def write_page(
    source: Path,
    found: StrokeTable | Activity,
    page: Path,
    last: StrokeTable | Activity | None,
    who: Mapping[str, str],
    force: bool,
) -> None:
    """Write the page of an export; `who` and then `session.toml` beside the export say who rowed.

    Raises:
        UsageError: the page exists or is a folder, or `last` has no strokes.
    """
    from oarlock.recording.session_info import checked_session, read_session
    from oarlock.rowing import StrokeTable
    from oarlock.rowing.report.export_page import write_strokes_report

    if last is not None and not isinstance(last, StrokeTable):
        raise UsageError(f"--last {last.source}: contains no strokes to compare with")
    if page.is_dir():
        raise UsageError(f"--report {page}: is a folder; name a file, such as {page / 'strokes.html'}")
    free_file(page, force)
    write_strokes_report(
        found, page, last, checked_session({**read_session(source.parent), **who}, "session"), progress=True
    )


def show_activity(found: Activity, wanted: OutputPaths, json_output: bool, page: Path | None = None) -> None:
    """Print an activity's course, without positions.

    Raises:
        UsageError: files of strokes are wanted.
    """
    if wanted.out or wanted.fit or wanted.rowingdata:
        raise UsageError(f"{found.source}: contains no strokes, so there are no files of strokes to write")
    rows = [_row(found, name) for name in _SHOWN if name in found]
    if json_output:
        names = ("name", "label", "unit", "points", "median", "low", "high")
        return print_json(
            {
                "source": found.source,
                "points": len(found),
                "start": found.epoch or None,
                "duration_s": found.duration_s,
                "distance_m": _distance_m(found),
                "notes": found.notes,
                "summary": [dict(zip(names, row, strict=True)) for row in rows],
                "files": [page] if page else [],
            }
        )
    say(f"{found.source}: {len(found)} points, no strokes", style="bold")
    say(
        f"start {found.epoch or 'unknown'}, {_words(found.duration_s, 's')}, {_words(_distance_m(found), 'm')}"
    )
    if rows:
        table(
            ["quantity", "unit", ">points", ">median", ">5 %", ">95 %"],
            [(label, unit, n, *(number(one, ".1f") for one in three)) for _, label, unit, n, *three in rows],
        )
    if found.notes:
        heading("Notes")
        for note in found.notes:
            say(f"- {note}", indent=2)
    if page:
        say(f"Wrote {page}")


def _row(found: Activity, name: str) -> tuple[str, str, str, int, float, float, float]:
    from oarlock.rowing import FEATURES

    values = found[name][np.isfinite(found[name])]
    low, median, high = (float(one) for one in np.percentile(values, (5.0, 50.0, 95.0)))
    return name, FEATURES[name].label, FEATURES[name].shown_unit, len(values), median, low, high


def _distance_m(found: Activity) -> float | None:
    """From the first to the last point."""
    if "distance_m" not in found:
        return None
    known = found["distance_m"][np.isfinite(found["distance_m"])]
    return float(known[-1] - known[0])


def _words(value: float | None, unit: str) -> str:
    return f"{'time' if unit == 's' else 'distance'} unknown" if value is None else f"{value:.0f} {unit}"
