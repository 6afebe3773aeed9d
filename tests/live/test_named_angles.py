"""Angles of ball joints, estimate by estimate, are those of the whole track."""

import numpy as np
import pytest

import oarlock
from oarlock.live.named_angles import LiveAngles, joints_with_names
from oarlock.model.angle_sequence import angle_stds, angles_from_quat
from oarlock.model.coordinates import joint_columns
from oarlock.model.rotation import quat_from_rotvec

STEP = 1e-3
"""Of differences in place of derivatives, as a share."""


def waved(model, rows=400):
    """A posture that swings, away from the poles of the shoulders' angles."""
    rng = np.random.default_rng(4)
    phase = rng.uniform(0, 2 * np.pi, len(model.coordinate_names))
    q = 0.3 * np.sin(np.linspace(0, 9, rows)[:, None] + phase)
    for joint, sign in (("shoulder_r", -1.0), ("shoulder_l", 1.0)):
        if f"{joint}.rx" in model.coordinate_names:
            q[:, list(model.coordinate_names).index(f"{joint}.rx")] += -1.2
            q[:, list(model.coordinate_names).index(f"{joint}.rz")] += 0.2 * sign
    return q


@pytest.mark.parametrize("name", ["full_body", "upper_body", "arm"])
def test_they_are_those_of_the_whole_track_but_for_full_turns(name):
    model = oarlock.load_model(name)
    q = waved(model)
    std = np.full_like(q, 0.02)
    angles = LiveAngles(model)
    rows = np.array([angles.of(*pair) for pair in zip(q, std, strict=True)])
    columns = joint_columns(model.coordinate_names)
    found = 0
    for joint, named in joints_with_names(model).items():
        quat = named.rotation(quat_from_rotvec(q[:, list(columns[joint][-3:])]))
        whole = angles_from_quat(quat, named.sequence)
        expected = np.multiply(named.signs, whole) + named.offsets_rad
        turns = (rows[:, 0, found : found + 3] - expected) / (2 * np.pi)
        np.testing.assert_allclose(turns, np.broadcast_to(np.round(turns[0]), turns.shape), atol=1e-9)
        stds = angle_stds(whole, named.sequence, np.full((len(q), 3), 0.02))
        np.testing.assert_allclose(rows[:, 1, found : found + 3], stds, rtol=STEP)
        found += len(named.names)
    assert found == len(angles.names) >= 3
    assert np.abs(rows[0, 0]).max() <= np.pi, "the first is within half a turn of 0"
    assert np.abs(np.diff(rows[:, 0], axis=0)).max() < 0.5, "without jumps"


def test_a_joint_that_nothing_measures_has_no_angles():
    model = oarlock.load_model("full_body")
    q = waved(model, 2)
    q[1, [list(model.coordinate_names).index("shoulder_l.ry")]] = np.nan
    angles = LiveAngles(model)
    assert np.isfinite(angles.of(q[0], q[0] * 0 + 0.1)).all()
    unknown = [
        name for name, value in zip(angles.names, angles.of(q[1], q[1])[0], strict=True) if np.isnan(value)
    ]
    assert unknown == ["shoulder_plane_l", "shoulder_elevation_l", "shoulder_rotation_l"]


def test_a_body_without_ball_joints_has_none(sculler):
    angles = LiveAngles(sculler)
    q = np.zeros(len(sculler.coordinate_names))
    assert angles.names == () and angles.of(q, q)[0].shape == (0,)
