"""Mounts of the two units at an elbow, found from ordinary movement without magnetometers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from command_line import run
from local_data import local_folder
from oarlock.calibration.static.sagittal import calibrate_sagittal
from oarlock.calibration.static.two_hinges import TwoHinges

UNITS = ["thorax", "upper_arm_r", "forearm_r"]
ELBOW = UNITS[1:]
STILL_S = (0.1, 1.9)
NOISE = {name: {"gyro_rad_s": 0.01, "accel_m_s2": 0.05} for name in UNITS}
# Of each of the three axes of six mounts.
STDS_BOUND = 3.5


@pytest.fixture(scope="module")
def model():
    return oarlock.load_model("arm", stature_m=1.78, mass_kg=75).with_units(UNITS)


def reaching(model, seed, flexion=0.7, pronation=0.5):
    """An arm that hangs for two seconds and then reaches; the forearm's rotation in the posture is off by some deg."""
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, 25.0, 0.01)
    moving = np.clip(time_s - 2.0, 0.0, None)
    rise = np.clip(moving, 0.0, 1.0)
    onset = rise**4 * (35 - 84 * rise + 70 * rise**2 - 20 * rise**3)

    def waves(size):
        return size * onset * (1.0 - np.cos(2 * np.pi * random.uniform(0.2, 0.7) * moving))

    rest = np.concatenate([np.ravel(j.rest) for j in model.describe().joints])
    q = np.tile(rest, (len(time_s), 1))
    sizes = {
        "thorax.rz": 0.15, "shoulder_r.rz": 0.5, "shoulder_r.rx": 0.15, "shoulder_r.ry": 0.15,
        "elbow_flexion_r": flexion, "elbow_pronation_r": -pronation,
    }  # fmt: skip
    for name, size in sizes.items():
        q[:, model.coordinate_names.index(name)] += waves(size)
    q[:, model.coordinate_names.index("elbow_pronation_r")] += random.normal(0.0, np.radians(8.0))
    return oarlock.simulation.Motion(tuple(model.coordinate_names), time_s, q)


def recorded(model, motion, seed):
    """True mounts of any orientation, and a recording without magnetometers."""
    random = np.random.default_rng(1000 + seed)
    mounts = {
        s.name: (Rotation.random(random_state=random).as_matrix(), np.asarray(s.mount.offset))
        for s in model.describe().inertial_units
    }
    _, recording = oarlock.simulate(
        model, motion, seed=seed, rate_hz=100, noise=NOISE, gyro_bias_rad_s=0.005,
        calibration=oarlock.Calibration(mounts=mounts), heading_rad={"upper_arm_r": 1.0, "forearm_r": -1.0},
    )  # fmt: skip
    return mounts, without_magnetometers(recording)


def without_magnetometers(recording):
    return oarlock.Recording(
        [
            oarlock.recording.ImuStream(s.name, s.time_s, gyro_rad_s=s.gyro_rad_s, accel_m_s2=s.accel_m_s2)
            for s in recording.streams
        ]
    )


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(s, marks=pytest.mark.long) for s in range(2, 6))])
def test_mounts_of_any_orientation_are_within_their_standard_deviations(model, seed):
    true, recording = recorded(model, reaching(model, seed), seed)
    found = calibrate_sagittal(model, recording, still_s=STILL_S)
    (pair,) = found.noted["two_hinges"]
    assert pair["refused"] == ""
    for name in ELBOW:
        assert found.noted["sensor"][name]["heading_by"] == "two hinges"
        off = Rotation.from_matrix(found.mounts[name][0] @ true[name][0].T).as_rotvec()
        assert np.abs(off / found.mount_stds_rad[name]).max() < STDS_BOUND, (name, np.degrees(off))


def test_the_verb_shows_mounts_of_an_elbow_with_their_own_standard_deviations(model, tmp_path):
    _, recording = recorded(model, reaching(model, 0), 0)
    recording.save(tmp_path / "reach")
    body = ("--model", "arm", "--stature-m", 1.78, "--mass-kg", 75, "--sensors", ",".join(UNITS))
    out = tmp_path / "cal.toml"
    shown = run(
        "calibrate", "sagittal", tmp_path / "reach", *body, "--still-s", *STILL_S, "--out", out
    ).output
    found = oarlock.load_calibration(out)
    for name in ELBOW:
        unit = found.noted["sensor"][name]
        # The vertical is the long axis of a hanging arm, but for the elbow's carrying angle.
        assert unit["heading_std_rad"] == pytest.approx(found.mount_stds_rad[name][1], rel=0.1)
        (line,) = (line for line in shown.splitlines() if line.split()[:1] == [name])
        assert f"{np.degrees(unit['heading_std_rad']):.0f}" in line.split()


def test_an_elbow_that_does_not_bend_is_refused(model):
    _, recording = recorded(model, reaching(model, 0, flexion=0.0), 0)
    found = calibrate_sagittal(model, recording, still_s=STILL_S)
    (pair,) = found.noted["two_hinges"]
    assert "deg, more than" in pair["refused"]
    assert all(found.noted["sensor"][name]["heading_by"] != "two hinges" for name in ELBOW)


def test_units_that_do_not_move_as_two_hinges_are_refused(model, tmp_path):
    """Fifteen seconds of this arm leave the axes of its elbow uncertain by tens of degrees."""
    folder = local_folder("data/opensimrt_upper_limb_ngimu")
    run("import", folder, "--model", "arm", "--out", tmp_path / "arm", "--no-questions")
    recording = oarlock.load_recording(tmp_path / "arm")
    found = calibrate_sagittal(model, recording, still_s=(recording.start_s, recording.start_s + 0.6))
    (pair,) = found.noted["two_hinges"]
    assert "axis has a standard deviation" in pair["refused"]
    assert found.noted["balls"] == [["elbow_flexion_r", "elbow_pronation_r"]]


def test_only_an_elbow_whose_axes_and_headings_are_unknown_becomes_a_ball(model):
    """Where the headings of the mounts are known, hinges follow the arm better even without the axes' own search."""
    _, recording = recorded(model, reaching(model, 0, flexion=0.7, pronation=0.0), 0)
    found = calibrate_sagittal(model, recording, still_s=STILL_S)
    (pair,) = found.noted["two_hinges"]
    assert pair["refused"] and found.noted["balls"] == []
    unclear = TwoHinges(tuple(ELBOW), ("a", "b"), {}, 0.0, 0.0, np.zeros(2), "refused", upright=True)
    assert unclear.is_ball({"upper_arm_r": np.radians(24), "forearm_r": np.radians(8)})
    assert not unclear.is_ball({"upper_arm_r": np.radians(9), "forearm_r": np.radians(8)})
    assert not replace(unclear, upright=False).is_ball(dict.fromkeys(ELBOW, 1.0))
    assert not replace(unclear, refused="").is_ball(dict.fromkeys(ELBOW, 1.0))
