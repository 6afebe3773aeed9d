"""System calls of Python on some folders, which fail when a test says so; for tests of what a session does then."""

from __future__ import annotations

import builtins
import errno
import io
import os
import sys
import threading
from contextlib import ExitStack, contextmanager
from pathlib import Path
from unittest import mock

import pyarrow.parquet as pq

from oarlock.live import disk

BY_PATH = ("open", "mkdir", "rename", "replace", "unlink", "rmdir", "scandir", "listdir", "stat", "lstat")
BY_PATH += ("statvfs", "truncate", "link", "access")
BY_NUMBER = ("fsync", "fdatasync", "fstat")
CODES = {"mkdir": errno.EACCES, "open": errno.EMFILE, "write": errno.ENOSPC}
REASON = "made to fail"


class System:
    """Counts calls by the lines of the package that make them, and lets some fail.

    Args:
        *folders: calls on what is in these are counted.
    """

    def __init__(self, *folders):
        self.folders = [os.path.abspath(folder) for folder in folders]
        self.sites = []
        """Name of a call and lines that lead to it, in the order of their first calls."""
        self.fails = lambda name, path, site: False
        self.failed = 0
        self._paths = {}
        self._calls = threading.Lock()

    @contextmanager
    def watched(self):
        """Within it calls are counted, and may fail."""
        with ExitStack() as patches:

            def patch(owner, name, made):
                patches.enter_context(mock.patch.object(owner, name, made))

            for name in BY_PATH:
                patch(os, name, self._by_path(name, getattr(os, name)))
            for name in BY_NUMBER:
                patch(os, name, self._by_number(name, getattr(os, name)))
            patch(disk, "SYNC", os.fdatasync)
            opened = self._opened(io.open)
            patch(io, "open", opened)
            patch(builtins, "open", opened)
            patch(pq, "write_table", self._second_is_path("write", pq.write_table))
            patch(threading.Thread, "start", self._started(threading.Thread.start))
            yield self

    def call(self, name, path):
        """Notes a call, and raises if it fails."""
        if path is not None and not self._is_ours(path):
            return
        site = (name, *_lines())
        if len(site) == 1:
            return
        with self._calls:
            if site not in self.sites:
                self.sites.append(site)
            if not self.fails(name, path, site):
                return
            self.failed += 1
        if name == "start":
            raise RuntimeError(REASON)
        raise OSError(CODES.get(name, errno.EIO), REASON, str(path))

    def _is_ours(self, path):
        try:
            path = os.path.abspath(os.fspath(path))
        except TypeError:
            return False
        return any(path == folder or path.startswith(folder + os.sep) for folder in self.folders)

    def _by_path(self, name, function):
        def called(path=".", *given, **keys):
            if isinstance(path, int):
                return function(path, *given, **keys)
            self.call(name, path)
            made = function(path, *given, **keys)
            if name == "open" and self._is_ours(path):
                self._paths[made] = path
            return made

        return called

    def _by_number(self, name, function):
        def called(number):
            if number in self._paths:
                self.call(name, self._paths[number])
            # Nothing is synced, which takes most of the time of a session.
            return None if "sync" in name else function(number)

        return called

    def _second_is_path(self, name, function):
        def called(table, path, *given, **keys):
            self.call(name, path)
            return function(table, path, *given, **keys)

        return called

    def _opened(self, function):
        def called(file, *given, **keys):
            path = self._paths.get(file) if isinstance(file, int) else file
            if path is None or not self._is_ours(path):
                return function(file, *given, **keys)
            if path is file:
                self.call("open", path)
            stream = function(file, *given, **keys)
            self._paths[stream.fileno()] = path
            return _Stream(stream, path, self)

        return called

    def _started(self, function):
        def called(thread):
            self.call("start", None)
            return function(thread)

        return called


class _Stream:
    """A file whose calls are counted."""

    def __init__(self, stream, path, system):
        self._stream, self._path, self._system = stream, path, system

    def __getattr__(self, name):
        found = getattr(self._stream, name)
        if name not in ("write", "read", "truncate", "flush"):
            return found

        def called(*given):
            self._system.call(name, self._path)
            return found(*given)

        return called

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __iter__(self):
        return iter(self._stream)

    def close(self):
        self._system._paths.pop(None if self._stream.closed else self._stream.fileno(), None)
        self._stream.close()


def _lines():
    """The lines of the package on the way to this call, the nearest first."""
    frame, found = sys._getframe(3), []
    while frame is not None:
        file = frame.f_code.co_filename
        if f"{os.sep}oarlock{os.sep}" in file and f"{os.sep}python{os.sep}" in file:
            found.append(f"{Path(file).name}:{frame.f_lineno} {frame.f_code.co_name}")
        frame = frame.f_back
    return found
