"""The sections of a rower's report, from the pieces that it is about."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files

from oarlock.report import Section, Zone, sort_script
from oarlock.rowing.report import words
from oarlock.rowing.report.arms import arms_at_finish
from oarlock.rowing.report.averages import Average
from oarlock.rowing.report.compared import comparison_table, sentences
from oarlock.rowing.report.definitions import definitions
from oarlock.rowing.report.drawings import curves, hand_paths, trends
from oarlock.rowing.report.piece import Piece
from oarlock.rowing.report.tables import averages_table, sides_table, strokes_table

BAND = "Tinted: one standard deviation between strokes, either way."


def sections_of(pieces: Sequence[Piece], zones: dict[str, Zone], csv_names: Sequence[str]) -> list[Section]:
    """Sections of one piece, or of two beside each other; those that have nothing to show are left out."""
    first = pieces[0]
    told = sentences(first, pieces[1]) if len(pieces) > 1 else []
    style = files(__package__).joinpath("style.css").read_text(encoding="utf-8")
    found = [
        ("compared-pieces", "Side by side", _compared(pieces)),
        ("strokes", "Strokes", _strokes(pieces, csv_names)),
        (
            "trends",
            "Over the piece",
            _hinted("Dots: strokes. Bars: the 95 % interval of each.", trends(pieces, zones)),
        ),
        ("courses", "Over a stroke", _hinted(f"Means over the strokes. {BAND}", curves(pieces))),
        ("paths", "Paths of the hands", _paths(pieces)),
        ("arms", "Arms at the finish", _arms(pieces)),
        ("sides", "Right and left", sides_table("sides", first.averages)),
        ("numbers", "All numbers of the piece", _numbers(pieces)),
        (
            "meanings",
            "What each number means",
            definitions(name for piece in pieces for name in piece.table.columns),
        ),
    ]
    sections = [Section(key, name, markup) for key, name, markup in found if markup]
    return [
        Section(
            "lead-in" if not sections else sections[0].key,
            sections[0].name,
            sections[0].markup,
            (*told, *words.summary(first)),
            tuple(words.key_figures(first)),
            style,
            sort_script(),
        ),
        *sections[1:],
    ]


def _hinted(hint: str, content: str) -> str:
    return f'<p class="hint">{escape(hint)}</p>{content}' if content else ""


def _compared(pieces: Sequence[Piece]) -> str:
    return comparison_table("compared-pieces", pieces[0], pieces[1]) if len(pieces) > 1 else ""


def _strokes(pieces: Sequence[Piece], csv_names: Sequence[str]) -> str:
    parts = []
    for k, (piece, csv_name) in enumerate(zip(pieces, csv_names, strict=True)):
        heading = f"<h3>{escape(piece.name)}</h3>" if piece.name else ""
        beside = (
            '<p class="files">All columns, with their standard deviations, are in '
            f"<code>{escape(csv_name)}</code> beside this page. A click on a head sorts.</p>"
            if csv_name
            else ""
        )
        parts.append(
            heading + beside + strokes_table(piece.table, "strokes" if k == 0 else f"strokes-{k + 1}")
        )
    return "".join(parts)


def _paths(pieces: Sequence[Piece]) -> str:
    hint = f"Where the handles go, seen from the boat: the bow is at the right. {BAND}"
    return _hinted(hint, hand_paths(pieces))


def _arms(pieces: Sequence[Piece]) -> str:
    hint = (
        "Shoulder, elbow and wrist when the handle turns, mean over the strokes; thin lines: single strokes."
    )
    return _hinted(hint, arms_at_finish(pieces))


def _numbers(pieces: Sequence[Piece]) -> str:
    parts = []
    for k, piece in enumerate(pieces):
        caption = f"{piece.name}: means over the strokes" if piece.name else "Means over the strokes"
        key = "numbers-of" if k == 0 else f"numbers-of-{k + 1}"
        parts.append(averages_table(key, f"{caption}.", _sorted(piece.averages)))
    return "".join(parts)


def _sorted(averages: dict[str, Average]) -> list[Average]:
    """Those that are known first."""
    return sorted(averages.values(), key=lambda one: one.count == 0)
