"""Makes reach.trc: an arm that reaches about, seen by cameras that lose markers. The truth is known."""

from pathlib import Path

import numpy as np

import oarlock

HERE = Path(__file__).parent
LENGTHS = {"l_ua": 0.298, "l_fa": 0.245}
RATE_HZ, DURATION_S, NOISE_M = 50.0, 6.0, 0.001
# middle and swing of each joint in deg, and its swings a second
REACHING = {
    "shoulder_abduction": (25, 15, 0.35),
    "shoulder_rotation": (0, 25, 0.55),
    "shoulder_flexion": (45, 35, 0.45),
    "elbow_flexion": (70, 45, 0.65),
    "elbow_rotation": (-10, 35, 0.5),
    "hand_abduction": (-5, 12, 0.75),
    "hand_flexion": (0, 25, 0.85),
}
GAPS = {"UA2": (2.0, 2.2), "FA1": (3.1, 3.3), "HA3": (4.0, 4.12), "FA3": (1.0, 1.6)}
# the laboratory's axes (rows, in root axes): z up, turned by 30 deg about it
LAB_FROM_ROOT = np.array([[0.8660254037844386, 0, 0.5], [0.5, 0, -0.8660254037844386], [0, 1, 0]])


def main() -> None:
    model = oarlock.load_model(HERE / "arm.toml", parameters=LENGTHS)
    attachments = oarlock.markers.load_attachments(HERE / "person.toml")
    time_s = np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
    random = np.random.default_rng(1)
    q = np.stack(
        [
            np.radians(m + a * np.sin(2 * np.pi * f * time_s + k))
            for k, (m, a, f) in enumerate(REACHING.values())
        ],
        axis=1,
    )
    poses = model.forward_kinematics(q)
    position = np.stack(
        [
            pose[:, :3, :3] @ a.point_m + pose[:, :3, 3]
            for a in attachments
            for pose in [poses[:, model.frame_names.index(a.frame)]]
        ],
        axis=1,
    )
    position += NOISE_M * random.standard_normal(position.shape)
    for k, a in enumerate(attachments):
        start, end = GAPS.get(a.marker, (0.0, 0.0))
        position[(time_s >= start - 1e-9) & (time_s < end - 1e-9), k] = np.nan
    lab = position @ LAB_FROM_ROOT.T + np.array([1.2, -0.4, 1.35])
    markers = oarlock.markers.Markers(
        tuple(a.marker for a in attachments), np.round(time_s, 3), np.round(lab, 4)
    )
    markers.save(HERE / "reach.trc")


if __name__ == "__main__":
    main()
