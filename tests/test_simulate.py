"""Simulated signals: the same seed gives the same, and what is asked for is what is in them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import oarlock
from exact_recording import UNITS, Floats, sculler
from oarlock.recording import Clock, EncoderScale
from oarlock.rowing import sculling
from random_tree import load_tree, random_tree, waves

# The simulator differentiates poses over nine instants 2 ms apart; the model multiplies rates and accelerations out.
# What is left is the step in the fifth derivative of the joints' splines at each knot, and rounding over (2 ms)^2.
GYRO_AGREES_RAD_S = 1e-9
ACCEL_AGREES_M_S2 = 1e-6
MAG_AGREES_UT = 1e-10
SURGE_IS_FELT_M_S2 = 1e-6
SPREAD = 5.0
"""Standard errors that an estimate of a mean or a deviation may be off: 1 in 1.7 million."""
FIELDS = {
    "gyro_rad_s": ("gyro_std_rad_s", "rad/s"),
    "accel_m_s2": ("accel_std_m_s2", "m/s2"),
    "mag_ut": ("mag_std_ut", "uT"),
}


@pytest.fixture(scope="module")
def motion() -> oarlock.simulation.Motion:
    return sculling(sculler(), 8.0, 30.0, seed=2)


@pytest.fixture(scope="module")
def clean(motion) -> tuple[oarlock.Track, oarlock.Recording]:
    return oarlock.simulate(sculler(), motion, noise=False)


def as_readings(recording: oarlock.Recording, units: Any) -> Floats:
    """Gyro, accel and mag of some units end to end, (T, 9 units)."""
    return np.column_stack([np.column_stack(list(recording[u].values.values())) for u in units])


def assert_signals_agree(model: oarlock.Model, motion: oarlock.simulation.Motion) -> None:
    truth, recording = oarlock.simulate(model, motion, noise=False)
    units = [s.name for s in model.describe().inertial_units]
    rows = len(truth.time_s)
    base = oarlock.model.Base(
        np.broadcast_to(np.eye(3), (rows, 3, 3)), acceleration_m_s2=motion.base_acceleration_at(truth.time_s)
    )
    expected = model.predict_measurements(truth.q, truth.qd, truth.qdd, base)[:, : 9 * len(units)]
    apart = (
        np.abs(as_readings(recording, units) - expected).reshape(rows, len(units), 3, 3).max(axis=(0, 1, 3))
    )
    print(f"{model.name}: signals apart by {apart[0]:.1e} rad/s, {apart[1]:.1e} m/s2, {apart[2]:.1e} uT")
    assert apart[0] <= GYRO_AGREES_RAD_S
    assert apart[1] <= ACCEL_AGREES_M_S2
    assert apart[2] <= MAG_AGREES_UT


def test_differentiated_poses_agree_with_the_model(motion):
    assert_signals_agree(sculler(), motion)


@pytest.mark.parametrize("seed", range(3))
def test_differentiated_poses_of_any_tree_agree_with_the_model(seed, tmp_path):
    model = load_tree(random_tree(seed), tmp_path)
    assert_signals_agree(model, waves(model, seed, 2.0))


def test_same_seed_same_bits(motion):
    one, other, another = (oarlock.simulate(sculler(), motion, seed=s)[1] for s in (7, 7, 8))
    for a, b, c in zip(one, other, another, strict=True):
        for name, values in a.values.items():
            assert np.array_equal(values, b.values[name]), (a.name, name)
            assert not np.any(values == c.values[name]), (a.name, name)


def test_truth_is_the_motion(motion, clean):
    truth, recording = clean
    for values, expected in zip(
        (truth.q, truth.qd, truth.qdd), motion.derivatives(truth.time_s), strict=True
    ):
        assert np.array_equal(values, expected)
    assert truth.observed.all()
    assert np.isnan(truth.q_std).all()
    assert truth.info is None
    assert np.diff(truth.time_s) == pytest.approx(1 / 125.0)
    assert motion.start_s <= truth.time_s[0] < truth.time_s[-1] <= motion.end_s
    assert all(np.array_equal(s.time_s, truth.time_s) for s in recording)


def test_encoders_read_their_joints(clean):
    truth, recording = clean
    for name in ("seat", "r_oar_phi", "r_oar_alpha", "l_oar_phi", "l_oar_alpha"):
        assert np.array_equal(recording[name].value, truth[name].value)


def noise_of(
    motion: oarlock.simulation.Motion, clean: oarlock.Recording, **asked: Any
) -> Mapping[str, Mapping[str, Floats]]:
    noisy = oarlock.simulate(sculler(), motion, seed=3, **asked)[1]
    return {s.name: {f: v - clean[s.name].values[f] for f, v in s.values.items()} for s in noisy}


def assert_noise(found: Floats, mean: Any, std: float, where: str) -> None:
    """Mean and deviation of each axis within a few standard errors."""
    n = len(found)
    assert np.abs(found.mean(axis=0) - mean).max() <= SPREAD * std / np.sqrt(n) + 1e-12, where
    assert np.abs(found.std(axis=0) - std).max() <= SPREAD * std / np.sqrt(2 * n) + 1e-12, where


def test_noise_is_the_models(motion, clean):
    found = noise_of(motion, clean[1])
    for sensor in sculler().describe().sensors:
        for field, values in found[sensor.name].items():
            std = getattr(sensor, FIELDS[field][0]) if sensor.kind == "imu" else sensor.std
            assert_noise(values.reshape(len(values), -1), 0.0, std, f"{sensor.name}.{field}")


def test_noise_is_white(motion, clean):
    found = noise_of(motion, clean[1])
    for name in UNITS:
        for values in found[name].values():
            n = len(values)
            scaled = (values - values.mean(axis=0)) / values.std(axis=0)
            assert np.abs((scaled[1:] * scaled[:-1]).mean(axis=0)).max() <= SPREAD / np.sqrt(n)
            across = np.corrcoef(scaled.T) - np.eye(3)
            assert np.abs(across).max() <= SPREAD / np.sqrt(n)


def test_noise_as_asked(motion, clean):
    asked = {"back": {"gyro_rad_s": 0.5}, "seat": {"value": 0.2}}
    found = noise_of(motion, clean[1], noise=asked)
    assert_noise(found["back"]["gyro_rad_s"], 0.0, 0.5, "back")
    assert_noise(found["seat"]["value"][:, None], 0.0, 0.2, "seat")
    own = sculler().describe().sensors[0].accel_std_m_s2
    assert_noise(found["back"]["accel_m_s2"], 0.0, own, "what is not named keeps the model's")


def test_biases_as_asked(motion, clean):
    found = noise_of(
        motion,
        clean[1],
        noise=False,
        gyro_bias_rad_s=0.01,
        accel_bias_m_s2={"back": [0.1, -0.2, 0.3], "r_forearm": 0.05},
    )
    accel = {"back": [0.1, -0.2, 0.3], "r_forearm": [0.05] * 3}
    for name in UNITS:
        expected = {"gyro_rad_s": 0.01, "accel_m_s2": np.array(accel.get(name, [0.0] * 3)), "mag_ut": 0.0}
        for field, bias in expected.items():
            rounding = 1e-12
            np.testing.assert_allclose(
                found[name][field], np.broadcast_to(bias, (1, 3)) + 0 * found[name][field], atol=rounding
            )


def test_errors_of_a_calibration_are_in_the_readings(motion, clean):
    soft = np.array([[1.1, 0.02, 0.0], [0.02, 0.95, 0.01], [0.0, 0.01, 0.97]])
    calibration = oarlock.Calibration(
        gyro_biases_rad_s={"back": [0.1, -0.2, 0.3]},
        accel_biases_m_s2={"back": [1.0, 2.0, 3.0]},
        accel_scales={"back": [1.1, 0.9, 1.2]},
        mag_offsets_ut={"back": [5.0, -4.0, 3.0]},
        mag_matrices={"back": soft},
        clocks={"back": Clock(0.25, 1e-4)},
        encoders={"seat": EncoderScale(0.3, -2.0)},
    )
    measured = oarlock.simulate(sculler(), motion, noise=False, calibration=calibration)[1]
    back, true = measured["back"], clean[1]["back"]
    rounding = 1e-11
    np.testing.assert_allclose(
        back.gyro_rad_s - true.gyro_rad_s, [[0.1, -0.2, 0.3]] * len(back), atol=rounding
    )
    away = back.accel_m_s2 - true.accel_m_s2 * [1.1, 0.9, 1.2]
    np.testing.assert_allclose(away, [[1.0, 2.0, 3.0]] * len(back), atol=rounding)
    np.testing.assert_allclose((back.mag_ut - [5.0, -4.0, 3.0]) @ soft.T, true.mag_ut, atol=rounding)
    np.testing.assert_allclose(back.time_s, true.time_s * (1.0 + 1e-4) + 0.25, atol=rounding)
    np.testing.assert_allclose(measured["seat"].value, clean[1]["seat"].value / -2.0 + 0.3, atol=rounding)
    again = calibration.corrected(measured)
    np.testing.assert_allclose(again["back"].accel_m_s2, true.accel_m_s2, atol=rounding)
    np.testing.assert_allclose(again["seat"].value, clean[1]["seat"].value, atol=rounding)
    assert np.array_equal(measured["r_forearm"].gyro_rad_s, clean[1]["r_forearm"].gyro_rad_s)


def test_surge_enters_the_accelerometers_only(motion, clean):
    truth, moving = clean
    still = oarlock.simulate(
        sculler(), oarlock.simulation.Motion(motion.joint_names, motion.time_s, motion.q), noise=False
    )[1]
    surge = motion.base_acceleration_at(truth.time_s)
    assert np.abs(surge[:, 2]).max() > 3.0
    poses = sculler().forward_kinematics(truth.q)
    for sensor in sculler().describe().sensors:
        if sensor.kind != "imu":
            continue
        name = sensor.name
        frame = poses[:, sculler().frame_names.index(sensor.frame), :3, :3]
        root_from_sensor = frame @ np.array(sensor.mount.rotation)
        felt = np.einsum("tji,tj->ti", root_from_sensor, surge)
        added = moving[name].accel_m_s2 - still[name].accel_m_s2
        np.testing.assert_allclose(added, felt, rtol=0, atol=SURGE_IS_FELT_M_S2, err_msg=name)
        assert np.array_equal(moving[name].gyro_rad_s, still[name].gyro_rad_s)
        assert np.array_equal(moving[name].mag_ut, still[name].mag_ut)


def test_other_lengths_and_mounts_are_other_signals(motion, clean):
    turned = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    calibration = oarlock.Calibration(mounts={"back": (turned, [0.0, 0.0, 0.0])})
    recording = oarlock.simulate(sculler(), motion, noise=False, calibration=calibration)[1]
    own = np.array(sculler().describe().sensors[0].mount.rotation)
    expected = clean[1]["back"].gyro_rad_s @ own.T @ turned
    np.testing.assert_allclose(recording["back"].gyro_rad_s, expected, atol=1e-9)
    assert np.array_equal(recording["r_forearm"].accel_m_s2, clean[1]["r_forearm"].accel_m_s2)


def test_azimuth_turns_the_field(motion, clean):
    azimuth = sculler().describe().world.magnetic_azimuth_rad
    same, turned = (
        oarlock.simulate(sculler(), motion, noise=False, azimuth_rad=a)[1]["back"].mag_ut
        for a in (azimuth, azimuth + 1.0)
    )
    assert np.array_equal(same, clean[1]["back"].mag_ut)
    assert np.linalg.norm(turned, axis=1) == pytest.approx(np.linalg.norm(same, axis=1))
    assert np.abs(turned - same).max() > 10.0


def test_chosen_sensors_at_a_chosen_rate(motion):
    truth, recording = oarlock.simulate(sculler(), motion, ["seat", "back"], rate_hz=50.0)
    assert recording.names == ("seat", "back")
    assert recording["back"].rate_hz == pytest.approx(50.0)
    assert len(truth.time_s) == pytest.approx(8.0 * 50.0, abs=2)


def test_a_joint_without_values_is_named(motion):
    kept = [i for i, name in enumerate(motion.joint_names) if name != "trunk"]
    short = oarlock.simulation.Motion(
        tuple(motion.joint_names[i] for i in kept), motion.time_s, motion.q[:, kept]
    )
    with pytest.raises(oarlock.DataError, match="no values for trunk"):
        oarlock.simulate(sculler(), short)


def test_joints_may_stand_in_any_order(motion, clean):
    order = list(reversed(range(len(motion.joint_names))))
    turned = oarlock.simulation.Motion(
        tuple(motion.joint_names[i] for i in order),
        motion.time_s,
        motion.q[:, order],
        motion.base_acceleration_m_s2,
    )
    truth, recording = oarlock.simulate(sculler(), turned, noise=False)
    assert np.array_equal(truth.q, clean[0].q)
    assert np.array_equal(recording["back"].accel_m_s2, clean[1]["back"].accel_m_s2)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"sensors": ["bak"]}, "'bak'.*back"),
        ({"rate_hz": 0.0}, "rate_hz = 0"),
        ({"rate_hz": float("nan")}, "rate_hz = nan"),
        ({"rate_hz": 0.1}, "too short"),
        ({"calibration": oarlock.Calibration(parameters={"l_x": 1.0})}, "l_x"),
        ({"calibration": oarlock.Calibration(mounts={"bak": (np.eye(3), [0, 0, 0])})}, "bak"),
        ({"gyro_bias_rad_s": {"bak": 0.1}}, "bak"),
        ({"noise": {"bak": {"gyro_rad_s": 0.1}}}, "bak"),
        ({"noise": {"back": {"gyro": 0.1}}}, "gyro"),
        ({"gyro_bias_rad_s": [0.1, 0.2]}, "gyro_bias_rad_s"),
    ],
    ids=str,
)
def test_what_cannot_be_simulated_is_explained(motion, asked, said):
    with pytest.raises(oarlock.DataError, match=said):
        oarlock.simulate(sculler(), motion, **asked)
