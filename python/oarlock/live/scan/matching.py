"""Which device feeds which stream of a model: by hand, by names, or as somebody who is asked says."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from oarlock.live.rig import Source
from oarlock.live.scan.finding import OWN_STATE, ScanDevice, Sender, devices_of, received_together
from oarlock.recording.unit_names import assign_units
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

INERTIAL_FORMATS = ("dot", "ngimu", "shimmer3", "ximu3")
_NEEDED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"imu": ("gyro_rad_s", "accel_m_s2"), "vector": ("position_m",), "orientation": ("quat_wxyz",)}
)
_SCALES: Mapping[str, float] = MappingProxyType(
    {"_mm": 1e-3, "_cm": 1e-2, "_m": 1.0, "_deg": math.pi / 180.0, "_rad": 1.0}
)
"""Ending of a quantity's name -> what makes it m or rad."""
_RATES_HZ = (1, 2, 4, 5, 8, 10, 12, 12.5, 15, 16, 20, 25, 30, 32, 40, 50, 60, 64, 80, 100, 120, 125, 128, 150, 200, 240,
             250, 256, 300, 400, 500, 512, 1000)  # fmt: skip
"""That devices are usually set to."""
_ALIKE = 0.03
_OTHER_UNITS = re.compile(r"_(hpa|deg_c|percent|v|w|n|j|s|ms|hz|kg|per_min|m_s|m_s2|kcal|dbm)$")
"""Endings of quantities that are no angle and no length."""
_ASKED_HZ = MappingProxyType({"dot": 60.0})
"""What a device is asked for when it is connected."""


@dataclass(frozen=True)
class DeviceCandidate:
    """A device, or one quantity of it, that may feed a stream.

    Args:
        source: its name in the rig file.
        format: of the source.
        device: that sends.
        value: quantity that a scalar stream takes; "" for others.
        is_alone: whether its source has no other device, so that it need not be named.
    """

    source: str
    format: str
    device: ScanDevice
    value: str = ""
    is_alone: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """By which it may be called."""
        own = (self.device.name, self.device.finding.name, self.device.finding.address)
        return tuple(dict.fromkeys(name for name in own if name))

    @property
    def whole(self) -> str:
        """A name that no other device has."""
        return f"{self.source}/{self.device.name}"

    @property
    def title(self) -> str:
        """For people."""
        name = self.device.finding.name
        shown = f"{self.device.name} ({name})" if name and name != self.device.name else self.device.name
        return f"{shown}, {self.value}" if self.value not in ("", "value") else shown

    @property
    def rate_hz(self) -> float | None:
        """The rate to expect: the measured one, or the usual one near it."""
        part = self.device.part
        measured = (
            _ASKED_HZ.get(self.format) if part is None else part.rates_hz.get(self.value) or part.rate_hz
        )
        if measured is None:
            return None
        usual = min(_RATES_HZ, key=lambda rate: abs(rate - measured))
        return float(usual) if abs(usual - measured) <= _ALIKE * measured else float(f"{measured:.3g}")

    @property
    def scale(self) -> float | None:
        """What makes its value m or rad, by the ending of its name; None if that says nothing."""
        ending = next((end for end in _SCALES if self.value.endswith(end)), None)
        return None if ending is None else _SCALES[ending]


@dataclass(frozen=True)
class Sources:
    """What a scan found as sources of a rig, and their devices."""

    named: tuple[tuple[Source, tuple[Sender, ...]], ...]
    candidates: tuple[DeviceCandidate, ...]

    @classmethod
    def of(cls, findings: Sequence[Sender]) -> Sources:
        """The sources that receive all findings, with names."""
        named: list[tuple[Source, tuple[Sender, ...]]] = []
        for source, senders in received_together(findings):
            taken = {one.name for one, _ in named}
            named.append((replace(source, name=_free_name(source, senders, taken)), tuple(senders)))
        return cls(tuple(named), tuple(c for source, senders in named for c in _candidates(source, senders)))

    def feeding(self, kind: str) -> list[DeviceCandidate]:
        """The candidates for a kind of stream."""
        return [one for one in self.candidates if kind in _kinds(one)]


Ask = Callable[[str, Sequence[DeviceCandidate]], DeviceCandidate | None]


def matched(
    streams: Mapping[str, str],
    sources: Sources,
    by_hand: Mapping[str, str],
    ask: Ask = lambda stream, found: None,
) -> dict[str, DeviceCandidate]:
    """What feeds which stream.

    Args:
        streams: of the model -> kind.
        sources: what was found.
        by_hand: stream -> name of a device, or `name:value`.
        ask: who chooses for a stream that nothing has the name of.

    Raises:
        DataError: a name that was given by hand does not exist, or several devices have it.
    """
    found: dict[str, DeviceCandidate] = {}
    for stream, name in by_hand.items():
        if stream not in streams:
            raise DataError(f"--feed {stream}: the model has none. {did_you_mean(stream, sorted(streams))}")
        found[stream] = _called(name, stream, sources.feeding(streams[stream]))
    for kind in ("imu", "orientation", "vector", "scalar"):
        open_streams = [s for s, own in streams.items() if own == kind and s not in found]
        free = [one for one in sources.feeding(kind) if one not in found.values()]
        found |= _by_name(open_streams, free)
    for stream, kind in streams.items():
        free = [one for one in sources.feeding(kind) if one not in found.values()]
        if stream not in found and free and (chosen := ask(stream, free)) is not None:
            found[stream] = chosen
    return {stream: found[stream] for stream in streams if stream in found}


def _by_name(streams: Sequence[str], free: Sequence[DeviceCandidate]) -> dict[str, DeviceCandidate]:
    """The streams that exactly one candidate means."""
    meant: dict[str, list[DeviceCandidate]] = {}
    for one in free:
        for stream in dict.fromkeys(_meanings(one, streams)):
            meant.setdefault(stream, []).append(one)
    return {stream: own[0] for stream, own in meant.items() if len(own) == 1}


def _meanings(one: DeviceCandidate, streams: Sequence[str]) -> Iterator[str]:
    """The streams whose name a candidate has, in any spelling."""
    plain = {_plain(stream): stream for stream in streams}
    value = one.value
    for ending in _SCALES:
        value = value.removesuffix(ending)
    for name in (*one.names, *((value,) if one.value else ())):
        if _plain(name) in plain:
            yield plain[_plain(name)]
            return
    for name in () if one.value else one.names:
        try:
            units = assign_units(list(streams), [name]).units
        except DataError:
            continue  # its name may mean several; who is asked decides
        if units:
            yield next(iter(units))
            return


def _called(name: str, stream: str, candidates: Sequence[DeviceCandidate]) -> DeviceCandidate:
    own, _, value = name.rpartition(":")
    for device, quantity in ((name, ""), (own, value)):
        called = [
            one
            for one in candidates
            if device.casefold() in {n.casefold() for n in (*one.names, one.whole)}
            and quantity in ("", one.value)
        ]
        if len(called) == 1:
            return called[0]
        if called:
            values = (f":{one.value}" if one.value else "" for one in called)
            given = [one.whole + value for one, value in zip(called, values, strict=True)]
            choices = " or ".join(f"--feed {stream}={name}" for name in given)
            raise DataError(f"--feed {stream}={name}: several fit. Give {choices}.")
    known = did_you_mean(name, [one.device.name for one in candidates])
    raise DataError(f"--feed {stream}={name}: no such device was heard that could feed it. {known}")


def _candidates(source: Source, senders: Sequence[Sender]) -> Iterator[DeviceCandidate]:
    devices = devices_of(senders)
    listed = any(isinstance(value, list) for value in source.options.values())
    for device in devices:
        alone = len(devices) == 1 and not listed and not (device.part and device.part.name)
        one = DeviceCandidate(source.name, source.format, device, "", alone)
        yield one
        for name, value in {} if device.part is None else device.part.last.items():
            if isinstance(value, float | int) and name not in OWN_STATE and not _OTHER_UNITS.search(name):
                yield replace(one, value=name)


def _kinds(one: DeviceCandidate) -> set[str]:
    """The kinds of streams that a candidate can feed."""
    part = one.device.part
    if one.value:
        return {"scalar"}
    if part is None:
        return {"imu"} if one.format in INERTIAL_FORMATS else set()
    return {kind for kind, needed in _NEEDED.items() if set(needed) & part.last.keys()}


def _free_name(source: Source, senders: Sequence[Sender], taken: set[str]) -> str:
    told = senders[0].name if source.transport == "lsl" else source.format
    name = re.sub(r"\W+", "_", told).strip("_") or source.format
    numbers = (f"{name}_{k}" for k in range(2, len(taken) + 3))
    return name if name not in taken else next(one for one in numbers if one not in taken)


def _plain(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).casefold()
