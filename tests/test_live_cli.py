"""`oarlock live` as a user types it, with sensors emulated on this machine."""

import json

import numpy as np

import oarlock
from command_line import run
from oarlock.live.folder import LiveFolder
from oarlock.live.reading import Packet
from oarlock.live.recorder import Recorder
from oarlock.live.rig import rig_document
from oarlock.live.session import command
from oarlock.live.simulated_devices import lines_rig
from oarlock.live.transports.udp import free_port
from oarlock.storage.toml import write_toml


def test_a_rig_is_recorded_and_the_recording_written_again(sculler, tmp_path):
    write_toml(
        tmp_path / "rig.toml", rig_document(lines_rig(sculler, "sculler", free_port(), 100.0, ("back",)))
    )
    out = tmp_path / "today"
    said = run("live", "run", tmp_path / "rig.toml", "--no-page", "--duration-s", "0.3", "--out", out).stdout
    assert "No sensor of the rig was heard" in said and f"Wrote {out}" in " ".join(said.split())
    assert f"oarlock live doctor {out / 'rig.toml'}" in " ".join(said.split())
    again = run("live", "recover", out).stdout
    assert "no reading of the rig's sensors" in again
    nothing = json.loads(run("live", "recover", out, "--json").stdout)
    assert nothing.items() >= {"written": None, "damage": [], "refused": [], "missing": []}.items()
    assert (
        "has a live session already"
        in run(
            "live", "run", tmp_path / "rig.toml", "--no-page", "--duration-s", "0.3", "--out", out, status=1
        ).stderr
    )


def test_recover_names_commands_that_it_skips_and_fails_where_packets_are_missing(sculler, tmp_path):
    rig = lines_rig(sculler, "sculler", 9000, 100.0, ("back",))
    place = LiveFolder.create(tmp_path / "today", rig, None, 0)
    recorder = Recorder(place.disk)
    line = b'{"device": "back", "t_us": 1, "accel_m_s2": [9.81, 0, 0], "gyro_rad_s": [0, 0, 0]}'
    recorder.write(Packet("lines", "", "", 1, line))
    for device in ("nobody", 5):
        recorder.write(command(2, "assign", stream="nobody", device=device))
    recorder.close()
    (file,) = (tmp_path / "today" / "packets").iterdir()
    told = json.loads(run("live", "recover", tmp_path / "today", "--json").stdout)
    reasons = ("no stream 'nobody'", "needs a text as 'device'")
    for number, (text, reason) in enumerate(zip(told["refused"], reasons, strict=True), 2):
        assert text.startswith(f"{file}, packet {number}: the command was skipped: ") and reason in text
    assert told["written"] == str(tmp_path / "today" / "recording") and told["streams"] == 1
    file.rename(file.with_name("0002.packets"))
    assert "0001.packets is missing" in run("live", "recover", tmp_path / "today", status=1).stdout
    told = json.loads(run("live", "recover", tmp_path / "today", "--json", status=1).stdout)
    assert len(told["refused"]) == 2 and len(told["missing"]) == 1


def test_the_demo_tracks_emulated_sensors(tmp_path):
    out = tmp_path / "demo"
    said = run("live", "demo", "--no-page", "--duration-s", "4", "--out", out).stdout
    recording = oarlock.load_recording(out / "recording")
    assert {"back", "seat", "r_oar_phi"} <= set(recording.names)
    assert np.isfinite(recording.sensor("back").gyro_rad_s).all()
    assert f"Wrote {out}" in said
    assert f"oarlock track {out / 'recording'} --model sculler" in " ".join(said.split())
