"""The closed form of an arm agrees with forward kinematics and with least squares, and says what it cannot do."""

import numpy as np
import pytest

import oarlock
from marker_bodies import clusters, markers_on
from oarlock import DataError
from oarlock.markers import Arm, Attachment, inverse_kinematics

EXACT_RAD = 1e-9
ARMS = [
    ("arm7", "shoulder", "hand"),
    ("sculler", "r_shoulder", "r_hand"),
    ("sculler", "l_shoulder", "l_hand"),
]


def random_postures(model, joints, count, seed):
    random = np.random.default_rng(seed)
    limits = {j.name: np.array(j.limits) for j in model.describe().joints}
    q = np.zeros((count, len(model.coordinate_names)))
    for name in model.coordinate_names:
        middle, half = limits[name].mean(), 0.3 * np.ptp(limits[name])
        if name in joints or name in ("trunk", "seat"):
            q[:, model.coordinate_names.index(name)] = random.uniform(middle - half, middle + half, count)
    # bent by 10 to 140 deg: straight arms are another test
    bend = next(
        k for k, name in enumerate(model.coordinate_names) if name in joints and "elbow_flexion" in name
    )
    q[:, bend] = np.radians(random.uniform(10.0, 140.0, count))
    return q


def targets(model, q, base, tip):
    poses, index = model.forward_kinematics(q), model.frame_names.index
    side = base.removesuffix("shoulder")
    return (
        poses[:, index(f"{side}wrist"), :3, 3],
        poses[:, index(f"{side}elbow"), :3, 3],
        poses[:, index(tip), :3, :3],
        poses[:, index(base)],
    )


@pytest.mark.parametrize(("name", "base", "tip"), ARMS)
def test_closed_form_gives_back_the_postures(name, base, tip):
    model = oarlock.load_model(name)
    arm = Arm(model, base, tip)
    q = random_postures(model, arm.joint_names, 200, 0)
    wrist, elbow, hand, base_pose = targets(model, q, base, tip)
    own = q[:, [model.coordinate_names.index(joint) for joint in arm.joint_names]]
    found = arm.solve(wrist, elbow, tip_rotation=hand, root_from_base=base_pose)
    assert found.reachable.all()
    assert not (found.stretched | found.pole).any()
    np.testing.assert_allclose(found.q, own, atol=EXACT_RAD)
    again = arm.solve(wrist, swivel_rad=found.swivel_rad, tip_rotation=hand, root_from_base=base_pose)
    np.testing.assert_allclose(again.q, own, atol=EXACT_RAD)


def test_closed_form_agrees_with_least_squares_on_exact_markers():
    model = oarlock.load_model("arm7")
    arm = Arm(model)
    q = random_postures(model, arm.joint_names, 40, 1)
    attachments = (
        Attachment("elbow", "elbow", np.zeros(3)),
        Attachment("wrist", "wrist", np.zeros(3)),
        *clusters(["hand"], 3, 0.08, 0),
    )
    fits = [
        inverse_kinematics(
            model, markers_on(model, row[None], np.zeros(1), attachments), attachments, start_q=row + 0.1
        )
        for row in q
    ]
    wrist, elbow, hand, _ = targets(model, q, "shoulder", "hand")
    found = arm.solve(wrist, elbow, tip_rotation=hand)
    np.testing.assert_allclose(found.q, np.concatenate([fit.q for fit in fits]), atol=EXACT_RAD)


def test_targets_out_of_reach_and_stretched_arms_are_told():
    arm = Arm(oarlock.load_model("arm7"))
    nearest, furthest = arm.reach_m
    assert (nearest, furthest) == pytest.approx((0.045, 0.585))
    wrist = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.6], [0.0, 0.0, 0.02], [0.0, -0.585, 0.0]])
    found = arm.solve(wrist, swivel_rad=0.4)
    assert found.reachable.tolist() == [True, False, False, True]
    np.testing.assert_allclose(found.miss_m, [0.0, 0.015, 0.025, 0.0], atol=1e-12)
    assert found.stretched.tolist() == [False, True, True, True]
    assert np.isfinite(found.q).all()
    # out of reach the arm points at the target
    model = oarlock.load_model("arm7")
    q = np.zeros((4, 7))
    q[:, :4] = found.q
    reached = model.forward_kinematics(q)[:, model.frame_names.index("wrist"), :3, 3]
    np.testing.assert_allclose(
        reached[1], [0.0, 0.0, 0.585], atol=1e-7
    )  # acos loses half the digits at the end
    np.testing.assert_allclose(reached[0], wrist[0], atol=1e-12)


def test_poles_of_the_shoulder_are_told():
    model = oarlock.load_model("arm7")
    arm = Arm(model)
    q = random_postures(model, arm.joint_names, 2, 3)
    q[0, 1] = np.pi / 2
    wrist, elbow, hand, _ = targets(model, q, "shoulder", "hand")
    assert arm.solve(wrist, elbow, tip_rotation=hand).pole.tolist() == [True, False]


def test_swivel_turns_the_elbow_about_the_line_to_the_wrist():
    model = oarlock.load_model("arm7")
    wrist = np.tile([0.1, -0.2, 0.3], (5, 1))
    swivel = np.linspace(0.0, 1.0, 5)
    q = np.zeros((5, 7))
    q[:, :4] = Arm(model).solve(wrist, swivel_rad=swivel).q
    elbow = model.forward_kinematics(q)[:, model.frame_names.index("elbow"), :3, 3]
    line = wrist[0] / np.linalg.norm(wrist[0])
    along = elbow @ line
    np.testing.assert_allclose(along, along[0], atol=1e-12)
    assert elbow[0, 1] == elbow[:, 1].min(), "0 is the lowest point"
    out = elbow - np.outer(along, line)
    turned = np.arctan2(np.cross(out[0], out[1:]) @ line, out[1:] @ out[0])
    np.testing.assert_allclose(turned, swivel[1:], atol=1e-12)


@pytest.mark.parametrize(
    ("base", "tip", "said"),
    [
        ("shoulder", "elbow", "expected hinges"),
        ("elbow", "shoulder", "does not hang"),
        ("sholder", "hand", "no frame"),
    ],
)
def test_what_is_no_arm_is_refused(base, tip, said):
    with pytest.raises(DataError, match=said):
        Arm(oarlock.load_model("arm7"), base, tip)


def test_elbow_or_swivel_but_not_both():
    with pytest.raises(DataError, match="either elbow_m or swivel_rad"):
        Arm(oarlock.load_model("arm7")).solve([0.1, 0.1, 0.1])
