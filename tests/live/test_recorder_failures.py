"""Every step of the recorder fails once in turn, and for good: nothing is lost, each failure is counted and said."""

import errno
import shutil
import threading
import time
from pathlib import Path

import pytest

from oarlock.live import disk as disk_module
from oarlock.live import recorder as recorder_module
from oarlock.live.disk import SessionDisk
from oarlock.live.reading import Packet
from oarlock.live.recorder import Recorder, packet_files, read_packets
from refusals import assert_refused

COUNT = 400
FILE_BYTES = 2000  # so that files change all the time


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(recorder_module, "PAGE_S", 0.005)
    monkeypatch.setattr(recorder_module, "FILE_BYTES", FILE_BYTES)


def packets(count=COUNT):
    return [Packet("u", f"a{n % 3}", "", n, bytes([n % 256]) * 30) for n in range(count)]


def send(recorder, sent, meanwhile=lambda number: None):
    """Gives the packets one after the other, with time for pages in between."""
    for number, packet in enumerate(sent):
        meanwhile(number)
        recorder.write(packet)
        if number % 20 == 0:
            time.sleep(0.01)


class Failing:
    """A function that fails with an error of the system at one of its calls."""

    def __init__(self, function, at, code):
        self.function, self.at, self.code, self.calls = function, at, code, 0

    def __call__(self, *given, **keys):
        self.calls += 1
        if self.calls == self.at:
            raise OSError(self.code, "made to fail")
        return self.function(*given, **keys)


STEPS = {
    "open": (Path, "open", errno.EMFILE),
    "mkdir": (Path, "mkdir", errno.EACCES),
    "list": (recorder_module, "_files", errno.EIO),
    "write": (recorder_module, "write_all", errno.ENOSPC),
    "sync": (disk_module, "SYNC", errno.EIO),
    "status": (recorder_module.os, "stat", errno.ESTALE),
}


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("at", [2, 3, 4])
def test_a_step_that_fails_once_costs_nothing(step, at, tmp_path, monkeypatch):
    owner, name, code = STEPS[step]
    recorder, sent = Recorder(SessionDisk(tmp_path)), packets()
    failing = Failing(getattr(owner, name), at, code)
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, lambda *given, **keys: failing(*given, **keys))
        send(recorder, sent)
        recorder.close()
    assert failing.calls >= at
    assert (recorder.packets, recorder.lost, recorder.disk.problem, recorder.disk.failures) == (
        COUNT,
        0,
        "",
        1,
    )
    assert [text.partition(": ")[2][:7] for text in recorder.disk.news()] == ["nothing", "works a"]
    assert list(read_packets(tmp_path)) == sent


def test_a_place_that_fails_for_good_is_replaced_by_the_second(tmp_path, monkeypatch):
    monkeypatch.setattr(disk_module, "PATIENCE_S", 0.05)
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    (first / "rig.toml").write_text("of an earlier session")
    recorder, sent = Recorder(SessionDisk(first, second, {"rig.toml": "x"})), packets()
    write, full = recorder_module.write_all, [False]

    def refused(file, content):
        if full[0] and first in Path(file.name).parents:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(file, content)

    monkeypatch.setattr(recorder_module, "write_all", refused)

    def meanwhile(number):
        full[0] = 100 <= number < 300
        if number == 250:
            while not recorder.elsewhere:
                time.sleep(0.01)
            problem = recorder.disk.problem
            assert "No space left" in problem and f"recorded elsewhere: {second}" in problem

    send(recorder, sent, meanwhile)
    recorder.close()
    assert (recorder.packets, recorder.lost, recorder.disk.problem) == (COUNT, 0, "")
    assert recorder.elsewhere > 0 and recorder.disk.failures > 0
    assert list(read_packets(first, second=second)) == sent
    assert (first / "rig.toml").read_text() == (second / "rig.toml").read_text() == "x"


@pytest.mark.parametrize("is_moved", [False, True])
@pytest.mark.parametrize("is_refused", [False, True])
def test_a_folder_that_is_removed_or_moved_is_written_again(is_moved, is_refused, tmp_path, monkeypatch):
    monkeypatch.setattr(disk_module, "PATIENCE_S", 0.0)
    today, second = tmp_path / "today", tmp_path / "second"
    recorder, sent = Recorder(SessionDisk(today, second, {"rig.toml": "x"})), packets(200)

    def meanwhile(number):
        if number == 140:
            while recorder.packets < number:  # then nothing is written meanwhile
                time.sleep(0.01)
            today.rename(tmp_path / "yesterday") if is_moved else shutil.rmtree(today)
            if is_refused:
                today.write_text("in the way")

    send(recorder, sent, meanwhile)
    recorder.close()
    place = second if is_refused else today
    assert (recorder.packets, recorder.lost) == (200, 0)
    assert list(read_packets(place)) == sent and (place / "rig.toml").read_text() == "x"
    assert [int(file.stem) for file in packet_files(place)] == [*range(1, 1 + len(packet_files(place)))]


def test_a_disk_that_hangs_is_named_and_holds_up_nobody(tmp_path, monkeypatch):
    monkeypatch.setattr(disk_module, "ANSWER_S", 0.01)
    answers, write = threading.Event(), recorder_module.write_all
    monkeypatch.setattr(recorder_module, "write_all", lambda *given: answers.wait() and write(*given))
    recorder, sent, said = Recorder(SessionDisk(tmp_path)), packets(50), []
    for packet in sent:
        recorder.write(packet)
    while not said:
        said += recorder.disk.news()
        time.sleep(0.01)
    assert "disk: has not answered" in said[0] and "has not answered" in recorder.disk.problem
    answers.set()
    recorder.close()
    assert recorder.disk.news() == ["disk: works again"]
    assert list(read_packets(tmp_path)) == sent


def test_a_thread_that_cannot_be_started_is_an_error(tmp_path, monkeypatch):
    def refused(self):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(recorder_module.threading.Thread, "start", refused)
    assert_refused(lambda: Recorder(SessionDisk(tmp_path)), "cannot be written", "thread")


def test_an_error_that_nobody_foresaw_does_not_end_the_thread(tmp_path, monkeypatch):
    recorder, sent = Recorder(SessionDisk(tmp_path)), packets(100)
    failing = [True]

    def page(given, whole=recorder_module._page):
        if failing and failing.pop():
            raise ValueError("nobody foresaw this")
        return whole(given)

    monkeypatch.setattr(recorder_module, "_page", page)
    send(recorder, sent)
    recorder.close()
    assert recorder.packets == 100 and list(read_packets(tmp_path)) == sent
    assert recorder.disk.failures == 1 and "nobody foresaw this" in recorder.disk.news()[0]


@pytest.mark.parametrize("head", [b"OARP", recorder_module._HEAD.pack(b"OARP", 1 << 20, 7)])
def test_the_search_for_a_page_is_bounded(head, tmp_path):
    """A megabyte of heads, each with a length that reaches to the end, was quadratic."""
    if len(head) > 4:
        head += recorder_module._CHECK.pack(recorder_module.zlib.crc32(head))
    sent = packets(10)
    whole = recorder_module._page(sent)
    (tmp_path / "packets").mkdir()
    (tmp_path / "packets" / "0001.packets").write_bytes(whole + head * ((1 << 20) // len(head)))
    damage = []
    assert list(read_packets(tmp_path, damage)) == sent
    assert [d.at_byte for d in damage] == [len(whole)]


def test_pages_with_a_right_checksum_and_wrong_lengths_are_damage(tmp_path):
    (tmp_path / "packets").mkdir()
    for body in (
        b"x",
        recorder_module._ROW.pack(1, 1 << 31, 0, 0, 0),
        recorder_module._ROW.pack(1, 0, 0, 0, 5) + b"abc",
        recorder_module._ROW.pack(1, 1, 0, 0, 0) + b"\xff",
    ):
        head = recorder_module._HEAD.pack(b"OARP", len(body), recorder_module.zlib.crc32(body))
        head += recorder_module._CHECK.pack(recorder_module.zlib.crc32(head))
        (tmp_path / "packets" / "0001.packets").write_bytes(head + body)
        damage = []
        assert list(read_packets(tmp_path, damage)) == []
        assert [d.length for d in damage] == [len(head + body)]


def test_a_text_that_is_none_holds_up_nothing(tmp_path):
    recorder = Recorder(SessionDisk(tmp_path))
    sent = [Packet("u", "half \ud800, byte \udc80", "c", n, b"x") for n in range(3)]
    send(recorder, sent)
    recorder.close()
    assert recorder.packets == 3 and list(read_packets(tmp_path)) == sent
