"""The result of tracking: arrays over time by name, standard deviations, infos and provenance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from oarlock.model.angle_sequence import DEFAULT_SEQUENCE
from oarlock.model.coordinates import angle_sequences, coordinate_units, joint_columns, joint_units
from oarlock.model.rotation import continuous_quat, quat_from_matrix
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.tracking.columns import columns_of
from oarlock.tracking.joint_series import BallSeries, FreeSeries, JointSeries
from oarlock.tracking.places import PositionSpread, model_of, poses_of, position_spreads, relative_positions
from oarlock.tracking.records import Beliefs, SensorInfo, SlowSeries

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from oarlock._core import Belief, Model, Run

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
_ARRAYS = ("time_s", "q", "qd", "qdd", "q_std", "qd_std", "qdd_std", "observed")


@dataclass(frozen=True)
class Later:
    """In the place of a field of `Track`: what it will hold is made when it is first asked for."""

    make: Callable[[], Any]


@dataclass(frozen=True, eq=False)
class Track:
    """Estimates over `time_s` (T,). Never changes; `oarlock.smooth` gives another one.

    Args:
        model: what was tracked; None if its file could not be found again after loading.
        time_s: (T,) s.
        joint_names: the model's joints, in its order.
        joint_units: "rad" of hinges and balls, "m" of slides, "m, rad" of free joints.
        q: (T, n_coordinates), rad or m; of a ball joint the rotation vector of parent-from-child.
        qd: rates, per s; of a ball joint the angular velocity in the child's axes. `qdd` per s2.
        q_std: standard deviations; of a ball joint those of the error e in the child's axes, R_true = R Exp(e).
        observed: (T, n_coordinates) whether the sensors pin the coordinate down.
        coordinate_names: order of the columns of `q` and its kin; left out, they are the joints: hinges and slides.
        coordinate_units: "rad" or "m" each.
        angle_sequences: named angles of each ball and free joint, such as "YXY".
        slow: slow states by name.
        info: what became of the measurements; None for a simulated truth.
        beliefs: full beliefs every few seconds; None for a simulated truth.
        notes: plain sentences on what was missing or odd.
        provenance: version, configuration, hashes of what went in, speed.
        smoothed: each estimate rests on all samples.
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
    notes: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    smoothed: bool = False
    last_belief: Belief | None = None
    run: Run | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            _keep(self.__dict__[name])
        if not self.coordinate_names:
            object.__setattr__(self, "coordinate_names", tuple(self.joint_names))
            object.__setattr__(self, "coordinate_units", tuple(self.joint_units))
        for name in ("slow", "angle_sequences"):
            if not isinstance(self.__dict__[name], Later):
                object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    if not TYPE_CHECKING:  # it would hide misspelt names from the checker

        def __getattribute__(self, name: str) -> Any:
            value = object.__getattribute__(self, name)
            if type(value) is Later:
                value = _keep(value.make())
                object.__setattr__(self, name, value)
            return value

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the engine's run: an unpickled track cannot be smoothed, like one read from files."""
        whole = {name: getattr(self, name) for name in self.__dict__}
        plain = {name: dict(whole[name]) for name in ("slow", "angle_sequences", "provenance")}
        return whole | plain | {"run": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    def __getitem__(self, name: str) -> Any:
        """The joint of this name: `JointSeries` of a hinge or slide, `BallSeries`, `FreeSeries`."""
        if name not in self.joint_names:
            raise KeyError(f"no joint '{name}'. {did_you_mean(name, self.joint_names)}")
        columns = list(joint_columns(self.coordinate_names)[name])
        if len(columns) == 1:
            return self._scalar(name, columns[0])
        return self._ball(name, columns) if len(columns) == 3 else self._free(name, columns)

    def _scalar(self, name: str, column: int) -> JointSeries:
        return JointSeries(
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

    def with_notes(self, *sentences: str) -> Track:
        """The same track, whose notes begin with these."""
        other = object.__new__(Track)
        other.__dict__.update(self.__dict__)
        other.__dict__["notes"] = tuple(dict.fromkeys((*sentences, *self.notes)))
        return other

    def __len__(self) -> int:
        return len(self.time_s)

    def __repr__(self) -> str:
        kind = "smoothed" if self.smoothed else "filtered" if self.info else "simulated"
        span = f"{self.time_s[0]:.2f} to {self.time_s[-1]:.2f} s" if len(self) else "empty"
        return f"Track({kind}, {len(self)} samples, {span}, {len(self.joint_names)} joints)"

    def frame_positions(self, frame: str, relative_to: str = "root") -> Floats:
        """Origin of a frame over time, (T, 3) in m, in the axes of frame `relative_to`.

        Lengths that were estimated along the way are those of each sample. A joint that no stream ever told (the turn
        of a grip, say) is taken at 0; where a reading that was needed is missing, the position is NaN.

        Raises:
            DataError: no such frame, or the track has no model.
        """
        own, reference = self._frames("frame_positions", frame, relative_to)
        return relative_positions(poses_of(self), [own], reference)[:, 0]

    def frame_position_spread(self, frame: str, relative_to: str = "root") -> PositionSpread:
        """How uncertain `frame_positions` is: covariances (T, 3, 3) in m2, and what they were made from.

        Raises:
            DataError: no such frame, or the track has no model.
        """
        own, reference = self._frames("frame_position_spread", frame, relative_to)
        covariance, source = position_spreads(self, [own], reference)
        return PositionSpread(covariance[:, 0], source)

    def frame_position_stds(self, frame: str, relative_to: str = "root") -> Floats:
        """Standard deviations of `frame_positions` along its three axes, (T, 3) in m.

        `frame_position_spread` has the covariance, and says whether correlations were known.

        Raises:
            DataError: no such frame, or the track has no model.
        """
        return self.frame_position_spread(frame, relative_to).std_m

    def frame_quat_wxyz(self, frame: str, relative_to: str = "root") -> Floats:
        """Orientation of a frame over time, (T, 4): the rotation `relative_to`-from-`frame`, signs continuous.

        Joints without a reading are treated as in `frame_positions`.

        Raises:
            DataError: no such frame, or the track has no model.
        """
        own, reference = self._frames("frame_quat_wxyz", frame, relative_to)
        poses = poses_of(self)[..., :3, :3]
        turned = np.einsum("tji,tjk->tik", poses[:, reference], poses[:, own])
        return continuous_quat(quat_from_matrix(turned))

    def _frames(self, asked: str, *frames: str) -> list[int]:
        """Numbers of frames in the model."""
        names = model_of(self, asked).frame_names
        for name in frames:
            if name not in names:
                raise DataError(f"{asked}: no frame '{name}'. {did_you_mean(name, names)}")
        return [names.index(name) for name in frames]

    def columns(self) -> dict[str, Floats]:
        """Every array under a plain column name with its unit, (T,) each, `time_s` first.

        A ball joint has its rotation vector, rates and deviations by coordinate (`shoulder.rx_rad`,
        `shoulder.rx_velocity_rad_s`), the quaternion (`shoulder_quat_w`), its named angles with their sequence
        (`shoulder_YXY_y1_rad`, `shoulder_YXY_y1_std_rad`) and where these are near singular.
        """
        return columns_of(self)

    def to_dataframe(self) -> pd.DataFrame:
        """All columns as a pandas DataFrame (needs the extra `oarlock[dataframe]`)."""
        try:
            import pandas as pd
        except ImportError:
            raise DataError("to_dataframe needs pandas: pip install 'oarlock[dataframe]'") from None
        return pd.DataFrame(self.columns())

    def to_xarray(self) -> xr.Dataset:
        """All columns over the coordinate `time_s` (needs the extra `oarlock[xarray]`)."""
        try:
            import xarray as xr
        except ImportError:
            raise DataError("to_xarray needs xarray: pip install 'oarlock[xarray]'") from None
        columns = self.columns()
        time_s = columns.pop("time_s")
        return xr.Dataset({k: ("time_s", v) for k, v in columns.items()}, coords={"time_s": time_s})

    def save(self, folder: str | PathLike[str]) -> None:
        """Write track.parquet, sensors.parquet, beliefs.parquet, model.toml and run.toml into a folder."""
        from oarlock.tracking.folder import write_track

        write_track(self, folder)

    @staticmethod
    def load(folder: str | PathLike[str]) -> Track:
        """Read what `save` wrote; the same as `oarlock.load_track`."""
        return load_track(folder)


def load_track(folder: str | PathLike[str]) -> Track:
    """Read a track from a folder that `Track.save` wrote.

    Raises:
        DataError: the folder holds no track, or a file in it is damaged.
    """
    from oarlock.tracking.folder import read_track

    return read_track(folder)


def track_without_filter(
    model: Model,
    time_s: Floats,
    q: Floats,
    qd: Floats | None = None,
    qdd: Floats | None = None,
    *,
    provenance: Mapping[str, Any],
) -> Track:
    """A Track that no filter made, (T, n_coordinates) each: a simulated truth or a reference; deviations are NaN."""
    unknown, joints = np.full(q.shape, np.nan), model.describe()["joints"]
    return Track(
        model=model,
        time_s=time_s.copy(),
        joint_names=tuple(model.joint_names),
        joint_units=joint_units(model, joints),
        coordinate_names=tuple(model.coordinate_names),
        coordinate_units=coordinate_units(model, joints),
        angle_sequences=angle_sequences(model, joints),
        q=q,
        qd=unknown if qd is None else qd,
        qdd=unknown if qdd is None else qdd,
        q_std=unknown,
        qd_std=unknown,
        qdd_std=unknown,
        observed=np.isfinite(q),
        provenance=provenance,
    )


def track_of_run(model: Model, run: Run, notes: tuple[str, ...], provenance: Mapping[str, Any]) -> Track:
    """A Track from what the engine returned; its arrays are made when they are asked for."""
    states = {name: i for i, name in enumerate(run.state_names)}
    names, joints = model.coordinate_names, model.describe()["joints"]

    def estimates(suffix: str, std: bool) -> Floats:
        return run.states([states.get(name + suffix) for name in names], std)

    def q() -> Floats:
        values = estimates("", False)
        columns, readings = run.inputs()
        values[:, columns] = readings
        return values

    def q_std() -> Floats:
        values = estimates("", True)
        columns, readings = run.inputs()
        known = {joint["name"]: joint["std"] for joint in joints if joint["input"]}
        values[:, columns] = np.where(np.isnan(readings), np.nan, [known[names[c]] for c in columns])
        return values

    def later(make: Callable[[], Any]) -> Any:
        return Later(make)

    return Track(
        model=model,
        time_s=run.time_s(),
        joint_names=tuple(model.joint_names),
        joint_units=joint_units(model, joints),
        coordinate_names=tuple(names),
        coordinate_units=coordinate_units(model, joints),
        angle_sequences=angle_sequences(model, joints),
        q=later(q),
        qd=later(lambda: estimates(".velocity", False)),
        qdd=later(lambda: estimates(".acceleration", False)),
        q_std=later(q_std),
        qd_std=later(lambda: estimates(".velocity", True)),
        qdd_std=later(lambda: estimates(".acceleration", True)),
        observed=later(lambda: run.observed().astype(bool)),
        slow=later(lambda: _slow(run, states, model)),
        info=later(lambda: _info(run)),
        beliefs=later(lambda: _beliefs(run)),
        notes=tuple(dict.fromkeys(notes)),
        provenance=MappingProxyType(dict(provenance)),
        smoothed=run.smoothed,
        last_belief=run.last_belief,
        run=run,
    )


def _keep(value: Any) -> Any:
    """The value, if an array then read-only."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    return value


def _info(run: Run) -> SensorInfo:
    found = run.infos()
    counts = {
        name: found[name].astype(np.int64) for name in ("used", "rejected", "missing", "field", "fault")
    }
    return SensorInfo(
        sensor_names=tuple(run.source_names),
        nis=found["nis"],
        inertial_nis=found["inertial_nis"],
        inertial_used=found["inertial_used"].astype(np.int64),
        **counts,
    )


def _slow(run: Run, states: Mapping[str, int], model: Model) -> Mapping[str, SlowSeries]:
    moving = {name + rate for name in model.coordinate_names for rate in ("", ".velocity", ".acceleration")}
    names = [name for name in states if name not in moving]
    value, std = (run.states([states[name] for name in names], which) for which in (False, True))
    return MappingProxyType(
        {name: SlowSeries(value[:, i], std[:, i], _slow_unit(name)) for i, name in enumerate(names)}
    )


def _slow_unit(name: str) -> str:
    if name == "azimuth" or ".mount_r" in name:
        return "rad"
    if name.startswith("parameters."):
        return "m"
    if ".gyro_bias" in name:
        return "rad/s"
    return "m/s3" if name.endswith(".rate") else "m/s2"


def _beliefs(run: Run) -> Beliefs:
    beliefs = run.beliefs()
    n = len(run.state_names)
    return Beliefs(
        np.array([b[0] for b in beliefs]),
        np.array([b[1] for b in beliefs]).reshape(-1, n),
        np.array([b[2] for b in beliefs]).reshape(-1, n, n),
        tuple(run.state_names),
    )
