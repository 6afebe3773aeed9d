"""Builds all sections of a rower's report from one or two pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from importlib.resources import files

from oarlock.report import Section, Zone, fixed, sort_script
from oarlock.rowing.report import words
from oarlock.rowing.report.averages import feature_of
from oarlock.rowing.report.compared import comparison_table, first_sentence
from oarlock.rowing.report.definitions import definitions
from oarlock.rowing.report.drawings import arms_at_finish, curves, hand_paths, pairs, speeds, trends
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.report.player import player
from oarlock.rowing.report.shown import PLUS_MINUS, places
from oarlock.rowing.report.tables import (
    averages_table,
    shares_table,
    sides_table,
    strokes_table,
    unknown_list,
)

BAND = "Tinted: SD, the standard deviation between strokes, to either side."
_PATHS = "Paths of the handles relative to the boat; the bow is at the right. Means over the strokes."
_IN_FULL = '<a href="#compared-pieces-in">Side by side</a> has every number.'


def sections_of(pieces: Sequence[ReportPiece], csv_names: Sequence[str]) -> list[Section]:
    """Sections of one piece, or of two compared; empty sections are left out."""
    first = pieces[0]
    zones = {
        name: Zone(target.low * scale, target.high * scale, target.source)
        for name, target in first.technique.targets.items()
        for scale in [feature_of(name).shown_scale]
    }
    sides = [(piece, sides_table(f"sides-{k}", piece)) for k, piece in enumerate(pieces)]
    names = [name for piece in pieces for name in (*piece.table.columns, *piece.technique.curves)]
    parts = [
        ("moving", "The strokes, moving", player(pieces)),
        (
            "compared-pieces",
            "Side by side",
            comparison_table("compared-pieces", *pieces) if pieces[1:] else "",
        ),
        ("strokes", "Stroke by stroke", _strokes(pieces, csv_names)),
        ("trends", "Over the piece", _trends(pieces, zones)),
        (
            "courses",
            "Over a stroke",
            _hinted(
                f"Means over the strokes; 0 % is the catch, the dashed vertical line the mean finish. {BAND}",
                curves(pieces),
            ),
        ),
        ("speeds", "Legs, trunk, arms", _speeds(pieces)),
        ("paths", "Paths of the hands", _hinted(f"{_PATHS} {BAND}", hand_paths(pieces))),
        ("arms", "Arms at the finish", _arms(pieces)),
        ("sides", "Right and left", "".join(f"{_heading(one)}{table}" for one, table in sides if table)),
        ("numbers", "All numbers", _numbers(pieces, zones)),
        ("meanings", "What each number means", definitions(names)),
    ]
    sections = [Section(key, name, markup, folded=key != "moving") for key, name, markup in parts if markup]
    return [_speaking(sections[0], pieces), *sections[1:]]


def _speaking(section: Section, pieces: Sequence[ReportPiece]) -> Section:
    """The first section with the comparison in words, style and script of the page."""
    told = [f"<b>{escape(first_sentence(*pieces))}</b> {_IN_FULL}", _whose(pieces)] if len(pieces) > 1 else []
    style, script = (
        files(__package__).joinpath(name).read_text("utf-8") for name in ("style.css", "strokes.js")
    )
    return replace(
        section,
        sentences=tuple(told),
        notes=tuple(words.notes(pieces[0])),
        style=style,
        script=sort_script() + script,
    )


def _whose(pieces: Sequence[ReportPiece]) -> str:
    first, second = (f"<b>{escape(piece.name)}</b>" for piece in pieces)
    text = f"The findings and “How it was measured” are those of {first}."
    if pieces[0].track.smoothed != pieces[1].track.smoothed:
        how = ("smoothed", "filtered") if pieces[0].track.smoothed else ("filtered", "smoothed")
        text += f" It was {how[0]} and {second} {how[1]}: small differences may be caused by this."
    return text


def _hinted(hint: str, content: str) -> str:
    return f'<p class="hint">{escape(hint)}</p>{content}' if content else ""


def _strokes(pieces: Sequence[ReportPiece], csv_names: Sequence[str]) -> str:
    parts = []
    for k, (piece, csv_name) in enumerate(zip(pieces, csv_names, strict=True)):
        beside = (
            '<p class="files">All columns, with their standard deviations, are in '
            f"<code>{escape(csv_name)}</code> beside this page. A click on a head sorts"
            + ("; one on a stroke's number repeats that stroke in the player.</p>" if k == 0 else ".</p>")
        )
        key = "strokes" if k == 0 else f"strokes-{k + 1}"
        parts.append(_heading(piece) + beside + strokes_table(piece, key, played=k == 0))
    return "".join(parts)


def _trends(pieces: Sequence[ReportPiece], zones: dict[str, Zone]) -> str:
    hint = "Dots: counted strokes. Bars: the 95 % interval of each value; it is hidden if it is smaller than the dot."
    if zones:
        hint += (
            " Tinted: published targets with their source. No target is right for everyone: it depends on height, rig, "
            "rate and boat."
        )
    return _hinted(hint, trends(pieces, zones))


def _speeds(pieces: Sequence[ReportPiece]) -> str:
    hint = (
        "The speed of the handle along the keel is the sum of legs (seat), trunk (shoulders relative to "
        f"the seat) and arms (handle relative to the shoulders). Means over the strokes. {BAND}"
    )
    return _hinted(
        hint, pairs([*speeds(pieces), *[shares_table(f"shares-{k}", p) for k, p in enumerate(pieces)]])
    )


def _arms(pieces: Sequence[ReportPiece]) -> str:
    hint = (
        "Shoulder, elbow and wrist at the finish, means over the strokes"
        f"{'; thin lines: single strokes' if len(pieces) == 1 else ''}. The arm plane contains these three points."
    )
    return _hinted(hint, arms_at_finish(pieces))


def _numbers(pieces: Sequence[ReportPiece], zones: dict[str, Zone]) -> str:
    published = {}
    for name, zone in zones.items():
        low, high = (fixed(end, places(feature_of(name))) for end in (zone.low, zone.high))
        span = low if low == high else f"{low} to {high}"
        published[name] = f'{escape(span)} <span class="mark">{escape(zone.name)}</span>'
    parts = []
    for k, piece in enumerate(pieces):
        sided = {f"{side}_{name}" for side in "rl" for name in piece.sides}
        found = [one for name, one in piece.averages.items() if name not in sided]
        whose = f"{piece.name}. " if piece.name else ""
        caption = (
            f"{whose}Means over the strokes. {PLUS_MINUS}: half of the 95 % interval of the mean; SD: "
            "standard deviation between strokes. Grey, not clear: a size of which ± is more than half. Numbers of "
            "both sides are in the section Right and left."
        )
        parts.append(_heading(piece) + averages_table(f"numbers-{k}", caption, piece, found, published))
        parts.append(unknown_list(found))
    return "".join(parts)


def _heading(piece: ReportPiece) -> str:
    return f"<h3>{escape(piece.name)}</h3>" if piece.name else ""
