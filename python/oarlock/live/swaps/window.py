"""A short window of readings as numbers in the order of the model's measurements, for several suppositions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.evaluation.suspects.fit import (
    ACCEL_STD_M_S2,
    CLOSURE_STD_AXIS,
    GYRO_STD_RAD_S,
    HINGE_STD_RAD,
    PLACE_STD_M,
)
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Calibration

WINDOW_S = 0.4
"""A movement of so long is a cubic of time, nearly; and a joint turns far enough in it."""
TIMES = 5
TIMES_S: Floats = np.asarray(WINDOW_S * ((np.arange(TIMES) + 0.5) / TIMES - 0.5))
"""From the middle of the window."""
_QUANTITIES = {"gyro": ("gyro_rad_s", GYRO_STD_RAD_S), "accel": ("accel_m_s2", ACCEL_STD_M_S2)}


@dataclass(frozen=True)
class WindowLayout:
    """Which of the model's measurements a window has.

    Args:
        rows: places in `Model.measurement_names`.
        stds: of the errors of real recordings.
        columns: stream -> the columns of its readings.
        turns: inertial unit -> nominal axes from those that it measures in.
    """

    rows: Floats
    stds: Floats
    columns: dict[str, list[int]]
    turns: dict[str, Floats]

    @classmethod
    def of(cls, model: Model, calibration: Calibration | None) -> WindowLayout:
        """The layout of a model's inertial units, encoders and closures."""
        described = model.describe()
        slides = {joint.name for joint in described.joints if joint.kind == "slide"}
        stds = {
            encoder.name: PLACE_STD_M if encoder.joint in slides else HINGE_STD_RAD
            for encoder in described.encoders
        }
        units = {unit.name for unit in described.inertial_units}
        rows: list[int] = []
        found: list[float] = []
        columns: dict[str, list[int]] = {}
        for row, name in enumerate(model.measurement_names):
            own, _, part = name.partition(".")
            std = stds.get(own)
            if own in units and part[:-2] in _QUANTITIES:
                std = _QUANTITIES[part[:-2]][1]
            elif own in model.closure_names:
                std = CLOSURE_STD_AXIS if "axis" in part else PLACE_STD_M
            if std is not None:
                columns.setdefault(own, []).append(len(rows))
                rows.append(row)
                found.append(std)
        for closure in model.closure_names:
            columns.pop(closure, None)
        return cls(np.array(rows), np.array(found), columns, _turns(model, calibration))

    def seen(self, recording: Recording, middle_s: float) -> Floats:
        """(times, rows) means of the readings around each time; NaN where there are none, 0 for closures."""
        measured = sorted(column for own in self.columns.values() for column in own)
        found = np.zeros((TIMES, len(self.rows)))
        found[:, measured] = np.nan
        edges = middle_s + WINDOW_S * (np.arange(TIMES + 1) / TIMES - 0.5)
        for stream in recording.streams:
            if stream.name in self.columns:
                for k, (begin, end) in enumerate(pairwise(edges)):
                    rows = (stream.time_s >= begin) & (stream.time_s < end)
                    if rows.any():
                        found[k, self.columns[stream.name]] = self._mean(stream, rows)
        return found

    def exchanged(self, seen: Floats, pairs: Sequence[tuple[str, str]]) -> Floats:
        """(pairs, times, rows) the readings if each pair sat in each other's place."""
        found = np.repeat(seen[None], len(pairs), axis=0)
        for k, (one, other) in enumerate(pairs):
            first, second = self.columns[one], self.columns[other]
            found[k][:, first], found[k][:, second] = (
                self._placed(seen[:, second], other, one),
                self._placed(seen[:, first], one, other),
            )
        return found

    def _placed(self, values: Floats, unit: str, place: str) -> Floats:
        """A unit's readings in another's place: it sits there as that one was mounted."""
        turn = self.turns[place] @ self.turns[unit].T
        return (values.reshape(len(values), -1, 3) @ turn.T).reshape(values.shape)

    def _mean(self, stream: Any, rows: Floats) -> Floats:
        if isinstance(stream, ScalarStream):
            return np.atleast_1d(np.nanmean(stream.value[rows]))
        if not isinstance(stream, ImuStream):
            return np.full(len(self.columns[stream.name]), np.nan)
        parts = []
        for name, _ in _QUANTITIES.values():
            values = stream.values.get(name)
            mean = np.full(3, np.nan) if values is None else values[rows].mean(axis=0)
            parts.append(self.turns[stream.name] @ mean)
        return np.concatenate(parts)


def _turns(model: Model, calibration: Calibration | None) -> dict[str, Floats]:
    nominal = {unit.name: np.array(unit.mount.rotation) for unit in model.describe().inertial_units}
    worn = {unit.name: np.array(unit.mount.rotation) for unit in model.describe(calibration).inertial_units}
    return {name: nominal[name].T @ worn[name] for name in nominal}
