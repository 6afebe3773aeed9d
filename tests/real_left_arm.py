"""Real trajectories of a left arm: rigid clusters seen by cameras, as an arm with joint centres of its own.

The arm is mirrored, so that the shipped right arm fits it: a mirrored movement is a movement too.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from local_data import local_folder
from oarlock import Model
from oarlock.markers import Attachment, Markers

RATE_HZ = 100.0
MIRROR = np.diag([1.0, -1.0, 1.0])
# laboratory: z up, the person looks along x; root of the model: X left, Y up, Z forward
ROOT_FROM_LAB = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
REACH_M = 0.05
SKIN_STD_M = 5e-3  # a cluster on the upper arm, against the bone


@dataclass(frozen=True)
class LeftArm:
    """Shoulder at the origin; positions (T, 3) in root axes, m; the forearm's cluster as rotations (T, 3, 3)."""

    time_s: np.ndarray
    elbow_m: np.ndarray
    wrist_m: np.ndarray
    forearm: np.ndarray
    upper_m: np.ndarray
    upper: np.ndarray
    elbow_miss_m: float
    elbow_deg: np.ndarray
    own_positions_m: tuple[np.ndarray, np.ndarray]

    @property
    def lengths(self) -> dict[str, float]:
        """Mean lengths of upper arm and forearm, m."""
        upper = np.linalg.norm(self.elbow_m, axis=1).mean()
        return {
            "l_ua": float(upper),
            "l_fa": float(np.linalg.norm(self.wrist_m - self.elbow_m, axis=1).mean()),
        }

    @property
    def markers(self) -> Markers:
        """Elbow and wrist, and three points of each cluster 5 cm from its origin."""
        corners = REACH_M * np.eye(3)
        places = [self.elbow_m, self.wrist_m]
        places += [self.wrist_m + self.forearm @ corner for corner in corners]
        places += [self.upper_m + self.upper @ corner for corner in corners]
        return Markers(
            ("elbow", "wrist", "fa", "fb", "fc", "ua", "ub", "uc"), self.time_s, np.stack(places, axis=1)
        )

    def attachments(self, model: Model, q: np.ndarray, frames: np.ndarray) -> tuple[Attachment, ...]:
        """Where these sit on the model, on average over some frames with known postures (T, 7)."""
        poses, markers = model.forward_kinematics(q[frames]), self.markers
        found = [Attachment("elbow", "elbow", np.zeros(3)), Attachment("wrist", "wrist", np.zeros(3))]
        for name in markers.names[2:]:
            frame = "wrist" if name[0] == "f" else "elbow"
            pose = poses[:, model.frame_names.index(frame)]
            away = markers[name][frames] - pose[:, :3, 3]
            point = np.einsum("tji,tj->ti", pose[:, :3, :3], away).mean(axis=0)
            found.append(Attachment(name, frame, point, 1e-3 if frame == "wrist" else SKIN_STD_M))
        return tuple(found)


def real_left_arm() -> LeftArm:
    """Reads the file; skips the test where the data or h5py are absent."""
    folder = local_folder("data/ruffaldi_upper_limb")
    h5py = pytest.importorskip("h5py", reason="NOT RUN: h5py reads these files and is not installed")
    with h5py.File(folder / "model_res_290715_1314.mat") as file:
        clusters = {name: rows[()] for name, rows in file["resdata2/ref/vic"].items()}
        own = file["resdata2/pep/Pep_or"]
        elbow_deg = np.degrees(own["ang/all"][:, 3])
        positions = tuple(own[f"pos/{name}"][()] / 1e3 for name in ("Lelbow", "Lwrist"))
    (shoulder, _), (upper, upper_turn) = _pose(clusters["L_Shoulder"]), _pose(clusters["L_upper_arm"])
    lower, lower_turn = _pose(clusters["L_lower_arm"])
    centre, miss = _common_point(upper, upper_turn, lower, lower_turn)
    return LeftArm(
        time_s=np.arange(len(lower)) / RATE_HZ,
        elbow_m=(lower + lower_turn @ centre - shoulder) @ ROOT_FROM_LAB.T,
        wrist_m=(lower - shoulder) @ ROOT_FROM_LAB.T,
        forearm=ROOT_FROM_LAB @ lower_turn,
        upper_m=(upper - shoulder) @ ROOT_FROM_LAB.T,
        upper=ROOT_FROM_LAB @ upper_turn,
        elbow_miss_m=miss,
        elbow_deg=elbow_deg,
        own_positions_m=(positions[0], positions[1]),
    )


def _pose(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mirrored places (T, 3), m, and world-from-cluster rotations (T, 3, 3): quaternions are stored w first."""
    turns = Rotation.from_quat(rows[[5, 6, 7, 4]].T).as_matrix()
    return rows[1:4].T / 1e3 @ MIRROR, MIRROR @ turns @ MIRROR


def _common_point(
    first_m: np.ndarray, first: np.ndarray, second_m: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, float]:
    """The point that is fixed in both bodies, in axes of the second, and by how much it misses (root mean square)."""
    both = np.concatenate([first, -second], axis=2).reshape(-1, 6)
    apart = (second_m - first_m).ravel()
    found = np.linalg.lstsq(both, apart, rcond=None)[0]
    miss = (both @ found - apart).reshape(-1, 3)
    return found[3:], float(np.sqrt(np.mean(np.sum(miss**2, axis=1))))
