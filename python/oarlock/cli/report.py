"""`oarlock report`: writes a track as one HTML file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from oarlock.cli.evaluate import truth_folder
from oarlock.cli.tables import write_contradiction
from oarlock.cli.terminal import UsageError, free_file, progress, say
from oarlock.cli.verbs import command

if TYPE_CHECKING:
    from oarlock import Track
    from oarlock.rowing import Activity, StrokeTable
    from oarlock.rowing.findings.rowed import StoredStrokes


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock report out",
        "oarlock report out --truth trial/truth",
        "oarlock report after --compare before",
        "oarlock report out --with rp3.csv",
        "oarlock report out --last monday --best record",
        "oarlock report out --season season --names ~/names.toml",
        "oarlock report out --out a.html",
        "oarlock report out --summary",
        "oarlock report out --card --out pictures",
        show=_show,
        metavars={
            "track": "TRACK",
            "truth": "FOLDER",
            "compare": "TRACK2",
            "targets": "NAME|FILE",
            "with_": "FILE|FOLDER",
            "last": "TRACK",
            "best": "TRACK",
            "season": "SEASON",
            "out": "FILE|FOLDER",
        },
    )(report)


def report(
    track: Path,
    *,
    truth: Path | None = None,
    compare: Path | None = None,
    targets: str | None = None,
    with_: Path | None = None,
    offset_s: float | None = None,
    last: Path | None = None,
    best: Path | None = None,
    season: str | None = None,
    names: Path | None = None,
    summary: bool = False,
    card: bool = False,
    out: Path | None = None,
    force: bool = False,
) -> WrittenReport:
    """Write report.html: one file that works offline, with findings, curves and sensor health.

    The report of a rower begins with the strokes: what stands out, the change against earlier pieces, a player. It
    writes strokes.csv beside the page. The section "What each number means" and docs/report.md define each number
    with its unit, sign and source.

    Args:
        track: a folder that `oarlock track` wrote.
        truth: draw the ground truth with the estimate.
        compare: rowing: compare with the track of another piece or athlete.
        targets: rowing: draw published ranges of a boat class or of your own file. Classes: sculling_men,
            sculling_women, sculling_light_women, sculling, sweep_men, sweep_women, ergometer.
        with_: rowing: add pace, heart rate and force of the same piece: a device's export, or the folder of a live
            session with a PM5. The session of the track itself is found.
        offset_s: with --with: what to add to the export's times, if intervals between strokes cannot tell.
        last: rowing: the athlete's piece before, to show the change.
        best: rowing: the athlete's own best piece.
        season: rowing: find last time and own best of the athlete in a season (folder or address).
        names: with --season: pseudonyms of the athletes' names.
        summary: write only a page of one A4 sheet, to print or save as PDF.
        card: write only a picture for a chat, PNG; needs oarlock[plot].
        out: the file to write, or a folder: the file is then named by athlete and date. Else TRACK/report.html.
        force: replace what is there.
    """
    import oarlock
    from oarlock import load_track
    from oarlock.rowing.report.called import Folder
    from oarlock.rowing.report.write import is_of_rower
    from oarlock.storage.folder_writer import replaced_folder

    if offset_s is not None and with_ is None:
        raise UsageError("--offset-s needs --with FILE: it is the offset of that export's clock")
    if names is not None and season is None:
        raise UsageError("--names needs --season SEASON: it says which pseudonym a name has there")
    if summary and card:
        raise UsageError("--summary and --card: give one of them")
    if summary or card:
        _refuse_on_a_sheet("--summary" if summary else "--card", {"--truth": truth, "--with": with_})
    estimate = load_track(track)
    page = _place(estimate, track, out, "summary.html" if summary else "card.png" if card else "report.html")
    free_file(page, force)
    reference = load_track(truth_folder(truth)) if truth is not None else None
    other = load_track(compare) if compare is not None else None
    pieces = [None if place is None else (Folder(place.name), load_track(place)) for place in (last, best)]
    earlier = ReportComparisons(pieces[0], pieces[1])
    if season is not None:
        earlier = _from_season(season, names, estimate, earlier)
    export = _measured_beside(estimate, track, with_, offset_s)
    titles = (Folder(track.name), Folder(compare.name if compare is not None else ""))
    with replaced_folder(page.parent, "", force, adds=True) as stage:
        place = stage / page.name
        if summary or card:
            staged = [_write_front(estimate, place, card, earlier, other, titles, targets)]
        elif is_of_rower(estimate):
            staged = oarlock.write_report(
                estimate,
                place,
                truth=reference,
                progress=True,
                other=other,
                names=titles,
                targets=targets,
                export=export,
                last=earlier.last,
                best=earlier.best,
                compared_notes=earlier.notes,
            )
        else:
            _refuse_of_others(estimate, {**_of_rowers(earlier, other, targets), "--with": export})
            staged = oarlock.write_report(estimate, place, truth=reference, progress=True)
    written = [page.with_name(file.name) for file in staged]
    return WrittenReport(estimate, written, earlier.notes if season is not None else None)


class WrittenReport(NamedTuple):
    """Whose report it is, its files, and which pieces of a season it compares with."""

    track: Track
    files: list[Path]
    season: tuple[str, ...] | None

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        from oarlock.recording.session_info import session_info

        session = dict(session_info(self.track.provenance))
        document = {"report": self.files[0], "beside": self.files[1:], "session": session}
        return document if self.season is None else {**document, "season": self.season}


def _show(result: WrittenReport) -> None:
    from oarlock.recording.session_info import session_info, session_text

    write_contradiction(result.track.notes)
    if session := session_info(result.track.provenance):
        say(session_text(session), style="bold")
    for note in result.season or ():
        say(note)
    say(f"Wrote {' and '.join(str(path) for path in result.files)}")


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
    pseudonyms = {} if names is None else NamesFile.read(names).pseudonyms
    with progress("looking in the season"):
        stored = earlier_pieces(season, track, pseudonyms, last=given.last is None, best=given.best is None)
    return ReportComparisons(given.last or stored.last, given.best or stored.best, stored.notes)


def _measured_beside(
    track: Track, out: Path, beside: Path | None, offset: float | None
) -> tuple[StrokeTable | Activity, float | None] | None:
    """What is asked for, or else the strokes of the ergometer's monitor in the track's own live session."""
    from oarlock.rowing import load_export
    from oarlock.rowing.alongside.monitor import monitor_strokes, session_near
    from oarlock.rowing.report.write import is_of_rower

    if beside is not None:
        return (monitor_strokes(beside) if beside.is_dir() else load_export(beside)), offset
    near = session_near(out, track.epoch) if is_of_rower(track) else None
    return None if near is None else (near, None)


def _place(track: Track, out: Path, to: Path | None, name: str) -> Path:
    """The file to write. The page in the track's own folder keeps its name; whatever is sent on names its athlete."""
    from oarlock.report import named_file

    if to is None:
        return out / (name if name == "report.html" else named_file(track.provenance, name))
    return to / named_file(track.provenance, name) if to.is_dir() else to


def _refuse_on_a_sheet(flag: str, options: Mapping[str, object]) -> None:
    for option, value in options.items():
        if value is not None:
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
    for flag, value in options.items():
        if value is not None:
            raise UsageError(
                f"{flag} needs the track of a rower; this one has the joints {', '.join(track.joint_names[:6])}"
            )
