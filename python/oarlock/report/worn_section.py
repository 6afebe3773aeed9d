"""The section of a session's page that shows the units on the body: a verdict, a picture, and axes in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.calibration.static.pose_mounts import rest_posture
from oarlock.recording.calibration import Calibration
from oarlock.report.markup import rendered, table
from oarlock.report.pose_picture.skeleton import Vector
from oarlock.report.worn_picture import MARKS, WornBody, WornUnit, pointing, worn_picture

if TYPE_CHECKING:
    from oarlock._core import Model

Check = Mapping[str, Any]


def worn_section(calibration: Calibration, model: Model, pose: Mapping[str, float] | None = None) -> str:
    """The section as markup.

    Args:
        calibration: of a session.
        model: the body.
        pose: the still pose by coordinate, rad and m; the others are as at rest.
    """
    q = np.asarray(rest_posture(model, dict(pose) if pose else None))
    stds = heading_stds_deg(calibration, model, q)
    noted: Any = calibration.noted["session"]
    verdicts = unit_verdicts(noted["check"], stds)
    worn = WornBody.of(model, q, calibration, verdicts)
    styles = {style: sum(unit.style == style for unit in worn.units) for style in MARKS}
    lead = rendered("session_worn", styles=styles, marks=MARKS)
    rows = [_row(unit, worn, stds) for unit in worn.units]
    heads = ["unit", "result", "x points", "y points", "z points", "heading std, deg"]
    listed = table("worn-axes", "Axes of each sensor in the still pose, seen from the person.", heads, rows)
    return f'{lead}{worn_picture(worn)}<div class="compared">{listed}</div>'


def heading_stds_deg(calibration: Calibration, model: Model, q: Vector) -> dict[str, float]:
    """Unit -> standard deviation of its mount about the vertical in a posture, deg."""
    poses, up = np.asarray(model.forward_kinematics(q)), np.asarray(model.describe().world.up)
    found = {}
    for sensor in model.describe().inertial_units:
        std_rad = calibration.mount_stds_rad.get(sensor.name)
        if std_rad is not None:
            in_link = poses[model.frame_names.index(sensor.frame), :3, :3].T @ up
            found[sensor.name] = float(np.degrees(np.linalg.norm(in_link * np.asarray(std_rad))))
    return found


def unit_verdicts(checks: Sequence[Check], heading_deg: Mapping[str, float]) -> dict[str, tuple[str, str]]:
    """Unit -> (style, words). A mount that is unsure mostly about the vertical is an uncertain heading."""
    found = {}
    for mount in (check for check in checks if check["what"] == "mount"):
        name, std = mount["subject"], mount.get("std", float("nan"))
        failed = [c for c in checks if c["subject"] == name and c["outcome"] == "redo"]
        heading = heading_deg.get(name, 0.0)
        if not failed:
            found[name] = ("good", f"± {std:.1f}°")
        elif all(check is mount for check in failed) and heading >= HEADING_SHARE * std:
            found[name] = ("unsure", f"heading ± {heading:.0f}°")
        else:
            what = "mount" if any(check is mount for check in failed) else failed[0]["what"]
            found[name] = ("bad", f"± {std:.0f}°" if what == "mount" else str(what))
    return found


HEADING_SHARE = 0.8


def _row(unit: WornUnit, worn: WornBody, stds: Mapping[str, float]) -> list[str]:
    style = "open" if unit.style == "unsure" else unit.style
    verdict = f'<span class="verdict {style}">{MARKS[unit.style]} {escape(unit.verdict)}</span>'
    axes = [escape(pointing(axis, worn.body, worn.right)) for axis in unit.root_from_sensor.T]
    return [escape(unit.name), verdict, *axes, f"{stds[unit.name]:.1f}" if unit.name in stds else "–"]
