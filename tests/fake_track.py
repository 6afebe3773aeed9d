"""Tracks made by hand, with the attributes of a real one, for tests of what reads tracks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from oarlock.model import FrameDescription
from oarlock.storage.arrays import Bools, Floats, Ints
from oarlock.tracking.counts import StreamCount


def frame(name: str, parent: str | None, joint: str | None = None) -> FrameDescription:
    return FrameDescription(name=name, parent=parent, joint=joint, sign=1.0, before=None, after=None)


@dataclass(frozen=True)
class FakeModel:
    frame_names: tuple[str, ...] = ("root", "r_shoulder", "r_wrist", "r_handle")
    frame_parents: tuple[int, ...] = (-1, 0, 1, 2)
    name: str = "fake"

    def describe(self) -> SimpleNamespace:
        parents = [None if p < 0 else self.frame_names[p] for p in self.frame_parents]
        frames = [frame(name, parent) for name, parent in zip(self.frame_names, parents, strict=True)]
        return SimpleNamespace(frames=frames)


@dataclass(frozen=True)
class FakeSeries:
    unit: str


@dataclass(frozen=True)
class FakeSlow:
    value: Floats
    std: Floats
    unit: str


@dataclass(frozen=True)
class FakeInfo:
    sensor_names: tuple[str, ...]
    nis: Floats
    used: Ints
    rejected: Ints
    missing: Ints
    inertial_nis: Floats
    inertial_used: Ints
    field: Ints
    fault: Ints


@dataclass(frozen=True)
class FakeBeliefs:
    time_s: Floats
    mean: Floats
    covariance: Floats
    state_names: tuple[str, ...]


@dataclass(frozen=True)
class FakeTrack:
    """The attributes of a track that evaluation and report read."""

    time_s: Floats
    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    q: Floats
    qd: Floats
    qdd: Floats
    q_std: Floats
    observed: Bools
    model: FakeModel | None = None
    positions: Mapping[str, Floats] = field(default_factory=dict)
    position_std_m: float = np.nan
    slow: Mapping[str, FakeSlow] = field(default_factory=dict)
    info: FakeInfo | None = None
    beliefs: FakeBeliefs | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    smoothed: bool = False
    counts: tuple[StreamCount, ...] = ()

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        return self.joint_names

    @property
    def epoch(self) -> str | None:
        return self.provenance.get("epoch")

    def __getitem__(self, name: str) -> FakeSeries:
        return FakeSeries(self.units[self.joint_names.index(name)])

    def frame_positions(self, frame: str, relative_to: str = "root") -> Floats:
        return self.positions[frame]

    def positions_of(self, frames: Sequence[str]) -> Floats:
        return np.stack([self.frame_positions(frame) for frame in frames], axis=1)

    def frame_position_stds(self, frame: str, relative_to: str = "root") -> Floats:
        return np.full_like(self.positions[frame], self.position_std_m)


def motion(time_s: Floats, units: tuple[str, ...]) -> tuple[Floats, Floats, Floats]:
    """Smooth joint values and their two derivatives, (T, J) each: one sine per joint."""
    columns = [_sine(time_s, 0.8 + 0.1 * j, 0.3 + 0.2 * j) for j in range(len(units))]
    q, qd, qdd = (np.stack(parts, axis=1) for parts in zip(*columns, strict=True))
    return q, qd, qdd


def _sine(time_s: Floats, amplitude: float, frequency_hz: float) -> tuple[Floats, Floats, Floats]:
    w = 2 * np.pi * frequency_hz
    wave, slope = np.sin(w * time_s), np.cos(w * time_s)
    return amplitude * wave, amplitude * w * slope, -amplitude * w * w * wave


def true_track(time_s: Floats, joint_names: tuple[str, ...], units: tuple[str, ...]) -> FakeTrack:
    """Truth along ``motion``; frames on a unit circle that follows the first joint."""
    q, qd, qdd = motion(time_s, units)
    model = FakeModel()
    circle = np.stack([np.cos(q[:, 0]), np.sin(q[:, 0]), np.zeros(len(time_s))], axis=1)
    return FakeTrack(
        time_s=time_s,
        joint_names=joint_names,
        units=units,
        q=q,
        qd=qd,
        qdd=qdd,
        q_std=np.full(q.shape, np.nan),
        observed=np.ones(q.shape, dtype=bool),
        model=model,
        positions={name: circle * (k + 1) for k, name in enumerate(model.frame_names)},
    )


def noisy_track(truth: FakeTrack, std: float, seed: int = 0, claimed: float | None = None) -> FakeTrack:
    """Truth plus independent Gaussian errors of ``std`` in every joint; the track claims ``claimed`` (default: std)."""
    rng = np.random.default_rng(seed)
    claimed = std if claimed is None else claimed
    return replace(
        truth,
        q=truth.q + std * rng.standard_normal(truth.q.shape),
        q_std=np.full(truth.q.shape, claimed),
        info=healthy_info(len(truth.time_s), rng),
        slow={
            "surge": FakeSlow(np.sin(truth.time_s), np.full(len(truth.time_s), 0.1), "m/s2"),
            "back.gyro_bias_x": FakeSlow(
                np.full(len(truth.time_s), 0.01), np.full(len(truth.time_s), 1e-3), "rad/s"
            ),
        },
        provenance={
            "version": "0.1.0",
            "config": {"filter": "ukf", "closures": True},
            "nominal_mounts": ["back"],
        },
        notes=("theta: not observed (no stream)",),
        counts=healthy_counts(len(truth.time_s)),
    )


def healthy_counts(samples: int) -> tuple[StreamCount, ...]:
    """Of the two sensors of `healthy_info` that have a stream: nothing is missing, ten readings are rejected."""
    rows = {"back": 9 * samples, "seat": samples}
    return tuple(StreamCount(name, 100.0, n, n, n - 10, 10) for name, n in rows.items())


def healthy_info(samples: int, rng: np.random.Generator) -> FakeInfo:
    """Three sensors of 9, 1 and 6 rows whose NIS is chi-square; the last one silent every other sample."""
    rows = np.array([9, 1, 6])
    used = np.tile(rows, (samples, 1))
    nis = rng.chisquare(used).astype(float)
    used[1::2, 2], nis[1::2, 2] = 0, np.nan
    missing = np.tile(rows, (samples, 1)) - used
    sensors = ("back", "seat", "r_grip")
    none = np.zeros_like(used)
    return FakeInfo(sensors, nis, used, none, missing, nis[:, 0], used[:, 0], none, none)


def with_beliefs(
    track: FakeTrack, truth: FakeTrack, covariance: Floats, every: int, seed: int = 0
) -> FakeTrack:
    """Beliefs over all joints' angle, velocity and acceleration, drawn from N(truth, covariance)."""
    rng = np.random.default_rng(seed)
    names = tuple(f"{j}{s}" for j in track.joint_names for s in ("", ".velocity", ".acceleration"))
    true = np.stack([truth.q, truth.qd, truth.qdd], axis=2).reshape(len(truth.time_s), -1)[::every]
    mean = true + rng.multivariate_normal(np.zeros(len(names)), covariance, size=len(true))
    stack = np.repeat(covariance[None], len(true), axis=0)
    return replace(track, beliefs=FakeBeliefs(truth.time_s[::every], mean, stack, names))
