"""Processes beside this one, which leave Ctrl-C to it and end with it, however it ends; for studies and pages."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing.connection import wait
from typing import Any, TypeVar

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")
_GIVEN: Any = None


def child_pool() -> ProcessPoolExecutor:
    """Another process, which leaves Ctrl-C to this one and ends with it."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), begin_child)


def in_processes(
    work: Callable[[Any, _Task], _Result], given: Any, tasks: Sequence[_Task], jobs: int
) -> Iterator[tuple[_Task, _Result]]:
    """Tasks with their results `work(given, task)`, in the order in which they end; `given` goes to a process once.

    One job at a time is done here, without another process. Processes are stopped when the iteration ends early, as
    by Ctrl-C.
    """
    if min(jobs, len(tasks)) <= 1:
        yield from ((task, work(given, task)) for task in tasks)
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, len(tasks)), context, _begin_given, (given,))
    try:
        waiting = {pool.submit(_work_given, work, task): task for task in tasks}
        for future in as_completed(waiting):
            yield waiting[future], future.result()
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in multiprocessing.active_children():
            child.terminate()
        raise


def _begin_given(given: Any) -> None:
    global _GIVEN
    begin_child()
    _GIVEN = given


def _work_given(work: Callable[[Any, _Task], _Result], task: _Task) -> _Result:
    return work(_GIVEN, task)


def begin_child() -> None:
    """Start of a child process: it ignores Ctrl-C, which the parent handles, and ends if the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Ends the process when the parent's end of the pipe closes: a killed parent cannot stop its children."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
