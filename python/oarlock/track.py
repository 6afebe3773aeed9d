"""The result of tracking: arrays over time by name, standard deviations, infos and provenance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from oarlock.errors import DataError
from oarlock.suggest import did_you_mean

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from oarlock._core import Belief, Model, Run

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class JointSeries:
    """One joint over time, (T,) each: rad for hinges, m for slides, per s and per s2; NaN where there is none."""

    name: str
    unit: str
    value: Floats
    velocity: Floats
    acceleration: Floats
    std: Floats
    velocity_std: Floats
    acceleration_std: Floats
    observed: Bools

    def __getattr__(self, name: str) -> Floats:
        """`angle_rad`, `velocity_rad_s`, `std_rad` of a hinge; `position_m`, `velocity_m_s`, `std_m` of a slide."""
        unit = self.__dict__.get("unit", "")
        names = {
            ("angle_rad" if unit == "rad" else "position_m"): "value",
            f"std_{unit}": "std",
            f"velocity_{unit}_s": "velocity",
            f"velocity_std_{unit}_s": "velocity_std",
            f"acceleration_{unit}_s2": "acceleration",
            f"acceleration_std_{unit}_s2": "acceleration_std",
        }
        if name not in names:
            kind = "hinge" if unit == "rad" else "slide"
            raise AttributeError(f"a {kind} has no '{name}'; it has {', '.join(names)}, observed")
        values: Floats = self.__dict__[names[name]]
        return values


@dataclass(frozen=True)
class SlowSeries:
    """A bias, an acceleration of the base or the field's azimuth over time, (T,) each."""

    value: Floats
    std: Floats
    unit: str


@dataclass(frozen=True)
class SensorInfo:
    """What each update did with each sensor and closure: (T, S) each. NIS is NaN where nothing was used.

    `inertial_nis` (T,) is that of all inertial readings of a sample together, `inertial_used` (T,) their number.
    """

    sensor_names: tuple[str, ...]
    nis: Floats
    used: NDArray[np.int64]
    rejected: NDArray[np.int64]
    missing: NDArray[np.int64]
    inertial_nis: Floats
    inertial_used: NDArray[np.int64]


@dataclass(frozen=True)
class Beliefs:
    """Full beliefs every few seconds: (B,) s, (B, n), (B, n, n); states in SI and rad."""

    time_s: Floats
    mean: Floats
    covariance: Floats
    state_names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Track:
    """Estimates over `time_s` (T,). Never changes; `oarlock.smooth` gives another one.

    Args:
        model: what was tracked; None if its file could not be found again after loading.
        time_s: (T,) s.
        joint_names: order of the columns of `q` and its kin, (T, n_joints), rad or m.
        joint_units: "rad" or "m" each.
        observed: (T, n_joints) whether the sensors pin the joint down.
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
    slow: Mapping[str, SlowSeries] = field(default_factory=dict)
    info: SensorInfo | None = None
    beliefs: Beliefs | None = None
    notes: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    smoothed: bool = False
    last_belief: Belief | None = None
    run: Run | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name in ("time_s", "q", "qd", "qdd", "q_std", "qd_std", "qdd_std", "observed"):
            getattr(self, name).flags.writeable = False
        object.__setattr__(self, "slow", MappingProxyType(dict(self.slow)))

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the engine's run: an unpickled track cannot be smoothed, like one read from files."""
        plain = {"slow": dict(self.slow), "provenance": dict(self.provenance), "run": None}
        return self.__dict__ | plain

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    def __getitem__(self, name: str) -> JointSeries:
        """The joint of this name."""
        if name not in self.joint_names:
            raise KeyError(f"no joint '{name}'. {did_you_mean(name, self.joint_names)}")
        i = self.joint_names.index(name)
        return JointSeries(
            name=name,
            unit=self.joint_units[i],
            value=self.q[:, i],
            velocity=self.qd[:, i],
            acceleration=self.qdd[:, i],
            std=self.q_std[:, i],
            velocity_std=self.qd_std[:, i],
            acceleration_std=self.qdd_std[:, i],
            observed=self.observed[:, i],
        )

    def __len__(self) -> int:
        return len(self.time_s)

    def __repr__(self) -> str:
        kind = "smoothed" if self.smoothed else "filtered" if self.info else "simulated"
        span = f"{self.time_s[0]:.2f} to {self.time_s[-1]:.2f} s" if len(self) else "empty"
        return f"Track({kind}, {len(self)} samples, {span}, {len(self.joint_names)} joints)"

    def frame_positions(self, frame: str, relative_to: str = "root") -> Floats:
        """Origin of a frame over time, (T, 3) in m, in the axes of frame `relative_to`.

        A joint that no stream ever told (the turn of a grip, say) is taken at 0; where a reading that was needed is
        missing, the position is NaN.

        Raises:
            DataError: no such frame, or the track has no model.
        """
        if self.model is None:
            raise DataError(
                "frame_positions: this track was loaded without its model; load the model file again"
            )
        names = self.model.frame_names
        for name in (frame, relative_to):
            if name not in names:
                raise DataError(f"frame_positions: no frame '{name}'. {did_you_mean(name, names)}")
        q = np.where(np.isnan(self.q).all(axis=0), 0.0, self.q)
        poses = self.model.forward_kinematics(q)
        away = poses[:, names.index(frame), :3, 3]
        reference = poses[:, names.index(relative_to)]
        moved: Floats = np.einsum("tji,tj->ti", reference[:, :3, :3], away - reference[:, :3, 3])
        return moved

    def columns(self) -> dict[str, Floats]:
        """Every array under a plain column name with its unit, (T,) each, `time_s` first."""
        found: dict[str, Floats] = {"time_s": self.time_s}
        for name in self.joint_names:
            s = self[name]
            u = s.unit
            found |= {f"{name}_{u}": s.value, f"{name}_std_{u}": s.std}
            found |= {f"{name}_velocity_{u}_s": s.velocity, f"{name}_velocity_std_{u}_s": s.velocity_std}
            found |= {f"{name}_acceleration_{u}_s2": s.acceleration}
            found |= {f"{name}_acceleration_std_{u}_s2": s.acceleration_std}
            found[f"{name}_observed"] = s.observed.astype(np.float64)
        for name, slow in self.slow.items():
            found |= {f"{name} [{slow.unit}]": slow.value, f"{name} std [{slow.unit}]": slow.std}
        return found

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
        from oarlock.io.track_folder import write_track

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
    from oarlock.io.track_folder import read_track

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
    """A Track that no filter made, (T, n_joints) each: a simulated truth or a reference. Its deviations are NaN."""
    unknown = np.full(q.shape, np.nan)
    return Track(
        model=model,
        time_s=time_s.copy(),
        joint_names=tuple(model.joint_names),
        joint_units=joint_units(model),
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
    """A Track from what the engine returned."""
    arrays = run.arrays()
    states = {name: i for i, name in enumerate(run.state_names)}
    shape = arrays["inputs"].shape
    columns = {}
    for suffix, kind in (("", "q"), (".velocity", "qd"), (".acceleration", "qdd")):
        for source, label in (("mean", kind), ("std", f"{kind}_std")):
            values = arrays["inputs"].copy() if label == "q" else np.full(shape, np.nan)
            for j, name in enumerate(model.joint_names):
                if name + suffix in states:
                    values[:, j] = arrays[source][:, states[name + suffix]]
            columns[label] = values
    joints = model.describe()["joints"]
    for j, joint in enumerate(joints):
        if joint["input"]:
            columns["q_std"][:, j] = np.where(np.isnan(columns["q"][:, j]), np.nan, joint["std"])
    return Track(
        model=model,
        time_s=arrays["time_s"],
        joint_names=tuple(model.joint_names),
        joint_units=joint_units(model),
        observed=arrays["observed"].astype(bool),
        slow=_slow(arrays, states, model),
        info=_info(arrays, run),
        beliefs=_beliefs(run),
        notes=tuple(dict.fromkeys(notes)),
        provenance=MappingProxyType(dict(provenance)),
        smoothed=run.smoothed,
        last_belief=run.last_belief,
        run=run,
        **columns,
    )


def joint_units(model: Model) -> tuple[str, ...]:
    """Unit of each joint: "m" for slides, "rad" for the rest."""
    return tuple("m" if j["kind"] == "slide" else "rad" for j in model.describe()["joints"])


def _info(arrays: Mapping[str, Floats], run: Run) -> SensorInfo:
    return SensorInfo(
        sensor_names=tuple(run.source_names),
        nis=arrays["nis"],
        used=arrays["used"].astype(np.int64),
        rejected=arrays["rejected"].astype(np.int64),
        missing=arrays["missing"].astype(np.int64),
        inertial_nis=arrays["inertial_nis"],
        inertial_used=arrays["inertial_used"].astype(np.int64),
    )


def _slow(arrays: Mapping[str, Floats], states: Mapping[str, int], model: Model) -> dict[str, SlowSeries]:
    joints = set(model.joint_names)
    found = {}
    for name, i in states.items():
        if name.split(".")[0] in joints and name.rpartition(".")[2] in (name, "velocity", "acceleration"):
            continue
        unit = "rad" if name == "azimuth" else "rad/s" if ".gyro_bias" in name else "m/s2"
        found[name] = SlowSeries(arrays["mean"][:, i], arrays["std"][:, i], unit)
    return found


def _beliefs(run: Run) -> Beliefs:
    beliefs = run.beliefs()
    n = len(run.state_names)
    return Beliefs(
        np.array([b[0] for b in beliefs]),
        np.array([b[1] for b in beliefs]).reshape(-1, n),
        np.array([b[2] for b in beliefs]).reshape(-1, n, n),
        tuple(run.state_names),
    )
