"""Builds the sections of a movement's report: ranges, player, courses over a cycle, right against left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from itertools import pairwise

import numpy as np

from oarlock.movement.angles import MovementAngle
from oarlock.movement.blocks import MovementAnalysis, MovementBlock
from oarlock.movement.cycles import cycle_courses
from oarlock.movement.range_section import STYLE, ranges_markup
from oarlock.movement.ranges import side_pairs
from oarlock.movement.words import plain, quality, titled
from oarlock.report import (
    Axis,
    Column,
    Section,
    Series,
    course_chart,
    fixed,
    folded_help,
    plain_table,
    sort_script,
)
from oarlock.report.viewer import Curve, embed, scene
from oarlock.report.viewer.sides import side_of

LONGEST_S = 60.0
"""Longest part in the player of the page; `oarlock view` shows the whole track."""
HELP = (
    "Figure and curves share one cursor. Drag to rotate, wheel or + and − to zoom; space plays, arrows step. Loop "
    "repeats a cycle, Ghost draws another one over it. Uncertainty shows where each joint is with 95 % probability."
)
FOLDED = ("cycles", "sides")


def sections_of(movement: MovementAnalysis, csv_name: str) -> list[Section]:
    """The sections of a body's movement, for `write_page`; none if no joint angle is observed."""
    if not movement.angles:
        return []
    parts = [
        ("moving", "The movement", _player(movement)),
        ("ranges", "Range of motion", ranges_markup(movement)),
        ("cycles", "Over a cycle", "".join(_cycles(movement, one, csv_name) for one in movement.blocks)),
        ("sides", "Right and left", _sides(movement)),
    ]
    sections = [Section(key, name, markup, folded=key in FOLDED) for key, name, markup in parts if markup]
    told = tuple(escape(sentence) for sentence in quality(movement))
    return [replace(sections[0], script=sort_script(), style=STYLE, sentences=told), *sections[1:]]


def _player(movement: MovementAnalysis) -> str:
    track, blocks = movement.track, movement.blocks
    first, last = movement.start_s, float(track.time_s[-1])
    begins_s = [float(block.repetition.begins_s[0]) for block in blocks]
    start = max(first, min(min(begins_s, default=first) - 1.0, last - LONGEST_S))
    # A clock that was set leaves years without a sample.
    start = float(track.time_s[np.searchsorted(track.time_s, start)])
    end = min(last, start + LONGEST_S)
    marks = []
    for block in blocks:
        name = f"block {block.number}, {plain(block.repetition.lead)}" if movement.several else "cycle"
        pairs = enumerate(pairwise(block.repetition.begins_s), 1)
        marks += [(float(a), float(b), f"{name} {k}") for k, (a, b) in pairs if a >= start and b <= end]
    shown = scene(track, marks=marks, curves=_curves(movement), start_s=start, end_s=end)
    hint = ""
    if start > track.time_s[0] or end < last:
        hint = (
            f'<p class="hint">It shows {fixed(start, 0)} to {fixed(end, 0)} s; <code>oarlock view</code> shows the '
            "whole track.</p>"
        )
    return hint + embed(shown, "player") + folded_help(HELP)


def _curves(movement: MovementAnalysis) -> list[Curve]:
    """The angles of the tables by their names, as the scene opens those that move most."""
    found = []
    for angle in movement.angles:
        joint, space, axis = angle.name.partition(" ")
        side, stem = side_of(joint)
        panel, label = (stem + space + axis, side) if side else ("", plain(angle.name))
        values, std = angle.value_deg, angle.std_deg
        found.append(Curve(angle.name, label, "deg", values, std, panel, side, angle.label))
    return found


def _cycles(movement: MovementAnalysis, block: MovementBlock, csv_name: str) -> str:
    """Mean courses of a block."""
    one = block.repetition
    hint = (
        f"Means over {one.count} cycles; 0 % is where {escape(plain(one.lead))} is largest. Tinted: plus and minus "
        f"one standard deviation between cycles. Each cycle is a row of <code>{escape(csv_name)}</code> beside this "
        "page."
    )
    charts = [_chart(movement, block, k, name, group) for k, (name, group) in enumerate(_groups(block))]
    head = f"<h3>{escape(titled(block))}</h3>" if movement.several else ""
    return f'{head}<p class="hint">{hint}</p><div class="grid-figures">{"".join(charts)}</div>'


def _groups(block: MovementBlock) -> list[tuple[str, list[MovementAngle]]]:
    """Angles that move, right and left together, in the order of the model."""
    moving = {
        angle.name: angle
        for angle in block.angles
        if angle.name in block.ranges and not block.ranges[angle.name].hardly_moved
    }
    pairs = side_pairs(list(moving))
    stems = {name: stem for stem, both in pairs.items() for name in both}
    found: dict[str, list[MovementAngle]] = {}
    for name, angle in moving.items():
        found.setdefault(stems.get(name, name), []).append(angle)
    return list(found.items())


def _chart(
    movement: MovementAnalysis, block: MovementBlock, place: int, name: str, group: Sequence[MovementAngle]
) -> str:
    series = []
    for angle in sorted(group, key=_side, reverse=True):
        courses = cycle_courses(movement.track.time_s, angle.value_deg, block.repetition.begins_s)
        mean, spread = courses.mean(axis=0), courses.std(axis=0, ddof=1)
        label = _side(angle) if len(group) > 1 else plain(angle.name)
        series.append(Series(label, np.linspace(0.0, 100.0, len(mean)), mean, mean - spread, mean + spread))
    key = f"cycle-{block.number}-{place}" if movement.several else f"cycle-{place}"
    return course_chart(
        key, plain(name), series, Axis("cycle", "%", (0.0, 100.0)), Axis("", "deg", least=5.0)
    )


def _side(angle: MovementAngle) -> str:
    return side_of(angle.name.partition(" ")[0])[0]


def _sides(movement: MovementAnalysis) -> str:
    if not movement.sides:
        return ""
    rows = []
    for block, one in movement.sides:
        texts = [fixed(v, 1) for v in (one.right.range_deg, one.left.range_deg, one.difference_deg)]
        verdict = "yes" if one.certain else "no"
        number = [str(block.number)] if movement.several and block else []
        rows.append([escape(plain(one.name)), *number, *texts, fixed(one.limit_deg, 1), verdict])
    over = "means over the cycles" if movement.blocks else "over the whole track"
    caption = (
        f"Ranges of both sides, {over}. ±: half of the 95 % interval of the difference. The last column says whether "
        "both ranges are measured well and the difference is above 2° and outside this interval."
    )
    heads: list[str | Column] = [
        "angle",
        *(["block"] if movement.several else []),
        Column("right", "deg"),
        Column("left", "deg"),
        Column("difference", "deg"),
        Column("±", "deg"),
        "differs",
    ]
    return plain_table("sides", caption, heads, rows)
