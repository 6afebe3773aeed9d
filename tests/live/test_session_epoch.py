"""A session knows when it was: its recording and its track have the moment of their start."""

import time

import pytest

import oarlock
from oarlock.live.folder import SESSION, LiveFolder
from oarlock.live.live_track import live_track
from oarlock.live.reading import Packet
from oarlock.live.recorder import Recorder
from oarlock.live.session import command
from oarlock.live.simulated_devices import LINES, Faults, deliveries, json_line, lines_rig
from oarlock.storage.epoch import moment_of
from oarlock_lab.emulators.swinging import swinging

MICROSECOND_S = 1e-6
"""What `datetime` resolves."""


@pytest.fixture
def place(pendulum, tmp_path):
    """The folder of a session that has ended."""
    start_ns = time.monotonic_ns()
    found = LiveFolder.create(
        tmp_path / "today", lines_rig(pendulum, "pendulum3", 9000, 50.0), None, start_ns
    )
    sent = swinging(pendulum, 50.0, seed=2)[1].slice(end_s=1.5)
    packets = [
        Packet(LINES, "10.0.0.7:5000", "", start_ns + round(1e9 * d.due_s), json_line(d))
        for d in deliveries(sent, Faults())
    ]
    orders = [command(start_ns + round(1e9 * at_s), do) for at_s, do in ((0.5, "track"), (2.0, "stop"))]
    recorder = Recorder(found.disk)
    for packet in sorted((*packets, *orders), key=lambda packet: packet.arrival_ns):
        recorder.write(packet)
    recorder.close()
    found.finish(pendulum)
    return found


def test_recording_and_track_are_dated(pendulum, place):
    recording = oarlock.load_recording(place.path / "recording")
    began = moment_of(recording.epoch)
    assert began.kind == "utc" and abs(began.seconds - place.start_epoch_s) <= MICROSECOND_S
    assert live_track(LiveFolder.load(place.path), pendulum).epoch == recording.epoch


def test_an_older_folder_has_no_date(pendulum, place):
    file = place.path / SESSION
    kept = [line for line in file.read_text().splitlines() if "epoch" not in line]
    file.write_text("\n".join(kept) + "\n")
    made = LiveFolder.load(place.path).finish(pendulum).recording
    assert made.epoch is None
