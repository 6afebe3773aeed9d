"""Joint variables from orientations: exact where these come from a posture, honest where they do not tell."""

import numpy as np
import pytest

import oarlock
from exact_recording import Floats
from oarlock import rowing
from oarlock.evaluation.comparison.inverse_kinematics import Measured, solve
from oarlock.model.rotation import quat_from_matrix, quat_from_rotvec, quat_product, rotvec_between
from oarlock.storage.arrays import Bools

# Gauss-Newton is quadratic where all agrees: the last step, under 1e-6, leaves 1e-12; rounding of angles is 1e-15.
EXACT = 1e-8
RATE_HZ = 50.0


def swinging(model: oarlock.Model, seconds: float = 2.0) -> tuple[Floats, Floats]:
    """Every coordinate swings by itself, far from any pole."""
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    middle = np.random.default_rng(1).uniform(-0.4, 0.4, len(model.coordinate_names))
    return time_s, middle + 0.4 * np.sin(2.0 * time_s[:, None] + np.arange(len(middle)))


def rowed(model: oarlock.Model) -> tuple[Floats, Floats]:
    motion = rowing.sculling(model, duration_s=3.0)
    time_s = np.arange(motion.start_s, motion.end_s, 1.0 / RATE_HZ)
    order = [motion.coordinate_names.index(name) for name in model.coordinate_names]
    return time_s, motion.at(time_s)[:, order]


def seen_by_units(model: oarlock.Model, q: Floats) -> Measured:
    """Orientations of the frames that carry inertial units, and what encoders would read."""
    poses = model.forward_kinematics(q)
    sensors = model.describe().sensors
    frames = {s.frame for s in sensors if s.kind == "imu"}
    joints = {s.joint for s in sensors if s.kind == "encoder"}
    return Measured(
        {f: quat_from_matrix(poses[:, model.frame_names.index(f), :3, :3]) for f in sorted(frames)},
        {j: q[:, model.coordinate_names.index(j)] for j in sorted(joints)},
    )


def furthest(model: oarlock.Model, found: Floats, q: Floats, seen: Bools) -> float:
    """Largest error of what is seen; rotation vectors are compared as turns."""
    error = np.where(seen, found - q, 0.0)
    for joint in model.describe().joints:
        columns = [model.coordinate_names.index(c) for c in joint.coordinates if c.rpartition(".r")[1]]
        if len(columns) == 3 and seen[:, columns].all():
            quats = (quat_from_rotvec(a[:, columns]) for a in (found, q))
            error[:, columns] = rotvec_between(*quats)
    return float(np.abs(error).max())


@pytest.mark.parametrize("name", ["sculler", "sculler_ball", "arm7", "pendulum3", "qmt_full_body"])
def test_orientations_of_a_posture_give_it_back(name: str) -> None:
    model = oarlock.load_model(name)
    time_s, q = rowed(model) if name == "sculler" else swinging(model)
    found, seen = solve(model, seen_by_units(model, q), time_s)
    assert seen.any()
    assert furthest(model, found, q, seen) < EXACT
    assert np.isnan(found[~seen]).all()


def test_what_no_unit_feels_is_not_made_up() -> None:
    model = oarlock.load_model("sculler")
    time_s, q = rowed(model)
    _, seen = solve(model, seen_by_units(model, q), time_s)
    hidden = {n for n, s in zip(model.coordinate_names, seen.any(axis=0), strict=True) if not s}
    hands = {f"{side}_hand_{turn}" for side in "rl" for turn in ("abduction", "flexion")}
    assert hidden == hands | {"r_oar_theta", "l_oar_theta"}


def test_a_gap_hides_what_only_that_unit_tells() -> None:
    model = oarlock.load_model("sculler")
    time_s, q = rowed(model)
    measured = seen_by_units(model, q)
    gap = (time_s > 1.0) & (time_s < 1.6)
    measured.orientations["r_wrist"][gap] = np.nan
    found, seen = solve(model, measured, time_s)
    lost = [model.coordinate_names.index(n) for n in ("r_elbow_flexion", "r_elbow_rotation")]
    assert not seen[gap][:, lost].any()
    kept = [model.coordinate_names.index(n) for n in ("trunk", "r_shoulder_flexion", "l_elbow_rotation")]
    assert seen[gap][:, kept].all()
    assert seen[~gap][:, lost].all()
    assert furthest(model, found, q, seen) < EXACT


def test_contradictions_are_shared_out_by_weight() -> None:
    """A link whose orientation says +0.1 rad and whose encoder says -0.1, with half the standard deviation."""
    model = oarlock.load_model("pendulum3")
    time_s, q = swinging(model)
    name = model.coordinate_names[0]
    frame = next(f.name for f in model.describe().frames if f.joint == name)
    rotations = model.forward_kinematics(q)[..., :3, :3]
    axis = model.frame_jacobian(q, [frame]).by_coordinate[:, 0, 3:, 0]
    true = quat_from_matrix(rotations[:, model.frame_names.index(frame)])
    off = quat_product(quat_from_rotvec(0.1 * axis), true)
    found, seen = solve(
        model, Measured({frame: off}, {name: q[:, 0] - 0.1}, {frame: 0.02}, {name: 0.01}), time_s
    )
    # weights 1 to 4
    assert np.abs(found[:, 0] - q[:, 0] + 0.06).max() < EXACT
    assert seen.tolist() == [[True, False, False]] * len(q)


@pytest.mark.parametrize("name", ["sculler", "qmt_full_body"])
def test_axes_are_those_of_differences(name: str) -> None:
    model = oarlock.load_model(name)
    _, q = swinging(model, 0.2)
    frames = list(seen_by_units(model, q).orientations)
    jacobian = model.frame_jacobian(q, frames).by_coordinate[..., 3:, :]
    step = 1e-6
    hinges = [k for k, n in enumerate(model.coordinate_names) if ".r" not in n]
    rows = [model.frame_names.index(f) for f in frames]
    for k in hinges:
        moved = (q + sign * step * np.eye(q.shape[1])[k] for sign in (1.0, -1.0))
        ahead, behind = (model.forward_kinematics(x)[:, rows, :3, :3] for x in moved)
        turn = np.einsum("tsij,tskj->tsik", ahead, behind) / (2 * step)
        vector = 0.5 * np.stack(
            [
                turn[..., 2, 1] - turn[..., 1, 2],
                turn[..., 0, 2] - turn[..., 2, 0],
                turn[..., 1, 0] - turn[..., 0, 1],
            ],
            axis=-1,
        )
        # central differences: rounding 1e-16 over 1e-6
        assert np.abs(vector - jacobian[..., k]).max() < 1e-8
