"""A sensor that vibrates faster than limbs move is named; one that only moves is not."""

import numpy as np
import pytest

import oarlock
from oarlock import Recording
from oarlock.recording import ImuStream

RATE_HZ = 100.0
DURATION_S = 6.0
ROTOR_HZ = 35.0


def notes_with(gyro_rad_s: float, accel_m_s2: float) -> list[str]:
    """Notes about vibration of a unit at rest that a rotor shakes with these amplitudes for half of the time."""
    time_s = np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
    random = np.random.default_rng(2)
    phase = 2.0 * np.pi * ROTOR_HZ * time_s
    circle = (
        np.stack([np.cos(phase), np.sin(phase), 0.0 * phase], axis=1) * (time_s > DURATION_S / 2.0)[:, None]
    )
    gyro = 0.01 * random.standard_normal((len(time_s), 3)) + gyro_rad_s * circle
    accel = [0.0, 0.0, 9.8] + 0.05 * random.standard_normal((len(time_s), 3)) + accel_m_s2 * circle
    unit = ImuStream("imu", time_s, gyro_rad_s=gyro, accel_m_s2=accel)
    return [n for n in oarlock.track(oarlock.load_model("broad"), Recording([unit])).notes if "vibrated" in n]


@pytest.mark.parametrize(
    ("gyro_rad_s", "accel_m_s2", "named"),
    [(0.0, 0.0, None), (0.0, 3.0, "accelerometer"), (3.0, 0.0, "gyroscope")],
    ids=["still", "accelerometer", "gyroscope"],
)
def test_only_the_sensor_that_vibrates_is_named(gyro_rad_s, accel_m_s2, named):
    notes = notes_with(gyro_rad_s, accel_m_s2)
    assert len(notes) == (named is not None)
    for note in notes:
        assert note.startswith(f"imu: its {named} vibrated faster than limbs move in ")
        assert "mount the unit more firmly" in note
