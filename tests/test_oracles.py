"""Random trees: poses and inertial signals agree with two independent rigid-body libraries."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from random_tree import GRAVITY_M_S2, Floats, RootMotion, Tree, load_tree, random_tree

SEEDS = range(12)
POSTURES = 5
AGREES = 1e-9  # readings up to about 1e3 and a dozen links: rounding stays near 1e-12


def absent(package: str) -> str:
    return f"the oracle {package} is not installed: pip install -r requirements/dev.txt. Trees are NOT compared with it"


def state(tree: Tree, random: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Random q, qd, qdd, (n_joints,): hinges over the full circle, slides within half a metre."""
    wide = np.where(np.array(tree.kinds) == "hinge", np.pi, 0.5)
    n = len(tree.kinds)
    return wide * random.uniform(-1, 1, n), random.uniform(-4, 4, n), random.uniform(-30, 30, n)


class Pinocchio:
    """A tree in pinocchio, on a free root: each moving link has its own joint."""

    def __init__(self, tree: Tree) -> None:
        self.pin: Any = pytest.importorskip("pinocchio", reason=absent("pinocchio (package pin)"))
        pin = self.pin
        self.tree, self.model = tree, pin.Model()
        self.model.gravity.linear = -GRAVITY_M_S2 * tree.up
        root = self.model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
        places = [(root, np.eye(4))]
        for link in tree.links:
            joint, there = places[link.parent]
            if link.kind == "fixed":
                places.append((joint, there @ link.before @ link.after))
                continue
            kind = (
                pin.JointModelRevoluteUnaligned if link.kind == "hinge" else pin.JointModelPrismaticUnaligned
            )
            moved = self.model.addJoint(joint, kind(link.axis), pin.SE3(there @ link.before), link.name)
            places.append((moved, link.after))
        self.frames = [self._frame(f"link_{i}", *place) for i, place in enumerate(places)]
        self.sensors = [
            self._frame(s.name, places[s.link][0], places[s.link][1] @ s.mount) for s in tree.spots
        ]
        self.data = self.model.createData()

    def _frame(self, name: str, joint: int, placement: Floats) -> int:
        pin = self.pin
        return self.model.addFrame(pin.Frame(name, joint, 0, pin.SE3(placement), pin.FrameType.OP_FRAME))

    def readings(self, root: RootMotion, q: Floats, qd: Floats, qdd: Floats) -> tuple[Floats, Floats]:
        """Poses (n_frames, 4, 4) and gyro, accel, mag of each sensor, end to end."""
        pin, tree = self.pin, self.tree
        quaternion = Rotation.from_matrix(root.rotation).as_quat()
        # The library's joint acceleration is spatial: the classical one without w x v.
        linear = root.acceleration - np.cross(root.angular_velocity, root.velocity)
        x = np.concatenate([root.position, quaternion, tree.coordinates(q)])
        v = np.concatenate([root.velocity, root.angular_velocity, tree.coordinates(qd)])
        a = np.concatenate([linear, root.angular_acceleration, tree.coordinates(qdd)])
        pin.forwardKinematics(self.model, self.data, x, v, a)
        pin.updateFramePlacements(self.model, self.data)
        poses = np.array([self.data.oMf[f].homogeneous for f in self.frames])
        return poses, np.concatenate([self._unit(f) for f in self.sensors])

    def _unit(self, frame: int) -> Floats:
        pin, local = self.pin, self.pin.ReferenceFrame.LOCAL
        sensor_from_world = self.data.oMf[frame].rotation.T
        gyro = pin.getFrameVelocity(self.model, self.data, frame, local).angular
        accel = pin.getFrameClassicalAcceleration(self.model, self.data, frame, local).linear
        lift = sensor_from_world @ self.model.gravity.linear
        return np.concatenate([gyro, accel - lift, sensor_from_world @ self.tree.field_ut])


class Mujoco:
    """A tree in MuJoCo, on a free root: a body before and one behind each joint, a site for each sensor."""

    def __init__(self, tree: Tree) -> None:
        self.mujoco: Any = pytest.importorskip("mujoco", reason=absent("mujoco"))
        self.tree = tree
        spec = self.mujoco.MjSpec()
        spec.option.gravity = -GRAVITY_M_S2 * tree.up
        spec.option.magnetic = tree.field_ut
        root = self._body(spec.worldbody, "root", np.eye(4))
        root.add_freejoint()
        ends = [root]
        for link in tree.links:
            moved = self._body(ends[link.parent], f"{link.name}_moved", link.before)
            if link.kind != "fixed":
                kinds = self.mujoco.mjtJoint
                kind = kinds.mjJNT_HINGE if link.kind == "hinge" else kinds.mjJNT_SLIDE
                moved.add_joint(name=link.name, type=kind, axis=link.axis)
            ends.append(self._body(moved, link.name, link.after))
        for spot in tree.spots:
            self._site(spec, ends[spot.link], spot.name, spot.mount)
        self.model = spec.compile()
        self.data = self.mujoco.MjData(self.model)
        self.bodies = [self.model.body(n).id for n in ("root", *(link.name for link in tree.links))]

    def _body(self, parent: Any, name: str, placement: Floats) -> Any:
        # Accelerations are imposed, so the masses only have to be there.
        body = parent.add_body(name=name, pos=placement[:3, 3], quat=wxyz(placement))
        body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
        return body

    def _site(self, spec: Any, body: Any, name: str, placement: Floats) -> None:
        body.add_site(name=name, pos=placement[:3, 3], quat=wxyz(placement))
        sensors = self.mujoco.mjtSensor
        for kind in (sensors.mjSENS_GYRO, sensors.mjSENS_ACCELEROMETER, sensors.mjSENS_MAGNETOMETER):
            spec.add_sensor(
                name=f"{name}_{kind.name}", type=kind, objtype=self.mujoco.mjtObj.mjOBJ_SITE, objname=name
            )

    def readings(self, root: RootMotion, q: Floats, qd: Floats, qdd: Floats) -> tuple[Floats, Floats]:
        """Poses (n_frames, 4, 4) and gyro, accel, mag of each sensor, end to end."""
        mujoco, model, data = self.mujoco, self.model, self.data
        # A free joint's linear part is in world axes, its angular part in the body's.
        data.qpos[:7] = np.concatenate([root.position, wxyz(root.rotation)])
        data.qvel[:6] = np.concatenate([root.rotation @ root.velocity, root.angular_velocity])
        acceleration = np.concatenate([root.rotation @ root.acceleration, root.angular_acceleration])
        moving = [link for link in self.tree.links if link.joint is not None]
        for link, x, v in zip(moving, self.tree.coordinates(q), self.tree.coordinates(qd), strict=True):
            data.joint(link.name).qpos, data.joint(link.name).qvel = x, v
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        data.qacc[:6] = acceleration
        for link, a in zip(moving, self.tree.coordinates(qdd), strict=True):
            data.joint(link.name).qacc = a
        mujoco.mj_sensorPos(model, data)
        mujoco.mj_sensorVel(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        mujoco.mj_sensorAcc(model, data)
        poses = np.tile(np.eye(4), (len(self.bodies), 1, 1))
        poses[:, :3, :3] = data.xmat[self.bodies].reshape(-1, 3, 3)
        poses[:, :3, 3] = data.xpos[self.bodies]
        return poses, data.sensordata.copy()


def wxyz(rotation: Floats) -> Floats:
    return Rotation.from_matrix(rotation[:3, :3]).as_quat(scalar_first=True)


def world_from_root(root: RootMotion) -> Floats:
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = root.rotation, root.position
    return whole


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("oracle", [Pinocchio, Mujoco])
def test_tree_agrees(oracle, seed, tmp_path):
    tree = random_tree(seed)
    model, other = load_tree(tree, tmp_path), oracle(tree)
    random = np.random.default_rng([seed, 1])
    for posture in range(POSTURES):
        root = RootMotion.at_rest() if posture == 0 else RootMotion.at_random(random)
        q, qd, qdd = state(tree, random)
        poses, readings = other.readings(root, q, qd, qdd)
        ours = world_from_root(root) @ model.forward_kinematics(q)
        np.testing.assert_allclose(ours, poses, rtol=0, atol=AGREES, err_msg=f"poses, posture {posture}")
        base = None if posture == 0 else root.base
        z = model.predict_measurements(q, qd, qdd, base)
        np.testing.assert_allclose(z, readings, rtol=0, atol=AGREES, err_msg=f"signals, posture {posture}")


def test_trees_hold_what_they_should():
    """Hinges and slides, shared and negated joints, fixed links, rows and transforms all occur."""
    trees = [random_tree(seed) for seed in SEEDS]
    links = [link for tree in trees for link in tree.links]
    assert {"hinge", "slide", "fixed"} == {link.kind for link in links}
    assert {1.0, -1.0} == {link.sign for link in links}
    assert any("dh" in link.table for link in links)
    assert any("transform" in link.table for link in links)
    assert {len(tree.kinds) for tree in trees} <= set(range(6, 13))
    assert all(len(tree.links) == len(tree.kinds) + 4 for tree in trees)


def test_predictions_in_one_call_equal_those_one_by_one(tmp_path):
    """Bases of many rows too."""
    tree = random_tree(3)
    model, random = load_tree(tree, tmp_path), np.random.default_rng(9)
    states = np.array([state(tree, random) for _ in range(4)])
    roots = [RootMotion.at_random(random) for _ in range(4)]
    alone = [model.predict_measurements(*s, r.base) for s, r in zip(states, roots, strict=True)]
    stacked = type(roots[0].base)(
        *(
            np.stack(x)
            for x in zip(
                *((r.rotation, r.angular_velocity, r.angular_acceleration, r.acceleration) for r in roots),
                strict=True,
            )
        )
    )
    together = model.predict_measurements(*states.transpose(1, 0, 2), stacked)
    assert np.array_equal(together, np.stack(alone))
