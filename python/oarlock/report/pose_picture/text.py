"""A posture as text for terminals: braille patterns for lines, or plain ASCII."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from oarlock.report.pose_picture.skeleton import SAME_POINT_M, Bounds, Skeleton, Spot, Vector, View, views

# bits of a braille cell, by row and column of its dots
_BRAILLE = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_DOTS_DOWN, _DOTS_ACROSS = 4, 2
# characters kept free for names beside a view, and lines above and below it
_NAME_COLUMNS = 12
_MOST_ROWS = 22
_MARGIN_ROWS = 1
_BETWEEN = "  "
# views are placed one above the other if this enlarges them by this factor
_WORTH_STACKING = 1.4
# a fixed line is drawn with every fourth dot
_SPARSE = 4


@dataclass(frozen=True)
class _Style:
    spot: str
    has_sensor: str
    ascii_only: bool


def draw_text(body: Skeleton, columns: int = 80, ascii_only: bool = False) -> str:
    """Side view and front view, side by side or, if this is larger, one above the other.

    Args:
        body: the body to draw.
        columns: largest width, characters; at least 60.
        ascii_only: no braille patterns and no squares.
    """
    style = _Style("o", "#" if ascii_only else "■", ascii_only)
    pair = [(view, view.bounds(body)) for view in views(body)]
    beside = _dots_per_m([box for _, box in pair], columns - len(_BETWEEN), _MOST_ROWS, style)
    stacked = min(_dots_per_m([box], columns, _MOST_ROWS, style) for _, box in pair)
    if stacked > _WORTH_STACKING * beside:
        panels = [_panel(body, view, box, stacked, style) for view, box in pair]
        rows = [row for panel in panels for row in [*panel, ""]]
    else:
        panels = [_panel(body, view, box, beside, style) for view, box in pair]
        rows = [_BETWEEN.join(pieces) for pieces in zip(*_same_height(panels), strict=True)]
    key = f"{style.has_sensor} frame with a sensor   {style.spot} another frame"
    return "\n".join([*_without_blank_runs(rows), "", key])


def _dots_per_m(boxes: Sequence[Bounds], columns: int, rows: int, style: _Style) -> float:
    free_columns = columns - len(boxes) * (2 * _NAME_COLUMNS + 1)
    width, height = sum(box.width for box in boxes), max(box.height for box in boxes)
    limits = [
        dots / size
        for dots, size in (
            (_DOTS_ACROSS * max(free_columns, 8), width),
            (_DOTS_DOWN * (rows - 2 * _MARGIN_ROWS - 1), height),
        )
        if size > SAME_POINT_M
    ]
    return min(limits, default=1.0)


def _same_height(panels: Sequence[list[str]]) -> list[list[str]]:
    height = max(len(panel) for panel in panels)
    return [panel + [" " * len(panel[0])] * (height - len(panel)) for panel in panels]


def _without_blank_runs(rows: Sequence[str]) -> list[str]:
    kept: list[str] = []
    for row in (row.rstrip() for row in rows):
        if row or (kept and kept[-1]):
            kept.append(row)
    while kept and not kept[-1]:
        kept.pop()
    return kept


def _panel(body: Skeleton, view: View, box: Bounds, dots_per_m: float, style: _Style) -> list[str]:
    columns = math.ceil(box.width * dots_per_m / _DOTS_ACROSS) + 1 + 2 * _NAME_COLUMNS
    columns = max(columns, len(view.title))
    rows = math.ceil(box.height * dots_per_m / _DOTS_DOWN) + 1 + 2 * _MARGIN_ROWS
    canvas = _Canvas(columns, rows)
    # a narrow body is centred
    left = (_DOTS_ACROSS * columns - box.width * dots_per_m) / 2

    def dot(point: Vector) -> tuple[float, float]:
        right, up = view.project(point)
        return (right - box.left) * dots_per_m + left, (box.top - up) * dots_per_m + _DOTS_DOWN * _MARGIN_ROWS

    for link in body.links:
        canvas.line(dot(link.start), dot(link.end), 1 if link.moves else _SPARSE)
    cells = [canvas.cell(dot(spot.point)) for spot in body.spots]
    for has_sensor, glyph in ((False, style.spot), (True, style.has_sensor)):
        for spot, (row, column) in zip(body.spots, cells, strict=True):
            if spot.has_sensor is has_sensor:
                canvas.write(row, column, glyph)
    _write_names(canvas, body.spots, cells)
    lines = [line.ljust(columns) for line in canvas.lines(style.ascii_only)]
    return [view.title.center(columns), *lines]


def _write_names(canvas: _Canvas, spots: Sequence[Spot], cells: Sequence[tuple[int, int]]) -> None:
    named: set[tuple[int, int]] = set()
    for spot, (row, column) in zip(spots, cells, strict=True):
        # of frames at the same place in the view only the first is named
        if (row, column) in named:
            continue
        named.add((row, column))
        length = len(spot.name)
        right, left, middle = column + 2, column - 1 - length, column - length // 2
        places = [(row, right), (row, left), (row + 1, middle), (row - 1, middle)]
        places += [(row + 1, right), (row - 1, right), (row + 1, left), (row - 1, left)]
        for room, (at_row, at_column) in product((1, 0), places):
            if canvas.free(at_row, at_column, length, room):
                canvas.write(at_row, at_column, spot.name)
                break


class _Canvas:
    """Characters in rows; lines are dots, 2 across and 4 down in a character, which makes dots square."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self.dots = np.zeros((rows * _DOTS_DOWN, columns * _DOTS_ACROSS), dtype=bool)
        self.marks: dict[tuple[int, int], str] = {}

    def cell(self, dot: tuple[float, float]) -> tuple[int, int]:
        """Row and column of the character that contains a dot (across, down)."""
        return round(dot[1]) // _DOTS_DOWN, round(dot[0]) // _DOTS_ACROSS

    def line(self, start: tuple[float, float], end: tuple[float, float], every: int) -> None:
        """Sets every n-th dot (across, down) of a straight line."""
        steps = max(1, math.ceil(max(abs(end[0] - start[0]), abs(end[1] - start[1]))))
        for step in range(0, steps + 1, every):
            share = step / steps
            across = round(start[0] + share * (end[0] - start[0]))
            down = round(start[1] + share * (end[1] - start[1]))
            if 0 <= down < self.dots.shape[0] and 0 <= across < self.dots.shape[1]:
                self.dots[down, across] = True

    def free(self, row: int, column: int, length: int, room: int) -> bool:
        """Whether a text fits on the canvas, `room` away from a line, and touches no other text."""
        if not (0 <= row < self.rows and column >= 0 and column + length <= self.columns):
            return False
        dots = self._cell(row, max(column - room, 0), length + 2 * room)
        around = range(column - 1, column + length + 1)
        return not dots.any() and not any((row, at) in self.marks for at in around)

    def write(self, row: int, column: int, text: str) -> None:
        """Writes characters over the existing ones."""
        for k, character in enumerate(text):
            self.marks[row, column + k] = character

    def lines(self, ascii_only: bool) -> list[str]:
        """The canvas as text, a string a row."""
        return [
            "".join(self._character(row, column, ascii_only) for column in range(self.columns))
            for row in range(self.rows)
        ]

    def _cell(self, row: int, column: int, length: int = 1) -> NDArray[np.bool_]:
        down = slice(row * _DOTS_DOWN, (row + 1) * _DOTS_DOWN)
        return self.dots[down, column * _DOTS_ACROSS : (column + length) * _DOTS_ACROSS]

    def _character(self, row: int, column: int, ascii_only: bool) -> str:
        mark = self.marks.get((row, column))
        if mark is not None:
            return mark
        dots = self._cell(row, column)
        if not dots.any():
            return " "
        if ascii_only:
            return _stroke(dots)
        return chr(0x2800 + sum(_BRAILLE[down][across] for down, across in np.argwhere(dots)))


def _stroke(dots: NDArray[np.bool_]) -> str:
    """The ASCII character that is most similar to the dots of one cell."""
    down, across = np.nonzero(dots)
    if len(down) == 1:
        return "."
    if np.ptp(down) <= 1 and np.ptp(across) > 0:
        return "-"
    if np.ptp(across) == 0 or np.ptp(down) == 0:
        return "|"
    leaning = float(np.corrcoef(down, across)[0, 1])
    return "|" if abs(leaning) < 0.2 else "\\" if leaning > 0 else "/"
