"""Writes a rig file with comments from what was found, for `oarlock live init`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from oarlock.live.rig import FORMAT, Rig, Source, streams_of
from oarlock.live.scan.finding import Sender, sends
from oarlock.live.scan.joint_read import unit_read
from oarlock.live.scan.matching import DeviceCandidate, Sources
from oarlock.storage.toml import toml_text

if TYPE_CHECKING:
    from oarlock._core import Model

_KINDS = {
    "imu": "an inertial unit",
    "orientation": "an orientation",
    "vector": "a position",
    "scalar": "a number",
}
_COLUMN = 22


@dataclass(frozen=True)
class RigDraft:
    """A rig file before it is written.

    Args:
        model: of the body.
        model_name: as the file names it.
        calibration: as the file names it; "" for none.
        sources: what was found.
        feeds: stream -> what feeds it.
    """

    model: Model
    model_name: str
    calibration: str
    sources: Sources
    feeds: Mapping[str, DeviceCandidate]

    @property
    def free(self) -> list[str]:
        """Streams that nothing feeds."""
        return [stream for stream in streams_of(self.model) if stream not in self.feeds]

    @property
    def unused(self) -> list[str]:
        """Devices that feed nothing."""
        used = {(one.source, one.device.name) for one in self.feeds.values()}
        every = [(one.source, one.device.name) for one in self.sources.candidates]
        return [name for source, name in dict.fromkeys(every) if (source, name) not in used]

    def text(self) -> str:
        """The file."""
        return "\n".join([*self._head(), *self._sources(), *self._streams(), ""])

    def _head(self) -> Iterator[str]:
        yield "# Which sensor feeds which stream of the model. Check it: oarlock live doctor FILE"
        yield from _keys({"format": FORMAT, "model": self.model_name})
        if self.calibration:
            yield from _keys({"calibration": self.calibration})
        else:
            yield '# calibration = "calibration.toml"   # mounts of this session: oarlock calibrate session'
        wait = f"wait_ms = {1e3 * Rig.wait_s:g}"
        yield _with_comment(wait, "how long an estimate waits for late readings")

    def _sources(self) -> Iterator[str]:
        yield ""
        if not self.sources.named:
            yield "[sources]"
            yield "# Nothing was heard. Take the # away and write what your sensors have:"
            yield from ("# [sources.units]", '# format = "lines"', '# transport = "udp"', "# port = 9000")
        for source, senders in self.sources.named:
            yield from self._source(source, senders)

    def _source(self, source: Source, senders: Sequence[Sender]) -> Iterator[str]:
        yield f"[sources.{source.name}]"
        yield from (f"# {what}" for what in dict.fromkeys(one.what for one in senders))
        if all(one.source != source.name for one in self.feeds.values()):
            yield "# feeds no stream: it is recorded only"
        yield from _keys({"format": source.format, "transport": source.transport, **source.options})
        if any("gyro_unknown_unit" in part.rates_hz for one in senders for part in one.parts):
            yield f"# [sources.{source.name}.decoder]"
            yield '# gyro_unit = "deg/s"   # the sender does not say whether deg/s or rad/s; try both'
        yield ""

    def _streams(self) -> Iterator[str]:
        kinds = {stream: kind for stream, (kind, _) in streams_of(self.model).items()}
        if not self.feeds:
            yield from ("[streams]", "")
        for stream, one in self.feeds.items():
            yield from self._stream(stream, one)
        if self.free:
            yield "# Nothing was found for the streams below. A model may have more sensors than you use: leave those"
            yield "# that you do not have. For the others take the # away and name source and device."
        for stream in self.free:
            yield from ("", _with_comment(f"# [streams.{stream}]", _KINDS[kinds[stream]]))
            yield from self._choices(kinds[stream])

    def _stream(self, stream: str, one: DeviceCandidate) -> Iterator[str]:
        yield f"[streams.{stream}]"
        yield from _keys({"source": one.source})
        part = one.device.part
        if not one.is_alone:
            told = "" if part is None else sends(tuple(part.rates_hz))
            yield _with_comment(_key("device", one.device.name), told)
        if one.value:
            yield from self._value(stream, one)
        measured = None if part is None else part.rates_hz.get(one.value) or part.rate_hz
        if one.rate_hz is not None:
            told = "" if measured is None else f"measured {measured:.4g}"
            yield _with_comment(_key("rate_hz", one.rate_hz), told)
        yield ""

    def _value(self, stream: str, one: DeviceCandidate) -> Iterator[str]:
        unit = unit_read(self.model, stream)
        yield from _keys({"value": one.value})
        if one.scale is not None:
            yield _with_comment(_key("scale", one.scale), f"to {unit}")
            return
        last = one.device.part.last.get(one.value) if one.device.part is not None else None
        heard = f"; it sent {last:g}" if isinstance(last, float | int) and one.format != "lsl" else ""
        yield _with_comment("scale = 1.0", f"scale * {one.value} + offset must be {unit}{heard}")
        yield "offset = 0.0"

    def _choices(self, kind: str) -> Iterator[str]:
        found = [one for one in self.sources.feeding(kind) if one not in self.feeds.values()]
        source = found[0].source if found else next((s.name for s, _ in self.sources.named), "units")
        yield from (f"# {line}" for line in _keys({"source": source}))
        titles = (
            ", ".join(f"{one.source}: {one.title}" for one in found) or "nothing that was heard measures it"
        )
        yield _with_comment('# device = "..."', titles)


def _keys(values: Mapping[str, object]) -> list[str]:
    """Lines of a TOML table, one for each key."""
    return [_key(key, value) for key, value in values.items()]


def _key(key: str, value: object) -> str:
    return toml_text({key: value}).strip()


def _with_comment(line: str, comment: str) -> str:
    return f"{line.ljust(_COLUMN)} # {comment}" if comment else line
