"""A body with hinge, slide, ball and free joints whose kinematics are a few lines of scipy, and tracks of it."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fake_track import frame
from oarlock import load_model
from oarlock.model import JointDescription, ModelDescription, ProcessDescription
from oarlock.model.coordinates import angle_sequences, coordinate_units, joint_columns, joint_units
from oarlock.model.rotation import quat_from_rotvec, quat_product, rotvec_from_quat
from oarlock.simulation.motion import Motion
from oarlock.storage.arrays import Floats
from oarlock.tracking.records import Beliefs
from oarlock.tracking.track import Track

STEP = 1e-5
"""Of central differences, rad or m: errors of 1e-10."""

COORDINATES = {
    "hinge": ("",),
    "slide": ("",),
    "ball": (".rx", ".ry", ".rz"),
    "free": (".x", ".y", ".z", ".rx", ".ry", ".rz"),
}
SEQUENCES = {"pelvis": "ZXY", "shoulder": "YXY"}
ARM = {"pelvis": "free", "trunk": "hinge", "rail": "slide", "shoulder": "ball", "elbow": "hinge"}


class BallBody:
    """root - pelvis (free) - thorax (trunk about z) - collar (rail along x) - upperarm (shoulder) - forearm - hand.

    Y is up, and every link but the pelvis starts 0.3 m above the one before.
    """

    name, text, path, description, structure = "ball_body", "", "", "", "tree"
    parameters: dict[str, float] = {}  # noqa: RUF012
    sensor_names: tuple[str, ...] = ()
    length_names: tuple[str, ...] = ()

    def __init__(self, kinds: dict[str, str] = ARM) -> None:
        self.kinds = kinds
        self.joint_names = list(kinds)
        self.coordinate_names = [name + end for name, kind in kinds.items() for end in COORDINATES[kind]]
        links = {
            "pelvis": "pelvis",
            "trunk": "thorax",
            "rail": "collar",
            "shoulder": "upperarm",
            "elbow": "forearm",
        }
        self.links = [(links[name], name) for name in kinds]
        self.frame_names = ["root", *(link for link, _ in self.links), "hand"]

    def describe(self) -> ModelDescription:
        joints = tuple(
            JointDescription(
                name=name,
                kind=kind,
                coordinates=tuple(name + end for end in COORDINATES[kind]),
                angles=SEQUENCES.get(name),
                input=False,
                std=None,
                label="",
                limits=(-1.0, 1.0),
                rest=0.0 if len(COORDINATES[kind]) == 1 else (0.0,) * len(COORDINATES[kind]),
                process=ProcessDescription(kind="jerk", density=11.2, start_std=(0.2, 0.5, 5.0)),
            )
            for name, kind in self.kinds.items()
        )
        chain = [*self.links, ("hand", None)]
        frames = [frame("root", None)]
        for parent, (link, joint) in zip(self.frame_names, chain, strict=False):
            frames.append(frame(link, parent, joint))
        world = load_model("sculler").describe().world
        none = dict.fromkeys(
            ("parameters", "sensors", "closures", "base_acceleration", "measurement_names"), ()
        )
        rates = ("", ".velocity", ".acceleration")
        return ModelDescription(
            name=self.name,
            description="",
            path="",
            world=world,
            joints=joints,
            frames=tuple(frames),
            state_names=tuple(c + rate for rate in rates for c in self.coordinate_names),
            **none,
        )

    def forward_kinematics(self, q: Floats, lengths: Floats | None = None) -> Floats:
        q = np.asarray(q, dtype=float)
        poses = np.tile(np.eye(4), (*q.shape[:-1], len(self.frame_names), 1, 1))
        columns = joint_columns(self.coordinate_names)
        for k, (link, joint) in enumerate([*self.links, ("hand", "")], 1):
            values = q[..., list(columns.get(joint, ()))]
            turned = poses[..., k - 1, :, :] @ _move(self.kinds.get(joint, ""), values, link)
            poses[..., k, :, :] = turned
        return poses

    def frame_jacobian(
        self, q: Floats, frames: list[str], lengths: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Central differences (T, K, 6, n): moves and turns in root axes; of balls about the child's axes."""
        chosen = [self.frame_names.index(name) for name in frames]
        columns = [self._moved(q, k, STEP) for k in range(len(self.coordinate_names))]
        found = np.stack([a[:, chosen] - b[:, chosen] for a, b in columns], axis=-1) / (2.0 * STEP)
        here = self.forward_kinematics(q)[:, chosen, :3, :3]
        spins = np.einsum("tkijn,tklj->tkiln", found[..., :3, :3, :], here)
        turns = np.stack([spins[:, :, 2, 1], spins[:, :, 0, 2], spins[:, :, 1, 0]], axis=2)
        whole = np.concatenate([found[..., :3, 3, :], turns], axis=2)
        return whole, np.zeros((*whole.shape[:2], 3, 0))

    def _moved(self, q: Floats, k: int, step: float) -> tuple[Floats, Floats]:
        """Poses with one coordinate, or one axis of a ball, moved forward and back."""
        name, found = self.coordinate_names[k], []
        for sign in (1.0, -1.0):
            moved = np.array(q, dtype=float)
            if name.endswith((".rx", ".ry", ".rz")):
                ball = slice(k - "xyz".index(name[-1]), k - "xyz".index(name[-1]) + 3)
                turn = Rotation.from_rotvec(sign * step * np.eye(3)["xyz".index(name[-1])])
                moved[:, ball] = (Rotation.from_rotvec(moved[:, ball]) * turn).as_rotvec()
            else:
                moved[:, k] += sign * step
            found.append(self.forward_kinematics(moved))
        return found[0], found[1]


def _move(kind: str, values: Floats, link: str) -> Floats:
    pose = np.tile(np.eye(4), (*values.shape[:-1], 1, 1))
    pose[..., 1, 3] = 0.0 if link == "pelvis" else 0.3
    turn = np.zeros((*values.shape[:-1], 3))
    if kind == "hinge":
        turn[..., 2] = values[..., 0]
    elif kind == "slide":
        pose[..., 0, 3] += values[..., 0]
    elif kind in ("ball", "free"):
        turn = values[..., -3:]
        pose[..., :3, 3] += values[..., :3] if kind == "free" else 0.0
    flat = np.nan_to_num(turn.reshape(-1, 3))
    matrix = Rotation.from_rotvec(flat).as_matrix().reshape(*turn.shape[:-1], 3, 3)
    pose[..., :3, :3] = np.where(np.isnan(turn).any(axis=-1)[..., None, None], np.nan, matrix)
    return pose


def waving(body: BallBody, duration_s: float = 20.0, seed: int = 0) -> Motion:
    """Slow sines on every joint; balls go through half turns."""
    random, time_s = np.random.default_rng(seed), np.arange(0.0, duration_s + 0.5, 0.02)
    joints: dict[str, Floats] = {}
    for name, kind in body.kinds.items():
        n = len(COORDINATES[kind])
        wave = np.sin(np.outer(time_s, random.uniform(0.5, 2.0, n)) + random.uniform(0.0, 6.0, n))
        reach = np.full(n, 0.4) if kind in ("hinge", "slide") else np.full(n, 1.6)
        reach[: 3 * (kind == "free")] = 0.3
        joints[name] = wave[:, 0] * reach if n == 1 else wave * reach
    return Motion.from_joints(time_s, joints)


def true_track(body: BallBody, duration_s: float = 20.0, seed: int = 0, rate_hz: float = 50.0) -> Track:
    """The truth of `waving`."""
    motion = waving(body, duration_s, seed)
    time_s = np.arange(0.0, duration_s, 1.0 / rate_hz)
    q, qd, qdd = motion.derivatives(time_s)
    order = [motion.coordinate_names.index(name) for name in body.coordinate_names]
    unknown = np.full(q.shape, np.nan)
    return Track(
        model=body,  # type: ignore[arg-type]
        time_s=time_s,
        joint_names=tuple(body.joint_names),
        joint_units=joint_units(body),  # type: ignore[arg-type]
        coordinate_names=tuple(body.coordinate_names),
        coordinate_units=coordinate_units(body),  # type: ignore[arg-type]
        angle_sequences=angle_sequences(body),  # type: ignore[arg-type]
        q=q[:, order],
        qd=qd[:, order],
        qdd=qdd[:, order],
        q_std=unknown,
        qd_std=unknown.copy(),
        qdd_std=unknown.copy(),
        observed=np.ones(q.shape, dtype=bool),
        provenance={"model": body.name},
    )


def rotation_columns(track: Track) -> list[list[int]]:
    """Columns of each rotation vector."""
    groups = joint_columns(track.coordinate_names).values()
    return [list(columns[-3:]) for columns in groups if len(columns) > 1]


def plus(track: Track, q: Floats, error: Floats) -> Floats:
    """Values (T, n) moved by tangent errors (T, n): rotations by R Exp(e)."""
    moved = q + error
    for columns in rotation_columns(track):
        turned = quat_product(quat_from_rotvec(q[:, columns]), quat_from_rotvec(error[:, columns]))
        moved[:, columns] = rotvec_from_quat(turned)
    return moved


def noisy(truth: Track, std: Floats | float, seed: int = 0, claimed: float = 1.0) -> Track:
    """Estimates whose error, in the axes of the estimate's child, is Gaussian; the track claims `claimed` times it."""
    random = np.random.default_rng(seed)
    spread = np.broadcast_to(std, truth.q.shape)
    error = spread * random.standard_normal(truth.q.shape)
    return replace(truth, q=plus(truth, truth.q, error), q_std=claimed * spread, notes=("made by hand",))


def with_beliefs(track: Track, truth: Track, covariance: Floats, every: int, seed: int = 0) -> Track:
    """Beliefs over all coordinates and their rates drawn from N(truth, covariance) in the tangent."""
    random = np.random.default_rng(seed)
    n = len(track.coordinate_names)
    names = tuple(c + s for s in ("", ".velocity", ".acceleration") for c in track.coordinate_names)
    rows = slice(None, None, every)
    error = random.multivariate_normal(np.zeros(3 * n), covariance, size=len(truth.time_s[rows]))
    mean = np.hstack(
        [
            plus(truth, truth.q[rows], error[:, :n]),
            truth.qd[rows] + error[:, n : 2 * n],
            truth.qdd[rows] + error[:, 2 * n :],
        ]
    )
    stack = np.repeat(covariance[None], len(mean), axis=0)
    return replace(track, beliefs=Beliefs(truth.time_s[rows], mean, stack, names))
