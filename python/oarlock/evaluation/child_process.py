"""A process beside this one, which leaves Ctrl-C to it and ends with it, however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.connection import wait


def child_pool() -> ProcessPoolExecutor:
    """Another process, which leaves Ctrl-C to this one and ends with it."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), begin_child)


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
