"""`Fault`: a key of a study and the function that applies the fault to a recording."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from oarlock._core import Model
from oarlock.evaluation.study.keys import StudyKey, Value, number_for
from oarlock.evaluation.study.trial import StudyTrial
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, Stream
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

MIDDLE_HALF = (0.25, 0.75)
"""Part of a recording in which temporary faults begin: the filter has converged, and has time to recover."""


@dataclass(frozen=True)
class Names:
    """Names of the streams that faults may affect."""

    streams: tuple[str, ...]
    units: tuple[str, ...]
    angles: tuple[str, ...]
    lengths: tuple[str, ...]

    @classmethod
    def of(cls, model: Model) -> Names:
        """Streams of sensors and input joints; inertial units; encoders in rad; encoders in m."""
        described = model.describe()
        kinds = {joint.name: joint.kind for joint in described.joints}
        joint_of = {joint.name: joint.name for joint in described.inputs}
        joint_of |= {s.name: s.joint for s in described.encoders}
        units = tuple(s.name for s in described.inertial_units)
        return cls(
            streams=tuple(dict.fromkeys([*model.sensor_names, *joint_of])),
            units=units,
            angles=tuple(name for name, joint in joint_of.items() if kinds[joint] == "hinge"),
            lengths=tuple(name for name, joint in joint_of.items() if kinds[joint] == "slide"),
        )


@dataclass(frozen=True, eq=False)
class Case:
    """Input of a fault: the trial, the study's values, and the seed of all random numbers."""

    trial: StudyTrial
    values: Mapping[str, Value]
    seed: int

    def random(self, what: str) -> np.random.Generator:
        """A random generator that does not depend on other faults."""
        return np.random.default_rng([self.seed, 4, zlib.crc32(what.encode())])

    def sign(self, what: str) -> float:
        """A random sign, -1 or 1."""
        return 1.0 if self.random(what).random() < 0.5 else -1.0

    def number(self, key: str) -> float:
        """A value of the study as a number."""
        return number_for(self.values[key], "")

    def meanwhile(self, time_s: Floats, lasting_s: float) -> Bools:
        """True for time stamps (N,) in the random interval of this length; all streams share it."""
        whole = self.trial.recording
        begin = self.random("meanwhile").uniform(*MIDDLE_HALF) * whole.duration_s
        start = whole.start_s + min(begin, max(whole.duration_s - lasting_s, 0.0))
        return np.asarray((time_s >= start) & (time_s < start + lasting_s))

    def up_in(self, unit: str, time_s: Floats) -> Floats:
        """The true vertical (N, 3) in the axes of an inertial unit, at time stamps (N,)."""
        true_s = self.trial.truth.time_s
        between = np.stack([np.interp(time_s, true_s, column) for column in self._up[unit].T], axis=-1)
        return np.asarray(between / np.linalg.norm(between, axis=1, keepdims=True))

    @cached_property
    def _up(self) -> dict[str, Floats]:
        model = self.trial.truth.model
        assert model is not None
        described = model.describe()
        up = np.asarray(described.world.up)
        poses = model.forward_kinematics(np.nan_to_num(self.trial.truth.q))
        frames = {name: place for place, name in enumerate(model.frame_names)}
        return {
            sensor.name: up @ poses[:, frames[sensor.frame], :3, :3] @ np.asarray(sensor.mount.rotation)
            for sensor in described.inertial_units
        }


Spoil: TypeAlias = Callable[[Recording, Value, Case], Recording]


@dataclass(frozen=True)
class Fault:
    """A fault of a recording.

    Args:
        key: its key in a study, with the unit in its name; the default means no fault.
        spoil: applies the fault to a recording; called only if the value is not the default.
    """

    key: StudyKey
    spoil: Spoil


def of_streams(change: Callable[[Stream, float, Case], Stream | None], all_of: tuple[str, ...]) -> Spoil:
    """A fault of single streams. A number without a name applies to `all_of`; a result of None removes the stream."""

    def spoil(recording: Recording, value: Value, case: Case) -> Recording:
        sizes = value if isinstance(value, Mapping) else dict.fromkeys(all_of, number_for(value, ""))
        changed = [
            change(stream, sizes[stream.name], case) if sizes.get(stream.name) else stream
            for stream in recording.streams
        ]
        left = [stream for stream in changed if stream is not None]
        if not left:
            raise DataError("the study leaves no stream: a fault removed all samples")
        return Recording(left, recording.meta)

    return spoil


def of_units(change: Callable[[ImuStream, float, Case], Stream], units: tuple[str, ...]) -> Spoil:
    """A fault of inertial units."""

    def only_units(stream: Stream, size: float, case: Case) -> Stream:
        return change(stream, size, case) if isinstance(stream, ImuStream) else stream

    return of_streams(only_units, units)


def with_values(stream: ImuStream, **changed: Floats) -> ImuStream:
    """The unit with changed readings, by field name; quantities that it does not measure stay absent."""
    return ImuStream(stream.name, stream.time_s, **{n: changed.get(n, v) for n, v in stream.values.items()})


def rows_kept(stream: Stream, kept: Bools) -> Stream | None:
    """The remaining samples of a stream; None without any."""
    if not kept.any():
        return None
    return stream.at_rows(kept)
