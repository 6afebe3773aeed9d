"""The arrays of a track over time (`Estimates`). `Track` extends it with frame positions, tables and files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, TypeVar, overload

import numpy as np

from oarlock.model.angle_sequence import DEFAULT_SEQUENCE
from oarlock.model.coordinates import joint_columns
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.tracking.counts import StreamCount
from oarlock.tracking.joint_series import BallSeries, FreeSeries, HingeSeries, Joint, JointSeries, SlideSeries
from oarlock.tracking.notes import Note
from oarlock.tracking.records import Beliefs, SensorInfo, SlowSeries

if TYPE_CHECKING:
    from oarlock._core import Belief, Model, Run
    from oarlock.recording.calibration import Calibration

_Kind = TypeVar("_Kind", bound=JointSeries | BallSeries)
_ARRAYS = ("time_s", "q", "qd", "qdd", "q_std", "qd_std", "qdd_std", "observed")


@dataclass(frozen=True)
class Later:
    """Placeholder for a field of `Estimates`, which is computed when it is first read."""

    make: Callable[[], Any]


@dataclass(frozen=True, eq=False)
class Estimates(Mapping[str, Joint]):
    """Joints by name, estimated over `time_s` (T,) with standard deviations, innovations, notes and provenance.

    Args:
        model: what was tracked; None if its file could not be found again after loading.
        time_s: (T,) s.
        joint_names: the model's joints, in its order.
        joint_units: "rad" for hinges and balls, "m" for slides, "m, rad" for free joints.
        q: (T, n_coordinates), rad or m. For a ball joint: the rotation vector of parent-from-child.
        qd: (T, n_coordinates) rates, per s. For a ball joint: the angular velocity in the child's axes. `qdd`: per s2.
        q_std: (T, n_coordinates) standard deviations, as are `qd_std` and `qdd_std`. For a ball joint: those of the
            error e in the child's axes, R_true = R Exp(e). At most half of the joint's range; from a quarter on, the
            prior's, the coordinate is not observed. A body that travels has no such bound.
        observed: (T, n_coordinates) true where the sensors determine the coordinate.
        coordinate_names: names of the columns of `q`, `qd` and the other arrays. Without it the joints are the
            coordinates, which is correct for hinges and slides.
        coordinate_units: "rad" or "m" for each coordinate.
        angle_sequences: named angles of each ball and free joint, such as "YXY".
        slow: slow states by name.
        info: readings used, rejected and missing, and NIS; None for a simulated ground truth.
        beliefs: state estimates with full covariance every few seconds; None for a simulated ground truth.
        notes: sentences on missing or implausible data and on the track, with code, subject and value.
        provenance: version, configuration, hashes of the inputs, speed.
        smoothed: true if each estimate uses all samples, earlier and later ones.
        counts: readings of each stream: expected, received, missing, used and rejected.
        calibration: the calibration that it was tracked with; None without one.
    """

    model: Model | None
    time_s: Floats
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    q: Floats
    qd: Floats
    qdd: Floats
    q_std: Floats
    qd_std: Floats
    qdd_std: Floats
    observed: Bools
    coordinate_names: tuple[str, ...] = ()
    coordinate_units: tuple[str, ...] = ()
    angle_sequences: Mapping[str, str] = field(default_factory=dict)
    slow: Mapping[str, SlowSeries] = field(default_factory=dict)
    info: SensorInfo | None = None
    beliefs: Beliefs | None = None
    notes: tuple[Note, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    smoothed: bool = False
    last_belief: Belief | None = None
    run: Run | None = field(default=None, repr=False)
    counts: tuple[StreamCount, ...] = ()
    calibration: Calibration | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            _keep(self.__dict__[name])
        if not self.coordinate_names:
            object.__setattr__(self, "coordinate_names", tuple(self.joint_names))
            object.__setattr__(self, "coordinate_units", tuple(self.joint_units))
        if not isinstance(self.__dict__["notes"], Later):
            object.__setattr__(self, "notes", tuple(map(Note, self.notes)))
        for name in ("slow", "angle_sequences"):
            if not isinstance(self.__dict__[name], Later):
                object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    if not TYPE_CHECKING:  # the type checker would no longer find misspelt names

        def __getattribute__(self, name: str) -> Any:
            value = object.__getattribute__(self, name)
            if type(value) is Later:
                value = _keep(value.make())
                value = tuple(map(Note, value)) if name == "notes" else value
                object.__setattr__(self, name, value)
            return value

    def __getstate__(self) -> dict[str, Any]:
        # An unpickled track cannot be smoothed, like a track read from files: the engine's run stays behind.
        whole = {name: getattr(self, name) for name in self.__dict__}
        plain = {name: dict(whole[name]) for name in ("slow", "angle_sequences", "provenance")}
        return whole | plain | {"run": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    @overload
    def __getitem__(self, name: str) -> Joint: ...
    @overload
    def __getitem__(self, name: slice) -> Self: ...
    def __getitem__(self, name: str | slice) -> Joint | Self:
        """The joint of this name, else KeyError; or `track[1.0:2.0]`, the part between two times, s."""
        if isinstance(name, slice):
            if name.step is not None:
                raise TypeError("track[start_s:end_s] has no step; track with output_rate_hz for fewer rows")
            return self.between(name.start, name.stop)
        if not isinstance(name, str):
            raise TypeError(
                f"track[{name!r}]: a track has joints by name and parts by time in s: "
                f'track["{next(iter(self.joint_names), "elbow")}"], track[1.0:2.0]; '
                "rows are in arrays, such as track.q[5]"
            )
        if name not in self.joint_names:
            raise KeyError(f"no joint '{name}'. {did_you_mean(name, self.joint_names)}")
        columns = list(joint_columns(self.coordinate_names)[name])
        if len(columns) == 1:
            return self._scalar(name, columns[0])
        return self._ball(name, columns) if len(columns) == 3 else self._free(name, columns)

    def __getattr__(self, name: str) -> Joint:
        """`track.trunk` is `track["trunk"]`."""
        joints = self.__dict__.get("joint_names", ())
        if name in joints:
            return self[name]
        if name.startswith("_"):
            raise AttributeError(name)
        known = [*joints, *(field for field in dir(type(self)) if not field.startswith("_"))]
        raise AttributeError(f"a track has no '{name}'. {did_you_mean(name, known)}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(name for name in self.joint_names if name.isidentifier())]

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.joint_names)

    def hinge(self, name: str) -> HingeSeries:
        """The hinge of this name; DataError if it is another joint."""
        return self._of_kind(name, HingeSeries)

    def slide(self, name: str) -> SlideSeries:
        """The slide of this name."""
        return self._of_kind(name, SlideSeries)

    def scalar(self, name: str) -> JointSeries:
        """The hinge or slide of this name."""
        return self._of_kind(name, JointSeries)

    def ball(self, name: str) -> BallSeries:
        """The ball or free joint of this name."""
        return self._of_kind(name, BallSeries)

    def free(self, name: str) -> FreeSeries:
        """The free joint of this name."""
        return self._of_kind(name, FreeSeries)

    def _of_kind(self, name: str, kind: type[_Kind]) -> _Kind:
        series = self[name]
        if not isinstance(series, kind):
            words = {HingeSeries: "hinge", SlideSeries: "slide", BallSeries: "ball", FreeSeries: "free"}
            found = words[type(series)]
            raise DataError(f'joint "{name}" is a {found} joint: use track.{found}("{name}")')
        return series

    def _scalar(self, name: str, column: int) -> HingeSeries | SlideSeries:
        return (SlideSeries if self.coordinate_units[column] == "m" else HingeSeries)(
            name=name,
            unit=self.coordinate_units[column],
            value=self.q[:, column],
            velocity=self.qd[:, column],
            acceleration=self.qdd[:, column],
            std=self.q_std[:, column],
            velocity_std=self.qd_std[:, column],
            acceleration_std=self.qdd_std[:, column],
            observed=self.observed[:, column],
        )

    def _ball(self, name: str, columns: list[int]) -> BallSeries:
        return BallSeries(**self._rotation(name, columns))

    def _free(self, name: str, columns: list[int]) -> FreeSeries:
        place, turn = columns[:3], columns[3:]
        return FreeSeries(
            **self._rotation(name, turn),
            position_m=self.q[:, place],
            velocity_m_s=self.qd[:, place],
            acceleration_m_s2=self.qdd[:, place],
            std_m=self.q_std[:, place],
            velocity_std_m_s=self.qd_std[:, place],
            acceleration_std_m_s2=self.qdd_std[:, place],
            position_observed=np.asarray(self.observed[:, place].all(axis=1)),
        )

    def _rotation(self, name: str, columns: list[int]) -> dict[str, Any]:
        return {
            "name": name,
            "angle_sequence": self.angle_sequences.get(name, DEFAULT_SEQUENCE),
            "rotvec_rad": self.q[:, columns],
            "velocity_rad_s": self.qd[:, columns],
            "acceleration_rad_s2": self.qdd[:, columns],
            "std_rad": self.q_std[:, columns],
            "velocity_std_rad_s": self.qd_std[:, columns],
            "acceleration_std_rad_s2": self.qdd_std[:, columns],
            "observed": self.observed[:, columns].all(axis=1),
        }

    @property
    def epoch(self) -> str | None:
        """As `Recording.epoch`."""
        return self.provenance.get("epoch")

    def __contains__(self, name: object) -> bool:
        return name in self.joint_names

    def __iter__(self) -> Iterator[str]:
        return iter(self.joint_names)

    def __len__(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def between(self, start_s: float | None = None, end_s: float | None = None) -> Self:
        """The part from `start_s` to `end_s`, both included; it cannot be smoothed."""
        first = -np.inf if start_s is None else start_s
        last = np.inf if end_s is None else end_s
        rows = (self.time_s >= first) & (self.time_s <= last)
        if not rows.any():
            whole = f"{self.time_s[0]:.3f} to {self.time_s[-1]:.3f} s" if len(self.time_s) else "no row"
            raise DataError(f"track: no row is between {first} and {last} s; the track has {whole}")
        changes: dict[str, Any] = {name: getattr(self, name)[rows] for name in _ARRAYS}
        changes["slow"] = MappingProxyType(
            {name: SlowSeries(s.value[rows], s.std[rows], s.unit) for name, s in self.slow.items()}
        )
        changes["info"] = None if self.info is None else self.info.of_rows(rows)
        changes["beliefs"] = None if self.beliefs is None else self.beliefs.between(first, last)
        changes |= {"run": None, "counts": ()} | ({} if rows[-1] else {"last_belief": None})
        return self._changed(changes)

    def _changed(self, fields: Mapping[str, Any]) -> Self:
        """The same with other values of these fields; those that are not computed yet stay so."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__ | {name: _keep(value) for name, value in fields.items()})
        return other


def _keep(value: Any) -> Any:
    """The value; an array becomes read-only."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    return value
