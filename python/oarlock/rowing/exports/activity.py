"""`Activity`: points in time of a watch or an app that recorded no strokes, as TCX and FIT files contain them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

COLUMNS = (
    "time_s",
    "latitude_deg",
    "longitude_deg",
    "distance_m",
    "speed_m_s",
    "heart_rate_per_min",
    "rate_per_min",
    "power_w",
)


@dataclass(frozen=True, eq=False)
class Activity:
    """Points in time, about one a second: what the rower did, but not how. It contains no strokes.

    Args:
        columns: numbers by name, (N,) each, NaN where a point lacks them: ``time_s``, and of ``latitude_deg``,
            ``longitude_deg``, ``distance_m``, ``speed_m_s``, ``heart_rate_per_min``, ``rate_per_min`` (strokes) and
            ``power_w`` those that the file has.
        source: file and kind, for people.
        epoch: the moment of 0 s, as `Recording.epoch`; "" if it is not known.
        notes: plain sentences on what is odd.

    Raises:
        DataError: there are no points, columns differ in length, or one has another name.
    """

    columns: Mapping[str, Floats]
    source: str = ""
    epoch: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        held = {name: np.array(values, dtype=np.float64) for name, values in self.columns.items()}
        object.__setattr__(self, "columns", MappingProxyType(held))
        unknown = [name for name in held if name not in COLUMNS]
        if unknown or "time_s" not in held:
            raise DataError(
                f"activity: needs time_s, and columns of {', '.join(COLUMNS)}; it has {', '.join(held)}"
            )
        if any(values.shape != held["time_s"].shape or values.ndim != 1 for values in held.values()):
            raise DataError("activity: its columns differ in length. Give one number a point")
        for values in held.values():
            values.flags.writeable = False

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    def __getitem__(self, name: str) -> Floats:
        """The column of this name, (N,)."""
        if name not in self.columns:
            raise KeyError(f"no column '{name}'; there are {', '.join(self.columns)}")
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    @property
    def duration_s(self) -> float | None:
        """From 0 s to the last point."""
        return float(np.nanmax(self["time_s"])) if np.isfinite(self["time_s"]).any() else None


def known_columns(found: Mapping[str, list[float] | Floats]) -> dict[str, Floats]:
    """Those columns that have a number in some row; a power that is always 0 was not measured."""
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in found.items()}
    if "power_w" in arrays and not np.nan_to_num(arrays["power_w"]).any():
        del arrays["power_w"]
    return {name: values for name, values in arrays.items() if np.isfinite(values).any()}
