"""Tracks with ball and free joints: what they hold, their columns, files and frames."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from ball_body import BallBody, noisy, true_track
from oarlock.evaluation.summary import summarize
from oarlock.model.angle_sequence import quat_from_angles
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec, rotvec_between
from oarlock.tracking.joint_series import BallSeries, FreeSeries, HingeSeries, SlideSeries
from refusals import assert_refused

ROUNDING = 1e-12
STD = np.linspace(0.01, 0.03, 12)


@pytest.fixture(scope="module")
def truth() -> oarlock.Track:
    return true_track(BallBody(), 20.0)


@pytest.fixture(scope="module")
def track(truth) -> oarlock.Track:
    return noisy(truth, STD)


def test_joints_come_as_what_they_are(track):
    kinds = [FreeSeries, HingeSeries, SlideSeries, BallSeries, HingeSeries]
    assert [type(track[name]) for name in track.joint_names] == kinds
    assert track.joint_units == ("m, rad", "rad", "m", "rad", "rad")
    assert track.coordinate_units == ("m",) * 3 + ("rad",) * 4 + ("m",) + ("rad",) * 4
    shoulder, pelvis = track["shoulder"], track["pelvis"]
    assert np.array_equal(shoulder.rotvec_rad, track.q[:, 8:11])
    assert np.array_equal(shoulder.velocity_rad_s, track.qd[:, 8:11])
    assert np.array_equal(shoulder.std_rad, track.q_std[:, 8:11])
    assert np.array_equal(pelvis.position_m, track.q[:, :3])
    assert np.array_equal(pelvis.velocity_m_s, track.qd[:, :3])
    assert np.array_equal(pelvis.rotvec_rad, track.q[:, 3:6])
    assert np.array_equal(pelvis.acceleration_rad_s2, track.qdd[:, 3:6])
    assert np.array_equal(track["trunk"].angle_rad, track.q[:, 6])
    assert np.array_equal(track["rail"].position_m, track.q[:, 7])
    with pytest.raises(KeyError, match="shoulder"):
        track["shoulder.rx"]


def test_a_ball_is_one_rotation_by_all_its_names(track):
    for series in (track["shoulder"], track["pelvis"]):
        expected = Rotation.from_rotvec(series.rotvec_rad)
        np.testing.assert_allclose(series.matrix, expected.as_matrix(), atol=ROUNDING)
        assert np.sum(series.quat_wxyz[1:] * series.quat_wxyz[:-1], axis=1).min() > 0.9
        for sequence in (None, "XYZ", "ZYZ"):
            angles = series.angles_rad(sequence)
            back = quat_from_angles(angles, sequence or series.angle_sequence)
            assert np.linalg.norm(rotvec_between(back, series.quat_wxyz), axis=1).max() < 1e-7
            clear = ~series.near_singular(sequence)
            assert np.abs(np.diff(angles, axis=0)[clear[1:] & clear[:-1]]).max() < 1.0
            assert np.isfinite(series.angles_std_rad(sequence)[clear]).all()
        with pytest.raises(oarlock.DataError, match=rf'joint "{series.name}": .XYY. is no angle sequence'):
            series.angles_rad("XYY")
    assert (track["shoulder"].angle_sequence, track["pelvis"].angle_sequence) == ("YXY", "ZXY")


def test_a_joint_is_observed_when_all_its_coordinates_are(track):
    observed = track.observed.copy()
    observed[:10, 9] = False
    observed[:, 4] = False
    seen = replace(track, observed=observed)
    assert seen["shoulder"].observed.tolist() == [False] * 10 + [True] * (len(track.time_s) - 10)
    assert not seen["pelvis"].observed.any()
    assert seen["pelvis"].position_observed.all()
    summary = summarize(seen)
    assert (summary.joints, summary.joints_observed, summary.not_observed) == (5, 4, ("pelvis",))


def test_columns_say_what_they_hold(track):
    columns = track.columns()
    assert list(columns)[:3] == ["time_s", "pelvis.x_m", "pelvis.x_std_m"]
    assert np.array_equal(columns["shoulder.ry_velocity_rad_s"], track.qd[:, 9])
    assert np.array_equal(columns["shoulder_quat_w"], track["shoulder"].quat_wxyz[:, 0])
    assert np.array_equal(columns["shoulder_YXY_y2_rad"], track["shoulder"].angles_rad()[:, 2])
    assert np.array_equal(columns["pelvis_ZXY_x_std_rad"], track["pelvis"].angles_std_rad()[:, 1])
    near = track["shoulder"].near_singular()
    assert near.any() and np.array_equal(columns["shoulder_YXY_near_singular"], near)
    assert all(values.shape == (len(track.time_s),) for values in columns.values())
    assert not any("trunk_quat" in name for name in columns)


def test_tables_of_others_take_them(track):
    frame = pytest.importorskip("pandas") and track.to_pandas()
    assert len(frame) == len(track.time_s)
    assert frame["shoulder.rx_rad"].iloc[3] == track.q[3, 8]
    pytest.importorskip("xarray")
    assert track.to_xarray()["shoulder_quat_z"].dims == ("time_s",)


def test_frames_have_orientations(track):
    poses = track.model.forward_kinematics(track.q)
    forearm = poses[:, track.model.frame_names.index("forearm"), :3, :3]
    upperarm = poses[:, track.model.frame_names.index("upperarm"), :3, :3]
    np.testing.assert_allclose(matrix_from_quat(track.frame_quat_wxyz("forearm")), forearm, atol=ROUNDING)
    between = upperarm.transpose(0, 2, 1) @ forearm
    relative = track.frame_quat_wxyz("forearm", relative_to="upperarm")
    np.testing.assert_allclose(matrix_from_quat(relative), between, atol=ROUNDING)
    assert np.sum(relative[1:] * relative[:-1], axis=1).min() > 0.9
    with pytest.raises(oarlock.DataError, match=r"no frame 'forarm'.*forearm"):
        track.frame_quat_wxyz("forarm")
    assert_refused(lambda: replace(track, model=None).frame_quat_wxyz("forearm"), "without its model")


def test_what_is_missing_stays_missing(track):
    q = track.q.copy()
    q[5, 8:11] = np.nan
    holed = replace(track, q=q)
    for values in (
        holed["shoulder"].quat_wxyz,
        holed["shoulder"].angles_rad(),
        holed.frame_quat_wxyz("forearm"),
    ):
        assert np.isnan(values[5]).all()
        assert np.isfinite(np.delete(values, 5, axis=0)).all()
    assert np.isfinite(holed.frame_quat_wxyz("collar")).all()


@pytest.fixture
def saved(track, tmp_path):
    replace(track, model=None).save(tmp_path)
    return tmp_path


def test_a_track_comes_back_from_its_folder(track, saved):
    loaded = oarlock.load_track(saved)
    for name in ("joint_names", "joint_units", "coordinate_names", "coordinate_units", "notes"):
        assert getattr(loaded, name) == getattr(track, name)
    assert dict(loaded.angle_sequences) == {"pelvis": "ZXY", "shoulder": "YXY"}
    for name in ("time_s", "q", "qd", "qdd", "q_std", "qd_std", "qdd_std"):
        assert np.array_equal(getattr(loaded, name), getattr(track, name), equal_nan=True), name
    assert np.array_equal(loaded.observed, track.observed)
    assert np.array_equal(loaded["shoulder"].angles_rad(), track["shoulder"].angles_rad())


def test_a_track_comes_back_from_a_pickle(track):
    loaded = pickle.loads(pickle.dumps(replace(track, model=None)))
    assert np.array_equal(loaded["pelvis"].quat_wxyz, track["pelvis"].quat_wxyz)
    assert loaded["shoulder"].angle_sequence == "YXY"


def test_coordinates_without_units_are_named(saved):
    text = (saved / "run.toml").read_text(encoding="utf-8")
    head, tail = text.split("[coordinates]")
    (saved / "run.toml").write_text(
        f"{head}[coordinates]{tail.replace('units', 'unit', 1)}", encoding="utf-8"
    )
    assert_refused(lambda: oarlock.load_track(saved), "[coordinates] needs")


def test_tracks_of_hinges_need_no_coordinates():
    plain = true_track(BallBody({"trunk": "hinge"}), 1.0)
    given = {
        name: getattr(plain, name) for name in ("q", "qd", "qdd", "q_std", "qd_std", "qdd_std", "observed")
    }
    track = oarlock.Track(
        model=None, time_s=plain.time_s.copy(), joint_names=("trunk",), joint_units=("rad",), **given
    )
    assert (track.coordinate_names, track.coordinate_units) == (("trunk",), ("rad",))
    assert np.array_equal(track["trunk"].value, plain.q[:, 0])


def test_rates_are_those_of_the_rotation(truth):
    """R(t + h) = R(t) Exp(w h + ...): the mean of the rates at both ends, to third order in h."""
    series = truth["shoulder"]
    h = truth.time_s[1] - truth.time_s[0]
    turn = rotvec_between(series.quat_wxyz[:-1], quat_from_rotvec(series.rotvec_rad[1:]))
    mean = 0.5 * (series.velocity_rad_s[1:] + series.velocity_rad_s[:-1])
    # h^2 / 12 of the second derivative of a rate of up to 6 rad/s whose sines are up to 4 rad/s fast
    np.testing.assert_allclose(turn / h, mean, atol=h**2 / 12 * 6 * 4**2 * 2)
