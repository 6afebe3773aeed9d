"""Joint values from markers: exact on exact data, honest about what markers do not tell."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import oarlock
from marker_bodies import arm_motion, clusters, markers_on, postures, with_gaps
from oarlock import DataError
from oarlock.evaluation.markers.point_tree import PointTree
from oarlock.markers import Attachment, Markers, fill_gaps, inverse_kinematics, low_pass
from oarlock.model.rotation import quat_from_rotvec, rotvec_between
from oarlock.model.shipped_files import model_names
from refusals import assert_refused

EXACT_RAD = 1e-9  # rounding of positions of a metre, over levers of 5 cm
DIFFERENCE = 1e-8  # central differences of 1e-6
PLAIN_RAD = 1e-6  # where a search with slopes by differences stops
WANTED_DEG = 0.5
WITHIN_THREE_STD = 0.99  # of a normal distribution 99.7 % lie inside


@pytest.mark.parametrize("name", model_names())
def test_slopes_of_points_are_their_derivatives(name):
    model = oarlock.load_model(name)
    random = np.random.default_rng(0)
    tree = PointTree(model, [Attachment(f, f, random.normal(size=3) * 0.1) for f in model.frame_names])
    q = 0.7 * random.standard_normal((4, len(model.coordinate_names)))
    _, slopes = tree.with_slopes(q)
    for k in range(q.shape[1]):
        step = np.zeros_like(q)
        step[:, k] = 1e-6
        difference = (tree.at(tree.plus(q, step)) - tree.at(tree.plus(q, -step))) / 2e-6
        np.testing.assert_allclose(slopes[..., k], difference, atol=DIFFERENCE)
        np.testing.assert_allclose(tree.minus(tree.plus(q, step), q), step, atol=EXACT_RAD)


def turns_apart(model: oarlock.Model, q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Differences, of rotations as turns."""
    apart = q - other
    for columns in PointTree(model, [Attachment("a", model.frame_names[-1], np.zeros(3))]).rotations:
        apart[:, columns] = rotvec_between(
            quat_from_rotvec(other[:, columns]), quat_from_rotvec(q[:, columns])
        )
    return apart


@pytest.mark.parametrize("name", ["arm7", "sculler", "sculler_ball", "qmt_full_body"])
def test_exact_markers_give_back_the_postures(name):
    model = oarlock.load_model(name)
    random = np.random.default_rng(1)
    time_s = np.arange(12) / 100.0
    moved = [f.name for f in model.describe().frames if f.joint is not None]
    attachments = clusters(moved, 3, 0.05, 2)
    start = 0.15 * random.standard_normal(len(model.coordinate_names))
    q = start + 0.02 * np.cumsum(random.standard_normal((12, len(start))), axis=0)
    fit = inverse_kinematics(model, markers_on(model, q, time_s, attachments), attachments)
    assert fit.determined.all()
    assert fit.settled.all()
    assert fit.notes == ()
    np.testing.assert_allclose(turns_apart(model, fit.q, q), 0.0, atol=EXACT_RAD)


def test_the_fit_is_the_least_of_a_plain_search():
    """Another library's least squares, on residuals written out here, finds the same posture in noise."""
    model = oarlock.load_model("arm7")
    random = np.random.default_rng(3)
    q = postures(model, arm_motion(model, 1.0, 3), np.array([0.5]))
    attachments = tuple(
        Attachment(a.marker, a.frame, a.point_m, std_m)
        for a, std_m in zip(
            clusters(["elbow", "wrist", "hand"], 3, 0.06, 3), random.uniform(1e-3, 8e-3, 9), strict=True
        )
    )
    seen = markers_on(model, q, np.zeros(1), attachments, 5e-3)

    def residuals(values: np.ndarray) -> np.ndarray:
        poses = model.forward_kinematics(values)
        rows = []
        for a in attachments:
            pose = poses[model.frame_names.index(a.frame)]
            rows.append((pose[:3, :3] @ a.point_m + pose[:3, 3] - seen[a.marker][0]) / a.std_m)
        return np.concatenate(rows)

    plain = least_squares(residuals, q[0], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    fit = inverse_kinematics(model, seen, attachments)
    np.testing.assert_allclose(fit.q[0], plain.x, atol=PLAIN_RAD)
    covariance = np.linalg.inv(plain.jac.T @ plain.jac)
    expected = np.sqrt(np.diag(covariance)) * max(1.0, np.sqrt(2.0 * plain.cost / (27 - 7)))
    np.testing.assert_allclose(fit.q_std[0], expected, rtol=0.05)  # the soft limits take a little away


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_known_motion_with_noise_and_gaps_comes_back_within_half_a_degree(seed):
    """1 mm of noise on every axis and a gap of 200 ms in every marker; four markers a body, 6 cm from its joint."""
    model = oarlock.load_model("arm7")
    time_s = np.arange(0.0, 6.0, 0.01)
    q = postures(model, arm_motion(model, 6.0, seed), time_s)
    attachments = clusters(["elbow", "wrist", "hand"], 4, 0.06, seed)
    given, told = with_gaps(markers_on(model, q, time_s, attachments, 1e-3, seed), 0.2, seed)
    filled = fill_gaps(given)
    assert {gap.marker: (gap.start_s, gap.frames) for gap in filled.gaps} == told
    assert all(gap.filled for gap in filled.gaps)
    fit = inverse_kinematics(model, low_pass(filled), attachments)
    error = np.degrees(fit.q - q)
    assert np.sqrt(np.mean(error**2, axis=0)).max() < WANTED_DEG
    # without the filter errors are those that the fit says
    raw = inverse_kinematics(model, given, attachments)
    assert raw.noise_scale == pytest.approx(1.0, abs=0.05)
    assert np.mean(np.abs(raw.q - q) < 3.0 * raw.q_std) > WITHIN_THREE_STD
    assert fit.determined.all()


def test_a_sculler_comes_back_too():
    from oarlock.rowing import sculling

    model = oarlock.load_model("sculler")
    motion = sculling(model, 3.5, 28.0, seed=5)
    time_s = np.arange(0.1, 3.4, 0.01)
    q = postures(model, motion, time_s)
    sides = [f"{side}_{part}" for side in "rl" for part in ("elbow", "wrist", "hand", "handle")]
    attachments = clusters(["seat", "r_shoulder", "l_shoulder", *sides], 4, 0.08, 3)
    given, told = with_gaps(markers_on(model, q, time_s, attachments, 1e-3, 4), 0.2, 5)
    filled = fill_gaps(given)
    assert {gap.marker: (gap.start_s, gap.frames) for gap in filled.gaps} == told
    fit = inverse_kinematics(model, low_pass(filled), attachments)
    error = fit.q - q
    assert np.degrees(np.sqrt(np.mean(error[:, 1:] ** 2, axis=0))).max() < WANTED_DEG
    assert np.abs(error[:, 0]).max() < 2e-3, "m, of the seat"


def test_what_no_marker_sees_is_said_and_held_by_its_limits():
    model = oarlock.load_model("arm7")
    time_s = np.arange(0.0, 1.0, 0.02)
    q = postures(model, arm_motion(model, 1.0, 1), time_s)
    attachments = (*clusters(["elbow"], 3, 0.05, 1), Attachment("wrist", "wrist", np.zeros(3)))
    fit = inverse_kinematics(model, markers_on(model, q, time_s, attachments, 1e-3), attachments)
    told = dict(zip(fit.coordinate_names, fit.determined.all(axis=0), strict=True))
    assert told == {name: name not in ("elbow_rotation", "hand_abduction", "hand_flexion") for name in told}
    assert "not determined by these markers: elbow_rotation, hand_abduction, hand_flexion" in fit.notes
    middle = {j.name: np.mean(j.limits) for j in model.describe().joints}
    for name in ("elbow_rotation", "hand_flexion"):
        np.testing.assert_allclose(fit.q[:, fit.coordinate_names.index(name)], middle[name], atol=EXACT_RAD)
    assert np.isnan(fit.track()["hand_flexion"].angle_rad).all()
    assert fit.motion().coordinate_names == tuple(model.coordinate_names)


def test_a_joint_lost_for_long_is_refused_by_name_and_a_short_loss_is_bridged():
    model = oarlock.load_model("arm7")
    time_s = np.arange(0.0, 2.0, 0.01)
    q = postures(model, arm_motion(model, 2.0, 2), time_s)
    attachments = clusters(["elbow", "wrist", "hand"], 3, 0.05, 2)
    whole = markers_on(model, q, time_s, attachments)

    def without_hand(first: int, last: int) -> Markers:
        position = np.array(whole.position_m)
        position[first:last, 6:] = np.nan
        return Markers(whole.names, time_s, position)

    short = inverse_kinematics(model, without_hand(80, 95), attachments)
    assert any(note.startswith("hand_flexion: not determined in 15 of 200 frames") for note in short.notes)
    np.testing.assert_allclose(np.degrees(short.motion().at(time_s) - q), 0.0, atol=0.2)
    long = inverse_kinematics(model, without_hand(80, 140), attachments)
    assert_refused(long.motion, "hand_abduction is not determined from 0.800 to 1.390 s")
    assert_refused(inverse_kinematics(model, without_hand(180, 200), attachments).motion, "at an end")


def test_a_heavier_marker_counts_for_less():
    model = oarlock.load_model("pendulum3")
    frame = model.frame_names[1]
    q = np.full((1, len(model.coordinate_names)), 0.3)
    good, bad = (
        Attachment("good", frame, [0.0, 0.3, 0.1]),
        Attachment("bad", frame, [0.1, 0.3, 0.0], std_m=1.0),
    )
    markers = markers_on(model, q, np.zeros(1), (good, bad))
    position = np.array(markers.position_m)
    position[0, 1] += 0.05
    fit = inverse_kinematics(model, Markers(markers.names, [0.0], position), (good, bad))
    assert fit.rmse_m["good"] < 1e-5 < 0.01 < fit.rmse_m["bad"]


def test_a_static_trial_places_markers(tmp_path):
    model = oarlock.load_model("arm7")
    posture = {"elbow_flexion": 0.5, "shoulder_flexion": 0.2}
    q = np.array([[posture.get(name, 0.0) for name in model.coordinate_names]] * 5)
    attachments = clusters(["elbow", "hand"], 2, 0.05, 0)
    static = markers_on(model, q, np.arange(5) / 100.0, attachments)
    found = oarlock.markers.attach_markers(model, static, {a.marker: a.frame for a in attachments}, posture)
    oarlock.markers.save_attachments(found, tmp_path / "person.toml")
    for a, b in zip(attachments, oarlock.markers.load_attachments(tmp_path / "person.toml"), strict=True):
        assert (a.marker, a.frame) == (b.marker, b.frame)
        np.testing.assert_allclose(a.point_m, b.point_m, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("format = 1\n[[marker]]\nname = 'a'\nframe = 'hand'\npoint = [0, 1]\n", "expected [x, y, z] in m"),
        ("format = 1\n[[marker]]\nname = 'a'\nframe = 'hand'\nstd_m = 0\n", "positive length"),
        ("format = 1\n[[marker]]\nname = 'a'\nplace = 'hand'\n", '"place"'),
        ("format = 2\n", "format 1"),
        ("format = 1\n", '"marker" is missing'),
    ],
)
def test_a_wrong_file_of_attachments_is_refused(tmp_path, text, said):
    (tmp_path / "wrong.toml").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"wrong\.toml") as refused:
        oarlock.markers.load_attachments(tmp_path / "wrong.toml")
    assert said in str(refused.value)


def test_wrong_names_are_refused():
    model, markers = oarlock.load_model("arm7"), Markers(("LELB",), [0.0], np.zeros((1, 1, 3)))
    with pytest.raises(DataError, match="none of the attached markers"):
        inverse_kinematics(model, markers, {"RELB": "elbow"})
    assert_refused(lambda: inverse_kinematics(model, markers, {"LELB": "ellbow"}), 'no frame "ellbow"')
    with pytest.raises(DataError, match="attached 2 times"):
        inverse_kinematics(model, markers, [Attachment("a", "hand", np.zeros(3))] * 2)


def test_lengths_and_the_laboratorys_pose_come_back_from_a_trial():
    model, lengths = oarlock.load_model("arm7"), {"l_ua": 0.298, "l_fa": 0.245}
    person = oarlock.load_model("arm7", parameters=lengths)
    time_s = np.arange(0.0, 8.0, 0.02)
    q = postures(person, arm_motion(person, 8.0, 4), time_s)
    torso = tuple(
        Attachment(f"t{k}", "root", p) for k, p in enumerate([[0.2, 0, 0], [0, 0.1, 0.1], [0, 0, -0.2]])
    )
    attachments = (*torso, *clusters(["elbow", "wrist", "hand"], 3, 0.06, 4))
    root_from_lab = np.eye(4)
    root_from_lab[:3, :3] = [[-0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, -0.6]]
    root_from_lab[:3, 3] = [1.0, -1.3, 2.0]
    seen = markers_on(person, q, time_s, attachments, 1e-3).moved(np.linalg.inv(root_from_lab))
    found = oarlock.markers.fit_body(model, seen, attachments, parameters=lengths, place_root=True)
    for name, length in lengths.items():
        assert abs(found.parameters[name] - length) < 4.0 * found.parameter_std[name] < 4e-3
    np.testing.assert_allclose(found.root_from_markers, root_from_lab, atol=3e-3)  # 1 mm over levers of 30 cm
    assert found.rms_m < 2e-3
    assert found.calibration().parameters == found.parameters
