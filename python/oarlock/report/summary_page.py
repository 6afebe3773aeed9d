"""`write_summary`: a report on one sheet of A4, to print or to save as PDF; for `oarlock report --summary`."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from oarlock.report.front import MOST_POINTS, Front
from oarlock.report.markup import rendered
from oarlock.report.page import POLICY, belief_of, definitions, heading_of
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file
from oarlock.tracking.track import Track

MOST_FIGURES = 6
DRAWINGS, DRAWINGS_ALONE = 2, 4
"""The most drawings that fit on the sheet: below findings, and without them."""


def write_summary(track: Track, path: Path, title: str | None, front: Front) -> Path:
    """Write the page: what was done, its key figures, up to three findings, changes, up to four drawings.

    Args:
        track: what was tracked; its session and sensors are shown.
        path: the file to write.
        title: what it is, beside who and when; default names the model.
        front: its content.

    Raises:
        DataError: the track has no samples.
    """
    if not len(track.time_s):
        raise DataError("nothing to report: the track has no samples. Was the recording empty?")
    heading, rest = heading_of(track, title)
    style = files(__package__)
    write_file(
        path,
        rendered(
            "summary",
            heading=heading,
            rest=rest,
            policy=POLICY,
            style="".join(style.joinpath(name).read_text("utf-8") for name in ("style.css", "summary.css")),
            definitions=definitions(),
            trust=belief_of(track, front.direct, front.caution),
            front=front,
            figures=list(front.figures)[:MOST_FIGURES],
            points=list(front.points)[:MOST_POINTS],
            drawings=list(front.drawings)[: DRAWINGS if front.points else DRAWINGS_ALONE],
        ),
    )
    return path
