"""A track against optical markers: clocks and axes are found, errors are those that were put in."""

import numpy as np
import pytest

import oarlock
from marker_bodies import arm_motion
from oarlock import DataError
from oarlock.markers import Attachment, Markers, evaluate_markers

LAB_FROM_ROOT = np.array([[0.8, 0.6, 0.0], [0.0, 0.0, 1.0], [0.6, -0.8, 0.0]])
LAB_M = np.array([1.0, -2.0, 3.0])
POINTS = ("elbow", "wrist", "hand")
CLOCK_S = 2e-4  # 1 mm of noise over hundreds of samples of a hand at 0.5 m/s
TURN = 1e-3  # direction cosines: 1 mm of noise over points 0.3 m apart, many samples
EXACT = 1e-9


@pytest.fixture(scope="module")
def track():
    model = oarlock.load_model("arm7")
    return oarlock.simulate(model, arm_motion(model, 10.0, 7), rate_hz=100.0)[0]


def lab_markers(track, offset_s=0.0, drift=0.0, noise_m=0.0, rate_hz=120.0) -> Markers:
    """The track's points by a camera system's clock and in its axes: t_track = t_camera (1 + drift) + offset."""
    own_s = np.arange(0.5, 9.5, 1.0 / rate_hz)
    model, motion = track.model, arm_motion(track.model, 10.0, 7)
    poses = model.forward_kinematics(motion.at(own_s))
    position = np.stack([poses[:, model.frame_names.index(name), :3, 3] for name in POINTS], axis=1)
    noise = noise_m * np.random.default_rng(0).standard_normal(position.shape)
    return Markers(POINTS, (own_s - offset_s) / (1.0 + drift), position @ LAB_FROM_ROOT.T + LAB_M + noise)


def at_start(found, markers: Markers) -> float:
    return float(markers.time_s[0]) + found.clock_offset_s


@pytest.mark.parametrize("offset_s", [0.0, 3.14159, -2.00417])
def test_clock_and_axes_are_found(track, offset_s):
    markers = lab_markers(track, offset_s, noise_m=1e-3)
    found = evaluate_markers(track, markers)
    assert found.clock_offset_s == pytest.approx(offset_s, abs=CLOCK_S)
    np.testing.assert_allclose(found.track_from_markers[:3, :3], LAB_FROM_ROOT.T, atol=TURN)
    for score in found.points.values():
        np.testing.assert_allclose(score.rmse_m, 1e-3, rtol=0.15)  # the noise itself
        assert score.correlation_3d > 0.9999
    assert found.notes == ()


def test_drift_is_found(track):
    markers = lab_markers(track, 1.5, 3e-4, 1e-3)
    found = evaluate_markers(track, markers, align_clock="drift")
    assert found.clock_drift == pytest.approx(3e-4, abs=1e-4)
    assert at_start(found, markers) == pytest.approx(0.5, abs=1e-3)
    assert found.mean_rmse_3d_m < evaluate_markers(track, markers).mean_rmse_3d_m


def test_errors_along_each_axis_are_those_put_in(track):
    markers = lab_markers(track)
    plain = Markers(
        POINTS, markers.time_s, (markers.position_m - LAB_M) @ LAB_FROM_ROOT + [0.01, 0.02, -0.02]
    )
    found = evaluate_markers(track, plain, align_clock=False, align_frame=False)
    for score in found.points.values():
        np.testing.assert_allclose(score.rmse_m, [0.01, 0.02, 0.02], atol=1e-6)  # splines between frames
        np.testing.assert_allclose(score.mean_error_m, [-0.01, -0.02, 0.02], atol=1e-6)
        assert score.rmse_3d_m == pytest.approx(0.03, abs=1e-6)
        np.testing.assert_allclose(score.correlation, 1.0, atol=1e-6)
    assert found.clock_offset_s == 0.0
    # one displacement for all points takes a common shift away
    assert evaluate_markers(track, plain, align_clock=False).mean_rmse_3d_m < 1e-6


def test_gaps_and_names_and_points_off_the_origin(track):
    markers = lab_markers(track)
    position = np.array(markers.position_m)
    position[200:400, 1] = np.nan
    renamed = Markers(("LELB", "LWRI", "LFIN"), markers.time_s, position)
    pairs = {"LELB": "elbow", "LWRI": "wrist"}
    found = evaluate_markers(track, renamed, pairs)
    assert set(found.points) == set(pairs)
    assert found.points["LWRI"].samples < found.points["LELB"].samples
    placed = [Attachment("LELB", "elbow", [0.0, 0.0, 0.0]), Attachment("LWRI", "wrist", [0.0, 0.05, 0.0])]
    moved = evaluate_markers(track, renamed, placed)
    assert moved.points["LWRI"].rmse_3d_m > 0.01, "the point of the marker counts"
    assert found.to_dict()["points"]["LELB"]["frame"] == "elbow"
    assert "LELB" in str(found)


def test_positions_relative_to_another_frame(track):
    wrist = track.frame_positions("wrist", "elbow")
    hand = track.frame_positions("hand", "elbow")
    markers = Markers(("wrist", "hand"), track.time_s, np.stack([wrist, hand], axis=1) @ LAB_FROM_ROOT.T)
    found = evaluate_markers(track, markers, relative_to="elbow", align_clock=False)
    np.testing.assert_allclose(found.track_from_markers[:3, :3], LAB_FROM_ROOT.T, atol=EXACT)
    assert found.mean_rmse_3d_m < EXACT


def test_a_movement_that_repeats_says_so():
    model = oarlock.load_model("arm7")
    time_s = np.arange(-0.1, 12.1, 0.01)
    q = np.stack([0.3 * np.sin(2 * np.pi * 0.5 * time_s + k) for k in range(7)], axis=1)
    motion = oarlock.simulation.Motion(tuple(model.joint_names), time_s, q)
    track = oarlock.simulate(model, motion, rate_hz=100.0)[0]
    poses = model.forward_kinematics(motion.at(np.arange(0.0, 12.0, 0.01)))
    position = np.stack([poses[:, model.frame_names.index(name), :3, 3] for name in POINTS], axis=1)
    found = evaluate_markers(track, Markers(POINTS, np.arange(0.0, 12.0, 0.01) - 0.3, position))
    assert found.clock_offset_s == pytest.approx(0.3, abs=CLOCK_S)
    assert "the movement repeats" in found.notes[0]
    near = evaluate_markers(
        track, Markers(POINTS, np.arange(0.0, 12.0, 0.01) - 0.3, position), largest_offset_s=0.8
    )
    assert near.notes == ()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"frames": {"LELB": "elbow"}}, 'no "LELB"'),
        ({"frames": {"elbow": "elboww"}}, 'no frame "elboww"'),
        ({"start_s": 99.0}, "no sample of the track"),
        ({"align_clock": "rate"}, "align_clock"),
    ],
)
def test_wrong_requests_are_refused(track, change, said):
    with pytest.raises(DataError, match=said):
        evaluate_markers(track, lab_markers(track), **change)


def test_points_on_a_line_and_clocks_apart_are_refused(track):
    time_s = track.time_s
    line = np.outer(np.sin(time_s), [1.0, 0.0, 0.0])[:, None]
    with pytest.raises(DataError, match="on a line"):
        evaluate_markers(track, Markers(("elbow",), time_s, line), align_clock=False)
    with pytest.raises(DataError, match="share 0 samples"):
        evaluate_markers(track, Markers(("elbow",), time_s + 100.0, line), align_clock=False)
    with pytest.raises(DataError, match="share no two seconds of movement"):
        evaluate_markers(track, Markers(("elbow",), time_s, 0.0 * line))
    with pytest.raises(DataError, match="has the name of a frame"):
        evaluate_markers(track, Markers(("LELB",), time_s, line))
