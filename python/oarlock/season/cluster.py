"""`DaskCluster`: computes jobs on the workers of a Dask scheduler that runs already.

Measured weaknesses of the scheduler, and what is done about them: results that are held in a worker's memory are
computed again when it dies, so futures are released at once and few jobs are in flight; all jobs assigned to a worker
that dies become suspicious, so each job runs in a process beside the worker, which survives it.
"""

from __future__ import annotations

import logging
import queue
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any

from oarlock.season.processes import Child
from oarlock.season.run import Ended, Job, Loss, Reply, Task
from oarlock.storage.errors import DataError

IN_FLIGHT = 2
"""Jobs that are assigned for each thread of a worker: one at work, one next."""
_LOOK_S = 0.5
_WORKERS_ASKED_S = 2.0
_CONNECT_S = 10.0
_LOCAL = threading.local()


class DaskCluster:
    """An `Executor` on an existing cluster, by the scheduler's address; `notice` is called when there is no worker."""

    def __init__(
        self, task: Task, scheduler: str, notice: Callable[[str], None] = lambda words: None
    ) -> None:
        self.task, self._scheduler, self._notice = task, scheduler, notice
        self._client = _connected(scheduler)
        self._waiting: deque[Job] = deque()
        self._running: dict[Any, Job] = {}
        self._changed: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._name = secrets.token_hex(4)
        self._sent = 0
        self._threads, self._asked_s, self._is_noticed = 0, -_WORKERS_ASKED_S, False

    @property
    def threads(self) -> int:
        """Threads of all workers at this moment."""
        if time.monotonic() - self._asked_s >= _WORKERS_ASKED_S:
            self._threads = sum(self._asked(self._client.nthreads).values())
            self._asked_s = time.monotonic()
            if self._threads == 0 and not self._is_noticed:
                self._notice(f"{self._scheduler} has no workers; waiting for some. Ctrl-C stops")
            self._is_noticed = self._threads == 0
        return self._threads

    def submit(self, job: Job) -> None:
        """As `Executor.submit`."""
        self._waiting.append(job)

    def as_completed(self) -> Iterator[Ended]:
        """As `Executor.as_completed`."""
        while self._waiting or self._running:
            self._send()
            try:
                future = self._changed.get(timeout=_LOOK_S)
            except queue.Empty:
                continue
            job = self._running.pop(future)
            ended = self._ended(future, job)
            future.release()
            yield ended

    def cancel(self) -> None:
        """As `Executor.cancel`; what is at work on a worker ends there and is stored."""
        self._waiting.clear()
        with suppress(Exception):
            self._client.cancel(list(self._running), asynchronous=False)
        self._running.clear()
        self.close()

    def close(self) -> None:
        """Leave the cluster; it goes on without us."""
        with suppress(Exception):
            self._client.close(timeout=1)

    def _send(self) -> None:
        room = IN_FLIGHT * max(1, self.threads)
        while self._waiting and len(self._running) < room:
            job = self._waiting.popleft()
            self._sent += 1
            key = f"oarlock-{self._name}-{self._sent}-{job.recording}"
            # The later it is sent, the later it begins.
            about = {"key": key, "pure": False, "priority": -self._sent}
            future = self._asked(partial(self._client.submit, on_worker, self.task, job, **about))
            self._running[future] = job
            future.add_done_callback(self._changed.put)

    def _ended(self, future: Any, job: Job) -> Ended:
        from distributed import KilledWorker

        if future.status in ("cancelled", "lost"):
            raise DataError(self._gone())
        error = self._asked(future.exception)
        if error is None:
            ended: Ended = self._asked(future.result)
            return ended
        if isinstance(error, KilledWorker):
            return Ended(job, Loss(False, "the workers that had it ended"))
        return Ended(job, Reply("refused", f"a worker of {self._scheduler}: {type(error).__name__}: {error}"))

    def _asked(self, ask: Callable[[], Any]) -> Any:
        """What the cluster answers."""
        from distributed.client import FutureCancelledError

        try:
            if self._client.status != "running":
                raise DataError(self._gone())
            return ask()
        except (OSError, TimeoutError, FutureCancelledError) as error:
            raise DataError(self._gone()) from error

    def _gone(self) -> str:
        return (
            f"{self._scheduler}: the scheduler does not answer any more. What was computed is stored; start the "
            "scheduler and its workers, and the same command continues"
        )


def on_worker(task: Task, job: Job) -> Ended:
    """Do a job in a process beside the worker; each of its threads has one."""
    child: Child | None = getattr(_LOCAL, "child", None)
    if child is None or child.task is not task:
        if child is not None:
            child.close()
        child = _LOCAL.child = Child(task)
    return child.ended(job)


def _connected(scheduler: str) -> Any:
    try:
        import distributed
    except ImportError:
        raise DataError(
            f'{scheduler}: Dask clusters need one more package: pip install "oarlock[dask]"'
        ) from None
    for logger in ("distributed", "distributed.client"):
        logging.getLogger(logger).setLevel(logging.CRITICAL)  # what fails is said in our words
    client: Any = distributed.Client
    try:
        return client(scheduler, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        first = str(error).strip().splitlines()[:1] or [type(error).__name__]
        raise DataError(
            f"{scheduler}: no Dask scheduler answers there ({first[0]}). Start one with `dask scheduler`, and workers "
            "with `dask worker ADDRESS`; it prints the address"
        ) from None
