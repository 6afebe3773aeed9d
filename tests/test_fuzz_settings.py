"""Configurations, calibrations and beliefs of anything: used, or refused with a reason."""

import math

import numpy as np
from hypothesis import strategies as st

import oarlock
from fuzz_campaign import answered, campaign
from fuzz_wounds import feed
from test_fuzz_arrays import HASHABLE, SCALARS, THINGS

MODEL = oarlock.load_model("pendulum3")
TIME_S = np.arange(30) / 50.0
RECORDING = oarlock.Recording(
    [
        oarlock.recording.ImuStream(
            name, TIME_S, gyro_rad_s=np.zeros((30, 3)), accel_m_s2=np.tile([0.0, 9.8, 0.1], (30, 1))
        )
        for name in MODEL.sensor_names
    ]
)

KEYS = tuple(oarlock.Config().to_dict())
FILTERS = ["ukf", "ekf", "factorised"]
WORDS = [*FILTERS, "jerk", "paper", "off", "gated", "on", "gyro_bias", "lengths", "mounts", "azimuth"]
NUMBERS = st.floats() | st.integers() | st.sampled_from([1e-300, 1e300, 0.3, 2.0])
VALUES = (
    NUMBERS
    | st.sampled_from(WORDS)
    | SCALARS
    | st.lists(NUMBERS | st.sampled_from(WORDS), max_size=4)
    | THINGS
)
RIGHT = {
    "alpha": st.floats(1e-3, 1.0),
    "beta": st.floats(1.0, 4.0),
    "kappa": st.floats(0.0, 3.0),
    "filter": st.sampled_from(WORDS[:4]),
    "estimate": st.lists(st.sampled_from(["gyro_bias", "accel_bias", "lengths", "mounts"]), max_size=4),
    "start_window_s": st.floats(1e-3, 1.0),
    "output_rate_hz": st.none() | st.floats(1e-3, 1e9),
    "belief_interval_s": st.floats(1e-6, 1e6),
    "initial_q": st.none() | st.lists(st.floats(-10, 10), min_size=3, max_size=3),
}
CONFIGS = st.dictionaries(
    st.sampled_from(KEYS) | st.text(max_size=5), VALUES, max_size=3
) | st.fixed_dictionaries({}, optional=RIGHT)


def check_config(keys):
    config = answered(lambda: oarlock.Config(**keys), (TypeError,))
    if config is None:
        return
    assert oarlock.Config(**config.to_dict()) == config
    repr(config)
    track = answered(lambda: oarlock.track(MODEL, RECORDING, config=config), (oarlock.DivergedError,))
    if track is not None:
        assert all(np.isfinite(track[joint].angle_rad).all() for joint in MODEL.joint_names)
        answered(lambda: oarlock.smooth(track), (oarlock.DivergedError,))


def test_configurations():
    campaign(check_config, CONFIGS)


ROTATIONS = st.floats(-7, 7).map(
    lambda a: [[math.cos(a), -math.sin(a), 0.0], [math.sin(a), math.cos(a), 0.0], [0.0, 0.0, 1.0]]
)
NAMES = st.sampled_from([*MODEL.sensor_names, *MODEL.parameters, "nobody"]) | HASHABLE
MOUNTS = st.tuples(ROTATIONS | THINGS, st.lists(st.floats(), min_size=3, max_size=3) | THINGS) | THINGS
CALIBRATIONS = st.fixed_dictionaries(
    {},
    optional={
        "parameters": st.dictionaries(NAMES, st.floats() | THINGS, max_size=2) | SCALARS,
        "mounts": st.dictionaries(NAMES, MOUNTS, max_size=2) | SCALARS,
        "noted": st.dictionaries(st.text(max_size=3), SCALARS, max_size=2),
        "mag_offsets_ut": st.dictionaries(NAMES, st.lists(st.floats(), max_size=4) | THINGS, max_size=2),
    },
)


def check_calibration(fields, folder):
    calibration = answered(lambda: oarlock.Calibration(**fields), (TypeError,))
    if calibration is None:
        return
    track = answered(lambda: oarlock.track(MODEL, RECORDING, calibration), (oarlock.DivergedError,))
    assert track is None or np.isfinite(track.columns()["time_s"]).all()
    file = folder / "calibration.toml"
    if answered(lambda: (calibration.save(file), True)) is None:
        return
    again = oarlock.load_calibration(file)
    assert dict(again.parameters) == dict(calibration.parameters)
    for name, (rotation, offset_m) in calibration.mounts.items():
        np.testing.assert_array_equal(again.mounts[name][0], rotation)
        np.testing.assert_array_equal(again.mounts[name][1], offset_m)


def test_calibrations(tmp_path):
    campaign(lambda fields: check_calibration(fields, tmp_path), CALIBRATIONS)


def test_calibration_files(tmp_path):
    file = tmp_path / "calibration.toml"
    oarlock.Calibration(
        {"l_lower": 0.3}, {"lower": (np.eye(3), (0.1, 0.0, 0.0))}, {"by": "hand"}, {"lower": (1.0, 2.0, 3.0)}
    ).save(file)
    feed(file, file.read_text(encoding="utf-8"), oarlock.load_calibration)
