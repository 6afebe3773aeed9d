"""The result of tracking (`Track`): estimates, frame positions, tables and files. Returned by `track` and `smooth`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.model.coordinates import angle_sequences, coordinate_units, joint_units
from oarlock.model.rotation import continuous_quat, quat_from_matrix
from oarlock.storage.arrays import Floats
from oarlock.storage.dataframes import pandas_table, polars_table, xarray_dataset
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.tracking.columns import columns_of, unit_of
from oarlock.tracking.counts import StreamCount
from oarlock.tracking.estimates import Estimates, Later
from oarlock.tracking.folder import read_track, write_track
from oarlock.tracking.html import track_html
from oarlock.tracking.notes import Note
from oarlock.tracking.places import (
    OFF_AXIS,
    PositionSpread,
    model_of,
    poses_of,
    position_spreads,
    relative_positions,
    rotation_stds,
)
from oarlock.tracking.plot import Panel, plot_track
from oarlock.tracking.records import Beliefs, SensorInfo, SlowSeries
from oarlock.tracking.turns import NotesOfRun, hinges_of, placed, turn_notes, without_turn_notes

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import xarray as xr
    from matplotlib.axes import Axes

    from oarlock._core import Belief, Model, Run
    from oarlock.recording.calibration import Calibration


class Track(Estimates):
    """Estimates over `time_s` (T,), with the fields of `Estimates`. Immutable.

    Positions, in m, and rotations of frames are relative to frame `relative_to`. They are NaN where a reading is
    missing; a joint without any reading counts as 0. DataError: no such frame, or no model.
    """

    def with_notes(self, *sentences: str) -> Track:
        """The track with these sentences before its notes."""
        return self._changed({"notes": tuple(dict.fromkeys((*map(Note, sentences), *self.notes)))})

    def __repr__(self) -> str:
        kind = "smoothed" if self.smoothed else "filtered" if self.info else "simulated"
        rows = len(self.time_s)
        span = f"{self.time_s[0]:.2f} to {self.time_s[-1]:.2f} s" if rows else "empty"
        return f"Track({kind}, {rows} samples, {span}, {len(self)} joints)"

    def frame_positions(self, frame: str, relative_to: str = "root") -> Floats:
        """Origin of a frame, (T, 3), with estimated lengths."""
        own, reference = self._frames("frame_positions", frame, relative_to)
        return relative_positions(poses_of(self), [own], reference)[:, 0]

    def positions_of(self, frames: Sequence[str], relative_to: str = "root") -> Floats:
        """Origins of K frames, (T, K, 3)."""
        *own, reference = self._frames("positions_of", *frames, relative_to)
        return relative_positions(poses_of(self), own, reference)

    def frame_position_spread(self, frame: str, relative_to: str = "root") -> PositionSpread:
        """Covariances (T, 3, 3) of `frame_positions`, m2, and their source."""
        own, reference = self._frames("frame_position_spread", frame, relative_to)
        covariance, source = position_spreads(self, [own], reference)
        return PositionSpread(covariance[:, 0], source)

    def frame_position_stds(self, frame: str, relative_to: str = "root") -> Floats:
        """Standard deviations (T, 3) of `frame_positions`."""
        return self.frame_position_spread(frame, relative_to).std_m

    def frame_quat_wxyz(self, frame: str, relative_to: str = "root") -> Floats:
        """Rotation `relative_to`-from-`frame`, (T, 4), signs continuous."""
        own, reference = self._frames("frame_quat_wxyz", frame, relative_to)
        poses = poses_of(self)[..., :3, :3]
        turned = np.einsum("tji,tjk->tik", poses[:, reference], poses[:, own])
        return continuous_quat(quat_from_matrix(turned))

    def frame_rotation_stds(self, frame: str, relative_to: str = "root") -> Floats:
        """Standard deviations (T, 3) of `frame_quat_wxyz` about the axes of `frame`, rad."""
        own, reference = self._frames("frame_rotation_stds", frame, relative_to)
        return rotation_stds(self, own, reference)

    def _frames(self, asked: str, *frames: str) -> list[int]:
        """Indices of frames in the model."""
        names = model_of(self, asked).frame_names
        for name in frames:
            if name not in names:
                raise DataError(f"{asked}: no frame '{name}'. {did_you_mean(name, names)}")
        return [names.index(name) for name in frames]

    def columns(self) -> dict[str, Floats]:
        """Arrays (T,) by names with unit, such as `trunk_rad`, `shoulder_quat_w`."""
        return columns_of(self)

    def column(self, name: str) -> Floats:
        """One of `columns`."""
        columns = self.columns()
        if name not in columns:
            raise DataError(f"no column '{name}'. {did_you_mean(name, columns)}")
        return columns[name]

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame of `columns`."""
        return pandas_table(self.columns())

    def to_polars(self) -> pl.DataFrame:
        """A DataFrame of `columns`; missing numbers are NaN."""
        return polars_table(self.columns())

    def to_xarray(self) -> xr.Dataset:
        """A Dataset of `columns` with units."""
        return xarray_dataset(self.columns(), unit_of)

    def plot(
        self,
        joints: Panel | Sequence[Panel] | None = None,
        *,
        truth: Track | None = None,
        axes: Sequence[Axes] | None = None,
    ) -> list[Axes]:
        """Draw joints with 95 % bands, deg and cm; dotted where the sensors do not determine them.

        Joints in a tuple share a panel; None draws all observed ones. `truth` is dashed; `axes` are of matplotlib,
        one a panel.
        """
        return plot_track(self, joints, truth, axes)

    def _repr_html_(self) -> str:
        return track_html(self)

    def save(self, folder: str | PathLike[str], *, force: bool = False) -> None:
        """Write a folder for `load_track`; an earlier track there is replaced, other files only by `force`.

        Raises:
            DataError: the folder cannot be written; it is unchanged.
        """
        write_track(self, folder, force)


def load_track(folder: str | PathLike[str]) -> Track:
    """Read a folder that `Track.save` wrote.

    Raises:
        DataError: no track, or a damaged file.
    """
    return Track(**read_track(folder))


def track_without_filter(
    model: Model,
    time_s: Floats,
    q: Floats,
    qd: Floats | None = None,
    qdd: Floats | None = None,
    *,
    provenance: Mapping[str, Any],
    **others: Any,
) -> Track:
    """A Track from given values, (T, n_coordinates) each: a simulated ground truth or a reference.

    Standard deviations are NaN and finite values count as observed, unless `others` (fields of `Estimates`) say more.
    """
    unknown, joints = np.full(q.shape, np.nan), model.describe().joints
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
        provenance=provenance,
        **{**dict.fromkeys(("q_std", "qd_std", "qdd_std"), unknown), "observed": np.isfinite(q), **others},
    )


def track_of_beliefs(
    model: Model, time_s: Floats, means: Floats, stds: Floats, beliefs: Sequence[tuple[float, Belief]]
) -> Track:
    """A Track of state estimates that a `Tracker` returned, such as the last seconds of a live session.

    Args:
        model: of the tracker; its encoders are sensors (`Config.inputs` without them).
        time_s: (T,) of the estimates, s.
        means: (T, n) their means.
        stds: (T, n) their standard deviations.
        beliefs: some of them with their times, say one each second, at least one: they have the names of the states,
            and the correlations between coordinates.
    """
    times, whole = zip(*beliefs, strict=True)
    names = list(whole[0].state_names)
    some = Beliefs(
        np.array(times),
        np.array([belief.mean for belief in whole]),
        np.array([belief.covariance for belief in whole]),
        tuple(names),
    )
    known: dict[str, Floats] = {}
    for field_name, suffix in (("q", ""), ("qd", ".velocity"), ("qdd", ".acceleration")):
        columns = [names.index(n + suffix) if n + suffix in names else -1 for n in model.coordinate_names]
        missing = np.array(columns) < 0
        for key, rows in ((field_name, means), (f"{field_name}_std", stds)):
            known[key] = np.where(missing, np.nan, rows[:, columns])
    return track_without_filter(model, time_s, provenance={}, beliefs=some, **known)


def track_of_run(
    model: Model,
    run: Run,
    notes: tuple[str, ...],
    provenance: Mapping[str, Any],
    counts: tuple[StreamCount, ...],
    calibration: Calibration | None = None,
) -> Track:
    """A Track from the engine's run. Its arrays are computed when they are first read."""
    states = {name: i for i, name in enumerate(run.state_names)}
    names, joints = model.coordinate_names, model.describe().joints
    hinges = hinges_of(joints, names)

    def estimates(suffix: str, std: bool) -> Floats:
        return run.states([states.get(name + suffix) for name in names], std)

    def q() -> Floats:
        values = estimates("", False)
        columns, readings = run.inputs()
        values[:, columns] = readings
        return placed(hinges, values, lambda: estimates(".velocity", False), run.time_s())

    def hinge_notes() -> tuple[str, ...]:
        return turn_notes(hinges, q(), run.observed().astype(bool))

    def q_std() -> Floats:
        values = estimates("", True)
        columns, _ = run.inputs()
        # Where an input has no reading, its estimate is its rest and its band the prior: the soft limits are two
        # standard deviations from their middle.
        known = {joint.name: (joint.std or 0.0, np.ptp(joint.limits) / 4) for joint in joints if joint.input}
        read = run.observed()[:, columns] == 1
        stds = np.array([known[names[c]] for c in columns]).reshape(len(columns), 2)
        values[:, columns] = np.where(read, stds[:, 0], stds[:, 1])
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
        notes=later(NotesOfRun(tuple(notes), hinge_notes)),
        calibration=calibration,
        provenance=MappingProxyType(dict(provenance)),
        smoothed=run.smoothed,
        last_belief=run.last_belief,
        run=run,
        counts=counts,
    )


def notes_without_hinges(track: Track) -> tuple[str, ...]:
    """The notes that do not depend on the estimates; does not read these."""
    notes = track.__dict__["notes"]
    if isinstance(notes, Later) and isinstance(notes.make, NotesOfRun):
        return notes.make.known
    return without_turn_notes(track.notes)


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
    slow = {name: SlowSeries(value[:, i], std[:, i], _slow_unit(name)) for i, name in enumerate(names)}
    frames, turns = run.off_axis()
    for k, (frame, axis) in enumerate((frame, axis) for frame in frames for axis in "xyz"):
        slow[f"{frame}{OFF_AXIS}{axis}"] = SlowSeries(turns[:, k], np.full(len(turns), np.nan), "rad")
    return MappingProxyType(slow)


def _slow_unit(name: str) -> str:
    if ".mount_r" in name:
        return "rad/s" if name.endswith(".velocity") else "rad"
    if name == "azimuth":
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
