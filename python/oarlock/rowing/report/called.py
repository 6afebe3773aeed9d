"""What pieces are called in a report: by day and stroke rate where the day is known, else by their folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from os import PathLike, fspath

from oarlock import Track
from oarlock.report import day_text, fixed, who_in_words
from oarlock.rowing.analysis.technique import Technique, technique
from oarlock.rowing.report.piece import Counted, ReportPiece
from oarlock.rowing.report.words import counted_rates, is_ramp, rates_at_ends
from oarlock.storage.epoch import moment_of

_DAY_S = 86_400.0


class Folder(str):
    """The name of a track's folder: a piece is called so only if its day is not known."""


def called(pieces: Sequence[ReportPiece], names: Sequence[str]) -> list[ReportPiece]:
    """The pieces with names that differ. A name that is no `Folder` wins; "" is none."""
    found = [_name(piece, name) for piece, name in zip(pieces, names, strict=True)]
    athletes = {who_in_words(piece.track.provenance).partition(", ")[0] for piece in pieces}
    if len(pieces) > 1 and len(athletes) == len(pieces):
        found = [_with_athlete(piece, name) for piece, name in zip(pieces, found, strict=True)]
    for add in (_with_time, _with_folder):
        if len(set(found)) < len(found):
            found = [add(piece, name) for piece, name in zip(pieces, found, strict=True)]
    if len(set(found)) < len(found):
        found = [f"{name} ({place})".strip() for name, place in zip(found, ("first", "second"), strict=False)]
    return [replace(piece, name=name) for piece, name in zip(pieces, found, strict=True)]


def piece_of(track: Track, name: str, targets: str | PathLike[str] | None = None) -> ReportPiece:
    """A piece that is not called anything yet, with its folder if `name` is one."""
    folder = str(name) if isinstance(name, Folder) else ""
    return ReportPiece("", track, _technique(track, None if targets is None else fspath(targets)), folder)


@lru_cache(maxsize=1)  # the report and the terminal give the same strokes
def _technique(track: Track, targets: str | None) -> Technique:
    return technique(track, targets=targets)


def _name(piece: ReportPiece, name: str) -> str:
    if name and not isinstance(name, Folder):
        return name
    if not piece.date:
        return str(name)
    return ", ".join(filter(None, (day_text(piece.date), rates_in_words(piece))))


def _with_athlete(piece: ReportPiece, name: str) -> str:
    """Two athletes are told apart by their names."""
    who = who_in_words(piece.track.provenance)
    athlete = who.removesuffix(day_text(piece.date)).removesuffix(", ")
    is_dated = bool(piece.date) and name.startswith(day_text(piece.date))
    return f"{athlete}, {name}" if athlete and is_dated else name


def _with_time(piece: ReportPiece, name: str) -> str:
    moment = moment_of(piece.track.provenance.get("epoch"))
    if moment is None or not piece.date or day_text(piece.date) not in name:
        return name
    minutes = int((moment.seconds + float(piece.track.time_s[0])) % _DAY_S // 60)
    return f"{name}, {minutes // 60:02d}:{minutes % 60:02d}"


def _with_folder(piece: ReportPiece, name: str) -> str:
    return f"{name} ({piece.folder})" if piece.folder and name != piece.folder else name


def rates_in_words(piece: Counted) -> str:
    """The stroke rate in short: "22/min", of a ramp "21 to 34/min"; "" if it is not known."""
    rates = counted_rates(piece)
    if not len(rates):
        return ""
    if is_ramp(piece):
        return " to ".join(fixed(end, 0) for end in rates_at_ends(piece)) + "/min"
    return f"{fixed(float(rates.mean()), 0)}/min"


def folders_in_words(pieces: Sequence[object]) -> list[str]:
    """In which folder each piece is, if its name does not say so; text."""
    return [
        f"{one.name}: folder {one.folder}"
        for one in pieces
        if isinstance(one, ReportPiece) and one.folder and one.folder != one.name
    ]
