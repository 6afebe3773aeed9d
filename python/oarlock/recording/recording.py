"""`Recording`: the streams of one trial. Importers and simulators create recordings; `oarlock.track` tracks them."""

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
    """Streams of one trial on one clock. They may differ in rate, start and end.

    If all time stamps are seconds since 1970 (between 1990 and 2100), they are shifted to start at 0 s, `epoch` keeps
    the moment, and a track has a note.

    Args:
        streams: the streams, each with its own name.
        meta: further information (``source``, ``athlete`` as a pseudonym, ``rig``, ``clock``): texts, numbers,
            booleans, and lists and tables of these, so that `save` can write them.

    Raises:
        DataError: There is no stream, an element is not a stream, two streams have the same name, or there are more
            than `MOST_STREAMS`.
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
    ) -> "Recording":
        """Streams by sensor, each with `time_s` and the fields of its kind.

        `Recording.from_arrays({"upper": {"time_s": t, "gyro_rad_s": g, "accel_m_s2": a}, "elbow": {"time_s": t,
        "value": angle, "unit": "rad"}})`: `gyro_rad_s`, `accel_m_s2` and `mag_ut` (T, 3) of a unit, `value` (T,) of an
        encoder or (T, 3) of a position, `quat_wxyz` (T, 4) of an orientation.

        Raises:
            DataError: a stream lacks `time_s` or has fields of no kind; otherwise as the streams.
        """
        return cls([stream_of(name, fields) for name, fields in streams.items()], meta)

    @classmethod
    def from_pandas(
        cls, frames: "Mapping[str, pd.DataFrame]", meta: Mapping[str, object] | None = None
    ) -> "Recording":
        """A table for each sensor, with columns as those of `to_pandas` of a stream: `time_s`, `gyro_rad_s_x`, ...

        Raises:
            DataError: as `from_arrays`.
        """
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
        """The streams' names, in order."""
        return tuple(s.name for s in self.streams)

    @property
    def epoch(self) -> str | None:
        """The moment of `time_s` = 0 as ISO text, from ``meta["clock"]["zero"]``; None if it is not known.

        It ends with "Z" in UTC, has no suffix in local time, and has no date if the device gave a time of day only.
        """
        return epoch_of(self.meta)

    @property
    def start_s(self) -> float:
        """Earliest time stamp in s."""
        return float(min(s.time_s[0] for s in self.streams))

    @property
    def end_s(self) -> float:
        """Latest time stamp in s."""
        return float(max(s.time_s[-1] for s in self.streams))

    @property
    def duration_s(self) -> float:
        """Time from the earliest to the latest time stamp in s."""
        return self.end_s - self.start_s

    def sensor(self, name: str) -> Stream:
        """The stream of one sensor.

        Raises:
            DataError: There is no such stream. The text suggests the most similar name.
        """
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

    def slice(self, start_s: float = -np.inf, end_s: float = np.inf) -> "Recording":
        """The samples with start_s <= time_s < end_s, with unchanged time stamps.

        A stream without a sample in this interval is left out. Adjacent slices share no sample.
        """
        cut = [part for s in self.streams if (part := s.between(start_s, end_s)) is not None]
        if not cut:
            raise DataError(
                f"no sample lies in {start_s:g} <= time_s < {end_s:g} s; "
                f"the recording spans {self.start_s:g} to {self.end_s:g} s"
            )
        return Recording(cut, self.meta)

    def low_passed(self, cutoff_hz: float) -> "Recording":
        """Inertial units without what is faster than a cut-off, at four or more samples a period of it.

        For units on clothes and soft tissue, which vibrate at every step: a person moves below 6 Hz. Butterworth of
        fourth order, forward and backward, so nothing is delayed; it needs the whole recording. Other streams stay.

        Args:
            cutoff_hz: frequency at which the amplitude falls to 1/sqrt(2), Hz.

        Raises:
            DataError: no positive cut-off, or a unit with too few samples for it.
        """
        from oarlock.recording.low_pass import low_passed

        return Recording(low_passed(self.streams, cutoff_hz), self.meta)

    def only(self, names: Iterable[str]) -> "Recording":
        """The recording with only the streams of these names, in the order of the recording.

        Raises:
            DataError: There is no stream of one of the names, or no name is given.
        """
        kept = {self.sensor(name).name for name in ([names] if isinstance(names, str) else names)}
        return Recording([s for s in self.streams if s.name in kept], self.meta)

    def without(self, names: Iterable[str]) -> "Recording":
        """The recording without the streams of these names.

        Raises:
            DataError: There is no stream of one of the names, or none would be left.
        """
        dropped = {self.sensor(name).name for name in ([names] if isinstance(names, str) else names)}
        return self.only(name for name in self.names if name not in dropped)

    def save(
        self,
        folder: str | PathLike[str],
        file_format: Literal["parquet", "csv"] = "parquet",
        *,
        force: bool = False,
    ) -> None:
        """Write a recording folder: recording.toml and one file for each stream.

        `load_recording` reads back identical values. A recording that was saved there before is replaced as a whole.

        Args:
            folder: created if it does not exist.
            file_format: of the stream files. Both formats are exact.
            force: replace files that are not Oarlock's, too.

        Raises:
            DataError: The folder cannot be written, another process writes into it, a file that is not Oarlock's would
                be replaced, or `meta` contains a value that TOML cannot store. The folder is unchanged then.
        """
        write_folder(self.streams, self.meta, folder, file_format, force)

    def plot(self, names: str | Iterable[str] | None = None) -> "list[Axes]":
        """Draw the readings of streams over time, a panel for each quantity (needs the extra `oarlock[plot]`).

        Args:
            names: of the streams; None draws the first.

        Returns:
            The axes of matplotlib, one for each panel.

        Raises:
            DataError: matplotlib is not installed, or there is no stream of one of the names.
        """
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
    """Read a recording folder, as `Recording.save` and ``oarlock import`` write it.

    Args:
        path: the folder, or its recording.toml.

    Raises:
        DataError: A file, column or key is missing or unknown, or a unit is not the required one.
    """
    return Recording(*read_folder(path))
