"""`StudyTrial`: ground truth and recording of one simulated trial, and its sensor settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from oarlock._core import Model
from oarlock.evaluation.study.keys import StudyKey, Value, by_name
from oarlock.model.description import ImuDescription
from oarlock.recording.recording import Recording
from oarlock.simulation.simulate import simulate
from oarlock.storage.errors import DataError
from oarlock.tracking.track import Track, load_track

if TYPE_CHECKING:
    from oarlock.simulation.motion import Motion

QUANTITIES = {
    "gyro": "gyro_rad_s",
    "accel": "accel_m_s2",
    "mag": "mag_ut",
    "encoder": "value",
}
"""Name of each noise factor's quantity, and the name of that quantity in a recording."""

SENSOR_KEYS = by_name(
    [
        StudyKey("rate_hz", "number", 125.0, "samples per second of every sensor", least=1.0, most=5000.0),
        StudyKey("noise_factor", "number", 1.0, "factor on the model file's noise, all sensors", least=0.0),
        *(
            StudyKey(f"{name}_noise_factor", "number", 1.0, f"the same for {name}s only", least=0.0)
            for name in QUANTITIES
        ),
        StudyKey("gyro_bias_rad_s", "by_name", 0.0, "constant bias on every axis, of all units or by unit"),
        StudyKey("accel_bias_m_s2", "by_name", 0.0, "constant bias on every axis, of all units or by unit"),
    ]
)
"""Sensor settings of all simulated motions."""


@dataclass(frozen=True)
class StudyTrial:
    """Ground truth and recording of one trial.

    Args:
        truth: true joint values.
        recording: readings of the sensors.
    """

    truth: Track
    recording: Recording

    KEYS = SENSOR_KEYS

    @classmethod
    def of_motion(cls, model: Model, motion: Motion, values: Mapping[str, Value], seed: int) -> StudyTrial:
        """Simulates every sensor of a model along a motion.

        Args:
            model: the true model of the body.
            motion: joint trajectories.
            values: values of `StudyTrial.KEYS`; other keys are ignored.
            seed: seed of the noise.
        """
        settings = {name: values.get(name, key.default) for name, key in SENSOR_KEYS.items()}
        truth, recording = simulate(
            model,
            motion,
            seed=seed,
            rate_hz=_float(settings["rate_hz"]),
            noise=_noise(model, settings),
            gyro_bias_rad_s=_bias(settings["gyro_bias_rad_s"]),
            accel_bias_m_s2=_bias(settings["accel_bias_m_s2"]),
        )
        return cls(truth, recording)


class StudySimulator(Protocol):
    """Creates trials. One object serves all runs. It is sent to other processes, so its fields must be plain values."""

    def keys(self, model: Model) -> Mapping[str, StudyKey]:
        """The keys of this simulator, by name."""
        ...

    def lengths(self, model: Model) -> tuple[str, ...]:
        """Parameters of the model that are lengths of the body."""
        ...

    def trial(self, model: Model, values: Mapping[str, Value], seed: int) -> StudyTrial:
        """Ground truth and recording; the same seed and values give identical results."""
        ...


@dataclass(frozen=True)
class TruthFolder:
    """Simulates sensors along a motion that was recorded or tracked before: a folder with a track.

    Args:
        folder: a track folder with all joints of the model, without gaps.
    """

    folder: str

    def keys(self, model: Model) -> Mapping[str, StudyKey]:
        """The common sensor settings, and the used part of the motion."""
        stretch = [
            StudyKey("start_s", "number", 0.0, "start of the used part of the motion", least=0.0),
            StudyKey(
                "duration_s", "number", None, "its duration; none: to the end", least=0.1, optional=True
            ),
        ]
        return SENSOR_KEYS | by_name(stretch)

    def lengths(self, model: Model) -> tuple[str, ...]:
        """Every parameter in metres."""
        return lengths_of(model)

    def trial(self, model: Model, values: Mapping[str, Value], seed: int) -> StudyTrial:
        """The same motion for every seed, with different noise."""
        from oarlock.simulation.motion import Motion

        track = load_track(Path(self.folder))
        first = float(track.time_s[0]) + _float(values.get("start_s", 0.0))
        length = values.get("duration_s")
        last = np.inf if length is None else first + _float(length)
        kept = (track.time_s >= first - 1e-9) & (track.time_s <= last + 1e-9)
        q = track.q[kept]
        if not np.isfinite(q).all():
            gone = [
                n for n, col in zip(track.coordinate_names, q.T, strict=True) if not np.isfinite(col).all()
            ]
            raise DataError(
                f"{self.folder}: the motion of {', '.join(gone)} has gaps; a motion must have all values"
            )
        return StudyTrial.of_motion(
            model, Motion(track.coordinate_names, track.time_s[kept], q), values, seed
        )


def lengths_of(model: Model) -> tuple[str, ...]:
    """Names of a model's parameters in metres."""
    return tuple(p.name for p in model.describe().parameters if p.unit == "m")


def _float(value: Value) -> float:
    assert isinstance(value, int | float)
    return float(value)


def _bias(value: Value) -> Any:
    return dict(value) if isinstance(value, Mapping) else _float(value)


def _noise(model: Model, settings: Mapping[str, Value]) -> bool | dict[str, dict[str, float]]:
    """Standard deviations by sensor where they differ from the model's."""
    factors = {
        quantity: _float(settings["noise_factor"]) * _float(settings[f"{name}_noise_factor"])
        for name, quantity in QUANTITIES.items()
    }
    if all(factor == 1.0 for factor in factors.values()):
        return True
    described = model.describe()
    inputs = {joint.name: joint.std for joint in described.inputs}
    found: dict[str, dict[str, float]] = {}
    for sensor in described.sensors:
        own = {"value": sensor.std or sensor.std_m or inputs.get(sensor.joint or "")}
        if isinstance(sensor, ImuDescription):
            own |= {
                "gyro_rad_s": sensor.gyro_std_rad_s,
                "accel_m_s2": sensor.accel_std_m_s2,
                "mag_ut": sensor.mag_std_ut,
            }
        found[sensor.name] = {field: std * factors[field] for field, std in own.items() if std is not None}
    return found
