"""Runs groups of study runs on several processes. Results do not depend on the number or order of processes."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from oarlock import _core
from oarlock.evaluation.child_process import in_processes
from oarlock.evaluation.study.run import Group, Row, groups, run_group
from oarlock.evaluation.study.spec import Study, stable_text
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Told
from oarlock.storage.regular_file import read_bytes

UNFINISHED = "unfinished.jsonl"
"""File with the rows of finished groups, one line each, while a study runs."""


def all_rows(study: Study, jobs: int | None, folder: Path | None, progress: Told | None) -> list[Row]:
    """Rows of all runs, by scenario, then seed; the arguments are those of `rows_of_studies`."""
    return rows_of_studies((study,), jobs, folder, progress)[0]


def rows_of_studies(
    studies: Sequence[Study], jobs: int | None, folder: Path | None, progress: Told | None
) -> list[list[Row]]:
    """Rows of all runs of each study, by scenario, then seed. The same processes run all studies.

    Args:
        studies: the studies.
        jobs: number of processes; None uses all cores.
        folder: folder for finished groups, so that interrupted studies can continue; None stores nothing.
        progress: called regularly with the share done, 0 to 1.

    Raises:
        DataError: `jobs` is not a positive number.
    """
    if jobs is not None and (type(jobs) is not int or jobs < 1):
        raise DataError(f"study: jobs = {jobs!r}: expected 1 or more, or None for all cores")
    whole = [_Task(number, group) for number, study in enumerate(studies) for group in groups(study)]
    names = [identity(study) for study in studies]
    done = _read(folder)
    left = [task for task in whole if task.key(names) not in done]
    count = sum(task.size for task in whole)
    finished = count - sum(task.size for task in left)

    def report(more: int) -> None:
        nonlocal finished
        finished += more
        if progress is not None:
            progress(finished / count)

    # the longest first, so that no process ends much later than the others; the order of rows is restored below
    left.sort(key=lambda task: -task.size)
    for task, rows in _made(studies, left, jobs or os.cpu_count() or 1, report):
        done[task.key(names)] = rows
        _keep(folder, task.key(names), rows)
    found: list[list[Row]] = [[] for _ in studies]
    for task in whole:
        found[task.study] += done[task.key(names)]
    return [_in_order(study, rows) for study, rows in zip(studies, found, strict=True)]


def _in_order(study: Study, rows: list[Row]) -> list[Row]:
    seeds = {seed: place for place, seed in enumerate(study.seeds)}
    return sorted(rows, key=lambda row: (row["scenario"], seeds[row["seed"]]))


def forget(folder: Path) -> None:
    """Remove the rows that a study kept while it ran, after its result was saved elsewhere."""
    (folder / UNFINISHED).unlink(missing_ok=True)


@dataclass(frozen=True)
class _Task:
    """A group of a study, which has a number."""

    study: int
    group: Group

    @property
    def size(self) -> int:
        return len(self.group.scenarios)

    def key(self, names: Sequence[str]) -> tuple[str, str]:
        """Under which its rows are kept; `names` are the identities of the studies."""
        own = self.group
        return names[self.study], f"{own.seed} {own.key}" + (f" {own.part}" if own.part else "")


def _made(
    studies: Sequence[Study], left: list[_Task], jobs: int, report: Callable[[int], None]
) -> Iterator[tuple[_Task, list[Row]]]:
    if min(jobs, len(left)) <= 1:
        for task in left:
            yield task, run_group(studies[task.study], task.group, lambda: report(1))
        return
    for task, rows in in_processes(_one, studies, left, jobs):
        report(task.size)
        yield task, rows


def _one(studies: Sequence[Study], task: _Task) -> list[Row]:
    return run_group(studies[task.study], task.group)


# --- finished groups ----------------------------------------------------------------------------------


def identity(study: Study) -> str:
    """A hash of everything on which the rows depend."""
    parts = [
        _core.__version__,
        study.model.text,
        stable_text(study.model.parameters),
        repr(study.simulator),
        stable_text([[s.name, dict(s.values)] for s in study.expanded()]),
        stable_text([list(study.seeds), study.start_s, list(study.frames), list(study.joints)]),
    ]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _read(folder: Path | None) -> dict[tuple[str, str], list[Row]]:
    if folder is None or not (folder / UNFINISHED).is_file():
        return {}
    found = {}
    for line in read_bytes(folder / UNFINISHED).splitlines():
        try:
            kept = json.loads(line)
        except ValueError:  # the process was stopped while it wrote the line
            continue
        found[kept["study"], kept["group"]] = kept["rows"]
    return found


def _keep(folder: Path | None, key: tuple[str, str], rows: list[Row]) -> None:
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / UNFINISHED).is_symlink():
        raise DataError(f"{folder / UNFINISHED}: is a link; remove it")
    with (folder / UNFINISHED).open("a", encoding="utf-8") as file:
        file.write(json.dumps({"study": key[0], "group": key[1], "rows": rows}) + "\n")
