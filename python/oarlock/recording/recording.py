"""`Recording`: the streams of one trial. Importers and simulators create recordings; `oarlock.track` tracks them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from oarlock.recording.epoch import epoch_of, from_zero
from oarlock.recording.folder import read_folder, write_folder
from oarlock.recording.html import rate_and_missing, recording_html
from oarlock.recording.reader_notes import copied_notes
from oarlock.recording.streams import MOST_STREAMS, Stream, fields_of_columns, stream_of
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Recording:
    """Streams of one trial on one clock; rates, starts and ends may differ. Immutable.

    Time stamps since 1970 are shifted to start at 0 s.

    Args:
        streams: each with its own name, at most `MOST_STREAMS`.
        meta: further information for TOML, such as ``athlete`` (a pseudonym), ``rig``, ``clock``.

    Raises:
        DataError: a name twice, an unknown name, or no stream left.
    """

    streams: tuple[Stream, ...]
    meta: Mapping[str, object] = field(default_factory=dict)

    def __init__(self, streams: Iterable[Stream], meta: Mapping[str, object] | None = None) -> None:
        object.__setattr__(self, "streams", tuple(streams))
        self._check_streams()
        moved, told = from_zero(self.streams, copied_notes(meta or {}, "recording, meta"))
        object.__setattr__(self, "streams", tuple(moved))
        object.__setattr__(self, "meta", MappingProxyType(told))

    @classmethod
    def from_arrays(
        cls, streams: Mapping[str, Mapping[str, ArrayLike | str]], meta: Mapping[str, object] | None = None
    ) -> Recording:
        """Streams by sensor, such as `{"back": {"time_s": t, "gyro_rad_s": g}}`.

        A unit has `gyro_rad_s`, `accel_m_s2`, `mag_ut` (T, 3); an encoder `value` (T,) and `unit`; a position `value`
        (T, 3); an orientation `quat_wxyz` (T, 4).
        """
        return cls([stream_of(name, fields) for name, fields in streams.items()], meta)

    @classmethod
    def from_pandas(
        cls, frames: Mapping[str, pd.DataFrame], meta: Mapping[str, object] | None = None
    ) -> Recording:
        """Streams by sensor from tables with columns as in a stream's `to_pandas`."""
        return cls.from_arrays(
            {
                name: fields_of_columns({column: frame[column].to_numpy() for column in frame.columns})
                for name, frame in frames.items()
            },
            meta,
        )

    def _check_streams(self) -> None:
        if not self.streams:
            raise DataError("the recording is empty: it has no stream. Give at least one.")
        if len(self.streams) > MOST_STREAMS:
            raise DataError(
                f"the recording has {len(self.streams):,} streams; at most {MOST_STREAMS:,} are kept. "
                "Give the streams of the sensors alone."
            )
        seen: dict[str, int] = {}
        for index, stream in enumerate(self.streams):
            if not isinstance(stream, Stream):
                raise DataError(
                    f"streams[{index}] is a {type(stream).__name__}; "
                    "expected ImuStream, ScalarStream, VectorStream or OrientationStream"
                )
            if stream.name in seen:
                raise DataError(
                    f'two streams have the name "{stream.name}" '
                    f"(streams[{seen[stream.name]}] and streams[{index}]). Give each sensor its own name."
                )
            seen[stream.name] = index

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the streams."""
        return tuple(s.name for s in self.streams)

    @property
    def epoch(self) -> str | None:
        """The moment of 0 s, ISO; "Z" means UTC; None if unknown."""
        return epoch_of(self.meta)

    @property
    def start_s(self) -> float:
        """Earliest time stamp."""
        return float(min(s.time_s[0] for s in self.streams))

    @property
    def end_s(self) -> float:
        """Latest time stamp."""
        return float(max(s.time_s[-1] for s in self.streams))

    @property
    def duration_s(self) -> float:
        """From `start_s` to `end_s`."""
        return self.end_s - self.start_s

    def sensor(self, name: str) -> Stream:
        """The stream of a sensor."""
        for stream in self.streams:
            if stream.name == name:
                return stream
        raise DataError(f'the recording has no stream "{name}". {did_you_mean(str(name), self.names)}')

    def __getitem__(self, name: str) -> Stream:
        return self.sensor(name)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return Recording, (self.streams, dict(self.meta))

    def __iter__(self) -> Iterator[Stream]:
        return iter(self.streams)

    def __len__(self) -> int:
        return len(self.streams)

    def slice(self, start_s: float = -np.inf, end_s: float = np.inf) -> Recording:
        """The samples with start_s <= time_s < end_s."""
        cut = [part for s in self.streams if (part := s.between(start_s, end_s)) is not None]
        if not cut:
            raise DataError(
                f"no sample lies in {start_s:g} <= time_s < {end_s:g} s; "
                f"the recording spans {self.start_s:g} to {self.end_s:g} s"
            )
        return Recording(cut, self.meta)

    def low_passed(self, cutoff_hz: float) -> Recording:
        """Inertial units without vibration above `cutoff_hz`, not delayed (Butterworth, fourth order, both ways)."""
        from oarlock.recording.low_pass import low_passed

        return Recording(low_passed(self.streams, cutoff_hz), self.meta)

    def only(self, names: Iterable[str]) -> Recording:
        """The streams of these names."""
        kept = {self.sensor(name).name for name in ([names] if isinstance(names, str) else names)}
        return Recording([s for s in self.streams if s.name in kept], self.meta)

    def without(self, names: Iterable[str]) -> Recording:
        """The streams of other names."""
        dropped = {self.sensor(name).name for name in ([names] if isinstance(names, str) else names)}
        return self.only(name for name in self.names if name not in dropped)

    def save(
        self,
        folder: str | PathLike[str],
        file_format: Literal["parquet", "csv"] = "parquet",
        *,
        force: bool = False,
    ) -> None:
        """Write a folder for `load_recording`; an earlier recording there is replaced, other files only by `force`.

        Both formats are exact.

        Raises:
            DataError: the folder cannot be written; it is unchanged.
        """
        write_folder(self.streams, self.meta, folder, file_format, force)

    def plot(self, names: str | Iterable[str] | None = None) -> list[Axes]:
        """Draw streams (None: the first) and return the axes of matplotlib, one a quantity."""
        from oarlock.recording.plot import plot_streams

        return plot_streams((self.only(self.names[:1] if names is None else names)).streams)

    def _repr_html_(self) -> str:
        return recording_html(self, self.streams, self.epoch)

    def __repr__(self) -> str:
        width = max(len(n) for n in self.names)
        kind_width = max(6, *(len(s.kind) for s in self))
        lines = [
            f"Recording: {len(self)} streams, {self.start_s:.6g} to {self.end_s:.6g} s ({self.duration_s:.4g} s)"
        ]
        for s in self.streams:
            rate, missing = rate_and_missing(self, s)
            lines.append(
                f"  {s.name:<{width}}  {s.kind:<{kind_width}}  {rate:>6} Hz  {len(s):>8} samples  "
                f"{missing:>5} % missing  {' '.join(s.values)}"
            )
        return "\n".join(lines)


def load_recording(path: str | PathLike[str]) -> Recording:
    """Read a folder that `Recording.save` or ``oarlock import`` wrote.

    Raises:
        DataError: a missing or unknown file, column or key, or a wrong unit.
    """
    return Recording(*read_folder(path))
