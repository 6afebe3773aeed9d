"""Summary of a track in a few numbers: rows, rates, observed joints, readings, speed. For terminal, report and JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.evaluation.consistency import sensor_scores
from oarlock.evaluation.errors import OBSERVED_SHARE
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.scores import SensorScore
from oarlock.model.coordinates import joint_columns
from oarlock.recording.session_info import session_info
from oarlock.storage.epoch import moment_text
from oarlock.tracking.counts import StreamCount
from oarlock.tracking.track import Track

RATES_ALIKE = 0.005
"""Relative difference of rates that are written as one."""
LEAST_SHARE = 0.0005
"""A smaller share would be printed as 0.0 %, and is left out."""


@dataclass(frozen=True)
class TrackSummary:
    """Key figures of a track for the top of a page.

    `structure` is how it was tracked, "strapdown" or "tree", empty if that is not known.
    `session` says who was recorded and when (`recording.session_info`), empty if it is not known. `start` is the moment
    of the first row as text, empty if it is not known. `samples` counts the rows of the track and
    `rate_hz` is their rate; each stream has its own (`stream_rates`).
    `steps_per_s` is None for a track without a filter run, and `real_time_factor` is the recording's time divided by
    the time of computation. `readings` are the sums over all streams.
    """

    model: str
    structure: str
    session: Mapping[str, str]
    samples: int
    duration_s: float
    start: str
    rate_hz: float
    stream_rates: str
    steps_per_s: float | None
    real_time_factor: float | None
    smoothed: bool
    joints: int
    joints_observed: int
    not_observed: tuple[str, ...]
    notes: tuple[str, ...]
    readings: ReadingCounts | None
    sensors: tuple[SensorScore, ...]


@dataclass(frozen=True)
class ReadingCounts:
    """Sums of the counts of all streams."""

    expected: int
    received: int
    missing: int
    used: int
    rejected: int
    unused: int

    @property
    def used_share(self) -> float:
        """Used readings divided by expected ones."""
        return self.used / self.expected if self.expected else math.nan

    def text(self) -> str:
        """Such as "120 rejected, 0 missing"."""
        unused = f", {self.unused:,} not needed" if self.unused else ""
        return f"{self.rejected:,} rejected, {self.missing:,} missing{unused}"


def summarize(track: Track) -> TrackSummary:
    """The summary of a track. That of a simulated ground truth contains no sensors."""
    duration_s = float(track.time_s[-1] - track.time_s[0]) if len(track.time_s) else 0.0
    seen = observed_joints(track)
    steps_per_s, wall_s = track.provenance.get("steps_per_s"), track.provenance.get("wall_s")
    return TrackSummary(
        model=str(getattr(track.model, "name", track.provenance.get("model", "unknown"))),
        structure=str(track.provenance.get("structure", "")),
        session=session_info(track.provenance),
        samples=len(track.time_s),
        duration_s=duration_s,
        start=moment_text(track.provenance.get("epoch"), float(track.time_s[0])) if len(track.time_s) else "",
        rate_hz=row_rate_hz(track),
        stream_rates=stream_rates(track.counts),
        steps_per_s=None if steps_per_s is None else float(steps_per_s),
        real_time_factor=duration_s / float(wall_s) if wall_s else None,
        smoothed=bool(track.smoothed),
        joints=len(track.joint_names),
        joints_observed=len(seen),
        not_observed=tuple(name for name in track.joint_names if name not in seen),
        notes=tuple(track.notes),
        readings=readings(track.counts),
        sensors=sensor_scores(track, Interval(-math.inf, math.inf)),
    )


def observed_joints(track: Track) -> list[str]:
    """Names of the joints that were observed, in all their coordinates, in at least half of the rows."""
    columns = joint_columns(track.coordinate_names)
    observed = np.asarray(track.observed, dtype=bool)
    share = {name: np.mean(observed[:, list(own)].all(axis=1)) for name, own in columns.items()}
    return [name for name in track.joint_names if share[name] >= OBSERVED_SHARE]


def row_rate_hz(track: Track) -> float:
    """Rows of a track per second, to nine digits: time stamps have no more; NaN for a single row."""
    duration_s = float(track.time_s[-1] - track.time_s[0]) if len(track.time_s) else 0.0
    return float(f"{(len(track.time_s) - 1) / duration_s:.9g}") if duration_s > 0.0 else math.nan


def stream_rates(counts: Sequence[StreamCount]) -> str:
    """The rates of all streams, each rate once: "100 Hz (7 streams), 20 Hz (seat)"."""
    groups: list[list[StreamCount]] = []
    for count in sorted(counts, key=lambda count: -count.rate_hz):
        if groups and abs(groups[-1][0].rate_hz - count.rate_hz) <= RATES_ALIKE * count.rate_hz:
            groups[-1].append(count)
        elif math.isfinite(count.rate_hz):
            groups.append([count])
    if len(groups) == 1:
        return f"{rate_text(groups[0][0].rate_hz)} Hz"
    who = (group[0].name if len(group) == 1 else f"{len(group)} streams" for group in groups)
    return ", ".join(
        f"{rate_text(group[0].rate_hz)} Hz ({name})" for group, name in zip(groups, who, strict=True)
    )


def rate_text(rate_hz: float) -> str:
    """A rate with four digits, without its unit; a dash where there is none."""
    return f"{float(f'{rate_hz:.4g}'):,.10g}" if math.isfinite(rate_hz) else "-"


def readings(counts: Sequence[StreamCount]) -> ReadingCounts | None:
    """The sums over all streams; None if no stream was counted."""
    if not counts:
        return None
    names = ("expected", "received", "missing", "used", "rejected", "unused")
    return ReadingCounts(**{name: sum(getattr(count, name) for count in counts) for name in names})


def shares_text(shares: Mapping[str, float]) -> str:
    """Shares of disturbed or faulty samples by name, such as "norm 3.1 %"."""
    return ", ".join(f"{name} {100 * share:.1f} %" for name, share in shares.items() if share >= LEAST_SHARE)
