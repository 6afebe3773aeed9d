"""The importers on the real data sets: shapes, rates, and that readings and references belong together."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from local_data import local_folder
from oarlock.formats.datasets.broad import read_broad, read_broad_reference
from oarlock.formats.datasets.dfjimu import read_dfjimu, read_dfjimu_reference
from oarlock.formats.datasets.diodem import SEGMENTS, read_diodem, read_diodem_reference
from oarlock.formats.datasets.openaxes import (
    LINK_FROM_SENSOR,
    LINKS,
    openaxes_runs,
    read_openaxes,
    read_openaxes_reference,
)
from oarlock.formats.datasets.qmt import read_qmt

pytestmark = pytest.mark.data

# Linear accelerations average out over a minute or more: what remains are the sensors' offsets and the tilt of the
# optical world, each of one or two degrees (10 m/s2 times 0.035).
UP_BOUND_M_S2 = 0.4
# These accelerometers read 9.4 to 9.5 m/s2 at rest: their offsets are of that size.
UNCALIBRATED_BOUND_M_S2 = 0.6


def mean_pull(stream, reference, body, mount=None):
    """Mean specific force in the reference's world, m/s2: upwards, and as large as gravity."""
    turns = Rotation.from_quat(np.array(reference.quat_wxyz[body])[:, [1, 2, 3, 0]][reference.there(body)])
    rows = np.searchsorted(stream.time_s, reference.time_s[reference.there(body)]).clip(0, len(stream) - 1)
    accel = np.array(stream.accel_m_s2)[rows]
    return turns.apply(accel if mount is None else mount.apply(accel)).mean(axis=0)


def disagreement_at_joint(recording, reference, sign):
    """RMS difference of the joint's acceleration as both units feel it, m/s2, if it lies at `sign` times its place."""
    felt = []
    for body in ("body1", "body2"):
        stream, place = recording[body], sign * np.array(recording.meta["joint_in_sensor_m"][body])
        gyro = np.array(stream.gyro_rad_s)
        turning = np.gradient(gyro, stream.time_s, axis=0)
        accel = stream.accel_m_s2 + np.cross(turning, place) + np.cross(gyro, np.cross(gyro, place))
        felt.append(Rotation.from_quat(np.array(reference.quat_wxyz[body])[:, [1, 2, 3, 0]]).apply(accel))
    return float(np.sqrt(np.mean((felt[0] - felt[1]) ** 2)))


@pytest.mark.parametrize(
    ("trial", "samples"), [("1D_01", 3007), ("2D_01", 3069), ("3D_01", 3214), ("3D_05", 10590)]
)
def test_dfjimu(trial, samples):
    file = local_folder("data/dfjimu") / f"data_{trial}.mat"
    recording, reference = read_dfjimu(file), read_dfjimu_reference(file)
    for body in ("body1", "body2"):
        assert len(recording[body]) == samples and recording[body].rate_hz == pytest.approx(50.0)
        assert reference.there(body).all()
        np.testing.assert_allclose(
            mean_pull(recording[body], reference, body), [0.0, 0.0, 9.81], atol=UP_BOUND_M_S2
        )
        # a hand's breadth
        assert 0.05 < np.linalg.norm(recording.meta["joint_in_sensor_m"][body]) < 0.3
    here, opposite, none = (disagreement_at_joint(recording, reference, sign) for sign in (1.0, -1.0, 0.0))
    assert here < none < opposite


def test_diodem():
    trial = local_folder("data/diodem_arm") / "trial1"
    reference = read_diodem_reference(trial)
    assert reference.rate_hz == pytest.approx(30.0) and len(reference.time_s) == 1988
    assert np.count_nonzero(~reference.there("seg2")) == 220 and reference.there("seg4").all()
    for mounted in ("rigid", "foam"):
        recording = read_diodem(trial, mounted, mag_unit_ut=49.0)
        assert recording.names == SEGMENTS
        assert all(s.rate_hz == pytest.approx(40.0) and len(s) == 2650 for s in recording)
    pull = mean_pull(read_diodem(trial)["seg4"], reference, "seg4")
    np.testing.assert_allclose(pull, [0.0, 0.0, 9.81], atol=UP_BOUND_M_S2)


def test_openaxes():
    data = local_folder("data/openaxes_ur5")
    assert openaxes_runs(data) == ("circle-100", "circle-250", "triangle-150", "triangle-250")
    mount = Rotation.from_matrix(LINK_FROM_SENSOR)
    for run in openaxes_runs(data):
        recording, reference = read_openaxes(data, run), read_openaxes_reference(data, run)
        for link in LINKS:
            assert recording[link].rate_hz == pytest.approx(125.0)
            pull = mean_pull(recording[link], reference, link, mount)
            np.testing.assert_allclose(pull, [0.0, 0.0, 9.45], atol=UNCALIBRATED_BOUND_M_S2)


@pytest.mark.parametrize("every", [6, pytest.param(1, marks=pytest.mark.long)], ids=["a few", "all"])
def test_broad(every):
    files = sorted(local_folder("data/broad").glob("[0-9]*.mat"))
    assert files
    for file in files[::every]:
        recording, reference = read_broad(file), read_broad_reference(file)
        assert recording["imu"].rate_hz == pytest.approx(285.714, abs=0.01)
        assert len(recording["imu"]) == len(reference.time_s)
        assert 0.2 < reference.scored.mean() < 0.9
        np.testing.assert_allclose(
            mean_pull(recording["imu"], reference, "imu"), [0.0, 0.0, 9.81], atol=UP_BOUND_M_S2
        )


def test_qmt():
    recording = read_qmt(local_folder("data/qmt_full_body") / "full_body_example_data.mat")
    assert len(recording) == 16 and {"hip", "lower_back", "head", "forearm_right"} <= set(recording.names)
    assert all(s.rate_hz == pytest.approx(100.0) and len(s) == 10_000 and s.mag_ut is None for s in recording)
    assert recording.start_s == pytest.approx(40.0)
