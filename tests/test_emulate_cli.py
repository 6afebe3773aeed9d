"""`oarlock emulate` as a user types it."""

from command_line import run
from oarlock.live.emulators.kinds import KINDS
from oarlock.live.emulators.swinging import swinging
from oarlock.live.rig import Rig
from oarlock.live.transports.udp import free_port


def test_a_kind_is_emulated_and_its_rig_written(tmp_path):
    rig, port = tmp_path / "rig.toml", free_port()
    words = ("--model", "pendulum3", "--units", "upper,lower", "--port", port, "--rig", rig)
    said = run("emulate", "lines", *words, "--seconds", "0.3").stdout
    assert f"sends to 127.0.0.1:{port}" in said and "oarlock live run" in said
    found = Rig.load(rig)
    assert [feed.stream for feed in found.feeds] == ["upper", "lower"]
    assert found.sources["lines"].options["port"] == port
    assert "--force" in run("emulate", "lines", *words, status=2).stderr


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
    assert "sends to" in run("emulate", "lines", *words).stdout


def test_all_kinds_are_listed():
    said = run("emulate", "--list").stdout
    assert all(name in said for name in KINDS)


def test_wrong_words_are_explained(tmp_path):
    assert "lines" in run("emulate", "line", status=2).stderr
    assert "has no transport" in run("emulate", "lines", "--transport", "ble", status=1).stderr
    assert "NAME:FROM:TO" in run("emulate", "lines", "--dropout", "upper", status=2).stderr
    assert "no such sensor" in run("emulate", "lines", "--units", "knee", status=2).stderr
