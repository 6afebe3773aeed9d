"""`StreamCount`: readings of a stream expected, received, missing, used, rejected. Every page shows these numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from oarlock.recording.packets import expected_quantity_rows, expected_rows, stream_rate_hz
from oarlock.recording.recording import Recording
from oarlock.recording.streams import Stream
from oarlock.tracking.records import DISTURBED, FAULT, FIELD


@dataclass(frozen=True)
class StreamCount:
    """Readings of one stream over a whole recording, against the stream's own rate.

    A reading is one number of one quantity that the model uses, such as one axis of a gyroscope. Readings of rest and
    closures come from no sensor and are counted nowhere. A magnetometer that never gave a reading is not expected to.

    Args:
        name: of the stream.
        rate_hz: its rate, Hz.
        expected: readings if the stream had its rate from the first to the last sample of the recording.
        received: readings that are numbers.
        used: readings that the filter used.
        rejected: readings that the filter tested and did not use: outliers, disturbed fields, faults.
        disturbed: share of the magnetometer's samples that failed each test (`norm`, `dip`, `innovation`), without
            tests that none failed.
        faults: share of the samples with a fault (`clipped`, `stuck`).
    """

    name: str
    rate_hz: float
    expected: int
    received: int
    used: int
    rejected: int
    disturbed: Mapping[str, float] = field(default_factory=dict)
    faults: Mapping[str, float] = field(default_factory=dict)

    @property
    def missing(self) -> int:
        """Readings that were expected and not received."""
        return self.expected - self.received

    @property
    def unused(self) -> int:
        """Readings that were received and not needed, such as those that a slow magnetometer repeats."""
        return self.received - self.used - self.rejected

    def to_dict(self) -> dict[str, Any]:
        """The fields, for run.toml."""
        return {
            name: dict(value) if isinstance(value, Mapping) else value
            for name, value in vars(self).items()
            if name != "name"
        }


def count_streams(recording: Recording, counts: Sequence[Mapping[str, Any]]) -> tuple[StreamCount, ...]:
    """The counts of a run (`Run.counts`) against the rates of the recording's streams."""
    return tuple(_count(one, recording, recording[one["name"]]) for one in counts)


def _expected(recording: Recording, stream: Stream, channels: int) -> int:
    """Readings of the channels that the model uses. Those that a slow quantity never has are not expected."""
    rows = expected_rows(recording, stream)
    slower = expected_quantity_rows(recording, stream)
    widths = {name: values.size // len(values) for name, values in stream.values.items()}
    inertial = [name for name in widths if name != "mag_ut"]
    for used in (list(widths), inertial):
        if sum(widths[name] for name in used) == channels:
            return sum(widths[name] * slower[name] for name in used)
    return rows * channels


def _count(one: Mapping[str, Any], recording: Recording, stream: Stream) -> StreamCount:
    fields = dict(zip(FIELD[1:], one["fields"][1:], strict=True))
    faults = dict(zip(FAULT, one["faults"], strict=True))
    return StreamCount(
        name=one["name"],
        rate_hz=stream_rate_hz(recording, stream),
        expected=_expected(recording, stream, one["channels"]),
        received=one["received"],
        used=one["used"],
        rejected=one["rejected"],
        disturbed=_shares(fields, DISTURBED),
        faults=_shares(faults, FAULT[1:]),
    )


def _shares(counts: Mapping[str, int], names: Sequence[str]) -> dict[str, float]:
    total = sum(counts.values())
    return {name: counts[name] / total for name in names if counts[name]}
