"""Random kinematic trees as plain numbers, and as model files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import oarlock
from oarlock.storage.arrays import Floats
from oarlock.storage.toml import toml_text

GRAVITY_M_S2 = 9.80665
FIELD_UT, DIP_RAD, AZIMUTH_RAD = 47.0, 1.05, 0.4


@dataclass(frozen=True)
class Link:
    """A frame: `before` its joint, the joint's motion about or along `axis`, then `after`; (4, 4) each."""

    name: str
    parent: int
    before: Floats
    axis: Floats
    after: Floats
    kind: str
    joint: int | None
    sign: float
    table: dict[str, Any]


@dataclass(frozen=True)
class Spot:
    """Where a sensor sits: link from sensor (4, 4), and the index of its link; 0 is the root."""

    name: str
    link: int
    mount: Floats


@dataclass(frozen=True)
class Tree:
    """Links in the order of the file (root left out), kinds of the joints, sensors and the world's up."""

    links: tuple[Link, ...]
    kinds: tuple[str, ...]
    spots: tuple[Spot, ...]
    up: Floats
    forward: Floats
    joint_names: tuple[str, ...] = field(default=())

    @property
    def field_ut(self) -> Floats:
        """Magnetic field in root axes at rest, (3,) uT, as CONVENTIONS.md writes it."""
        level = np.cos(AZIMUTH_RAD) * self.forward + np.sin(AZIMUTH_RAD) * np.cross(self.up, self.forward)
        return FIELD_UT * (np.cos(DIP_RAD) * level - np.sin(DIP_RAD) * self.up)

    def coordinates(self, values: Floats) -> Floats:
        """Values of the joints as the moving links feel them, in their order: shared joints repeat, signs apply."""
        moving = [link for link in self.links if link.joint is not None]
        return np.array([link.sign * values[link.joint] for link in moving])


def pose(rotation: Floats, translation: Any) -> Floats:
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = rotation, translation
    return whole


def random_tree(seed: int) -> Tree:
    """6 to 12 joints, hinges and slides mixed; some move two links, some act negated, some links are fixed."""
    random = np.random.default_rng(seed)
    kinds = tuple(random.choice(["hinge", "slide"], random.integers(6, 13), p=[0.65, 0.35]))
    users = [*range(len(kinds)), *random.choice(len(kinds), 2), None, None]
    links: list[Link] = []
    for i, joint in enumerate(random.permutation(np.array(users, dtype=object))):
        parent = int(random.integers(max(0, i - 3), i + 1))
        links.append(_link(random, i, parent, joint, kinds))
    spots = tuple(
        Spot(f"unit_{k}", int(link), _random_pose(random, 0.2))
        for k, link in enumerate([*random.choice(len(links) + 1, 4, replace=False), len(links)])
    )
    up, forward = Rotation.random(rng=random).as_matrix()[:, :2].T
    return Tree(tuple(links), kinds, spots, up, forward, tuple(f"j{k}" for k in range(len(kinds))))


def _random_pose(random: np.random.Generator, reach_m: float) -> Floats:
    return pose(Rotation.random(rng=random).as_matrix(), random.uniform(-reach_m, reach_m, 3))


def _link(
    random: np.random.Generator, i: int, parent: int, joint: int | None, kinds: tuple[str, ...]
) -> Link:
    parent_name = "root" if parent == 0 else f"f{parent - 1}"
    table: dict[str, Any] = {"name": f"f{i}", "parent": parent_name}
    kind = "fixed" if joint is None else kinds[joint]
    sign = float(random.choice([-1.0, 1.0]))
    if joint is not None:
        table |= {"joint": f"j{joint}", "sign": int(sign)}
    if joint is not None and random.random() < 0.4:
        a, alpha, d, theta = random.uniform(-1.0, 1.0, 4)
        table["dh"] = {"a": a, "alpha": alpha, "d": d, "theta": theta}
        about_z = pose(Rotation.from_rotvec([0, 0, theta]).as_matrix(), [0, 0, d])
        along_x = pose(Rotation.from_rotvec([alpha, 0, 0]).as_matrix(), [a, 0, 0])
        return Link(
            f"f{i}", parent, np.eye(4), np.array([0.0, 0, 1]), about_z @ along_x, kind, joint, sign, table
        )
    before = _random_pose(random, 0.5)
    axis = random.standard_normal(3)
    axis /= np.linalg.norm(axis)
    table["transform"] = {"rotation": before[:3, :3].tolist(), "translation": before[:3, 3].tolist()}
    if joint is not None:
        table["axis"] = axis.tolist()
    return Link(f"f{i}", parent, before, axis, np.eye(4), kind, joint, sign, table)


def load_tree(tree: Tree, folder: Path) -> oarlock.Model:
    """The tree written as a model file, and read from it."""
    file = folder / "random_tree.toml"
    file.write_text(toml_text(_document(tree)), encoding="utf-8")
    return oarlock.load_model(file)


def waves(model: oarlock.Model, seed: int = 0, seconds: float = 3.0) -> oarlock.simulation.Motion:
    """Slow sines on every coordinate and on the root's acceleration."""
    random, time_s = np.random.default_rng(seed), np.linspace(0.0, seconds, round(200 * seconds) + 1)
    n = len(model.coordinate_names)
    speed, phase = random.uniform(1.0, 6.0, n + 3), random.uniform(0.0, 6.0, n + 3)
    wave = np.sin(time_s[:, None] * speed + phase) * random.uniform(0.1, 0.6, n + 3)
    return oarlock.simulation.Motion(tuple(model.coordinate_names), time_s, wave[:, :n], 5 * wave[:, n:])


def _document(tree: Tree) -> dict[str, Any]:
    process = {"kind": "jerk", "density": 11.2, "start_std": [0.2, 0.5, 5.0]}
    return {
        "format": 1,
        "name": "random_tree",
        "world": {
            "up": tree.up.tolist(),
            "forward": tree.forward.tolist(),
            "gravity_m_s2": GRAVITY_M_S2,
            "magnetic_norm_ut": FIELD_UT,
            "magnetic_dip_rad": DIP_RAD,
            "magnetic_azimuth_rad": AZIMUTH_RAD,
        },
        "process": {"hinge": process, "slide": process},
        "joint": [{"name": n, "kind": str(k)} for n, k in zip(tree.joint_names, tree.kinds, strict=True)],
        "frame": [link.table for link in tree.links],
        "sensor": [
            {
                "name": spot.name,
                "kind": "imu",
                "frame": "root" if spot.link == 0 else tree.links[spot.link - 1].name,
                "mount": {"rotation": spot.mount[:3, :3].tolist(), "offset": spot.mount[:3, 3].tolist()},
                "gyro_std_rad_s": 0.01,
                "accel_std_m_s2": 0.01,
                "mag_std_ut": 1.0,
            }
            for spot in tree.spots
        ],
    }


@dataclass(frozen=True)
class RootMotion:
    """Pose and twist of the root: position and rotation in the world; the rest in root axes, of its origin."""

    position: Floats
    rotation: Floats
    velocity: Floats
    angular_velocity: Floats
    angular_acceleration: Floats
    acceleration: Floats

    @classmethod
    def at_rest(cls) -> RootMotion:
        zero = np.zeros(3)
        return cls(zero, np.eye(3), zero, zero, zero, zero)

    @classmethod
    def at_random(cls, random: np.random.Generator) -> RootMotion:
        rotation = Rotation.random(rng=random).as_matrix()
        return cls(random.uniform(-2, 2, 3), rotation, *random.uniform(-4, 4, (4, 3)))

    @property
    def base(self) -> oarlock.model.Base:
        return oarlock.model.Base(
            self.rotation, self.angular_velocity, self.angular_acceleration, self.acceleration
        )
