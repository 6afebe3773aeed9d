"""`write_rowing_report`: writes the report of a rower with strokes, technique and an optional comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from os import PathLike
from pathlib import Path

from oarlock import DataError, Track
from oarlock.evaluation import Evaluation
from oarlock.report import Front, day_text, who_and_when, who_in_words, write_page
from oarlock.rowing.exports.activity import Activity
from oarlock.rowing.findings.rowed import StoredStrokes, rowing_kind
from oarlock.rowing.report.beside import alongside_sections
from oarlock.rowing.report.called import called, folders_in_words, piece_of
from oarlock.rowing.report.front import front_of
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.report.sections import sections_of
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.progress import Progress, mark, share, shown

_ROWER = {"seat", "trunk"}
_ROWED = {"sculling": "of sculling", "sweep": "of sweep rowing", "ergometer": "on the ergometer"}


def is_of_rower(track: Track) -> bool:
    """Whether the track's model has the joints of a rower: seat and trunk."""
    return set(track.joint_names) >= _ROWER and track.model is not None


def write_rowing_report(
    track: Track,
    path: str | PathLike[str],
    evaluation: Evaluation | None = None,
    truth: Track | None = None,
    *,
    title: str | None = None,
    other: Track | None = None,
    names: tuple[str, str] = ("", ""),
    targets: str | PathLike[str] | None = None,
    export: tuple[StrokeTable | Activity, float | None] | None = None,
    last: tuple[str, Track] | StoredStrokes | None = None,
    best: tuple[str, Track] | StoredStrokes | None = None,
    compared_notes: Sequence[str] = (),
    progress: Progress = None,
) -> list[Path]:
    """Write a rower's report, and beside it the strokes as CSV.

    Args:
        track: what to report, of a model with a rower's joints.
        path: the file to write, or an existing folder, which gets `report.html`.
        evaluation: scores against truth; computed if only `truth` is given.
        truth: reference that is drawn beside the estimate.
        title: heading; default says how many strokes of what, or names the pieces.
        other: a second piece to compare with.
        names: of the two pieces, for people; "" is replaced by day and stroke rate, if the session has a day.
        targets: a boat class of `oarlock.rowing.TARGET_CLASSES` or a file: published targets to draw.
        export: what another device measured during this piece, for sections on pace, heart rate and force; and the
            offset of its clock, s, if it is known.
        last: name and track of the athlete's piece before this one, or its strokes.
        best: name and track of the athlete's own best piece, or its strokes.
        compared_notes: sentences on which pieces these are and why (`oarlock.season.earlier_pieces`).
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        list: the files written, the report first. Without strokes only the report is written, with the reason.

    Raises:
        DataError: the track has no samples, `other` has no strokes, or the targets do not exist.
    """
    target = Path(path)
    target = target / "report.html" if target.is_dir() else target
    with shown(progress, "writing the report") as told:
        try:
            pieces = _pieces(track, other, names, targets)
            mark(told, 0.2)
        except DataError as error:
            if other is not None or targets is not None:
                raise
            noted = track.with_notes(f"No strokes found: {error}")
            return [write_page(noted, target, evaluation, truth, title, progress=told)]
        empty = [piece for piece in pieces if not len(piece.table)]
        if empty and other is not None:
            raise DataError(f"'{empty[0].name}' has no stroke to compare. {' '.join(empty[0].table.notes)}")
        if empty:
            noted = track.with_notes(*empty[0].table.notes)
            return [write_page(noted, target, evaluation, truth, title, progress=told)]
        # strokes.csv beside report.html, else NAME-strokes.csv; with -2 of a second piece
        stem = "strokes" if target.stem == "report" else f"{target.stem}-strokes"
        tables = [target.with_name(f"{stem}{end}.csv") for end in ("", "-2")[: len(pieces)]]
        sections = sections_of(pieces, [table.name for table in tables])
        if export is not None:
            sections[1:1] = [
                replace(one, folded=True)
                for one in alongside_sections(export[0], pieces[0].technique, export[1])
            ]
        mark(told, 0.5)
        before = _earlier(last), _earlier(best)
        front = front_of(pieces[0], *before, pieces[1] if other is not None else None)
        folders = tuple(map(escape, folders_in_words([*(pieces if other is not None else []), *before])))
        sections[0] = replace(sections[0], notes=(*sections[0].notes, *folders))
        said = f'<p class="hint">{escape(" ".join(compared_notes))}</p>' if compared_notes else ""
        front = replace(front, compared=front.compared + said)
        heading = title or _heading(pieces)
        written = write_page(
            track, target, evaluation, truth, heading, sections, front, progress=share(told, 0.6, 1.0)
        )
        for piece, table in zip(pieces, tables, strict=True):
            session = ", ".join(filter(None, who_and_when(piece.track.provenance)))
            replace(piece.table, source=": ".join(filter(None, (session, piece.table.source)))).to_csv(table)
        return [written, *tables]


def _pieces(
    track: Track, other: Track | None, names: tuple[str, str], targets: str | PathLike[str] | None
) -> list[ReportPiece]:
    if other is None:
        return [piece_of(track, names[0], targets)]
    both = zip((track, other), names, strict=True)
    return called([piece_of(one, name, targets) for one, name in both], names)


def rowing_front(
    track: Track,
    last: tuple[str, Track] | StoredStrokes | None = None,
    best: tuple[str, Track] | StoredStrokes | None = None,
    *,
    other: Track | None = None,
    names: tuple[str, str] = ("", ""),
    targets: str | PathLike[str] | None = None,
) -> tuple[str, Front]:
    """The title and the front of a rower's track, for the summary on paper and the picture for a chat.

    The arguments are those of `write_rowing_report`.

    Raises:
        DataError: no strokes were found, or the targets do not exist.
    """
    pieces = _pieces(track, other, names, targets)
    for piece in pieces:
        if not len(piece.table):
            whose = f"'{piece.name}': " if piece.name else ""
            raise DataError(f"{whose}no strokes were found. {' '.join(piece.table.notes)}")
    return _heading(pieces), front_of(pieces[0], _earlier(last), _earlier(best), *pieces[1:])


def _earlier(given: tuple[str, Track] | StoredStrokes | None) -> ReportPiece | StoredStrokes | None:
    if not isinstance(given, tuple):
        return given
    name, track = given
    return called([piece_of(track, name)], [name])[0]


def _heading(pieces: list[ReportPiece]) -> str:
    if len(pieces) > 1:
        first, second = (piece.name for piece in pieces)
        # The heading of the page begins with them.
        known = who_in_words(pieces[0].track.provenance), day_text(pieces[0].date)
        for start in filter(None, known):
            first = first.removeprefix(f"{start}, ")
        return f"{first} compared with {second}"
    count = len(pieces[0].table)
    return f"{count} {'stroke' if count == 1 else 'strokes'} {_ROWED[rowing_kind(pieces[0])]}"
