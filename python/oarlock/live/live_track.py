"""The track of a live session from its packets: the estimates that it made, bit for bit, as an ordinary `Track`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

import oarlock
from oarlock.live.session import Estimate, LiveSession, recorded
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError
from oarlock.tracking.notes import Note
from oarlock.tracking.records import FAULT, FIELD, SensorInfo, SlowSeries
from oarlock.tracking.track import track_of_beliefs

if TYPE_CHECKING:
    from oarlock import Model, Track
    from oarlock._core import Belief
    from oarlock.live.folder import LiveFolder

Progress = Callable[[float], object]
_ARRAYS = ("q", "qd", "qdd", "q_std", "qd_std", "qdd_std")
_COUNTS = ("used", "rejected", "missing")


def live_track(folder: LiveFolder, model: Model, progress: Progress = lambda share: None) -> Track:
    """Repeat a session from its packets, and give the estimates that it made.

    Estimates, standard deviations and the use of readings are those of the live session. Which joints are observed, the
    counts of readings and the notes need a look at the whole: they are those of a track of the recording.

    Args:
        folder: of the session.
        model: of its rig.
        progress: called with the share done, 0 to 1.

    Raises:
        DataError: the packets have no reading of a sensor, or the session was never tracked.
    """
    session = folder.session(model)
    rows = _Rows(session.config.belief_interval_s)
    from_s: float | None = None
    for estimate in _repeated(folder, session, progress):
        from_s = session.from_s if from_s is None else from_s
        rows.add(estimate)
    recording = recorded(folder.read(), folder.rig(model), folder.start_ns, epoch=folder.epoch)
    if from_s is None:
        raise DataError(
            f"{folder.path}: the session was not tracked, so it has no estimates. Its recording can be: "
            f"oarlock track {folder.path / 'recording'} --model {session.rig.model} --out TRACK"
        )
    measured = recording.slice(start_s=from_s)
    whole = oarlock.track(model, measured, session.calibration, session.config)
    return _with_whole(rows, rows.track(model), whole)


@dataclass
class _Rows:
    """Estimates as rows; whole beliefs only now and then, because covariances are large."""

    belief_every_s: float
    time_s: list[float] = field(default_factory=list)
    means: list[Floats] = field(default_factory=list)
    stds: list[Floats] = field(default_factory=list)
    sensors: list[Mapping[str, Mapping[str, Any]]] = field(default_factory=list)
    inertial: list[tuple[float, int]] = field(default_factory=list)
    beliefs: list[tuple[float, Belief]] = field(default_factory=list)

    def add(self, estimate: Estimate) -> None:
        belief, info = estimate.belief, estimate.info
        # Tracking that was stopped and started again may begin at a time that was estimated before.
        if self.time_s and estimate.time_s <= self.time_s[-1]:
            return
        self.time_s.append(estimate.time_s)
        self.means.append(belief.mean)
        self.stds.append(belief.std)
        self.sensors.append(info.sensors)
        self.inertial.append(info.inertial)
        if not self.beliefs or estimate.time_s >= self.beliefs[-1][0] + self.belief_every_s:
            self.beliefs.append((estimate.time_s, belief))

    def track(self, model: Model) -> Track:
        return track_of_beliefs(
            model, np.array(self.time_s), np.array(self.means), np.array(self.stds), self.beliefs
        )

    def info(self) -> SensorInfo:
        names = tuple(self.sensors[0])

        def table(key: str) -> list[list[Any]]:
            return [[one[name][key] for name in names] for one in self.sensors]

        def places(key: str, words: tuple[str, ...]) -> Ints:
            return np.array([[words.index(word) for word in row] for row in table(key)], dtype=np.int64)

        nis, used = zip(*self.inertial, strict=True)
        return SensorInfo(
            sensor_names=names,
            nis=np.array(table("nis"), dtype=float),
            inertial_nis=np.array(nis),
            inertial_used=np.array(used, dtype=np.int64),
            field=places("field", FIELD),
            fault=places("fault", FAULT),
            **{key: np.array(table(key), dtype=np.int64) for key in _COUNTS},
        )

    def slow(self, whole: Track, nearest: Ints) -> dict[str, SlowSeries]:
        """Of the live states; turns off the axes of hinges are no states, and are those of the whole recording."""
        column = {name: k for k, name in enumerate(self.beliefs[0][1].state_names)}
        means, stds = np.array(self.means), np.array(self.stds)
        return {
            name: SlowSeries(means[:, column[name]], stds[:, column[name]], slow.unit)
            if name in column
            else SlowSeries(slow.value[nearest], slow.std[nearest], slow.unit)
            for name, slow in whole.slow.items()
        }


def _repeated(folder: LiveFolder, session: LiveSession, progress: Progress) -> Iterator[Estimate]:
    """The estimates of a session, one after the other."""
    packets = sum(1 for _ in folder.read())
    for number, packet in enumerate(folder.read()):
        yield from session.take(packet)
        if number % 1000 == 0:
            progress(number / packets)


def _with_whole(rows: _Rows, made: Track, whole: Track) -> Track:
    """The live estimates with what a track of the whole recording says of them."""
    nearest = np.searchsorted(whole.time_s, made.time_s).clip(0, len(whole.time_s) - 1)
    # A joint that should have been read and never was is no state of the tracker: its estimate is its rest.
    arrays = {
        name: np.where(np.isnan(getattr(made, name)), getattr(whole, name)[nearest], getattr(made, name))
        for name in _ARRAYS
    }
    return replace(
        made,
        **arrays,
        model=whole.model,
        observed=whole.observed[nearest],
        slow=rows.slow(whole, nearest),
        info=rows.info(),
        notes=(*map(Note, _notes(made, whole, nearest)), *whole.notes),
        counts=whole.counts,
        provenance={**whole.provenance, "live": True, "steps": len(made.time_s)},
    )


def _notes(made: Track, whole: Track, nearest: Ints) -> Iterator[str]:
    """Whether readings that came late would have moved live estimates."""
    same = (whole.q[nearest] == made.q) | np.isnan(made.q)
    differ = int((~same.all(axis=1)).sum())
    if differ:
        yield (
            f"{differ:,} of {len(made.time_s):,} live estimates differ from those of the whole recording: readings "
            "came after them, or tracking was stopped. For the best angles run `oarlock track` on the recording."
        )
