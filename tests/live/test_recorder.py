"""Packets on the disk: whole after close, all but the last second after a kill, damage found by its page."""

import errno
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from oarlock.live import recorder as recorder_module
from oarlock.live.disk import SessionDisk
from oarlock.live.reading import Packet
from oarlock.live.recorder import Damage, Recorder, read_packets
from refusals import assert_refused


def packets(count, seed=0):
    rng = np.random.default_rng(seed)
    return [
        Packet("units", f"192.168.1.{n % 5}", "", 10_000_000 * n, rng.bytes(int(rng.integers(0, 90))))
        for n in range(count)
    ]


def written(folder, sent):
    recorder = Recorder(SessionDisk(folder))
    for packet in sent:
        recorder.write(packet)
    recorder.close()
    assert (recorder.packets, recorder.lost, recorder.disk.problem) == (len(sent), 0, "")
    return sorted(folder.glob("packets/*.packets"))


def test_packets_come_back_in_order_and_a_second_recorder_adds_a_file(tmp_path):
    first, second = packets(500), packets(100, seed=1)
    written(tmp_path, first)
    files = written(tmp_path, second)
    assert [f.name for f in files] == ["0001.packets", "0002.packets"]
    damage = []
    assert list(read_packets(tmp_path, damage)) == first + second
    assert damage == []


def pages(folder, sent, size=50):
    """One file of pages of `size` packets each, with the byte at which each begins."""
    whole = [recorder_module._page(sent[n : n + size]) for n in range(0, len(sent), size)]
    (folder / "packets").mkdir()
    file = folder / "packets" / "0001.packets"
    file.write_bytes(b"".join(whole))
    return file, [0, *np.cumsum([len(p) for p in whole])]


def test_a_file_cut_anywhere_gives_every_whole_page(tmp_path):
    sent = packets(200)
    file, begins = pages(tmp_path, sent)
    content = file.read_bytes()
    for cut in [*np.random.default_rng(2).integers(0, len(content), 40), *begins]:
        file.write_bytes(content[:cut])
        whole = sum(begin <= cut for begin in begins[1:])
        damage = []
        assert list(read_packets(tmp_path, damage)) == sent[: 50 * whole]
        assert damage == ([] if cut in begins else [Damage(file, begins[whole], cut - begins[whole])])


def test_one_flipped_bit_costs_one_page_and_is_named(tmp_path):
    sent = packets(200)
    file, begins = pages(tmp_path, sent)
    content = file.read_bytes()
    for at in np.random.default_rng(3).integers(0, len(content), 60):
        broken = bytearray(content)
        broken[at] ^= 1 << (at % 8)
        file.write_bytes(broken)
        page = int(np.searchsorted(begins, at, side="right")) - 1
        damage = []
        assert list(read_packets(tmp_path, damage)) == sent[: 50 * page] + sent[50 * (page + 1) :]
        assert damage == [Damage(file, begins[page], begins[page + 1] - begins[page])]


@pytest.mark.parametrize("tail", [bytes(4096), b"OARP", b"OARP" * 5, os.urandom(300)])
def test_what_a_power_cut_leaves_behind_the_end_hurts_nothing(tmp_path, tail):
    sent = packets(100)
    file, begins = pages(tmp_path, sent)
    file.write_bytes(file.read_bytes() + tail)
    damage = []
    assert list(read_packets(tmp_path, damage)) == sent
    assert damage == [Damage(file, begins[-1], len(tail))]


def test_a_full_disk_is_told_and_nothing_is_lost_when_there_is_room_again(tmp_path, monkeypatch):
    write, full = recorder_module.write_all, [False]

    def refused(file, page):
        if full[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(file, page)

    monkeypatch.setattr(recorder_module, "write_all", refused)
    monkeypatch.setattr(recorder_module, "PAGE_S", 0.01)
    sent = packets(300)
    recorder = Recorder(SessionDisk(tmp_path))
    full[0] = True
    for packet in sent[:200]:
        recorder.write(packet)
    while not recorder.disk.problem:
        time.sleep(0.01)
    assert "No space left on device" in recorder.disk.problem
    full[0] = False
    for packet in sent[200:]:
        recorder.write(packet)
    recorder.close()
    assert (recorder.packets, recorder.lost, recorder.disk.problem) == (300, 0, "")
    assert list(read_packets(tmp_path)) == sent


def test_what_finds_no_room_in_memory_is_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder_module, "HELD_BYTES", 1000)
    recorder = Recorder(SessionDisk(tmp_path))
    sent = [Packet("a", "", "", n, bytes(200)) for n in range(20)]
    for packet in sent:
        recorder.write(packet)
    recorder.close()
    assert (recorder.packets, recorder.lost) == (4, 16)
    assert list(read_packets(tmp_path)) == sent[:4]


SENDER = """
import os, sys, time
from pathlib import Path
from oarlock.live.disk import SessionDisk
from oarlock.live.recorder import Recorder
from oarlock.live.reading import Packet
recorder = Recorder(SessionDisk(Path(sys.argv[1])))
while True:
    now_ns = time.monotonic_ns()
    recorder.write(Packet("a", "", "", now_ns, bytes(60)))
    os.write(1, now_ns.to_bytes(8, "little"))
    time.sleep(0.001)
"""


@pytest.mark.parametrize("alive_s", [0.7, 1.3])
def test_a_kill_loses_what_came_since_the_last_page(tmp_path, alive_s):
    child = subprocess.Popen([sys.executable, "-c", SENDER, str(tmp_path)], stdout=subprocess.PIPE)
    child.stdout.read(8)
    time.sleep(alive_s)
    child.send_signal(signal.SIGKILL)
    given = np.frombuffer(child.stdout.read(), "<i8")
    child.stdout.close()
    child.wait()
    kept = [packet.arrival_ns for packet in read_packets(tmp_path)][1:]
    np.testing.assert_array_equal(kept, given[: len(kept)])
    # Half a second where the machine is idle; where it is not, the thread that writes may have waited for a core.
    assert (given[-1] - (kept or given)[-1]) / 1e9 < 5.0


def test_a_place_that_cannot_be_written_or_has_no_packets_is_refused(tmp_path):
    (tmp_path / "file").write_text("x")
    assert_refused(lambda: Recorder(SessionDisk(tmp_path / "file")), "file", "cannot be written")
    assert_refused(lambda: list(read_packets(tmp_path)), "has no file of packets")
