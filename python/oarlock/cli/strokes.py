"""`oarlock rowing strokes`: prints strokes of a track, a recording or an export of a rowing device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from oarlock.cli.import_path import taken_session
from oarlock.cli.options import Json, example
from oarlock.cli.terminal import (
    UsageError,
    free_file,
    heading,
    number,
    output_folder,
    print_json,
    say,
    table,
    verb,
)

if TYPE_CHECKING:
    from oarlock import Recording, Track
    from oarlock.rowing import Activity, StrokeTable

# Columns of the table of single strokes: the first of these that a source has, as many as fit.
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


_MOST_SHOWN = 8
_SHOWN_COLUMNS = (
    "catch_time_s",
    "time_s",
    "rate_per_min",
    "drive_time_s",
    "rhythm",
    "catch_angle_rad",
    "finish_angle_rad",
    "arc_rad",
    "slip_rad",
    "wash_rad",
    "handle_travel_m",
    "peak_force_n",
    "power_w",
    "speed_m_s",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "strokes",
        epilog=example(
            "oarlock rowing strokes out",
            "oarlock rowing strokes rp3.csv --each",
            "oarlock rowing strokes speedcoach.csv --out strokes",
            "oarlock rowing strokes rp3.csv --report rp3.html --athlete A07",
            "oarlock rowing strokes out --fit piece.fit --start 2026-05-01T07:30:00Z",
        ),
    )(strokes)


@verb
def strokes(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="TRACK|FILE",
            help="Folder of a track or recording, a device's export, or strokes.parquet.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FOLDER", help="Folder for strokes.csv and strokes.parquet."),
    ] = None,
    fit: Annotated[
        Path | None,
        typer.Option("--fit", metavar="FILE", help="FIT file to write, for other sites and apps."),
    ] = None,
    rowingdata: Annotated[
        Path | None, typer.Option("--rowingdata", metavar="FILE", help="RowingData CSV to write.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report", metavar="FILE", help="Page to write: what stands out, pace, heart rate, force."
        ),
    ] = None,
    last: Annotated[
        Path | None,
        typer.Option("--last", metavar="FILE", help="With --report: an export to compare with."),
    ] = None,
    athlete: Annotated[
        str | None, typer.Option("--athlete", metavar="NAME", help="With --report: name or pseudonym.")
    ] = None,
    boat: Annotated[
        str | None, typer.Option("--boat", metavar="TEXT", help="With --report: boat or boat class.")
    ] = None,
    date: Annotated[
        str | None,
        typer.Option("--date", metavar="TEXT", help="With --report: day of the piece, such as 2026-05-01."),
    ] = None,
    place: Annotated[
        str | None, typer.Option("--place", metavar="TEXT", help="With --report: place or water.")
    ] = None,
    note: Annotated[
        str | None,
        typer.Option("--note", metavar="TEXT", help="With --report: anything else, such as the session."),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option("--start", metavar="MOMENT", help="Moment of 0 s, such as 2026-05-01T07:30:00Z."),
    ] = None,
    format: Annotated[
        str | None,
        typer.Option(
            "--format", metavar="NAME", help="Kind of export, such as rp3; default: found from the contents."
        ),
    ] = None,
    seat: Annotated[
        int | None,
        typer.Option("--seat", metavar="N", help="Whose strokes, of a Peach file with several seats."),
    ] = None,
    each: Annotated[bool, typer.Option("--each", help="Also print every stroke.")] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Write into a folder with other files; replace files.")
    ] = False,
    json_output: Json = False,
) -> None:
    """Show strokes of a track, or of an export of Quiske, RP3, NK SpeedCoach, Concept2, rowsandall and others.

    Angles are shown in degrees, catch negative, finish positive. Files contain radians. TCX files, and most FIT files,
    contain points in time and no strokes: then their course is shown.
    """
    from oarlock.rowing import Activity

    if last is not None and report is None:
        raise UsageError("--last needs --report: the comparison is part of the page")
    who = taken_session({"athlete": athlete, "date": date, "boat": boat, "place": place, "note": note})
    if who and report is None:
        raise UsageError(f"--{next(iter(who))} needs --report: the page names who rowed, when and where")
    if report is not None and source.is_dir():
        raise UsageError(
            f"--report needs an export; {source} is a folder. For a track: `oarlock report {source}`"
        )
    found = _loaded(source, format, seat)
    if start is not None:
        found = replace(found, epoch=given_epoch(start))
    wanted = OutputPaths(out, fit, rowingdata, force)
    if report is not None:
        write_page(source, found, report, None if last is None else _loaded(last, None, seat), who, force)
    if isinstance(found, Activity):
        show_activity(found, wanted, json_output, report)
        return
    files, notes = write_strokes(found, wanted)
    files = files if report is None else (*files, report)
    if json_output:
        print_json(_document(found, files) | ({"left_out": notes} if notes else {}))
        return
    say(f"{found.source}: {len(found)} strokes", style="bold")
    _write_summary(found)
    if each:
        _write_each(found)
    if found.notes or notes:
        heading("Notes")
        for note in (*found.notes, *notes):
            say(f"- {note}", indent=2)
    for file in files:
        say(f"Wrote {file}")


def _loaded(source: Path, format: str | None, seat: int | None) -> StrokeTable | Activity:
    from oarlock.rowing import EXPORT_FORMATS, load_export, load_strokes
    from oarlock.rowing.exports.load import FILE_KINDS

    known = (*EXPORT_FORMATS, *FILE_KINDS)
    if format is not None and format not in known:
        raise UsageError(f"--format {format}: is not known; known are {', '.join(known)}")
    if not source.is_dir():
        is_own = source.suffix == ".parquet" and format is None
        return load_strokes(source) if is_own else load_export(source, format, seat)
    if format is not None:
        raise UsageError(f"--format needs a file; {source} is a folder")
    from oarlock.rowing import find_strokes

    return find_strokes(track_or_recording(source)).table()


def _document(found: StrokeTable, files: tuple[Path, ...]) -> dict[str, object]:
    from oarlock.rowing import summarise_strokes

    return {
        "source": found.source,
        "strokes": len(found),
        "notes": found.notes,
        "summary": summarise_strokes(found),
        "rows": found.to_rows(),
        "files": files,
    }


def _write_summary(found: StrokeTable) -> None:
    from oarlock.rowing import summarise_strokes

    table(
        ["quantity", "unit", ">strokes", ">median", ">5 %", ">95 %"],
        [
            (row.label, row.unit, row.strokes, *(_four(value) for value in (row.median, row.low, row.high)))
            for row in summarise_strokes(found)
        ],
    )


def _write_each(found: StrokeTable) -> None:
    from oarlock.rowing import FEATURES

    shown = [FEATURES[name] for name in _SHOWN_COLUMNS if name in found][:_MOST_SHOWN]
    heading("Strokes")
    table(
        [">stroke", *(f">{feature.label}\n{feature.shown_unit}" for feature in shown)],
        [
            (row + 1, *(_four(found[feature.name][row] * feature.shown_scale) for feature in shown))
            for row in range(len(found))
        ],
    )


def _four(value: float) -> str:
    """About four digits, without exponents."""
    digits = 0 if abs(value) >= 1000 else 1 if abs(value) >= 10 else 2
    return number(value, f".{digits}f")


def track_or_recording(folder: Path) -> Track | Recording:
    """The recording or the track of a folder.

    Raises:
        DataError: it contains neither, or what it contains is damaged.
    """
    from oarlock import load_recording, load_track
    from oarlock.storage.errors import DataError

    if (folder / "recording.toml").exists():
        return load_recording(folder)
    if not any((folder / name).exists() for name in ("run.toml", "track.parquet")):
        why = "contains neither a track nor a recording" if folder.exists() else "does not exist"
        raise DataError(f"{folder}: {why}; give a folder that `oarlock track` or `oarlock import` wrote")
    return load_track(folder)
