"""What may happen to a running session, each as a user meets it: with its own process, sockets and disk."""

import itertools
import json
import os
import re
import resource
import socket
import struct
import subprocess
import sys
import urllib.error
import urllib.request
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest
from live_process import HANGS_S, LiveProcess, page, rowing_units, running
from websockets.exceptions import ConnectionClosed, InvalidStatus

import oarlock
from oarlock.live.folder import LiveFolder
from oarlock.live.server import MOST_RUBBISH
from oarlock.live.transports.udp import free_port

pytestmark = pytest.mark.long

TRACKING = r"tracking"
DISK_BYTES, FILES_BYTES = 24 << 20, 200_000
SECONDS_BYTES = 800_000
"""Packets of some seconds, so that the clocks of the units have settled."""


def parts(viewer):
    """What the session sends, each part apart, acknowledged at once."""
    for message in viewer:
        told = json.loads(message)
        viewer.send('{"shown": 1}')
        yield from (
            (told[key] for key in ("health", "frame") if key in told) if told["type"] == "now" else [told]
        )


def first(messages, is_it):
    return next(told for told in messages if is_it(told))


def frames_go_on(url, count=20):
    """A new viewer gets frames, each newer than the one before."""
    frames = itertools.islice(oarlock.live.frames(url), count)
    assert np.all(np.diff([frame["time_s"] for frame in frames]) > 0)


@contextmanager
def small_disk(place, size=DISK_BYTES, options=""):
    """A file system in memory."""
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}{options}", "tmpfs", place],
        capture_output=True,
        check=False,
    )
    if mounted.returncode:
        pytest.skip(f"a disk of its own cannot be mounted here: {mounted.stderr.decode().strip()}")
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", place], check=True)


def fill(place):
    """Takes all the room of a disk, to the last byte."""
    filler = place / "filler"
    with filler.open("ab", buffering=0) as file:
        for size in (1 << 20, 1 << 12, 1):
            try:
                while True:
                    file.write(bytes(size))
            except OSError:
                pass
    return filler


def assert_whole(folder):
    """Every packet of the folder can be read, and the recording is that of the packets; how many there are."""
    damage = []
    packets = list(LiveFolder.load(folder).read(damage))
    assert damage == []
    recording = oarlock.load_recording(folder / "recording")
    assert {"back", "seat"} <= set(recording.names)
    return len(packets)


def test_a_full_disk_ends_no_session_and_loses_nothing_when_room_is_made(sculler, tmp_path):
    with (
        rowing_units(sculler, tmp_path) as rig,
        small_disk(tmp_path / "disk") as disk,
        running(rig, disk / "today", "--port", "0") as session,
    ):
        url = session.url
        session.until(TRACKING)
        filler = fill(disk)
        session.until("recorder: nothing is recorded at this time: No space left on device")
        with page(url) as viewer:
            messages = parts(viewer)
            told = first(messages, lambda one: one["type"] == "health" and one["recorder"]["problem"])
            assert "No space left" in told["recorder"]["problem"] and told["recorder"]["free_gb"] == 0.0
            later = first(
                messages, lambda one: one["type"] == "frame" and one["time_s"] > told["time_s"] + 1.0
            )
            assert later["joints"]
            filler.unlink()
            told = first(messages, lambda one: one["type"] == "health" and not one["recorder"]["problem"])
            assert told["recorder"]["lost"] == 0
        session.until("recorder: works again")
        status, said = session.end()
        assert status == 0, said
        assert assert_whole(disk / "today") >= told["recorder"]["packets"]


def test_a_disk_that_stays_full_leaves_whole_packets_and_says_how_to_go_on(sculler, tmp_path):
    with (
        rowing_units(sculler, tmp_path) as rig,
        small_disk(tmp_path / "disk") as disk,
        running(rig, disk / "today", "--no-page") as session,
    ):
        session.until(TRACKING)
        while (disk / "today" / "packets" / "0001.packets").stat().st_size < SECONDS_BYTES:
            assert session.is_alive()
        filler = fill(disk)
        session.until("nothing is recorded at this time")
        fill(disk)  # what the recorder had begun to write, and cut off again
        status, said = session.end()
        assert status == 1, said
        assert re.search(r"[1-9][\d,]* packets are in ", said)
        assert "The recording could not be written" in said and "Traceback" not in said
        assert f"oarlock live recover {disk / 'today'}" in said
        filler.unlink()
        words = [sys.executable, "-m", "oarlock", "live", "recover", str(disk / "today")]
        subprocess.run(words, check=True, capture_output=True, timeout=HANGS_S)
        assert assert_whole(disk / "today") > 10


def test_files_that_may_not_grow_are_a_full_disk_too(sculler, tmp_path):
    with rowing_units(sculler, tmp_path) as rig, running(rig, tmp_path / "today", "--no-page") as session:
        session.until(TRACKING)
        pid = session.process.pid
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (FILES_BYTES, resource.RLIM_INFINITY))
        session.until("recorder: nothing is recorded at this time: File too large")
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        session.until("recorder: works again")
        status, said = session.end()
        assert status == 0, said
    assert_whole(tmp_path / "today")


def refused(rig, out, *options):
    """A session that cannot begin: what it says."""
    status, said = LiveProcess(rig, out, "--duration-s", "30", *options).end_by_itself()
    assert status == 1 and "Traceback" not in said
    return said


def test_a_folder_that_cannot_be_made_or_written_is_refused_by_name(sculler, tmp_path):
    with rowing_units(sculler, tmp_path) as rig, small_disk(tmp_path / "fixed", options=",ro") as fixed:
        (tmp_path / "file").write_text("x")
        for place in (tmp_path / "file" / "today", tmp_path / "file", fixed / "today", fixed):
            assert str(place) in refused(rig, place, "--port", "0").replace(" ", "")
        assert (tmp_path / "file").read_text() == "x"


def test_a_folder_of_others_is_used_and_left_as_it_is(sculler, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("x")
    with rowing_units(sculler, tmp_path) as rig, running(rig, tmp_path / "mine", "--no-page") as session:
        session.until(TRACKING)
        assert session.end()[0] == 0
    assert (tmp_path / "mine" / "notes.txt").read_text() == "x"
    assert_whole(tmp_path / "mine")


def test_two_sessions_share_neither_folder_nor_port(sculler, tmp_path):
    with rowing_units(sculler, tmp_path) as rig, running(rig, tmp_path / "today", "--port", "0") as session:
        url = session.url
        session.until(TRACKING)
        port = url.rpartition(":")[2].strip("/")
        said = refused(rig, tmp_path / "today", "--no-page")
        assert "has a live session already" in said and "--out" in said
        said = refused(rig, tmp_path / "other", "--port", port)
        assert f"127.0.0.1:{port}" in said and "--port" in said
        assert not (tmp_path / "other").exists(), "it can be tried again with the same folder"
        said = refused(rig, tmp_path / "other", "--no-page")
        assert "source 'lines': port" in said and "rig file" in said
        assert not (tmp_path / "other").exists()
        frames_go_on(url)
        assert session.end()[0] == 0
    assert_whole(tmp_path / "today")


def stalled(url):
    """A viewer that has opened the WebSocket and never reads again."""
    host, _, port = url.partition("//")[2].strip("/").partition(":")
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    made.connect((host, int(port)))
    made.sendall(
        f"GET /live HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    return made


def test_stalled_viewers_rubbish_and_ten_others_disturb_nobody(sculler, tmp_path):
    with (
        rowing_units(sculler, tmp_path) as rig,
        running(rig, tmp_path / "today", "--port", "0") as session,
        ExitStack() as open_,
    ):
        url = session.url
        session.until(TRACKING)
        halted = [open_.enter_context(stalled(url)) for _ in range(3)]
        cut = open_.enter_context(stalled(url))
        cut.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        cut.close()
        for raw in (b"\x00" * 500, b"GET", b"GET / HTTP/1.1\r\nHost: " + b"x" * 100_000):
            with socket.create_connection(("127.0.0.1", int(url.rpartition(":")[2].strip("/")))) as odd:
                odd.sendall(raw)
        bad = open_.enter_context(page(url))
        with pytest.raises(ConnectionClosed) as closed:
            for _ in range(10 * MOST_RUBBISH):
                bad.send("no message")
                bad.recv()
        assert closed.value.rcvd.code == 1008
        viewers = [oarlock.live.frames(url) for _ in range(10)]
        for viewer in viewers:
            assert np.all(np.diff([frame["time_s"] for frame in itertools.islice(viewer, 10)]) > 0)
        for viewer in viewers:
            viewer.close()
        assert len(halted) == 3
        status, said = session.end()
        assert status == 0 and "Traceback" not in said, said
    assert_whole(tmp_path / "today")


def test_only_the_whole_address_and_the_sessions_own_page_may_enter(sculler, tmp_path):
    with (
        rowing_units(sculler, tmp_path) as rig,
        running(rig, tmp_path / "today", "--port", "0", "--share") as session,
    ):
        url = session.url
        session.until(TRACKING)
        bare = url.partition("?")[0]
        for address in (bare, f"{bare}?token=", f"{bare}?token=wrong", url[:-1]):
            with pytest.raises(urllib.error.HTTPError) as refusal:
                urllib.request.urlopen(address)
            assert refusal.value.code == 403 and b"token" in refusal.value.read()
            with pytest.raises(oarlock.DataError, match="with its token"):
                next(oarlock.live.frames(address))
        for origin in (
            "http://elsewhere.example",
            "null",
            f"{bare[:-1]}.elsewhere.example",
            "https://127.0.0.1",
        ):
            with pytest.raises(InvalidStatus) as refused_:
                page(url, origin=origin)
            assert refused_.value.response.status_code == 403
        with page(url, origin=bare[:-1]) as viewer:
            assert json.loads(viewer.recv())["type"] == "hello"
        frames_go_on(url)


def test_a_name_that_leads_here_is_no_way_in_without_a_token(sculler, tmp_path):
    with rowing_units(sculler, tmp_path) as rig, running(rig, tmp_path / "today", "--port", "0") as session:
        port = session.url.rpartition(":")[2].strip("/")
        for host, code in (("rebound.example", 403), ("", 403), ("localhost", 200), ("127.0.0.1", 200)):
            request = urllib.request.Request(f"http://127.0.0.1:{port}/", headers={"Host": f"{host}:{port}"})
            try:
                found = urllib.request.urlopen(request).status
            except urllib.error.HTTPError as refusal:
                found = refusal.code
            assert found == code, host
        with pytest.raises(InvalidStatus):
            page(
                f"http://127.0.0.1:{port}/",
                origin=f"http://rebound.example:{port}",
                additional_headers={"Host": f"rebound.example:{port}"},
            )


def test_an_output_nobody_hears_and_a_host_that_does_not_exist_are_events(sculler, tmp_path):
    silent = f"127.0.0.1:{free_port()}"
    with (
        rowing_units(sculler, tmp_path) as rig,
        running(
            rig, tmp_path / "today", "--no-page", "--udp", silent, "--osc", "no.such.host.invalid:9000"
        ) as session,
    ):
        session.until(TRACKING)
        session.until(rf"JSON lines to {silent}: Connection refused")
        session.until(r"OSC to no\.such\.host\.invalid:9000: \w+")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as hears:
            hears.bind(("127.0.0.1", int(silent.rpartition(":")[2])))
            hears.settimeout(HANGS_S)
            session.until(rf"JSON lines to {silent}: works again")
            assert json.loads(hears.recv(1 << 16))["type"] in ("frame", "stroke", "event")
        assert session.end()[0] == 0
    assert os.path.isdir(tmp_path / "today" / "recording")
