"""`oarlock live` as a user types it, with sensors emulated on this machine."""

import json

import numpy as np

import oarlock
from command_line import run
from oarlock.live.emulators.rig import lines_rig
from oarlock.live.rig import rig_document
from oarlock.live.transports.udp import free_port
from oarlock.storage.toml import write_toml


def test_a_rig_is_recorded_and_the_recording_written_again(sculler, tmp_path):
    write_toml(
        tmp_path / "rig.toml", rig_document(lines_rig(sculler, "sculler", free_port(), 100.0, ("back",)))
    )
    out = tmp_path / "today"
    said = run("live", "run", tmp_path / "rig.toml", "--no-page", "--seconds", "0.3", "--out", out).stdout
    assert "0 estimates" in said and "Wrote" in said
    assert "No sensor of the rig was heard" in said
    assert f"oarlock live doctor {out / 'rig.toml'}" in " ".join(said.split())
    again = run("live", "recover", out).stdout
    assert "no reading of the rig's sensors" in again
    assert json.loads(run("live", "recover", out, "--json").stdout) == {"recording": None, "damage": []}
    assert (
        "has a live session already"
        in run(
            "live", "run", tmp_path / "rig.toml", "--no-page", "--seconds", "0.3", "--out", out, status=1
        ).stderr
    )


def test_the_demo_tracks_emulated_sensors(tmp_path):
    out = tmp_path / "demo"
    said = run("live", "demo", "--no-page", "--seconds", "4", "--out", out).stdout
    recording = oarlock.load_recording(out / "recording")
    assert {"back", "seat", "r_oar_phi"} <= set(recording.names)
    assert np.isfinite(recording.sensor("back").gyro_rad_s).all()
    assert f"Wrote {out}" in said
    assert f"oarlock track {out / 'recording'} --model sculler" in " ".join(said.split())
