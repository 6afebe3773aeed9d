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
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from oarlock.season.run import Ended, Job, Reply, Task
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_bytes

START_LIMIT_S = 300.0
_DYING_S = 5.0
_IDLE_S = 600.0
"""A process that gets no job for so long ends: a worker of a cluster may stay for days."""
_REMOVALS = 3
"""The job at hand may write meanwhile."""
_SHOWN_BYTES = 2000
_READY = "ready"
_COMMAND = "from oarlock.season.processes import child_main; child_main()"
_ONE_THREAD = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
_LOCAL = threading.local()


class Child:
    """A process for one task, a function of a module; it is started when it is first asked."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self._process: subprocess.Popen[bytes] | None = None
        self._scratch = Path()
        self._lock = threading.Lock()
        self._is_stopped = False

    def ended(self, job: Job) -> Ended:
        """As `ask`; a process that does not start refuses the job."""
        began_s = time.monotonic()
        try:
            reply = self.ask(job)
        except (DataError, OSError) as error:
            reply = Reply("refused", str(error))
        number = os.getpid() if self._process is None else self._process.pid
        return Ended(job, reply, socket.gethostname(), number, time.monotonic() - began_s)

    def ask(self, job: Job) -> Reply:
        """Do a job; returns when there is a reply, the process ended, or the job's time limit is over.

        Raises:
            DataError: the process does not even start.
        """
        if job.alone or (self._process is not None and self._process.poll() is not None):
            self._end()
        process = self._process or self._started()
        reply, is_late = _answer(process, job, job.limit_s)
        if isinstance(reply, Reply):
            if is_late:  # it was killed after its answer
                self._end()
            return reply
        with suppress(subprocess.TimeoutExpired):
            process.wait(_DYING_S)
        process.kill()
        status, detail = process.wait(), self._errors()
        self._end()
        if is_late:
            return Reply("hung", f"it was not done after {job.limit_s:g} s", detail=detail)
        return Reply("lost", _how(status), detail=detail)

    def stop(self) -> None:
        """Kill the process; whoever waits for a reply gets one that it is lost. It does not start again."""
        with self._lock:
            self._is_stopped = True
            if self._process is not None:
                self._process.kill()

    def close(self) -> None:
        """Kill the process, and remove its files."""
        self.stop()
        self._end()

    def _started(self) -> subprocess.Popen[bytes]:
        self._scratch = Path(tempfile.mkdtemp(prefix="oarlock-"))
        self._remove_scratch = weakref.finalize(self, shutil.rmtree, self._scratch, True)  # at exit, too
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
        own = dict.fromkeys(_ONE_THREAD, "1") | dict.fromkeys(_TEMPORARY, str(self._scratch))
        with self._lock, (self._scratch / "errors.txt").open("wb") as errors:
            if self._is_stopped:
                raise DataError("the run was stopped")
            self._process = process = subprocess.Popen(
                [sys.executable, "-c", _COMMAND, str(self._scratch)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                env={**os.environ, **own, "PYTHONPATH": paths},
                process_group=0,  # so that Ctrl-C reaches only the command, which then stops its processes
            )
        if _answer(process, self.task, START_LIMIT_S)[0] != _READY:
            last = self._errors().splitlines()[-1:] or ["it wrote no error"]
            self._end()
            raise DataError(f"a process that computes could not start: {last[0]}")
        return process

    def _errors(self) -> str:
        file = self._scratch / "errors.txt"
        return read_bytes(file)[-_SHOWN_BYTES:].decode(errors="replace").strip() if file.exists() else ""

    def _end(self) -> None:
        if self._process is None:
            return
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # what was not read is lost with the process
                if stream is not None:
                    stream.close()
        self._process = None
        self._remove_scratch()


def _answer(process: subprocess.Popen[bytes], question: object, limit_s: float) -> tuple[object, bool]:
    """The answer of a process, None if it ended; and whether it was killed because the time limit was over."""
    assert process.stdin is not None and process.stdout is not None
    is_late = threading.Event()

    def kill() -> None:
        is_late.set()
        process.kill()

    timer = threading.Timer(limit_s, kill)
    timer.daemon = True
    timer.start()
    answer = None
    with suppress(EOFError, OSError, pickle.UnpicklingError):
        pickle.dump(question, process.stdin)
        process.stdin.flush()
        answer = pickle.load(process.stdout)
    timer.cancel()
    timer.join()
    return answer, is_late.is_set()


def _how(status: int) -> str:
    if status >= 0:
        return f"its process ended with status {status}"
    name = signal.Signals(-status).name if -status in set(signal.Signals) else f"signal {-status}"
    return f"its process was ended by {name}{' (out of memory?)' if name == 'SIGKILL' else ''}"


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
    answer: object = _READY
    while True:
        pickle.dump(answer, answers)
        answers.flush()
        try:
            job = jobs.get(timeout=_IDLE_S)
        except queue.Empty:
            _leave()
        try:
            answer = task(job)
        except Exception as error:
            answer = Reply("refused", f"{type(error).__name__}: {error}")


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


def in_child(task: Task, job: Job) -> Ended:
    """Do a job in the process that belongs to this thread."""
    child: Child | None = getattr(_LOCAL, "child", None)
    if child is None or child.task is not task:
        if child is not None:
            child.close()
        child = _LOCAL.child = Child(task)
    return child.ended(job)


class Processes:
    """An `Executor` with `workers` processes for a task; a thread looks after each."""

    def __init__(self, task: Task, workers: int) -> None:
        self._task, self._children = task, list[Child]()
        self._threads = ThreadPoolExecutor(workers, initializer=self._begin)

    def _begin(self) -> None:
        _LOCAL.child = Child(self._task)
        self._children.append(_LOCAL.child)

    def run(self, jobs: Sequence[Job]) -> Iterator[Ended]:
        """As `Executor.run`."""
        completed: queue.SimpleQueue[Future[Ended]] = queue.SimpleQueue()
        for job in jobs:
            self._threads.submit(in_child, self._task, job).add_done_callback(completed.put)
        for _ in jobs:
            with suppress(CancelledError):
                yield completed.get().result()

    def cancel(self) -> None:
        """As `Executor.cancel`."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for child in self._children:
            child.stop()
        self._threads.shutdown()
        for child in self._children:
            child.close()
