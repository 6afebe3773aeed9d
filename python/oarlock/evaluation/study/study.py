"""`study`: runs a Monte-Carlo study of how errors change with sensors, noise, mounts, rates and settings.

Each scenario is simulated with the same seeds, tracked and scored against its truth, on all cores.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from oarlock.evaluation.study.pool import Progress, all_rows
from oarlock.evaluation.study.result import StudyResult
from oarlock.evaluation.study.spec import Study


def study(
    what: Study,
    *,
    jobs: int | None = None,
    folder: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> StudyResult:
    """Run a study.

    The result has the same bits whatever `jobs` is. A run that fails is a row with its error and stops no other.
    With several jobs a script needs `if __name__ == "__main__":` around its call, as always with processes.

    Args:
        what: the study, from `load_study` or built in Python.
        jobs: processes; None is one for each core.
        folder: where finished runs are kept while others are under way, so that the same study goes on where it was
            stopped; None keeps nothing. `StudyResult.save` writes the results.
        progress: called now and then with the share of runs done, 0 to 1.

    Raises:
        DataError: `jobs` is no positive number.
    """
    place = None if folder is None else Path(folder)
    return StudyResult(what, tuple(all_rows(what, jobs, place, progress)))
