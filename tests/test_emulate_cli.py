"""`oarlock lab emulate` as a user types it."""

import subprocess
import sys

import pytest

import oarlock
from command_line import run
from oarlock import Recording
from oarlock.live.decoders import DECODERS
from oarlock.live.rig import Rig
from oarlock.live.transports import opened
from oarlock.live.transports.udp import free_port
from oarlock.recording import ScalarStream
from oarlock_lab.cli.emulate import write_rig
from oarlock_lab.emulators.emulated import Emulated
from oarlock_lab.emulators.kinds import KINDS
from oarlock_lab.emulators.swinging import swinging


def test_a_kind_is_emulated_and_its_rig_written(tmp_path):
    rig, port = tmp_path / "rig.toml", free_port()
    words = ("--model", "pendulum3", "--sensors", "upper,lower", "--port", port, "--rig-file", rig)
    said = run("lab", "emulate", "lines", *words, "--duration-s", "0.3").stdout
    assert f"sends to 127.0.0.1:{port}" in said and "oarlock live run" in said
    found = Rig.load(rig)
    assert [feed.stream for feed in found.feeds] == ["upper", "lower"]
    assert found.sources["lines"].options["port"] == port
    assert "--force" in run("lab", "emulate", "lines", *words, status=2).stderr


def test_a_recording_is_sent_once(pendulum, tmp_path):
    swinging(pendulum)[1].slice(end_s=0.3).save(tmp_path / "short")
    words = (
        "--replay",
        tmp_path / "short",
        "--port",
        free_port(),
        "--jitter-ms",
        "1",
        "--dropout",
        "upper:0:1",
    )
    assert "sends to" in run("lab", "emulate", "lines", *words).stdout


@pytest.mark.parametrize("name", [name for name, kind in KINDS.items() if not kind.streams])
def test_a_kind_that_feeds_no_sensor_gets_a_rig_without_streams(tmp_path, name):
    emulated = KINDS[name].emulated(Emulated(Recording([ScalarStream("time", [0.0, 0.3], [0.0, 0.3])])))
    write_rig(KINDS[name], emulated, "arm", tmp_path / "rig.toml")
    found = Rig.load(tmp_path / "rig.toml")
    [source] = found.sources.values()
    assert not found.feeds and source.transport == KINDS[name].transports[0]
    assert source.transport in DECODERS[source.format].transports
    opened(source)


def test_a_session_of_a_gps_receiver_records_its_speed(tmp_path):
    rig, port = tmp_path / "rig.toml", free_port()
    said = run("lab", "emulate", "nmea", "--port", port, "--rig-file", rig, "--duration-s", "0.1").stdout
    assert "feeds no sensor of a body" in " ".join(said.split())
    device = subprocess.Popen(
        [sys.executable, "-m", "oarlock", "lab", "emulate", "nmea", "--port", str(port)]
    )
    try:
        said = run("live", "run", rig, "--out", tmp_path / "today", "--no-page", "--duration-s", "6").stdout
    finally:
        device.terminate()
        device.wait()
    assert "nothing was tracked" in said and "estimates" not in said and "live doctor" not in said
    assert len(oarlock.live.channels(tmp_path / "today")["gps"].time_s) > 0


def test_all_kinds_are_listed():
    said = run("lab", "emulate", "--list").stdout
    assert all(name in said for name in KINDS)


def test_wrong_words_are_explained(tmp_path):
    assert "lines" in run("lab", "emulate", "line", status=2).stderr
    assert "has no transport" in run("lab", "emulate", "lines", "--transport", "ble", status=1).stderr
    assert "NAME:FROM:TO" in run("lab", "emulate", "lines", "--dropout", "upper", status=2).stderr
    assert "no such sensor" in run("lab", "emulate", "lines", "--sensors", "knee", status=2).stderr
