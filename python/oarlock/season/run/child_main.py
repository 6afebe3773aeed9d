"""What runs in a process that `Child` starts: it receives a task, then jobs, and answers each."""

from __future__ import annotations

import os
import pickle
import queue
import shutil
import signal
import sys
import threading
from typing import IO

from oarlock.season.run.job import Job, Reply, Task

READY = "ready"
_REMOVALS = 3
"""The job at hand may write meanwhile."""
_IDLE_S = 600.0
"""A process that gets no job for so long ends: a worker of a cluster may stay for days."""


def main() -> None:
    """Answer questions from the standard input until it ends, at once even if a job is at work.

    The argument of the command is a folder for temporary files, which is removed then.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    task: Task = pickle.load(sys.stdin.buffer)
    jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(jobs,), daemon=True).start()
    _answer(answers, READY)
    while True:
        try:
            job = jobs.get(timeout=_IDLE_S)
        except queue.Empty:
            _leave()
        _answer(answers, _done(task, job))


def _done(task: Task, job: Job) -> Reply:
    try:
        return task(job)
    except Exception as error:
        return Reply("refused", f"{type(error).__name__}: {error}")


def _answer(stream: IO[bytes], answer: object) -> None:
    pickle.dump(answer, stream)
    stream.flush()


def _receive(jobs: queue.SimpleQueue[Job]) -> None:
    """Passes jobs on. The end of the input is the end of whoever asks, and of this process."""
    while True:
        try:
            jobs.put(pickle.load(sys.stdin.buffer))
        except EOFError:
            _leave()
        except Exception:
            os._exit(1)


def _leave() -> None:
    """End this process, and leave no copies of recordings behind, also if whoever asked was killed."""
    for _ in range(_REMOVALS):
        shutil.rmtree(sys.argv[1], ignore_errors=True)
    os._exit(0)
