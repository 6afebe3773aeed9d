"""Puts the quantities of one sensor that were stamped apart, such as a slower magnetometer, into one stream's rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from oarlock.storage.arrays import Floats


def merged(
    parts: Sequence[tuple[Floats, Mapping[str, Floats]]],
) -> tuple[Floats, dict[str, Floats]]:
    """All time stamps of the parts, in order, and their fields (T, 3); NaN where a part has no sample."""
    if len(parts) == 1:
        return parts[0][0], dict(parts[0][1])
    time_s = np.unique(np.concatenate([stamps for stamps, _ in parts]))
    fields = {}
    for stamps, values in parts:
        rows = np.searchsorted(time_s, stamps)
        for name, readings in values.items():
            fields[name] = np.full((len(time_s), 3), np.nan)
            fields[name][rows] = readings
    return time_s, fields
