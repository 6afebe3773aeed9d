"""`DaskCluster`: computes jobs on the workers of a Dask scheduler that runs already.

Measured weaknesses of the scheduler, and what is done about them: results that are held in a worker's memory are
computed again when it dies, so futures are released at once and few jobs are in flight; all jobs assigned to a worker
that dies become suspicious, so each job runs in a process beside the worker, which survives it.
"""

from __future__ import annotations

import logging
import queue
import secrets
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

from oarlock.season.processes import in_child
from oarlock.season.run import Ended, Job, Reply, Task
from oarlock.storage.errors import DataError

_IN_FLIGHT = 2
"""Jobs that are assigned for each thread of a worker: one at work, one next."""
_LOOK_S = 0.5
_WORKERS_ASKED_S = 2.0
_CONNECT_S = 10.0


class DaskCluster:
    """An `Executor` on an existing cluster, by the scheduler's address; `notice` is called when there is no worker."""

    def __init__(
        self, task: Task, scheduler: str, notice: Callable[[str], None] = lambda words: None
    ) -> None:
        self.task, self._scheduler, self._notice = task, scheduler, notice
        self._client = _connected(scheduler)
        self._running: dict[Any, Job] = {}
        self._changed: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._name, self._sent = secrets.token_hex(4), 0
        self._threads, self._asked_s = 1, -_WORKERS_ASKED_S

    def run(self, jobs: Sequence[Job]) -> Iterator[Ended]:
        """As `Executor.run`."""
        waiting = deque(jobs)
        while waiting or self._running:
            self._send(waiting)
            with suppress(queue.Empty):
                future = self._changed.get(timeout=_LOOK_S)
                ended = self._ended(future, self._running.pop(future))
                future.release()
                yield ended

    def cancel(self) -> None:
        """As `Executor.cancel`; what is at work on a worker ends there and is stored."""
        with suppress(Exception):
            self._client.cancel(list(self._running), asynchronous=False)
        self._running.clear()
        with suppress(Exception):
            self._client.close(timeout=1)

    def _send(self, waiting: deque[Job]) -> None:
        if time.monotonic() - self._asked_s >= _WORKERS_ASKED_S:
            before, self._threads = self._threads, sum(self._answer(self._client.nthreads).values())
            self._asked_s = time.monotonic()
            if before and not self._threads:
                self._notice(f"{self._scheduler} has no workers; waiting for some. Ctrl-C stops")
        while waiting and len(self._running) < _IN_FLIGHT * max(1, self._threads):
            job = waiting.popleft()
            self._sent += 1
            key = f"oarlock-{self._name}-{self._sent}-{job.recording}"
            # The later it is sent, the later it begins.
            about = {"key": key, "pure": False, "priority": -self._sent}
            future = self._answer(partial(self._client.submit, in_child, self.task, job, **about))
            self._running[future] = job
            future.add_done_callback(self._changed.put)

    def _ended(self, future: Any, job: Job) -> Ended:
        from distributed import KilledWorker

        if future.status in ("cancelled", "lost"):
            raise self._gone()
        error = self._answer(future.exception)
        if error is None:
            ended: Ended = self._answer(future.result)
            return ended
        if isinstance(error, KilledWorker):
            return Ended(job, Reply("lost", "the workers that had it ended"))
        return Ended(job, Reply("refused", f"a worker of {self._scheduler}: {type(error).__name__}: {error}"))

    def _answer(self, request: Callable[[], Any]) -> Any:
        """What the cluster answers."""
        from distributed.client import FutureCancelledError

        if self._client.status != "running":
            raise self._gone()
        try:
            return request()
        except (OSError, TimeoutError, FutureCancelledError) as error:
            raise self._gone() from error

    def _gone(self) -> DataError:
        return DataError(
            f"{self._scheduler}: the scheduler does not answer any more. What was computed is stored; start the "
            "scheduler and its workers, and the same command continues"
        )


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
