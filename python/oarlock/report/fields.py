"""`write_report`: the report of any track, in the words of the field of use that it belongs to."""

from __future__ import annotations

from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

from oarlock.evaluation.scores import Evaluation
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress
from oarlock.tracking.track import Track


def write_report(
    result: Track,
    path: str | PathLike[str],
    evaluation: Evaluation | None = None,
    truth: Track | None = None,
    *,
    progress: Progress = None,
    **of_rowers: Any,
) -> list[Path]:
    """Write the report of any track: strokes of a rower, else ranges and cycles.

    Args:
        result: the track.
        path: a file, or a folder for report.html.
        evaluation: scores; computed if only `truth` is given.
        truth: drawn beside the estimate.
        progress: True shows a bar.
        of_rowers: keywords of `oarlock.rowing.report.write.write_rowing_report`.

    Returns:
        The files, the report first.

    Raises:
        DataError: no samples, or keywords of rowers for another track.
    """
    # Fields of use stand above this room, so no import names them.
    rowing = import_module("oarlock.rowing.report.write")
    path = Path(path) / "report.html" if Path(path).is_dir() else Path(path)
    if rowing.is_of_rower(result):
        written: list[Path] = rowing.write_rowing_report(
            result, path, evaluation, truth, progress=progress, **of_rowers
        )
        return written
    if given := [name for name, value in of_rowers.items() if value]:
        raise DataError(
            f"{given[0]} needs the track of a rower; this one has the joints {', '.join(result.joint_names[:6])}"
        )
    written = import_module("oarlock.movement.report").write_movement_report(
        result, path, evaluation, truth, progress=progress
    )
    return written
