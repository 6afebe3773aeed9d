"""The benchmark problem: the shipped `"sculler"` with noise, biases and surge of the paper's hardest case."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from oarlock.model.description import ModelDescription
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock import Config, Model, Recording, Tracker


RATE_HZ: Final = 125.0
WARM: Final = 100
"""Number of samples until the start is fitted and the state estimate has converged."""

ESTIMATES: Final[dict[str, tuple[str, ...]]] = {
    "joints": (),
    "with_biases": ("gyro_bias", "accel_bias", "surge"),
}
"""Only joints and azimuth of the field, as in the paper; and all states of the default configuration."""

# The textbook filter has no gates, so they are off in Oarlock for the comparison.
_PLAIN: Final[dict[str, Any]] = {"gate": False, "magnetometer": "on"}


@dataclass(frozen=True, eq=False)
class BenchProblem:
    """A model, a recording, and the same readings as rows."""

    model: Model
    recording: Recording
    described: ModelDescription = field(repr=False)

    def config(self, estimate: str = "joints", filter_name: str = "ukf", plain: bool = False) -> Config:
        """Configuration of the filter: `estimate` is a key of `ESTIMATES`; `plain` switches off gates."""
        from oarlock import Config

        keys: dict[str, Any] = {"filter": filter_name} | (_PLAIN if plain else {})
        return Config(structure="tree", estimate=ESTIMATES[estimate], **keys)

    @cached_property
    def time_s(self) -> Floats:
        """Time stamps, (T,), s, which all streams share."""
        return np.asarray(self.recording.streams[0].time_s)

    @cached_property
    def readings(self) -> Floats:
        """Readings, (T, m), in the order of the measurement; closures read zero."""
        columns: dict[str, Floats] = {}
        for stream in self.recording.streams:
            for name, values in stream.values.items():
                if name == "value":
                    columns[stream.name] = values
                    continue
                part = name.split("_")[0]
                columns |= {f"{stream.name}.{part}_{axis}": values[:, k] for k, axis in enumerate("xyz")}
        zero = np.zeros(len(self.time_s))
        return np.column_stack([columns.get(name, zero) for name in self.model.measurement_names])

    @cached_property
    def inputs(self) -> Floats:
        """Readings of input joints, (T, n_coordinates); zero for other joints and without a stream."""
        values = np.zeros((len(self.time_s), len(self.model.coordinate_names)))
        for column, joint in enumerate(self.described.joints):
            if joint.input and joint.name in self.recording:
                values[:, column] = self.recording[joint.name].values["value"]
        return values

    @cached_property
    def read_inputs(self) -> list[int]:
        """Columns of `inputs` with a stream."""
        return [
            column
            for column, joint in enumerate(self.described.joints)
            if joint.input and joint.name in self.recording
        ]

    def started(self) -> tuple[Tracker, Floats, Floats]:
        """A plain tracker after the first `WARM` samples, its mean (n,) and covariance (n, n)."""
        from oarlock import Tracker

        tracker = Tracker(self.model, None, self.config(plain=True))
        for sample in tracker.samples(self.recording)[:WARM]:
            tracker.step(sample)
        belief = tracker.belief
        if belief is None:
            raise RuntimeError(f"no start was found within {WARM} samples")
        return tracker, belief.mean, belief.covariance


def sculling(duration_s: float = 10.0, seed: int = 1) -> BenchProblem:
    """The `"sculler"` over `duration_s` seconds at 125 Hz."""
    import oarlock
    from oarlock.rowing.simulation.experiment import simulate_sculling

    model = oarlock.load_model("sculler")
    _, recording = simulate_sculling(model, "B-B", duration_s, seed=seed)
    return BenchProblem(model, recording, model.describe())
