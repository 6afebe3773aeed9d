"""`oarlock live run` as a process of its own, with emulated sensors as another: for tests of what may happen to it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

from websockets.sync.client import connect

from oarlock.live.client import socket_address
from oarlock.live.rig import rig_document
from oarlock.live.simulated_devices import lines_rig
from oarlock.live.transports.udp import free_port
from oarlock.rowing.simulation.emulated import STREAMS
from oarlock.storage.toml import write_toml

RATE_HZ = 25.0
"""Low, so that a busy machine keeps up."""
HANGS_S = 300.0
ENVIRONMENT = {"PYTHONUNBUFFERED": "1", "COLUMNS": "200"}


class LiveProcess:
    """A session; `said` has what it printed."""

    def __init__(self, rig, out, *options):
        words = [
            sys.executable,
            "-m",
            "oarlock",
            "live",
            "run",
            str(rig),
            "--out",
            str(out),
            "--no-guide",
            *options,
        ]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            words,
            stdout=pipe,
            stderr=pipe,
            text=True,
            env={**os.environ, **ENVIRONMENT},
            start_new_session=True,
        )
        self.said = ""
        self._readers = [
            threading.Thread(target=self._read, args=(stream,), daemon=True)
            for stream in (self.process.stdout, self.process.stderr)
        ]
        for reader in self._readers:
            reader.start()

    @property
    def url(self):
        return self.until(r"http://\S+")

    def until(self, pattern):
        """Waits until it has printed this."""
        begun_s = time.monotonic()
        while not (found := re.search(pattern, " ".join(self.said.split()))):
            assert time.monotonic() - begun_s < HANGS_S and self.is_alive(), f"never {pattern!r}: {self.said}"
            time.sleep(0.05)
        return found[0]

    def is_alive(self):
        return self.process.poll() is None or any(reader.is_alive() for reader in self._readers)

    def end(self):
        """Ctrl-C; its exit status, and what it has printed, in one line."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)  # to all its processes, as a terminal does
        return self.end_by_itself()

    def end_by_itself(self):
        """Waits for its end; its exit status, and what it has printed, in one line."""
        status = self.process.wait(HANGS_S)
        for reader in self._readers:
            reader.join(HANGS_S)
        self.process.stdout.close()
        self.process.stderr.close()
        return status, " ".join(self.said.split())

    def _read(self, stream):
        for line in stream:
            self.said += line


@contextmanager
def running(rig, out, *options):
    """A session that is ended at the end, whatever happens."""
    session = LiveProcess(rig, out, *options)
    try:
        yield session
    finally:
        if session.process.poll() is None:
            os.killpg(session.process.pid, signal.SIGKILL)
        session.end_by_itself()


@contextmanager
def rowing_units(model, folder):
    """The rig of units that send; its file."""
    port = free_port()
    write_toml(folder / "rig.toml", rig_document(lines_rig(model, "sculler", port, RATE_HZ, STREAMS)))
    words = [sys.executable, "-m", "oarlock.rowing.simulation.emulated", str(port), str(RATE_HZ)]
    emulator = subprocess.Popen(words, stdout=subprocess.PIPE)
    try:
        emulator.stdout.readline()
        yield folder / "rig.toml"
    finally:
        emulator.kill()
        emulator.stdout.close()
        emulator.wait()


def page(url, **keys):
    """A connection like that of the page."""
    return connect(socket_address(url), compression=None, open_timeout=HANGS_S, **keys)
