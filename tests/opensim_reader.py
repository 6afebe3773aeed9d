"""OpenSim as an independent reader of what is exported: where its bodies are along its motion."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from oarlock.storage.arrays import Floats

ROTATIONAL = 1
"""OpenSim's number for a coordinate that is an angle."""


def opensim() -> Any:
    """The module, silent; skips the test where it is not installed."""
    reason = "NOT RUN: opensim is absent: pip install -r requirements/validation.txt"
    module = pytest.importorskip("opensim", reason=reason)
    module.Logger.setLevelString("Off")
    module.Logger.removeFileSink()
    return module


class OpensimReader:
    """A model and a motion, read by OpenSim."""

    def __init__(self, folder: Path, motion: str = "coordinates.mot") -> None:
        self.osim = opensim()
        self.model = self.osim.Model(str(folder / "model.osim"))
        self.state = self.model.initSystem()
        table = self.osim.TimeSeriesTable(str(folder / motion))
        self.in_degrees = table.getTableMetaDataString("inDegrees") == "yes"
        self.labels = tuple(table.getColumnLabels())
        self.time_s: Floats = np.array(table.getIndependentColumn())
        self.values: Floats = table.getMatrix().to_numpy()

    @property
    def coordinates(self) -> dict[str, Any]:
        every = self.model.getCoordinateSet()
        return {every.get(k).getName(): every.get(k) for k in range(every.getSize())}

    def si(self) -> Floats:
        """The motion (T, n) in rad and m."""
        turns = [self.coordinates[name].getMotionType() == ROTATIONAL for name in self.labels]
        return np.where(turns, np.radians(self.values), self.values) if self.in_degrees else self.values

    def along(self, rows: Floats) -> Iterator[int]:
        """Puts the model into the posture of each row."""
        values, coordinates = self.si(), self.coordinates
        for row in rows:
            for column, name in enumerate(self.labels):
                coordinates[name].setValue(self.state, float(values[row, column]), False)
            self.model.realizePosition(self.state)
            yield int(row)

    def places(self, bodies: dict[str, str], rows: Floats) -> dict[str, Floats]:
        """Origins of bodies in ground axes, m, (rows, 3) each, by the name of the frame here."""
        parts = {frame: self.model.getBodySet().get(body) for frame, body in bodies.items()}
        found: dict[str, list[Floats]] = {frame: [] for frame in bodies}
        for _ in self.along(rows):
            for frame, part in parts.items():
                found[frame].append(part.getPositionInGround(self.state).to_numpy())
        return {frame: np.array(points) for frame, points in found.items()}
