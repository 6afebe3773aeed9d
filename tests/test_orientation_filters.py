"""Filters on single units: right axes and signs on signals without noise, gaps, and what they cannot do."""

import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from exact_recording import Floats
from oarlock import DataError, Recording
from oarlock.evaluation.comparison.orientation_track import FILTERS as ORIENTATION_FILTERS
from oarlock.evaluation.comparison.orientation_track import root_from_north_west_up
from oarlock.evaluation.comparison.single_units import orientations, stretches
from oarlock.model.rotation import matrix_from_quat, rotvec_between
from oarlock.recording import ImuStream
from oarlock.simulation import Motion

FILTERS = tuple(ORIENTATION_FILTERS)
PACKAGE = {"vqf": "vqf", "madgwick": "ahrs", "quaternion_ekf": "ahrs", "quest_ekf": "ahrs"}
RATE_HZ = 100.0
DIP_RAD = 1.05

# A unit that turns on the spot feels gravity alone. What is left is of second order in a step: at 1 rad/s and 10 ms a
# rate's mean over a step is off by 1e-4 rad, and corrections keep that from adding up. Madgwick's steps are of the
# first order and always of the same length, so that it hunts.
CLEAN_DEG = dict.fromkeys(FILTERS, 0.05) | {"madgwick": 1.0}
# A slow swing: accelerations of 0.07 m/s2 tilt gravity by 0.4 deg, and three hinges share a unit's error unevenly.
SLOW_DEG = 1.5


def needs(name: str) -> None:
    if name in PACKAGE:
        pytest.importorskip(PACKAGE[name], reason="extra `compare`")


def turning_unit(seconds: float = 20.0) -> tuple[Rotation, ImuStream]:
    """A unit that turns on the spot about all axes: north-west-up from sensor, and what it reads."""
    time_s, fine = np.arange(round(seconds * RATE_HZ)) / RATE_HZ, 1e-5

    def at(t: Floats) -> Rotation:
        angles = [np.sin(0.7 * t), 0.6 * np.sin(0.9 * t), 0.8 * np.sin(0.5 * t + 1)]
        return Rotation.from_euler("ZYX", np.stack(angles, axis=1))

    turn = at(time_s)
    gyro = (at(time_s - fine).inv() * at(time_s + fine)).as_rotvec() / (2 * fine)
    accel = turn.inv().apply([0.0, 0.0, 9.81])
    mag = turn.inv().apply(48.0 * np.array([np.cos(DIP_RAD), 0.0, -np.sin(DIP_RAD)]))
    return turn, ImuStream("unit", time_s, gyro_rad_s=gyro, accel_m_s2=accel, mag_ut=mag)


def error_deg(turn: Rotation, quats: Floats) -> Floats:
    true = turn.as_quat()[:, [3, 0, 1, 2]]
    return np.degrees(np.linalg.norm(rotvec_between(quats, true), axis=1))


@pytest.mark.parametrize("name", FILTERS)
def test_an_orientation_is_found_without_noise(name):
    needs(name)
    turn, stream = turning_unit()
    found = [(s, ORIENTATION_FILTERS[name](s, DIP_RAD)) for s in stretches(stream, 0.01)]
    error = error_deg(turn, orientations(found, stream.time_s))
    settled = stream.time_s > 10.0
    assert error[settled].max() < CLEAN_DEG[name]


@pytest.mark.parametrize("name", FILTERS)
def test_gaps_are_left_and_bridged(name):
    """A silent magnetometer, one lost sample, and half a second without a gyroscope."""
    needs(name)
    turn, stream = turning_unit()
    gyro, mag = np.array(stream.gyro_rad_s), np.array(stream.mag_ut)
    time_s = stream.time_s
    mag[(time_s > 11.0) & (time_s < 12.0)] = np.nan
    gyro[1300] = np.nan
    silent = (time_s > 15.0) & (time_s < 15.5)
    gyro[silent] = np.nan
    holed = ImuStream("unit", time_s, gyro_rad_s=gyro, accel_m_s2=stream.accel_m_s2, mag_ut=mag)
    parts = list(stretches(holed, 0.01))
    assert len(parts) == 2
    quats = orientations([(s, ORIENTATION_FILTERS[name](s, DIP_RAD)) for s in parts], time_s)
    missing = np.isnan(quats).any(axis=1)
    assert missing[silent][1:-1].all()
    assert not missing[~silent].any()
    error = error_deg(turn, quats)
    # one straight line over 20 ms, and a second on the gyroscope alone
    assert error[(time_s > 10.0) & (time_s < 15.0)].max() < 2 * CLEAN_DEG[name]
    # the filter began anew, as exactly as at first
    assert error[time_s > 19.5].max() < 2 * CLEAN_DEG[name]


def test_north_lies_where_the_model_has_it():
    """Against the field that the engine predicts for a unit."""
    for name in ("sculler", "pendulum3", "arm7"):
        model = oarlock.load_model(name)
        described = model.describe()
        q = np.zeros(len(model.coordinate_names))
        rows = dict(zip(model.measurement_names, model.predict_measurements(q, q, q), strict=True))
        unit = next(s for s in described.inertial_units)
        read = np.array([rows[f"{unit.name}.mag_{axis}"] for axis in "xyz"])
        pose = model.forward_kinematics(q)[model.frame_names.index(unit.frame), :3, :3]
        in_root = pose @ np.asarray(unit.mount.rotation) @ read
        world = described.world
        dip, norm = world.magnetic_dip_rad, world.magnetic_norm_ut
        field = norm * np.array([np.cos(dip), 0.0, -np.sin(dip)])
        assert np.allclose(matrix_from_quat(root_from_north_west_up(model)) @ field, in_root, atol=1e-9)


def slow_arm() -> tuple[oarlock.Model, oarlock.Track, Recording]:
    """An arm that moves so slowly that accelerometers feel little but gravity."""
    model = oarlock.load_model("sculler")
    time_s = np.linspace(-1.0, 13.0, 281)
    names = [n for n in model.coordinate_names if "oar" not in n and n != "seat"]
    random = np.random.default_rng(4)
    phase, size = random.uniform(0, 6, len(names)), random.uniform(0.25, 0.35, len(names))
    swings = size * np.sin(0.6 * time_s[:, None] + phase)
    q = np.zeros((len(time_s), len(model.coordinate_names)))
    for k, name in enumerate(names):
        q[:, model.coordinate_names.index(name)] = swings[:, k] + (0.7 if "elbow_flexion" in name else 0.0)
    motion = Motion(tuple(model.coordinate_names), time_s, q)
    truth, recording = oarlock.simulate(model, motion, seed=2, rate_hz=50.0, noise=False)
    return model, truth, recording


@pytest.fixture(scope="module")
def slow() -> tuple[oarlock.Model, oarlock.Track, Recording]:
    return slow_arm()


@pytest.mark.parametrize("name", FILTERS)
def test_joint_angles_of_a_slow_motion(name, slow):
    needs(name)
    model, truth, recording = slow
    track = oarlock.studies.track_orientations(model, recording, name)
    scores = oarlock.evaluate(track, truth, start_s=6.0)
    assert scores.worst_rmse_deg() < SLOW_DEG
    assert scores["seat"].rmse < 1e-9  # read directly
    assert np.isnan(track.q_std).all()
    assert np.isnan(scores.mean_coverage())
    assert track.provenance["config"]["filter"] == name
    assert any("no standard deviations are estimated" in note for note in track.notes)


def test_the_track_comes_back_from_its_folder_and_can_be_reported(slow, tmp_path):
    from oarlock.report import write_page

    model, truth, recording = slow
    track = oarlock.studies.track_orientations(model, recording, "vector_kf")
    track.save(tmp_path)
    again = oarlock.load_track(tmp_path)
    assert np.array_equal(again.q, track.q, equal_nan=True)
    assert np.isnan(again.q_std).all()
    assert again.notes == track.notes
    assert write_page(again, tmp_path / "report.html", truth=truth).stat().st_size > 10_000


def test_mounts_and_magnetic_offsets_of_a_calibration_are_used(slow):
    model, _, recording = slow
    sensor = next(s for s in model.describe().sensors if s.name == "r_forearm")
    askew = Rotation.from_rotvec([0.3, -0.2, 0.1])
    unit, offset_ut = recording["r_forearm"], np.array([5.0, -3.0, 8.0])
    worn = ImuStream(
        "r_forearm",
        unit.time_s,
        gyro_rad_s=unit.gyro_rad_s @ askew.as_matrix(),
        accel_m_s2=unit.accel_m_s2 @ askew.as_matrix(),
        mag_ut=unit.mag_ut @ askew.as_matrix() + offset_ut,
    )
    others = [s for s in recording if s.name != "r_forearm"]
    rotation = np.asarray(sensor.mount.rotation) @ askew.as_matrix()
    calibration = oarlock.Calibration(
        mounts={"r_forearm": (rotation, sensor.mount.offset)}, mag_offsets_ut={"r_forearm": offset_ut}
    )
    track = oarlock.studies.track_orientations(model, Recording([*others, worn]), "vector_kf", calibration)
    plain = oarlock.studies.track_orientations(model, recording, "vector_kf")
    # the same rotations by another order of products
    assert np.nanmax(np.abs(track["r_elbow_rotation"].angle_rad - plain["r_elbow_rotation"].angle_rad)) < 1e-6


def test_a_unit_without_compass_is_left_out_and_told(slow):
    model, _, recording = slow
    bare = recording["l_forearm"]
    blind = ImuStream("l_forearm", bare.time_s, gyro_rad_s=bare.gyro_rad_s, accel_m_s2=bare.accel_m_s2)
    track = oarlock.studies.track_orientations(
        model, Recording([*(s for s in recording if s.name != "l_forearm"), blind]), "vector_kf"
    )
    assert not track["l_elbow_rotation"].observed.any()
    assert any("l_forearm" in note and "magnetometer" in note for note in track.notes)


def test_without_any_compass_it_is_refused(slow):
    model, _, recording = slow
    blind = [
        ImuStream(s.name, s.time_s, gyro_rad_s=s.gyro_rad_s, accel_m_s2=s.accel_m_s2)
        for s in recording
        if isinstance(s, ImuStream)
    ]
    with pytest.raises(DataError, match=r"magnetometer.*Use ukf"):
        oarlock.studies.track_orientations(model, Recording(blind), "vector_kf")


@pytest.mark.parametrize(("name", "package"), PACKAGE.items())
def test_a_missing_package_is_named_with_its_extra(name, package, slow, monkeypatch):
    model, _, recording = slow
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(DataError, match=rf"{package}: pip install 'oarlock\[compare\]'"):
        oarlock.studies.track_orientations(model, recording.slice(0.0, 1.0), name)


def test_an_unknown_filter_names_the_nearest(slow):
    model, _, recording = slow
    with pytest.raises(DataError, match="madgwick"):
        oarlock.studies.track_orientations(model, recording, "madgwik")
