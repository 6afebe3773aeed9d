"""Three hinges without a magnetometer that pass their singular pose."""

import numpy as np
from scipy.spatial.transform import Rotation

import oarlock
from oarlock import Recording
from oarlock_lab.validation import singular

# With this seed three hinges without a compass pass their pole so closely that they cannot follow.
SEED = 2
START_S = 2.0


def world_up(quat_wxyz: np.ndarray) -> np.ndarray:
    """The vertical in the body's axes, (T, 3)."""
    return Rotation.from_quat(quat_wxyz[:, [1, 2, 3, 0]]).inv().apply([0.0, 0.0, 1.0])


def test_three_hinges_in_a_row_outlive_their_pole() -> None:
    trial = singular.simulated(SEED)
    model = oarlock.load_model(str(singular.MODELS / "arm_hinges.toml"))
    plain = Recording(
        [
            oarlock.recording.ImuStream(s.name, s.time_s, gyro_rad_s=s.gyro_rad_s, accel_m_s2=s.accel_m_s2)
            for s in trial.recording
        ]
    )
    track = oarlock.track(model, plain)
    assert np.isfinite(track.q).all() and np.isfinite(track.q_std).all()
    # Which way the arm points about the vertical nothing shows but the hinges.
    after = track.time_s > START_S
    reference = trial.reference
    rows = np.searchsorted(reference.time_s, track.time_s - 1e-6).clip(0, len(reference.time_s) - 1)
    found = world_up(np.array(track.frame_quat_wxyz("upper_arm")))
    true = world_up(np.array(reference.quat_wxyz["upper_arm"])[rows])
    tilt_deg = np.degrees(np.arccos(np.clip(np.sum(found * true, axis=1), -1.0, 1.0)))
    assert np.quantile(tilt_deg[after], 0.99) < 5.0
    assert tilt_deg[-1] < 2.0
    smooth = oarlock.smooth(track)
    assert np.isfinite(smooth.q).all() and np.isfinite(smooth.q_std).all()
