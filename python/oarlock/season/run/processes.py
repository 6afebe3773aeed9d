"""`Processes`: computes jobs in processes of this machine."""

from __future__ import annotations

import queue
import socket
import threading
import time
from collections.abc import Iterator

from oarlock.season.run.child import Child
from oarlock.season.run.job import Ended, Job, Reply, Task
from oarlock.storage.errors import DataError

_LOOK_S = 0.5
_STOP_S = 5.0


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
