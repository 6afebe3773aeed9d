"""A magnetometer whose readings are late: the heading of a unit that turns to one side stays right."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from local_data import local_folder
from oarlock import Config, Recording
from oarlock.formats.datasets.broad import BODY, read_broad, read_broad_reference
from oarlock.recording import ImuStream
from oarlock_lab.validation import ours
from oarlock_lab.validation.scores import attitude_error_rad, rmse_deg

RATE_HZ = 200.0
DURATION_S = 40.0
SETTLED_S = 25.0
LAG_S = 0.015
DIP_RAD = np.radians(71.3)
FIELD_UT = 44.4 * np.array([0.0, np.cos(DIP_RAD), -np.sin(DIP_RAD)])


def posture(time_s: np.ndarray) -> Rotation:
    """Turns to one side about a vertical that sways."""
    sway = np.stack([1.2 * np.sin(5.0 * time_s), 0.9 * np.sin(3.7 * time_s), np.zeros_like(time_s)], axis=1)
    spin = np.stack([np.zeros_like(time_s), np.zeros_like(time_s), 4.0 * time_s], axis=1)
    return Rotation.from_rotvec(spin) * Rotation.from_rotvec(sway)


def unit_with(lag_s: float) -> ImuStream:
    """Readings of a unit on the spot with this lag of its magnetometer."""
    time_s = np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
    half_s = 1e-4
    rate = (posture(time_s - half_s).inv() * posture(time_s + half_s)).as_rotvec() / (2.0 * half_s)
    random = np.random.default_rng(3)
    noise = random.standard_normal((2, len(time_s), 3))
    return ImuStream(
        "imu",
        time_s,
        gyro_rad_s=rate + 0.01 * noise[0],
        accel_m_s2=posture(time_s).inv().apply([0.0, 0.0, 9.8]) + 0.05 * noise[1],
        mag_ut=posture(time_s - lag_s).inv().apply(FIELD_UT),
    )


def heading_errors_deg(unit: ImuStream, magnetometer: str) -> np.ndarray:
    track = oarlock.track(
        oarlock.load_model("broad"), Recording([unit]), None, Config(magnetometer=magnetometer)
    )
    found = Rotation.from_quat(np.array(track.frame_quat_wxyz("imu", relative_to="root")), scalar_first=True)
    off = (found * posture(np.asarray(track.time_s)).inv()).as_rotvec(degrees=True)[:, 2]
    return off[track.time_s > SETTLED_S]


def test_a_late_magnetometer_does_not_turn_the_heading():
    late = unit_with(LAG_S)
    uncorrected = heading_errors_deg(late, "on")
    corrected = heading_errors_deg(late, "gated")
    # The unit turns by 3.4 deg within the lag.
    assert abs(uncorrected.mean()) > 3.0
    assert abs(corrected.mean()) < 0.5


def test_a_punctual_magnetometer_is_used_as_it_is():
    punctual = unit_with(0.0)
    as_read, gated = (heading_errors_deg(punctual, use) for use in ("on", "gated"))
    assert abs(gated.mean()) < 0.2
    # A lag of 1 ms that is found and is not there would turn the heading by 0.23 deg.
    np.testing.assert_array_equal(gated, as_read)


@pytest.mark.data
@pytest.mark.parametrize(
    ("trial", "live_deg", "smoothed_deg"),
    [
        pytest.param("28_disturbed_stationary_magnet_A", 1.0, 1.02, id="beside", marks=pytest.mark.long),
        pytest.param("35_disturbed_attached_magnet_4cm", 1.21, 0.8, id="attached"),
    ],
)
def test_a_heading_beside_magnets(trial, live_deg, smoothed_deg):
    """VQF with its magnetometer has 3.3 deg beside a magnet, offline 2.0."""
    file = local_folder("data/broad") / f"{trial}.mat"
    reference = read_broad_reference(file)
    errors = [
        rmse_deg(attitude_error_rad(estimate, reference, BODY)[1], reference.scored)
        for estimate in ours.track_broad(read_broad(file))
    ]
    assert errors[0] < live_deg
    assert errors[1] < smoothed_deg
