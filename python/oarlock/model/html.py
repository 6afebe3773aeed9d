"""A model as notebooks show it (`Model._repr_html_`): its joints with their ranges, its sensors and lengths."""

from __future__ import annotations

import numpy as np

from oarlock._core import Model
from oarlock.model.description import JointDescription
from oarlock.storage.notebook_html import card, folded, html_table


def model_html(model: Model) -> str:
    """HTML of a model."""
    described = model.describe()
    joints = html_table(
        ["joint", "kind", "range", "what it is"], [_joint(joint) for joint in described.joints]
    )
    sensors = html_table(["sensor", "kind", "on"], [(s.name, s.kind, _place(s)) for s in described.sensors])
    lengths = html_table(
        ["parameter", "value"], [(name, f"{value:.4g}") for name, value in model.parameters.items()]
    )
    facts = f"{len(described.joints)} joints, {len(described.sensors)} sensors, {len(described.closures)} closures"
    return card(
        f"Model {model.name}",
        ", ".join(part for part in (model.description.rstrip("."), facts) if part),
        folded(f"Joints ({len(described.joints)})", joints, is_open=True),
        folded(f"Sensors ({len(described.sensors)})", sensors),
        folded(f"Parameters, m and rad ({len(model.parameters)})", lengths),
    )


def _place(sensor: object) -> str:
    return str(getattr(sensor, "frame", None) or getattr(sensor, "joint", None) or "–")


def _joint(joint: JointDescription) -> tuple[str, str, str, str]:
    if joint.kind not in ("hinge", "slide") or not np.isfinite(joint.limits).all():
        return joint.name, joint.kind, "–", joint.label
    factor, unit = (100.0, "cm") if joint.kind == "slide" else (float(np.degrees(1.0)), "deg")
    low, high = (factor * limit for limit in joint.limits)
    return joint.name, joint.kind, f"{low:.0f} to {high:.0f} {unit}", joint.label
