"""Runs groups of study runs on several processes. Results do not depend on the number or order of processes."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path

from oarlock import _core
from oarlock.evaluation.child_process import begin_child
from oarlock.evaluation.study.run import Group, Row, groups, run_group
from oarlock.evaluation.study.spec import Study, stable_text
from oarlock.storage.errors import DataError

Progress = Callable[[float], object]

UNFINISHED = "unfinished.jsonl"
"""File with the rows of finished groups, one line each, while a study runs."""

_OWN: Study | None = None


def all_rows(study: Study, jobs: int | None, folder: Path | None, progress: Progress | None) -> list[Row]:
    """Rows of all runs, by scenario, then seed.

    Args:
        study: the study.
        jobs: number of processes; None uses all cores.
        folder: folder for finished groups, so that an interrupted study can continue; None stores nothing.
        progress: called regularly with the share done, 0 to 1.

    Raises:
        DataError: `jobs` is not a positive number.
    """
    if jobs is not None and (type(jobs) is not int or jobs < 1):
        raise DataError(f"study: jobs = {jobs!r}: expected 1 or more, or None for all cores")
    whole = groups(study)
    done = _read(study, folder)
    left = [group for group in whole if _name(group) not in done]
    count = sum(len(group.scenarios) for group in whole)
    finished = count - sum(len(group.scenarios) for group in left)

    def report(more: int) -> None:
        nonlocal finished
        finished += more
        if progress is not None:
            progress(finished / count)

    # the longest first, so that no process ends much later than the others; the order of rows is restored below
    left.sort(key=lambda group: -len(group.scenarios))
    for group, rows in _made(study, left, min(jobs or os.cpu_count() or 1, max(len(left), 1)), report):
        done[_name(group)] = rows
        _keep(study, folder, group, rows)
    rows = [row for group in whole for row in done[_name(group)]]
    seeds = {seed: place for place, seed in enumerate(study.seeds)}
    rows.sort(key=lambda row: (row["scenario"], seeds[row["seed"]]))
    return rows


def forget(folder: Path) -> None:
    """Remove the rows that a study kept while it ran, after its result was saved elsewhere."""
    (folder / UNFINISHED).unlink(missing_ok=True)


def _made(
    study: Study, left: list[Group], jobs: int, report: Callable[[int], None]
) -> Iterator[tuple[Group, list[Row]]]:
    if jobs == 1:
        for group in left:
            yield group, run_group(study, group, lambda: report(1))
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_begin, initargs=(study,))
    try:
        waiting: dict[Future[list[Row]], Group] = {pool.submit(_one, group): group for group in left}
        while waiting:
            ended, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in ended:
                group = waiting.pop(future)
                report(len(group.scenarios))
                yield group, future.result()
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in multiprocessing.active_children():
            child.terminate()
        raise


def _begin(study: Study) -> None:
    """Start of a child process."""
    global _OWN
    begin_child()
    _OWN = study


def _one(group: Group) -> list[Row]:
    assert _OWN is not None
    return run_group(_OWN, group)


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


def _name(group: Group) -> str:
    return f"{group.seed} {group.key}" + (f" {group.part}" if group.part else "")


def _read(study: Study, folder: Path | None) -> dict[str, list[Row]]:
    if folder is None or not (folder / UNFINISHED).is_file():
        return {}
    own, found = identity(study), {}
    for line in (folder / UNFINISHED).read_text(encoding="utf-8").splitlines():
        try:
            kept = json.loads(line)
        except json.JSONDecodeError:  # the process was stopped while it wrote the line
            continue
        if kept["study"] == own:
            found[kept["group"]] = kept["rows"]
    return found


def _keep(study: Study, folder: Path | None, group: Group, rows: list[Row]) -> None:
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / UNFINISHED).is_symlink():
        raise DataError(f"{folder / UNFINISHED}: is a link; remove it")
    with (folder / UNFINISHED).open("a", encoding="utf-8") as file:
        file.write(json.dumps({"study": identity(study), "group": _name(group), "rows": rows}) + "\n")
