"""Exact derivatives of poses and readings: central differences and an independent library give the same."""

import numpy as np
import pytest

import oarlock
from oarlock import DataError
from oarlock.model.coordinates import plus, rotation_columns
from oarlock.model.rotation import quat_from_matrix, rotvec_from_quat
from oarlock.model.shipped_files import model_names
from random_tree import RootMotion, load_tree, random_tree
from test_oracles import SEEDS, Pinocchio, state

STEP = 1e-5
POSE_DIFFERENCE = 1e-9  # curvature of order 1, and rounding 1e-16 over 1e-5
READING_DIFFERENCE = 1e-6  # the same of readings up to 1e3
LENGTH_STEP_M = 1e-3  # places are linear in lengths
ROWS = 3


def random_motion(model, seed):
    random = np.random.default_rng(seed)
    n = len(model.coordinate_names)
    return random, *(scale * random.standard_normal((ROWS, n)) for scale in (0.7, 1.5, 4.0))


def moved(model, q, column, by):
    step = np.zeros_like(q)
    step[:, column] = by
    return plus(q, step, rotation_columns(model.coordinate_names))


def turn_between(one, other):
    """Small rotation vectors (..., 3) in root axes that lead from one rotation to another."""
    return rotvec_from_quat(quat_from_matrix(other @ np.swapaxes(one, -1, -2)))


@pytest.mark.parametrize("name", model_names())
def test_frames_move_as_central_differences_say(name):
    model = oarlock.load_model(name)
    _, q, *_ = random_motion(model, 1)
    lengths = np.array([model.parameters[length] for length in model.length_names])
    found = model.frame_jacobian(q)
    for column in range(q.shape[1]):
        ahead, behind = (model.forward_kinematics(moved(model, q, column, by)) for by in (STEP, -STEP))
        move = (ahead[..., :3, 3] - behind[..., :3, 3]) / (2.0 * STEP)
        turn = turn_between(behind[..., :3, :3], ahead[..., :3, :3]) / (2.0 * STEP)
        both = np.concatenate([move, turn], axis=-1)
        np.testing.assert_allclose(found.by_coordinate[..., column], both, rtol=0, atol=POSE_DIFFERENCE)
    for column in range(len(lengths)):
        step = LENGTH_STEP_M * np.eye(len(lengths))[column]
        ahead, behind = (model.forward_kinematics(q, lengths + by) for by in (step, -step))
        difference = (ahead - behind)[..., :3, :] / (2.0 * LENGTH_STEP_M)
        np.testing.assert_allclose(
            found.by_length[..., column], difference[..., 3], rtol=0, atol=POSE_DIFFERENCE
        )
        assert not difference[..., :3].any()


@pytest.mark.parametrize("rests", [True, False])
@pytest.mark.parametrize("name", model_names())
def test_readings_change_as_central_differences_say(name, rests):
    model = oarlock.load_model(name)
    random, q, qd, qdd = random_motion(model, 2)
    root = RootMotion.at_random(random)
    base = None if rests else root.base
    found = model.measurement_jacobian(q, qd, qdd, base)
    for column in range(q.shape[1]):
        for order, exact in enumerate((found.by_q, found.by_qd, found.by_qdd)):

            def read(by, order=order, column=column):
                motion = [q, qd, qdd]
                if order:
                    motion[order] = motion[order] + by * np.eye(q.shape[1])[column]
                else:
                    motion[0] = moved(model, q, column, by)
                return model.predict_measurements(*motion, base)

            difference = (read(STEP) - read(-STEP)) / (2.0 * STEP)
            np.testing.assert_allclose(exact[..., column], difference, rtol=0, atol=READING_DIFFERENCE)
    for column, length in enumerate(model.length_names):
        ahead, behind = (
            model.with_parameters({length: model.parameters[length] + by}).predict_measurements(
                q, qd, qdd, base
            )
            for by in (LENGTH_STEP_M, -LENGTH_STEP_M)
        )
        difference = (ahead - behind) / (2.0 * LENGTH_STEP_M)
        np.testing.assert_allclose(found.by_length[..., column], difference, rtol=0, atol=READING_DIFFERENCE)


@pytest.mark.parametrize("seed", SEEDS)
def test_frames_move_as_pinocchio_says(seed, tmp_path):
    tree = random_tree(seed)
    model, other = load_tree(tree, tmp_path), Pinocchio(tree)
    pin = other.pin
    q, *_ = state(tree, np.random.default_rng([seed, 2]))
    joints = np.concatenate([np.zeros(6), [1.0], tree.coordinates(q)])
    pin.computeJointJacobians(other.model, other.data, joints)
    pin.updateFramePlacements(other.model, other.data)
    aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    by_link = np.array(
        [pin.getFrameJacobian(other.model, other.data, frame, aligned)[:, 6:] for frame in other.frames]
    )
    # joints that move several links, some of them the other way
    shares = np.stack([tree.coordinates(unit) for unit in np.eye(len(tree.kinds))], axis=1)
    np.testing.assert_allclose(model.frame_jacobian(q).by_coordinate, by_link @ shares, rtol=0, atol=1e-12)


def test_chosen_frames_and_lengths_of_each_row():
    model = oarlock.load_model("sculler")
    _, q, *_ = random_motion(model, 3)
    lengths = np.array([model.parameters[length] for length in model.length_names])
    each = lengths + 0.05 * np.arange(ROWS)[:, None]
    chosen = model.frame_jacobian(q, ["r_hand", "root"], each)
    for row in range(ROWS):
        sized = model.with_parameters(dict(zip(model.length_names, each[row], strict=True)))
        alone = sized.frame_jacobian(q[row])
        for place, frame in enumerate(("r_hand", "root")):
            number = model.frame_names.index(frame)
            for some, one in zip(chosen, alone, strict=True):
                np.testing.assert_allclose(some[row, place], one[number], rtol=0, atol=1e-14)
        poses = sized.forward_kinematics(q[row])
        np.testing.assert_allclose(model.forward_kinematics(q, each)[row], poses, rtol=0, atol=1e-14)


def test_shapes_follow_the_arrays():
    model = oarlock.load_model("arm7")
    n, lengths = len(model.coordinate_names), len(model.length_names)
    q = np.zeros((2, 0, n))
    assert model.frame_jacobian(q).by_length.shape == (2, 0, len(model.frame_names), 3, lengths)
    one = model.measurement_jacobian(*np.zeros((3, n)))
    assert one.by_q.shape == (len(model.measurement_names), n)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frames": ["elbow_of_mine"]}, "no frame 'elbow_of_mine'"),
        ({"lengths": np.zeros((2, 3))}, "2 rows"),
        ({"lengths": np.zeros(4)}, "expected \\(..., 3\\)"),
    ],
)
def test_what_does_not_fit_is_refused(change, words):
    model = oarlock.load_model("arm7")
    with pytest.raises(DataError, match=words):
        model.frame_jacobian(np.zeros((5, len(model.coordinate_names))), **change)
