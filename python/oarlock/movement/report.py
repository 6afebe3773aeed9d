"""`write_movement_report`: the report of any body, with ranges of motion, repeated cycles, and right against left."""

from __future__ import annotations

from pathlib import Path

from oarlock import Evaluation, Track
from oarlock.movement.movement import cycles_table, movement_of
from oarlock.movement.sections import sections_of
from oarlock.report import write_report
from oarlock.storage import csv_cells


def write_movement_report(
    track: Track,
    path: Path,
    evaluation: Evaluation | None = None,
    truth: Track | None = None,
    title: str | None = None,
) -> list[Path]:
    """Write the report, and cycles.csv beside it if the movement repeats. Return the written files, the report first.

    Raises:
        DataError: the track has no samples.
    """
    if track.model is None or not len(track):
        return [write_report(track, path, evaluation, truth, title)]
    movement = movement_of(track)
    table = path.with_name("cycles.csv" if path.stem == "report" else f"{path.stem}-cycles.csv")
    written = [write_report(track, path, evaluation, truth, title, sections_of(movement, table.name))]
    if movement.main is not None:
        csv_cells.write_csv(cycles_table(movement, movement.main), table)
        written.append(table)
    return written
