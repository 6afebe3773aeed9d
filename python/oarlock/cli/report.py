"""`oarlock report`: writes a track as one HTML file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from oarlock.cli.evaluate import truth_folder
from oarlock.cli.options import Json, Replace, example
from oarlock.cli.tables import write_contradiction
from oarlock.cli.terminal import UsageError, free_file, print_json, progress, say, verb

if TYPE_CHECKING:
    from oarlock import Track
    from oarlock.rowing import Activity, StrokeTable
    from oarlock.rowing.findings.rowed import StoredStrokes


CLASSES = (
    "sculling_men",
    "sculling_women",
    "sculling_light_women",
    "sculling",
    "sweep_men",
    "sweep_women",
    "ergometer",
)
"""Those of `oarlock.rowing.TARGET_CLASSES`. Copied, because the import would slow down the help text."""


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "report",
        epilog=example(
            "oarlock report out",
            "oarlock report out --truth trial/truth",
            "oarlock report after --compare before",
            "oarlock report out --with rp3.csv",
            "oarlock report out --last monday --best record",
            "oarlock report out --season season --names ~/names.toml",
            "oarlock report out --out a.html",
            "oarlock report out --summary",
            "oarlock report out --card --out pictures",
        ),
    )(report)


@verb
def report(
    out: Annotated[Path, typer.Argument(metavar="TRACK", help="A folder that `oarlock track` wrote.")],
    truth: Annotated[
        Path | None,
        typer.Option("--truth", metavar="FOLDER", help="Draw the ground truth with the estimate."),
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(
            "--compare",
            metavar="TRACK2",
            help="Rowing: compare with the track of another piece or athlete.",
        ),
    ] = None,
    targets: Annotated[
        str | None,
        typer.Option(
            "--targets",
            metavar="NAME|FILE",
            help="Rowing: draw published ranges of a boat class or of your own file. Classes: "
            f"{', '.join(CLASSES)}.",
        ),
    ] = None,
    beside: Annotated[
        Path | None,
        typer.Option(
            "--with",
            metavar="FILE|FOLDER",
            help="Rowing: add pace, heart rate and force of the same piece: a device's export, or the folder of a "
            "live session with a PM5. The session of the track itself is found.",
        ),
    ] = None,
    offset: Annotated[
        float | None,
        typer.Option(
            "--offset-s",
            metavar="S",
            help="With --with: what to add to the export's times, if intervals between strokes cannot tell.",
        ),
    ] = None,
    last: Annotated[
        Path | None,
        typer.Option(
            "--last", metavar="TRACK", help="Rowing: the athlete's piece before, to show the change."
        ),
    ] = None,
    best: Annotated[
        Path | None, typer.Option("--best", metavar="TRACK", help="Rowing: the athlete's own best piece.")
    ] = None,
    season: Annotated[
        str | None,
        typer.Option(
            "--season",
            metavar="SEASON",
            help="Rowing: find last time and own best of the athlete in a season (folder or address).",
        ),
    ] = None,
    athletes: Annotated[
        Path | None,
        typer.Option("--names", metavar="FILE", help="With --season: pseudonyms of the athletes' names."),
    ] = None,
    summary: Annotated[
        bool, typer.Option("--summary", help="Write only a page of one A4 sheet, to print or save as PDF.")
    ] = False,
    card: Annotated[
        bool, typer.Option("--card", help="Write only a picture for a chat, PNG; needs oarlock[plot].")
    ] = False,
    to: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE|FOLDER",
            help="The file to write, or a folder: the file is then named by athlete and date. "
            "Else TRACK/report.html.",
        ),
    ] = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Write report.html: one file that works offline, with findings, curves and sensor health.

    The report of a rower begins with the strokes: what stands out, the change against earlier pieces, a player. It
    writes strokes.csv beside the page. The section "What each number means" and docs/report.md define each number
    with its unit, sign and source.
    """
    import oarlock
    from oarlock import load_track
    from oarlock.recording.session_info import session_info, session_text
    from oarlock.rowing.report.called import Folder
    from oarlock.rowing.report.write import is_of_rower
    from oarlock.storage.folder_writer import added_files

    if offset is not None and beside is None:
        raise UsageError("--offset-s needs --with FILE: it is the offset of that export's clock")
    if athletes is not None and season is None:
        raise UsageError("--names needs --season SEASON: it says which pseudonym a name has there")
    if summary and card:
        raise UsageError("--summary and --card: give one of them")
    if summary or card:
        _refuse_on_a_sheet("--summary" if summary else "--card", {"--truth": truth, "--with": beside})
    track = load_track(out)
    page = _place(track, out, to, "summary.html" if summary else "card.png" if card else "report.html")
    free_file(page, force)
    known = load_track(truth_folder(truth)) if truth is not None else None
    other = load_track(compare) if compare is not None else None
    given = [None if place is None else (Folder(place.name), load_track(place)) for place in (last, best)]
    earlier = ReportComparisons(given[0], given[1])
    if season is not None:
        earlier = _from_season(season, athletes, track, earlier)
    export = _measured_beside(track, out, beside, offset)
    names = (Folder(out.name), Folder(compare.name if compare is not None else ""))
    with added_files(page.parent, force) as stage:
        if summary or card:
            staged = [_write_front(track, stage / page.name, card, earlier, other, names, targets)]
        else:
            of_rowers: dict[str, Any] = {}
            if is_of_rower(track):
                of_rowers = {"other": other, "names": names, "targets": targets, "export": export}
                of_rowers |= {"last": earlier.last, "best": earlier.best, "compared_notes": earlier.notes}
            else:
                _refuse_of_others(track, {**_of_rowers(earlier, other, targets), "--with": export})
            staged = oarlock.write_report(track, stage / page.name, truth=known, progress=True, **of_rowers)
    written = [page.with_name(file.name) for file in staged]
    session = session_info(track.provenance)
    if json_output:
        found = {"season": earlier.notes} if season is not None else {}
        print_json({"report": written[0], "beside": written[1:], "session": dict(session), **found})
        return
    write_contradiction(track.notes)
    if session:
        say(session_text(session), style="bold")
    for note in earlier.notes:
        say(note)
    say(f"Wrote {' and '.join(str(path) for path in written)}")


class ReportComparisons(NamedTuple):
    """Names and tracks, or strokes, of the athlete's last and best piece; which of a season they are."""

    last: tuple[str, Track] | StoredStrokes | None = None
    best: tuple[str, Track] | StoredStrokes | None = None
    notes: tuple[str, ...] = ()


def _from_season(
    address: str, names: Path | None, track: Track, given: ReportComparisons
) -> ReportComparisons:
    """With what the season has in place of what was not given."""
    from oarlock.rowing.report.write import is_of_rower
    from oarlock.season import NamesFile, earlier_pieces, open_season

    if names is not None and not names.exists():
        raise UsageError(f"--names {names}: there is no such file; `oarlock season athlete --names` makes it")
    if not is_of_rower(track):
        _refuse_of_others(track, {"--season": address})
    season = open_season(address)
    known = {} if names is None else NamesFile.read(names).pseudonyms
    with progress("looking in the season"):
        found = earlier_pieces(season, track, known, last=given.last is None, best=given.best is None)
    return ReportComparisons(given.last or found.last, given.best or found.best, found.notes)


def _measured_beside(
    track: Track, out: Path, beside: Path | None, offset: float | None
) -> tuple[StrokeTable | Activity, float | None] | None:
    """What is asked for, or else the strokes of the ergometer's monitor in the track's own live session."""
    from oarlock.rowing import load_export
    from oarlock.rowing.alongside.monitor import monitor_strokes, session_near
    from oarlock.rowing.report.write import is_of_rower

    if beside is not None:
        return (monitor_strokes(beside) if beside.is_dir() else load_export(beside)), offset
    found = session_near(out, track.epoch) if is_of_rower(track) else None
    return None if found is None else (found, None)


def _place(track: Track, out: Path, to: Path | None, name: str) -> Path:
    """The file to write. The page in the track's own folder keeps its name; whatever is sent on names its athlete."""
    from oarlock.report import named_file

    if to is None:
        return out / (name if name == "report.html" else named_file(track.provenance, name))
    return to / named_file(track.provenance, name) if to.is_dir() else to


def _refuse_on_a_sheet(flag: str, options: Mapping[str, object]) -> None:
    for option, asked in options.items():
        if asked is not None:
            raise UsageError(f"{flag} has no room for what {option} adds: leave one of the two out")


def _write_front(
    track: Track,
    path: Path,
    card: bool,
    earlier: ReportComparisons,
    other: Track | None,
    names: tuple[str, str],
    targets: str | None,
) -> Path:
    """The summary of one sheet, or the picture."""
    from oarlock.movement.report import movement_front
    from oarlock.report import write_summary
    from oarlock.report.card import write_card
    from oarlock.rowing.report.write import is_of_rower, rowing_front

    title: str | None
    if is_of_rower(track):
        title, front = rowing_front(
            track, earlier.last, earlier.best, other=other, names=names, targets=targets
        )
    else:
        _refuse_of_others(track, _of_rowers(earlier, other, targets))
        title, front = movement_front(track)
    with progress("writing the report"):
        return (write_card if card else write_summary)(track, path, title, front)


def _of_rowers(earlier: ReportComparisons, other: Track | None, targets: str | None) -> dict[str, object]:
    """Options that need strokes, with what was given."""
    return {"--compare": other, "--targets": targets, "--last": earlier.last, "--best": earlier.best}


def _refuse_of_others(track: Track, options: Mapping[str, object]) -> None:
    for flag, asked in options.items():
        if asked is not None:
            raise UsageError(
                f"{flag} needs the track of a rower; this one has the joints {', '.join(track.joint_names[:6])}"
            )
