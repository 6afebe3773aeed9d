"""Reads XDF files, as LabRecorder writes them from streams of the Lab Streaming Layer (LSL)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike

import numpy as np

from oarlock.formats.arbitrary_units import scale_meta
from oarlock.formats.devices.xdf_chunks import MAGIC, ChannelInfo, XdfStream, read_chunks
from oarlock.formats.devices.xdf_clock import XdfClockFit, on_the_recorders_clock
from oarlock.formats.labelled_channels import Triple, inertial_fields, inertial_triples
from oarlock.formats.listing import FileMatch, Listing
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream, Stream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.names import LONGEST_NAME, numbered
from oarlock.storage.paths import place_of

EVENTS_KEY = "events"
"""`Recording.meta[EVENTS_KEY][stream]` has the texts of a stream of markers: `time_s` and `text`."""


def read_xdf(path: str | PathLike[str]) -> Recording:
    """Read all streams of an XDF file.

    Args:
        path: the file.

    Returns:
        One `ImuStream` for each inertial unit whose channels have labels such as "AccX" and a unit of measurement.
        Every other channel of numbers is a `ScalarStream` named "STREAM_LABEL"; texts are in ``meta["events"]``. The
        stamps are on the recorder's clock and start at 0: offset and drift of each sender's clock are fitted, and a
        stream with a nominal rate gets regular stamps, unless its sender had no regular clock. ``meta["source"]``
        has offset, drift and jitter of each stream.

    Raises:
        DataError: the file is damaged from its beginning, or has no numbers.
    """
    file = place_of(path)
    content = read_chunks(file)
    read = _Reading(list(content.notes))
    named = dict(
        zip(numbered((_short(stream.name) for stream in content.streams), " "), content.streams, strict=True)
    )
    clocks = {
        name: on_the_recorders_clock(stream)
        for name, stream in named.items()
        if any(len(chunk) for chunk in stream.stamps)
    }
    if not clocks:
        raise DataError(
            f"{file}: none of its {len(named)} streams has a sample. {' '.join(read.notes)}".rstrip()
        )
    zero_s = min(float(clock.time_s[0]) for clock in clocks.values())
    for name, stream in named.items():
        if name not in clocks:
            read.notes.append(f"{name}: has no samples.")
        else:
            read.take(name, stream, clocks[name].time_s - zero_s)
    if not read.streams:
        raise DataError(f"{file}: has no stream of numbers, only {', '.join(read.events)}")
    if not any(isinstance(stream, ImuStream) for stream in read.streams):
        read.notes.append(
            'No inertial unit was found: that needs channels with labels such as "AccX" and a unit. '
            "All channels are kept as plain numbers."
        )
    begun = {"begun": content.begun} if content.begun else {}
    about = {name: _about(stream, clocks.get(name)) for name, stream in named.items()}
    source = {"format": "xdf", "file": file.name, **begun, "streams": about, "notes": read.notes}
    clock = {"kind": "relative", "zero_s": zero_s, "found": _clock_notes(clocks)}
    events = {EVENTS_KEY: read.events} if read.events else {}
    return Recording(
        _apart(read.streams), {"source": source, CLOCK_KEY: clock, **events, **scale_meta(read.arbitrary)}
    )


def find_xdf(listing: Listing) -> list[FileMatch]:
    """Each XDF file is a recording."""
    return [
        FileMatch("xdf", file.path, (file.path,), file.path.stem, "XDF, streams of the Lab Streaming Layer")
        for file in listing.files
        if file.head.startswith(MAGIC)
    ]


@dataclass
class _Reading:
    """What was made of the streams so far: streams, events, notes, and magnetometers in arbitrary units."""

    notes: list[str]
    streams: list[Stream] = field(default_factory=list)
    events: dict[str, object] = field(default_factory=dict)
    arbitrary: dict[str, Floats] = field(default_factory=dict)

    def take(self, name: str, stream: XdfStream, time_s: Floats) -> None:
        """Add a stream of numbers or of texts."""
        if stream.is_text:
            texts = [" | ".join(sample) for sample in stream.texts]
            if len(time_s) > len(texts):
                self.notes.append(
                    f"{name}: only the first {len(texts):,} of {len(time_s):,} texts were kept."
                )
            self.events[name] = {"time_s": time_s[: len(texts)].tolist(), "text": texts}
            return
        values = _numbers(name, stream, self.notes)
        labels, units = ([getattr(c, key) for c in stream.channels] for key in ("label", "unit"))
        triples, said = inertial_triples(labels, units)
        self.notes += [f"{name}: {sentence}" for sentence in said]
        for unit in dict.fromkeys(triple.unit for triple in triples):
            self._unit(name, unit, [triple for triple in triples if triple.unit == unit], values, time_s)
        taken = {place for triple in triples for place in triple.places}
        for place, label in enumerate(_labels(stream.channels)):
            if place not in taken:
                channel = f"{_plain(name)}_{label}"[:LONGEST_NAME]
                self.streams.append(ScalarStream(channel, time_s, values[:, place]))

    def _unit(self, name: str, unit: str, triples: Sequence[Triple], values: Floats, time_s: Floats) -> None:
        own = unit if unit and not unit.isdigit() else "_".join(filter(None, (_plain(name).lower(), unit)))
        fields, arbitrary, said = inertial_fields(triples, values, own)
        self.notes += said
        if arbitrary is not None:
            self.arbitrary[own] = arbitrary
        if fields:
            self.streams.append(ImuStream(own[:LONGEST_NAME], time_s, **fields))
            self.notes.append(f"{name}: {own} was recognised by its labels ({', '.join(sorted(fields))}).")


def _numbers(name: str, stream: XdfStream, notes: list[str]) -> Floats:
    """(T, channels) readings; NaN for what is no finite number."""
    raw = np.concatenate(stream.values)
    values = raw.astype(np.float64)
    if raw.dtype.kind == "i" and not np.array_equal(values.astype(raw.dtype), raw):
        notes.append(f"{name}: integers above 2^53 were rounded.")
    infinite = np.isinf(values)
    if infinite.any():
        notes.append(f"{name}: {int(infinite.sum())} infinite numbers were taken as missing.")
    values[infinite] = np.nan
    return values


def _labels(channels: Sequence[ChannelInfo]) -> list[str]:
    return [_plain(channel.label) or str(number) for number, channel in enumerate(channels, 1)]


def _plain(text: str) -> str:
    return "_".join("".join(c if c.isprintable() else " " for c in text).split())


def _short(name: str) -> str:
    return " ".join(_plain(name).split("_"))[: LONGEST_NAME // 2] or "stream"


def _apart(streams: Sequence[Stream]) -> list[Stream]:
    """The streams, those whose labels repeat with a number."""
    names = numbered(stream.name for stream in streams)
    pairs = zip(streams, names, strict=True)
    return [stream if stream.name == name else replace(stream, name=name) for stream, name in pairs]


def _about(stream: XdfStream, clock: XdfClockFit | None) -> Mapping[str, object]:
    units = {c.label: c.unit for c in stream.channels if c.label and c.unit}
    told: dict[str, object] = {
        "type": stream.kind,
        "nominal_rate_hz": stream.rate_hz,
        "channels": len(stream.channels),
        **({"units": units} if units else {}),
        "clock_measurements": len(stream.measured),
    }
    if clock is None:
        return told
    found = {"offset_s": clock.offset_s, "drift_ppm": clock.drift_ppm, "jitter_s": clock.jitter_s}
    counts = {"clock_resets": clock.resets, "gaps": clock.gaps, "moved_stamps": clock.moved}
    return told | {k: v for k, v in found.items() if np.isfinite(v)} | {k: n for k, n in counts.items() if n}


def _clock_notes(clocks: Mapping[str, XdfClockFit]) -> list[str]:
    notes = []
    measured = {name: clock for name, clock in clocks.items() if np.isfinite(clock.offset_s)}
    for name, clock in clocks.items():
        if measured and name not in measured:
            notes.append(f"{name}: its clock was not measured; its stamps are taken for the recorder's.")
        if clock.resets:
            notes.append(
                f"{name}: its clock got another zero {_times(clock.resets)}; each part was fitted by itself."
            )
        if clock.wanders:
            notes.append(f"{name}: has no regular rate; the stamps of its sender were kept.")
        elif clock.gaps:
            notes.append(f"{name}: samples are missing in {clock.gaps} places.")
        if clock.moved:
            notes.append(f"{name}: {clock.moved} stamps were not later than the one before and were moved.")
    return notes


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"
