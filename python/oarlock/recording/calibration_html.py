"""A calibration as notebooks show it (`Calibration._repr_html_`): each value with its standard deviation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from oarlock.storage.notebook_html import card, folded, html_table


def calibration_html(values: Mapping[str, Mapping[str, Any]]) -> str:
    """HTML of the fields of a calibration, by name."""
    lengths = [
        (name, f"{value:.4g}", values["parameter_stds"].get(name))
        for name, value in values["parameters"].items()
    ]
    mounts = [(name, *_mount(values, name)) for name in values["mounts"]]
    clocks = [
        (name, f"{1e3 * clock.offset_s:.1f}", f"{1e6 * clock.drift:.1f}")
        for name, clock in values["clocks"].items()
    ]
    encoders = [(name, f"{one.zero:.4g}", f"{one.scale:.4g}") for name, one in values["encoders"].items()]
    parts = [
        _part("parameters", ["parameter", "value, m or rad", "std"], lengths),
        _part("mounts", ["sensor", "std, deg", "offset, cm"], mounts),
        _part("clocks", ["stream", "offset, ms", "drift, ppm"], clocks),
        _part("encoders", ["encoder", "zero, rad or m", "scale"], encoders),
    ]
    return card("Calibration", "" if any(parts) else "empty: nominal values are used", *parts)


def _part(what: str, header: list[str], rows: Sequence[Sequence[object]]) -> str:
    return folded(f"{what} ({len(rows)})", html_table(header, rows), is_open=True) if rows else ""


def _mount(values: Mapping[str, Mapping[str, Any]], name: str) -> tuple[str, str]:
    _, offset_m = values["mounts"][name]
    std_rad = values["mount_stds_rad"].get(name)
    angle = "–" if std_rad is None else f"{np.degrees(np.linalg.norm(std_rad)):.2f}"
    return angle, ", ".join(f"{100.0 * x:.1f}" for x in np.ravel(offset_m))
