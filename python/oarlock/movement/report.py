"""`write_movement_report`: the report of any body, with ranges of motion, repeated cycles, and right against left."""

from __future__ import annotations

from pathlib import Path

from oarlock import Track
from oarlock.evaluation import Evaluation
from oarlock.movement.front import front_of
from oarlock.movement.movement import cycles_table, movement_of
from oarlock.movement.sections import sections_of
from oarlock.movement.words import heading
from oarlock.report import Front, write_page
from oarlock.storage import csv_cells
from oarlock.storage.progress import Progress, mark, share, shown


def write_movement_report(
    track: Track,
    path: Path,
    evaluation: Evaluation | None = None,
    truth: Track | None = None,
    title: str | None = None,
    *,
    progress: Progress = None,
) -> list[Path]:
    """Write the report, and cycles.csv beside it if the movement repeats. Return the written files, the report first.

    `progress`: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Raises:
        DataError: the track has no samples.
    """
    if track.model is None or not len(track.time_s):
        return [write_page(track, path, evaluation, truth, title, progress=progress)]
    table = path.with_name("cycles.csv" if path.stem == "report" else f"{path.stem}-cycles.csv")
    with shown(progress, "writing the report") as told:
        movement = movement_of(track)
        front = front_of(movement) if movement.angles else None
        sections = sections_of(movement, table.name)
        title = title or heading(movement)
        mark(told, 0.5)
        rest = share(told, 0.5, 1.0)
        written = [write_page(track, path, evaluation, truth, title, sections, front, progress=rest)]
    if movement.blocks:
        csv_cells.write_csv(cycles_table(movement), table)
        written.append(table)
    return written


def movement_front(track: Track) -> tuple[str | None, Front]:
    """Title and front of any body's track, for its summary and its picture for a chat; empty without angles."""
    movement = movement_of(track) if track.model is not None and len(track.time_s) else None
    if movement is None or not movement.angles:
        return None, Front()
    return heading(movement), front_of(movement)
