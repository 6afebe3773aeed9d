"""The posture of each step of a guided start as frames of the page's figure; of a movement, one swing to and fro."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.calibration.session.body import BodyKinematics
from oarlock.model.rotation import quat_from_rotvec, quat_product, rotvec_from_quat
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.calibration.session.plan import SessionStep
    from oarlock.live.picture import LivePicture

FRAMES = 16
MOST_SWING_RAD, BACK_SWING_RAD, LEAST_SWING_RAD, BALL_SWING_RAD = 1.3, 0.5, 0.3, 0.8
MARGIN_RAD = 0.1


def pictures_of(
    model: Model, steps: Sequence[SessionStep], picture: LivePicture | None
) -> list[list[dict[str, Any]]]:
    """Frames of each step, as `LivePicture.frame` has them; none without a figure or a posture."""
    body = BodyKinematics.of(model, [])
    return [
        []
        if picture is None or step.kind not in ("pose", "move")
        else [picture.frame(q) for q in _postures(body, step)]
        for step in steps
    ]


def _postures(body: BodyKinematics, step: SessionStep) -> list[Floats]:
    posture = body.posture(step.pose)
    if step.kind == "pose":
        return [posture]
    swings = np.sin(2.0 * np.pi * np.arange(FRAMES) / FRAMES)
    return [_swung(body, step, posture, float(swing)) for swing in swings]


def _swung(body: BodyKinematics, step: SessionStep, posture: Floats, swing: float) -> Floats:
    """The posture with the step's joints turned by a share of their swing, the first side being positive."""
    q = posture.copy()
    limits = {j.name: j.limits for j in body.model.describe().joints if j.kind == "hinge"}
    for joint in step.joints:
        columns = [body.model.coordinate_names.index(c) for c in body.joints[joint]]
        way = step.first if swing > 0.0 else -step.first
        if joint in limits:
            low, high = limits[joint]
            room = (high - q[columns[0]] if way > 0 else q[columns[0]] - low) - MARGIN_RAD
            far = min(MOST_SWING_RAD if swing > 0.0 else BACK_SWING_RAD, room)
            q[columns[0]] += way * abs(swing) * far * (far > LEAST_SWING_RAD)
        elif step.axis is not None:
            about = np.asarray(step.axis) / np.linalg.norm(step.axis)
            turn = quat_from_rotvec(way * abs(swing) * BALL_SWING_RAD * about)
            q[columns] = rotvec_from_quat(quat_product(turn, quat_from_rotvec(q[columns])))
    return q
