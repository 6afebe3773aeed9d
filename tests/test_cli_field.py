"""`oarlock simulate --field`: what it writes, and what it refuses."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from exact_recording import ELEVEN
from oarlock.rowing import FieldEffects, simulate_field

SHORT = ("--duration-s", 2, "--rate-spm", 30, "--seed", 4)
LONG = ("--duration-s", 8, *SHORT[2:])
"""Strapdown links need some seconds of movement to tell how units sit."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("field") / "trial"
    done = run(
        "simulate", "--out", folder, "--field", "misfit", "--effect", "gap_s=0.2", "--rate-hz", 100, *LONG
    )
    for told in ("Effects that are on", "mount_error_rad 0.08727", "gap_s 0.2", "oarlock track"):
        assert told in done.output
    assert "skin_twist" not in done.output
    return folder


def test_what_is_written_is_the_trial(folder: Path) -> None:
    effects = FieldEffects(**FieldEffects.misfit().strengths() | {"gap_s": 0.2})
    model = oarlock.load_model("sculler")
    trial = simulate_field(model, effects, duration_s=8.0, rate_spm=30.0, rate_hz=100.0, seed=4)
    recording = oarlock.load_recording(folder)
    for stream in trial.recording:
        for name, values in stream.values.items():
            assert np.array_equal(recording[stream.name].values[name], values, equal_nan=True)
    assert recording.meta["effects"]["gap_s"] == 0.2
    truth = oarlock.load_track(folder / "truth")
    assert np.array_equal(truth.q, trial.truth.q)
    table = np.genfromtxt(folder / "markers.csv", delimiter=",", names=True)
    assert table.dtype.names[0] == "time_s" and len(table.dtype.names) == 19
    np.testing.assert_allclose(table["r_wrist_z_m"], trial.markers.position_m[:, 2, 2], atol=1e-9)


def test_the_true_calibration_can_be_tracked_with(folder: Path) -> None:
    file = folder / "true_calibration.toml"
    noted = tomllib.loads(file.read_text(encoding="utf-8"))["noted"]
    assert set(noted["clocks"]) == {"back", "r_upperarm", "r_forearm", "l_upperarm", "l_forearm"}
    recording, truth = oarlock.load_recording(folder), oarlock.load_track(folder / "truth")
    model = oarlock.load_model("sculler")
    errors = [
        oarlock.evaluate(oarlock.track(model, recording, calibration=c), truth, start_s=1.0).mean_rmse_deg(
            ELEVEN
        )
        for c in (None, oarlock.load_calibration(file))
    ]
    # what is left is a boat that rocks by 1.5 deg unseen; mounts that are 5 deg off cost more
    assert errors[1] < 0.5 * errors[0]


def test_json_and_errors(tmp_path: Path) -> None:
    done = run("simulate", "--out", tmp_path / "a", "--field", "careful", "--strength", 0.5, "--json", *SHORT)
    told = json.loads(done.stdout)
    assert told["effects"]["mount_error_rad"] == pytest.approx(0.5 * FieldEffects().mount_error_rad)
    assert Path(told["markers"]).is_file()
    for arguments, text in (
        (("--field", "calm"), "--field calm: choose one of careful, wild"),
        (("--field", "off", "--effect", "mount_err=1"), "no such effect"),
        (("--effect", "gap_s=1"), "need --field"),
        (("--rate-hz", "100"), "need --field"),
    ):
        refused = run("simulate", "--out", tmp_path / "b", *arguments, *SHORT, status=2)
        assert text in refused.output, refused.output
    refused = run(
        "simulate", "--out", tmp_path / "b", "--field", "off", "--effect", "packet_loss=2", *SHORT, status=1
    )
    assert "packet_loss is 2.0" in refused.output
    assert not (tmp_path / "b").exists()
