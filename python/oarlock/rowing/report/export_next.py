"""What the numbers of an export can show, and what to do next: in the boat first, then what to record."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from oarlock.rowing.alongside.paces import PER_500_M, SPEEDS, of_pace
from oarlock.rowing.findings.candidate import MetricComparison, against
from oarlock.rowing.findings.find import comparisons
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.findings.rowed import FEWEST_STROKES
from oarlock.rowing.report.checked import is_useful, sizes
from oarlock.rowing.report.export_fade import FORCES, LENGTHS, where_lost
from oarlock.rowing.report.export_force import after_start
from oarlock.rowing.report.export_piece import ExportPiece
from oarlock.rowing.report.shown import with_unit
from oarlock.rowing.report.usual import beyond_of, usual_span

_GROUPS = (SPEEDS, ("power_w",), FORCES, LENGTHS[1:])
_FOR_CHANGES = 60
"""Strokes at one rate that show a change which tells something, about a fifth of the power or 8 deg of arc: in the
sample files of rowingdata, of windows of 60 strokes 96 % for power, 94 % for speed and 88 % for arc; of windows of 12
strokes 65, 79 and 58 %."""
_IN_THE_BOAT = {
    "slip_rad": "The oar turns that far at the catch before the blade is loaded.",
    "wash_rad": "The oar turns that far at the finish without load on the blade.",
    "arc_rad": "",
}
"""What a number beyond usual values means in the boat; exercises come from `watched.toml`."""


def quiet_text(piece: ExportPiece) -> str:
    """What is said if nothing stands out: the size from which a change would, or that too few strokes count."""
    count, after = int(piece.counted.sum()), after_start(piece.course)
    if count < FEWEST_STROKES:
        return f"Not assessed: {count} whole strokes{after}, {FEWEST_STROKES} are needed."
    shown = could_show(piece, comparisons(piece.rowed, {}), "drift")
    if not shown:
        return (
            f"Not assessed: the {count} strokes{after} are too few, or differ too much from each other, to show "
            "a change from start to end."
        )
    return (
        "No change in the last third is larger than chance and large enough to matter. "
        f"It would have to be larger than about {', '.join(shown)}."
    )


def next_step(piece: ExportPiece, found: Sequence[Finding], is_compared: bool) -> str:
    """What to do in the boat where the numbers say so, and what the same piece again could show."""
    if int(piece.counted.sum()) < FEWEST_STROKES:
        return _record(piece)
    boat = where_lost(piece.faded, piece.course) or beyond_usual(piece)
    tries = "Try the exercises above." if any(one.advice for one in found) else ""
    if not (boat or found):
        few = int(piece.counted.sum()) < 4 * FEWEST_STROKES
        if few or not could_show(piece, comparisons(piece.rowed, {}), "drift"):
            return f"These strokes are too few to show what to change in the boat. {_record(piece)}"
        boat = "These numbers ask for no change in the boat."
    return " ".join(filter(None, (boat, tries, "" if is_compared else _again(piece))))


def beyond_usual(piece: ExportPiece) -> str:
    """The length, slip or wash that lies clearly beyond usual values, with their source and where to look."""
    for name, means in _IN_THE_BOAT.items():
        one = beyond_of(piece, name, piece.kind)
        if one is None or not one.matters or one.found.over.count < FEWEST_STROKES:
            continue
        tries, watched = one.to_try, one.watched
        told = f"Try: {tries.text}" if tries.text else means
        if not told:
            continue
        size = with_unit(watched.feature, one.found.over.mean)
        sources = "; ".join(filter(None, (watched.usual_source, tries.source)))
        return (
            f"Look at the {watched.feature.label} first: {size}, usual is {usual_span(watched, piece.kind)}. "
            f"{told} Source: {sources}."
        )
    return ""


def _again(piece: ExportPiece) -> str:
    """The same piece again, and what it could show; a longer one where it could show nothing."""
    shown = could_show(piece, list(against(piece.rowed, piece.rowed, "again")), "again")[:2]
    if not shown:
        return _record(piece)
    rate = piece.averages.get("rate_per_min")
    at = f" at {with_unit(rate.feature, rate.over.mean)}" if rate is not None and rate.known else ""
    pieces = "pieces" if len(piece.course.stretches) > 1 else "piece"
    wind = "" if piece.kind == "ergometer" else "; on the water wind and stream come on top"
    return (
        f"Row the same {pieces} again{at} and compare: differences from about {' and '.join(shown)} "
        f"can be shown{wind}."
    )


def _record(piece: ExportPiece) -> str:
    fewer = int(piece.counted.sum()) < _FOR_CHANGES
    size = f"at least {_FOR_CHANGES} strokes" if fewer else "a piece"
    return f"Record {size} at one rate without a pause: then a change and a difference from this piece can be shown."


def could_show(piece: ExportPiece, candidates: Sequence[MetricComparison], kind: str) -> list[str]:
    """The smallest differences that would be named, of speed, power, force and length, without useless ones."""
    useful = [one for one in candidates if is_useful(one, len(candidates))]
    told = []
    for group in _GROUPS:
        for one in useful:
            if one.kind == kind and one.watched.name in group and one.watched.name in SPEEDS:
                values = piece.rowed.columns[one.watched.name][piece.rowed.good(one.watched.name)]
                late_s = of_pace(float(np.median(values)), one.named_from(len(candidates)))
                told.append(f"{math.ceil(late_s)} {PER_500_M}")
                break
        else:
            told += [f"{size} {label}" for label, size in sizes(useful, kind, group, len(candidates))[:1]]
    return told
