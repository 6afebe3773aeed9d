"""`oarlock live run`, killed at any moment: all but the last second is there, and gives the estimates that it gave."""

import contextlib
import itertools
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.live.folder import LiveFolder
from oarlock.live.frame import frame_of
from oarlock.live.rig import rig_document
from oarlock.live.session import COMMANDS
from oarlock.live.simulated_devices import Faults, endless, json_line, lines_rig
from oarlock.live.transports.udp import free_port
from oarlock.rowing.simulation.emulated import PERIOD_S, STREAMS, endless_sculling
from oarlock.storage.toml import write_toml

RATE_HZ = 50.0
LOST_S = 1.1
TICK_S = 0.01
PAGES_BEHIND = 3
"""The second page that is begun after an estimate has its readings, and the third has later ones."""


@dataclass
class Senders:
    """All devices of a sculler, in a thread; it notes what was sent, and how long this machine kept it waiting."""

    model: oarlock.Model
    port: int = field(default_factory=free_port)
    sent: dict[bytes, int] = field(default_factory=dict)
    """Datagram -> when it was sent, ns."""
    pauses: list[tuple[int, float]] = field(default_factory=list)
    """When the thread was woken too late, ns, and by how much, s."""

    def __enter__(self):
        self._ended = threading.Event()
        self._packets = endless(endless_sculling(self.model, 0, RATE_HZ), PERIOD_S, Faults(jitter_ms=2.0))
        self._thread = threading.Thread(target=self._send)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()

    def paused_s(self, since_ns):
        return sum(late_s for at_ns, late_s in self.pauses if at_ns >= since_ns)

    def _send(self):
        begun_ns, packets = time.monotonic_ns(), iter(self._packets)
        waiting = next(packets)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            while not self._ended.is_set():
                asked_ns = time.monotonic_ns()
                time.sleep(TICK_S)
                now_ns = time.monotonic_ns()
                self.pauses.append((now_ns, (now_ns - asked_ns) / 1e9 - TICK_S))
                while begun_ns + 1e9 * waiting.due_s <= now_ns:
                    line = json_line(waiting)
                    self.sent[line] = time.monotonic_ns()
                    sender.sendto(line, ("127.0.0.1", self.port))
                    waiting = next(packets)


@pytest.fixture(scope="module")
def senders(sculler):
    with Senders(sculler) as running:
        yield running


def begins(content):
    """Where pages of packets begin."""
    return [at for at in range(len(content)) if content.startswith(b"OARP", at)]


def pages(folder):
    """How many pages a session has written."""
    return sum(len(begins(file.read_bytes())) for file in (folder / "today" / "packets").iterdir())


def waited_s(process):
    """How long a process has waited for a core: Linux, /proc/PID/task/ID/schedstat."""
    total_ns = 0
    for thread in Path(f"/proc/{process.pid}/task").glob("*/schedstat"):
        with contextlib.suppress(OSError):  # a thread that has ended
            total_ns += int(thread.read_text().split()[1])
    return total_ns / 1e9


def killed(senders, folder, alive_s, more_pages=0):
    """A session that is killed so long after its first estimate; the estimates that had reached another program.

    Also how long it has waited for a core since then: its last second is that much longer.
    """
    rig = lines_rig(senders.model, "sculler", senders.port, RATE_HZ, STREAMS)
    write_toml(folder / "rig.toml", rig_document(rig))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(120.0)
        to = f"127.0.0.1:{listener.getsockname()[1]}"
        words = [sys.executable, "-m", "oarlock", "live", "run", str(folder / "rig.toml"), "--no-page"]
        words += ["--udp", to, "--out", str(folder / "today")]
        with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as child:
            lines = [listener.recv(1 << 16)]
            ends_s, waited_before_s = time.monotonic() + alive_s, waited_s(child)
            least_pages = pages(folder) + more_pages if more_pages else 0
            while time.monotonic() < ends_s or (least_pages and pages(folder) < least_pages):
                lines.append(listener.recv(1 << 16))
            held_up_s = waited_s(child) - waited_before_s
            child.send_signal(signal.SIGKILL)
            child.wait()
            # The end of this pipe is reached when the session's other processes have ended, too.
            assert b"Traceback" not in child.stderr.read()
        listener.setblocking(False)
        while True:
            try:
                lines.append(listener.recv(1 << 16))
            except BlockingIOError:
                told = [json.loads(line) for line in lines]
                return [one for one in told if one["type"] == "frame"], held_up_s


def check(senders, folder, estimates, held_up_s):
    """What was received before the kill, by the session's own stamps, against what is on the disk."""
    place = LiveFolder.load(folder / "today")
    damage = []
    packets = [p for p in place.read(damage) if p.source != COMMANDS]
    assert {p.data for p in packets} <= senders.sent.keys()
    arrivals_s = [(p.arrival_ns - place.start_ns) / 1e9 for p in packets]
    # Each estimate names the arrival of a reading that the session therefore had.
    had_s = max(one["arrival_s"] for one in estimates)
    last_s = max(arrivals_s, default=0.0)
    paused_s = senders.paused_s(place.start_ns + int(1e9 * (had_s - 3.0)))
    assert had_s - last_s <= LOST_S + max(paused_s, held_up_s)
    assert all(d.at_byte + d.length == d.file.stat().st_size for d in damage)

    session = place.session(senders.model)
    again, counts = {}, {}
    for packet in place.read():
        for one in session.take(packet):
            again[round(one.time_s, 4)] = one
        counts = counts if session.tracker is None else session.tracker.arrivals
    known = [one for one in estimates if one["arrival_s"] <= last_s - 1e-3]
    for one in known:
        assert one["joints"] == frame_of(again[one["time_s"]], senders.model)["joints"]
    return session, again, counts, len(known)


def check_recording(senders, folder, session, again, counts):
    """The recovered recording loads, and its track is the live one."""
    recording = oarlock.load_recording(folder / "today" / "recording")
    if session.tracker is None:
        return  # The command to track was in what was lost.
    track = oarlock.track(senders.model, recording.slice(start_s=session.from_s), config=session.config)
    if counts["late"] or counts["too_late"]:
        return
    columns = {name: k for k, name in enumerate(track.coordinate_names)}
    live = [one for one in again.values() if one.time_s in set(track.time_s)]
    rows = np.searchsorted(track.time_s, [one.time_s for one in live])
    for one, row in zip(live, rows, strict=True):
        for name, (value, std) in frame_of(one, senders.model)["joints"].items():
            column = columns[name]
            assert (value, std) == (
                round(float(track.q[row, column]), 5),
                round(float(track.q_std[row, column]), 5),
            )


@pytest.mark.parametrize(
    "moments",
    [pytest.param((0.3, 3.5), id="two"), pytest.param(50, id="fifty", marks=pytest.mark.long)],
)
def test_a_killed_session_loses_the_last_second_at_most(senders, tmp_path, moments):
    drawn = np.random.default_rng(9).uniform(0.0, 3.0, moments) if isinstance(moments, int) else moments
    compared = 0
    for number, alive_s in enumerate(drawn):
        folder = tmp_path / str(number)
        folder.mkdir()
        is_last = number == len(drawn) - 1
        estimates, held_up_s = killed(senders, folder, float(alive_s), PAGES_BEHIND if is_last else 0)
        session, again, counts, known = check(senders, folder, estimates, held_up_s)
        compared += known
        said = run("live", "recover", folder / "today").stdout
        if session.intake.devices:
            assert "Wrote" in said
            check_recording(senders, folder, session, again, counts)
        else:
            assert "there is no recording" in " ".join(said.split())
    # The first estimate comes after a second, and the readings of the last one need not be on the disk.
    assert compared > 0


def test_a_torn_page_and_a_flipped_byte_are_reported_and_the_rest_is_read(senders, tmp_path):
    killed(senders, tmp_path, 2.0, more_pages=5)
    (file,) = (tmp_path / "today" / "packets").iterdir()
    content = bytearray(file.read_bytes())
    at_byte = begins(content)
    whole = list(LiveFolder.load(tmp_path / "today").read())
    content[(at_byte[1] + at_byte[2]) // 2] ^= 0x10
    file.write_bytes(content[: (at_byte[-1] + len(content)) // 2])
    os.sync()
    damage = []
    kept = list(LiveFolder.load(tmp_path / "today").read(damage))
    assert [one.at_byte for one in damage] == [at_byte[1], at_byte[-1]]
    at = next(k for k, (a, b) in enumerate(itertools.zip_longest(whole, kept)) if a != b)
    # Two pages are missing: one within, one at the end.
    left = len(kept) - at
    assert kept[:at] == whole[:at] and any(
        whole[k : k + left] == kept[at:] for k in range(at, len(whole) - left + 1)
    )
    told = json.loads(run("live", "recover", tmp_path / "today", "--json", status=1).stdout)
    assert [one["at_byte"] for one in told["damage"]] == [at_byte[1], at_byte[-1]]
    assert oarlock.load_recording(tmp_path / "today" / "recording").names
