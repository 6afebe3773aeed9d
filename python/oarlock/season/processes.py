"""Processes of this machine that compute: a `Child` does one job after the other; `Processes` has several.

A pool of processes (`concurrent.futures`) breaks as a whole when one of them dies, and does not say at which job. Here
each process has one job at a time, so that it is known. The processes are started as commands, because a worker of Dask
may not use `multiprocessing`.
"""

from __future__ import annotations

import os
import pickle
import queue
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO

from oarlock.season.run import Ended, Job, Loss, Reply, Task
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_bytes

_READY = "ready"
START_LIMIT_S = 300.0
_STOPPED = "the run was stopped"
_DYING_S = 5.0
_COMMAND = "from oarlock.season.processes import child_main; child_main()"
_ONE_THREAD = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
_SHOWN_BYTES = 2000
_LOOK_S = 0.5
_STOP_S = 5.0
_REMOVALS = 3
"""The job at hand may write meanwhile."""
_IDLE_S = 600.0
"""A process that gets no job for so long ends: a worker of a cluster may stay for days."""


class Child:
    """A process for one task, started when it is first asked.

    Args:
        task: a function of a module; the process imports it.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self._process: subprocess.Popen[bytes] | None = None
        self._scratch: Path | None = None
        self._lock = threading.Lock()
        self._stopped = False

    @property
    def process_id(self) -> int:
        """Of the process; 0 while there is none."""
        return 0 if self._process is None else self._process.pid

    def ask(self, job: Job) -> Reply | Loss:
        """Do a job; returns when there is a reply, the process ended, or the job's time limit is over.

        Raises:
            DataError: the process does not even start.
        """
        if job.alone:
            self._end()
        process = self._running()
        assert process.stdin is not None
        assert process.stdout is not None
        with _TimeLimit(process, job.limit_s) as limit:
            reply = _answer(process, job)
        if isinstance(reply, Reply):
            return reply
        status = _status(process)
        detail = self._errors()
        self._end()
        if limit.reached:
            return Loss(True, f"it was not done after {job.limit_s:g} s", detail)
        return Loss(False, _how(status), detail)

    def stop(self) -> None:
        """Kill the process; whoever waits for a reply gets a `Loss`. It does not start again."""
        with self._lock:
            self._stopped = True
            if self._process is not None:
                self._process.kill()

    def close(self) -> None:
        """Kill the process, and remove its files."""
        self.stop()
        self._end()

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is not None:
            self._end()
        if self._process is None:
            self._start()
        assert self._process is not None
        return self._process

    def _start(self) -> None:
        if self._stopped:
            raise DataError(_STOPPED)
        self._scratch = Path(tempfile.mkdtemp(prefix="oarlock-"))
        self._remove_scratch = weakref.finalize(self, shutil.rmtree, self._scratch, True)  # at exit, too
        with self._lock, (self._scratch / "errors.txt").open("wb") as errors:
            if self._stopped:
                raise DataError(_STOPPED)
            self._process = subprocess.Popen(
                [sys.executable, "-c", _COMMAND, str(self._scratch)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                env=_environment(self._scratch),
                process_group=0,  # so that Ctrl-C reaches only the command, which then stops its processes
            )
        with _TimeLimit(self._process, START_LIMIT_S):
            found = _answer(self._process, self.task)
        if found != _READY:
            last = self._errors().splitlines()[-1:] or ["it said nothing"]
            self._end()
            raise DataError(f"a process that computes could not start: {last[0]}")

    def _errors(self) -> str:
        assert self._scratch is not None
        file = self._scratch / "errors.txt"
        return read_bytes(file)[-_SHOWN_BYTES:].decode(errors="replace").strip() if file.exists() else ""

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdin, self._process.stdout):
                _closed(stream)
        if self._scratch is not None:
            self._remove_scratch()
        self._process = self._scratch = None


class _TimeLimit:
    """Kills a process unless the block ends before."""

    def __init__(self, process: subprocess.Popen[bytes], limit_s: float) -> None:
        self._process, self._limit_s = process, limit_s
        self._timer = threading.Timer(limit_s, self._kill)
        self._timer.daemon = True
        self._lock = threading.Lock()
        self._is_over = False
        self.reached = False

    def __enter__(self) -> _TimeLimit:
        self._timer.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._timer.cancel()
        with self._lock:
            self._is_over = True

    def _kill(self) -> None:
        with self._lock:
            if not self._is_over:
                self.reached = True
                self._process.kill()


def _answer(process: subprocess.Popen[bytes], question: object) -> object:
    """What the process answers; None if it ended."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        pickle.dump(question, process.stdin)
        process.stdin.flush()
        return pickle.load(process.stdout)
    except (EOFError, OSError, pickle.UnpicklingError):
        return None


def _status(process: subprocess.Popen[bytes]) -> int:
    """How a process ended that answers no more."""
    try:
        return process.wait(_DYING_S)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def _environment(scratch: Path) -> dict[str, str]:
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    return {
        **os.environ,
        **dict.fromkeys(_ONE_THREAD, "1"),
        **dict.fromkeys(_TEMPORARY, str(scratch)),
        "PYTHONPATH": paths,
    }


def _how(status: int) -> str:
    if status >= 0:
        return f"its process ended with status {status}"
    name = signal.Signals(-status).name if -status in set(signal.Signals) else f"signal {-status}"
    return f"its process was ended by {name}{' (out of memory?)' if name == 'SIGKILL' else ''}"


def _closed(stream: IO[bytes] | None) -> None:
    if stream is not None:
        with suppress(OSError):  # what was not read is lost with the process
            stream.close()


def child_main() -> None:
    """Answer questions from the standard input until it ends, at once even if a job is at work.

    The argument of the command is a folder for temporary files, which is removed then.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    task: Task = pickle.load(sys.stdin.buffer)
    jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(jobs,), daemon=True).start()
    _reply(answers, _READY)
    while True:
        try:
            job = jobs.get(timeout=_IDLE_S)
        except queue.Empty:
            _leave()
        _reply(answers, _do(task, job))


def _do(task: Task, job: Job) -> Reply:
    try:
        return task(job)
    except Exception as error:
        return Reply("refused", f"{type(error).__name__}: {error}")


def _reply(stream: IO[bytes], answer: object) -> None:
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


class Processes:
    """An `Executor` with a number of processes; a thread looks after each.

    Args:
        task: a function of a module.
        workers: how many processes.
    """

    def __init__(self, task: Task, workers: int) -> None:
        self._waiting: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._ended: queue.SimpleQueue[Ended] = queue.SimpleQueue()
        self._open = 0
        self._is_cancelled = False
        self._children = [Child(task) for _ in range(workers)]
        self._threads = [threading.Thread(target=self._serve, args=(c,), daemon=True) for c in self._children]
        for thread in self._threads:
            thread.start()

    def submit(self, job: Job) -> None:
        """As `Executor.submit`."""
        self._open += 1
        self._waiting.put(job)

    def as_completed(self) -> Iterator[Ended]:
        """As `Executor.as_completed`."""
        while self._open and not self._is_cancelled:
            try:
                ended = self._ended.get(timeout=_LOOK_S)
            except queue.Empty:
                continue
            self._open -= 1
            yield ended

    def cancel(self) -> None:
        """As `Executor.cancel`."""
        self._is_cancelled = True
        for child in self._children:
            child.stop()
        for _ in self._threads:
            self._waiting.put(None)
        ends = time.monotonic() + _STOP_S
        for thread in self._threads:
            thread.join(max(0.0, ends - time.monotonic()))

    def _serve(self, child: Child) -> None:
        host = socket.gethostname()
        try:
            while (job := self._waiting.get()) is not None and not self._is_cancelled:
                began = time.monotonic()
                try:
                    reply = child.ask(job)
                except (DataError, OSError) as error:
                    reply = Reply("refused", str(error))
                seconds = time.monotonic() - began
                self._ended.put(Ended(job, reply, host, child.process_id, seconds))
        finally:
            child.close()
