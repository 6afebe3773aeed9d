"""`study`: runs a Monte-Carlo study of how errors change with sensors, noise, mounts, rates and settings.

Each scenario is simulated with the same seeds, tracked and scored against its truth, on all cores.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from oarlock.evaluation.study.pool import all_rows, forget
from oarlock.evaluation.study.result import StudyResult
from oarlock.evaluation.study.spec import Study
from oarlock.storage.progress import Progress, shown


def run_study(
    what: Study,
    *,
    jobs: int | None = None,
    folder: str | PathLike[str] | None = None,
    progress: Progress = None,
) -> StudyResult:
    """Run a study.

    The result does not depend on `jobs`, bit for bit. A failing run becomes a row with its error and does not stop the
    others. With several jobs a script must call this function under `if __name__ == "__main__":`.

    Args:
        what: the study, from `load_study` or built in Python.
        jobs: number of processes; None is one for each core.
        folder: folder for finished runs, so that an interrupted study can continue; None stores nothing.
            `StudyResult.save` writes the results.
        progress: True shows a bar or lines; a function is called regularly with the share of runs done, 0 to 1.

    Raises:
        DataError: `jobs` is not a positive number.
    """
    place = None if folder is None else Path(folder)
    with shown(progress, f"{what.run_count} runs") as told:
        result = StudyResult(what, tuple(all_rows(what, jobs, place, told)))
    if place is not None:
        forget(place)
    return result
