"""`oarlock rowing strokes`: prints strokes of a track, a recording or an export of a rowing device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer

from oarlock.cli.session_options import session_of
from oarlock.cli.show import number_text, show_document
from oarlock.cli.terminal import UsageError, free_file, heading, output_folder, say, table
from oarlock.cli.verbs import NewFile, NewFolder, command

if TYPE_CHECKING:
    from oarlock import Recording, Track
    from oarlock.rowing import Activity, StrokeTable

# Columns of the table of single strokes: the first of these that a source has, as many as fit.
_COLUMNS: Final = (
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
_MOST_COLUMNS: Final = 8
_OF_ACTIVITIES: Final = ("speed_m_s", "rate_per_min", "heart_rate_per_min", "power_w")


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock rowing strokes out",
        "oarlock rowing strokes rp3.csv --each",
        "oarlock rowing strokes speedcoach.csv --out strokes",
        "oarlock rowing strokes rp3.csv --report rp3.html --athlete A07",
        "oarlock rowing strokes out --fit piece.fit --start 2026-05-01T07:30:00Z",
        show=_show,
        metavars={
            "source": "TRACK|FILE",
            "boat": "TEXT",
            "date": "TEXT",
            "place": "TEXT",
            "note": "TEXT",
            "start": "MOMENT",
        },
    )(strokes)


@dataclass(frozen=True)
class ShownStrokes:
    """Strokes, or an activity without any, the files that were written, and what was left out of them."""

    strokes: StrokeTable | Activity
    files: tuple[Path, ...]
    left_out: tuple[str, ...] = ()
    each: bool = False

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        from oarlock.rowing import Activity, summarise_strokes

        table, left_out = self.strokes, {"left_out": self.left_out} if self.left_out else {}
        about = {"source": table.source, "notes": table.notes, "files": self.files, **left_out}
        if isinstance(table, Activity):
            return {
                **about,
                "points": len(table),
                "start": table.epoch or None,
                "duration_s": table.duration_s,
                "distance_m": _distance_m(table),
                "summary": _course(table),
            }
        return {
            **about,
            "strokes": len(table),
            "summary": summarise_strokes(table),
            "rows": table.to_rows(),
        }


def strokes(
    source: Path,
    *,
    out: NewFolder | None = None,
    fit: NewFile | None = None,
    rowingdata: NewFile | None = None,
    report: Path | None = None,
    last: Path | None = None,
    athlete: str | None = None,
    boat: str | None = None,
    date: str | None = None,
    place: str | None = None,
    note: str | None = None,
    start: str | None = None,
    format: str | None = None,
    seat: int | None = None,
    each: bool = False,
    force: bool = False,
) -> ShownStrokes:
    """Show strokes of a track, or of an export of Quiske, RP3, NK SpeedCoach, Concept2, rowsandall and others.

    Angles are shown in degrees, catch negative, finish positive. Files contain radians. TCX files, and most FIT files,
    contain points in time and no strokes: then their course is shown.

    Args:
        source: folder of a track or recording, a device's export, or strokes.parquet.
        out: folder for strokes.csv and strokes.parquet.
        fit: FIT file to write, for other sites and apps.
        rowingdata: RowingData CSV to write.
        report: page to write: what stands out, pace, heart rate, force.
        last: with --report: an export to compare with.
        athlete: with --report: name or pseudonym.
        boat: with --report: boat or boat class.
        date: with --report: day of the piece, such as 2026-05-01.
        place: with --report: place or water.
        note: with --report: anything else, such as the session.
        start: moment of 0 s, such as 2026-05-01T07:30:00Z.
        format: kind of export, such as rp3; default: found from the contents.
        seat: whose strokes, of a Peach file with several seats.
        each: also print every stroke.
        force: replace what is there.
    """
    from oarlock.rowing import Activity, save_fit, save_rowingdata, save_strokes

    who = session_of(athlete=athlete, date=date, boat=boat, place=place, note=note)
    if report is None:
        extra = [f"--{name}" for name in (*(["last"] if last else ()), *who)]
        if extra:
            raise UsageError(
                f"{extra[0]} needs --report: the page compares, and says who rowed, when and where"
            )
    elif source.is_dir():
        raise UsageError(
            f"--report needs an export; {source} is a folder. For a track: `oarlock report {source}`"
        )
    table = _loaded(source, format, seat)
    if start is not None:
        table = replace(table, epoch=epoch_of(start))
    files: list[Path] = []
    if report is not None:
        _write_page(table, report, None if last is None else _loaded(last, None, seat), source, who, force)
    if isinstance(table, Activity):
        if out or fit or rowingdata:
            raise UsageError(
                f"{table.source}: contains no strokes, so there are no files of strokes to write"
            )
        return ShownStrokes(table, () if report is None else (report,))
    left_out: list[str] = []
    for file, save in ((fit, save_fit), (rowingdata, save_rowingdata)):
        if file is not None:
            left_out += save(table, file)
            files.append(file)
    if out is not None:
        with output_folder(out, "strokes", force) as stage:
            files += [out / file.name for file in save_strokes(table, stage)]
    files += [] if report is None else [report]
    return ShownStrokes(table, tuple(files), tuple(left_out), each)


def _write_page(
    strokes: StrokeTable | Activity,
    page: Path,
    last: StrokeTable | Activity | None,
    source: Path,
    who: Mapping[str, str],
    force: bool,
) -> None:
    """Writes the page of an export; `who` and then `session.toml` beside the export say who rowed.

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
    session = checked_session({**read_session(source.parent), **who}, "session")
    write_strokes_report(strokes, page, last, session, progress=True)


def epoch_of(text: str) -> str:
    """The epoch of `--start`.

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


def _loaded(source: Path, format: str | None, seat: int | None) -> StrokeTable | Activity:
    from oarlock.rowing import EXPORT_FORMATS, find_strokes, load_export, load_strokes
    from oarlock.rowing.exports.load import FILE_KINDS

    formats = (*EXPORT_FORMATS, *FILE_KINDS)
    if format is not None and format not in formats:
        raise UsageError(f"--format {format}: is not known; known are {', '.join(formats)}")
    if not source.is_dir():
        is_own = source.suffix == ".parquet" and format is None
        return load_strokes(source) if is_own else load_export(source, format, seat)
    if format is not None:
        raise UsageError(f"--format needs a file; {source} is a folder")
    return find_strokes(track_or_recording(source)).table()


def _show(result: ShownStrokes) -> None:
    from oarlock.rowing import Activity, summarise_strokes

    strokes = result.strokes
    if isinstance(strokes, Activity):
        say(f"{strokes.source}: {len(strokes)} points, no strokes", style="bold")
        show_document(
            {
                "start": strokes.epoch or "unknown",
                "duration_s": strokes.duration_s,
                "distance_m": _distance_m(strokes),
            }
        )
        rows, what = _course(strokes), "points"
    else:
        say(f"{strokes.source}: {len(strokes)} strokes", style="bold")
        rows, what = [vars(row) for row in summarise_strokes(strokes)], "strokes"
    table(
        ["quantity", "unit", f">{what}", ">median", ">5 %", ">95 %"],
        [
            (
                row["label"],
                row["unit"],
                row[what],
                *(number_text(row[key]) for key in ("median", "low", "high")),
            )
            for row in rows
        ],
    )
    if result.each and not isinstance(strokes, Activity):
        _show_each(strokes)
    if notes := [*strokes.notes, *result.left_out]:
        heading("Notes")
        for note in notes:
            say(f"- {note}", indent=2)
    for file in result.files:
        say(f"Wrote {file}")


def _course(activity: Activity) -> list[dict[str, Any]]:
    """Median and range of what an activity has."""
    import numpy as np

    from oarlock.rowing import FEATURES

    rows = []
    for name in _OF_ACTIVITIES:
        if name in activity:
            values = activity[name][np.isfinite(activity[name])]
            low, median, high = (float(value) for value in np.percentile(values, (5.0, 50.0, 95.0)))
            about = {"name": name, "label": FEATURES[name].label, "unit": FEATURES[name].shown_unit}
            rows.append(about | {"points": len(values), "median": median, "low": low, "high": high})
    return rows


def _distance_m(activity: Activity) -> float | None:
    """From the first to the last point."""
    import numpy as np

    if "distance_m" not in activity:
        return None
    known = activity["distance_m"][np.isfinite(activity["distance_m"])]
    return float(known[-1] - known[0])


def _show_each(strokes: StrokeTable) -> None:
    from oarlock.rowing import FEATURES

    features = [FEATURES[name] for name in _COLUMNS if name in strokes][:_MOST_COLUMNS]
    heading("Strokes")
    table(
        [">stroke", *(f">{feature.label}\n{feature.shown_unit}" for feature in features)],
        [
            (
                row + 1,
                *(number_text(strokes[feature.name][row] * feature.shown_scale) for feature in features),
            )
            for row in range(len(strokes))
        ],
    )


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
