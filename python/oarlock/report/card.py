"""`write_card`: a report as one picture for a chat, without links; for `oarlock report --card`.

Matplotlib draws it (`pip install 'oarlock[plot]'`).
"""

from __future__ import annotations

import textwrap
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock.report.front import MOST_POINTS, Course, Front
from oarlock.report.page import belief_of, heading_of
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file
from oarlock.tracking.track import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIDE_IN, DOTS_PER_IN = 10.8, 100
"""1080 pixels square, which chats show without cutting."""
INK, SOFT, TILE = "#16202b", "#566270", "#f2f4f7"
LEVELS = {"good": "#00795a", "care": "#8a5a00", "bad": "#b84a00"}
STYLES = (("#0072b2", "-"), ("#b84a00", "--"), ("#00795a", "-."), ("#8a3f77", ":"))
MOST_FIGURES = 4
LETTERS, TITLE_LETTERS, TILE_LETTERS = 88, 44, 9
"""Letters in a line of text, of the title and of a key figure; a longer figure is drawn smaller."""
LEFT, RIGHT, LINE = 0.055, 0.945, 0.03
"""Margins and the height of a line, in parts of the picture."""


def write_card(track: Track, path: Path, title: str | None, front: Front) -> Path:
    """Write the picture, PNG of 1080 x 1080 pixels: who and when, key figures, a curve, up to three findings.

    Args:
        track: what was tracked; its session and sensors are shown.
        path: the file to write.
        title: what it is, beside who and when; default names the model.
        front: its content.

    Raises:
        DataError: the track has no samples, or Matplotlib is not installed.
    """
    if not len(track.time_s):
        raise DataError("nothing to draw: the track has no samples. Was the recording empty?")
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise DataError(f"{path}: pictures are drawn with Matplotlib: pip install 'oarlock[plot]'") from None
    figure = Figure(figsize=(SIDE_IN, SIDE_IN), dpi=DOTS_PER_IN, facecolor="white")
    heading, _ = heading_of(track, title)
    belief = belief_of(track, front.direct, front.caution)
    at = _text(figure, 0.955, heading, 25, INK, "bold", TITLE_LETTERS)
    at = _text(figure, at - 0.005, f"{belief.words}: {belief.reason}", 15, LEVELS[belief.level])
    at = _tiles(figure, at - 0.01, front)
    below = _findings(figure, front, at)
    if front.course is not None and at - below > 0.2:
        _course(figure, front.course, below, at)
    stored = BytesIO()
    # Matplotlib would write its own address into the file.
    figure.savefig(stored, format="png", metadata={"Software": None})
    write_file(path, stored.getvalue())
    return path


def _text(
    figure: Figure,
    top: float,
    text: str,
    size: float,
    colour: str,
    weight: str = "normal",
    letters: int = LETTERS,
) -> float:
    """Lines of text below `top`; returns where they end."""
    lines = textwrap.wrap(text, letters) or [""]
    style: dict[str, Any] = {
        "fontsize": size,
        "color": colour,
        "weight": weight,
        "va": "top",
        "parse_math": False,
    }
    figure.text(LEFT, top, "\n".join(lines), linespacing=1.25, **style)
    return top - len(lines) * size * 1.45 / (72.0 * SIDE_IN)


def _tiles(figure: Figure, top: float, front: Front) -> float:
    from matplotlib.patches import FancyBboxPatch

    shown = list(front.figures)[:MOST_FIGURES]
    if not shown:
        return top
    step, height = (RIGHT - LEFT) / len(shown), 0.115
    for place, one in enumerate(shown):
        left = LEFT + place * step
        box = FancyBboxPatch(
            (left, top - height),
            step - 0.015,
            height,
            boxstyle="round,pad=0,rounding_size=0.01",
            transform=figure.transFigure,
            facecolor=TILE,
            edgecolor="none",
        )
        figure.add_artist(box)
        size = 24 * min(1.0, TILE_LETTERS / len(one.value))
        first, _, _ = one.detail.partition("; ")
        rows: tuple[tuple[str, float, dict[str, Any]], ...] = (
            (one.name, 0.015, {"fontsize": 13, "color": SOFT}),
            (one.value, 0.04, {"fontsize": size, "color": INK, "weight": "bold"}),
            (first, 0.085, {"fontsize": 11, "color": SOFT}),
        )
        for text, down, style in rows:
            figure.text(left + 0.015, top - down, text, va="top", parse_math=False, **style)
    return top - height


def _findings(figure: Figure, front: Front, ceiling: float) -> float:
    """The sentences at the foot; returns where they begin."""
    told = [f"• {point.sentence}" for point in list(front.points)[:MOST_POINTS]] or [front.quiet]
    told += [*front.changes, f"Next: {front.next_step}" if front.next_step else ""]
    lines = [
        line
        for text in told
        if text
        for line in textwrap.wrap(text, LETTERS, subsequent_indent="   " if text.startswith("•") else "")
    ]
    top = min(0.045 + (len(lines) + 1) * LINE, ceiling - 0.02)
    _text(figure, top, "What stands out", 16, INK, "bold")
    for place, line in enumerate(lines, 1):
        figure.text(
            LEFT, top - place * LINE - 0.004, line, fontsize=14.5, color=INK, va="top", parse_math=False
        )
    return top


def _course(figure: Figure, course: Course, below: float, above: float) -> None:
    foot = below + 0.075
    axes = figure.add_axes((LEFT + 0.05, foot, RIGHT - LEFT - 0.05, above - 0.06 - foot))
    for (name, (share, mean, low, high)), (colour, dash) in zip(course.curves.items(), STYLES, strict=False):
        axes.fill_between(share, low, high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(share, mean, dash, color=colour, linewidth=2.5, label=name)
    axes.set_title(f"{course.name}, {course.unit}", loc="left", fontsize=15, color=INK, weight="bold")
    axes.set_xlabel(course.across, fontsize=12, color=SOFT)
    axes.tick_params(labelsize=12, colors=SOFT)
    axes.margins(x=0)
    axes.grid(color="#dde2e8", linewidth=0.8)
    axes.spines[:].set_visible(False)
    if len(course.curves) > 1:
        axes.legend(frameon=False, fontsize=12, ncols=4, loc="upper right")
