"""What a scan has found: senders, what each sends, and the source of a rig file that receives it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from oarlock.live.reading import Value
from oarlock.live.rig import Source

LISTS = ("units", "addresses")
"""Options of sources that list devices: one source receives several."""
_QUANTITIES: Mapping[str, str] = MappingProxyType(
    {
        "gyro_rad_s": "gyro",
        "accel_m_s2": "accel",
        "mag_ut": "mag",
        "mag_arbitrary": "mag (no unit)",
        "quat_wxyz": "orientation",
        "position_m": "position",
        "pressure_hpa": "air pressure",
        "temperature_deg_c": "temperature",
    }
)
OWN_STATE = {"battery_percent", "battery_v", "charging", "rssi_percent", "rssi_dbm"}
"""What devices tell of themselves, not of a movement."""
_FIRST = ("gyro_rad_s", "accel_m_s2", "mag_ut", "mag_arbitrary", "quat_wxyz", "position_m", "value")
BATTERY = "battery_percent"


@dataclass(frozen=True)
class DevicePart:
    """What one device sends, or one part of it.

    Args:
        name: of the part; "" if the device has only one.
        rates_hz: quantity, as a `Reading` names it -> measured rate; None if too few were heard.
        battery_percent: charge; None if it tells none.
        lost_percent: readings that its counter shows to be missing; None if it does not count.
        last: quantity -> what it sent last; empty if nothing was received.
    """

    name: str
    rates_hz: Mapping[str, float | None]
    battery_percent: float | None = None
    lost_percent: float | None = None
    last: Mapping[str, Value] = field(default_factory=dict)

    @property
    def rate_hz(self) -> float | None:
        """The rate of what it measures."""
        names = [*_FIRST, *(name for name in self.rates_hz if name not in (*_FIRST, *OWN_STATE)), BATTERY]
        return next((self.rates_hz[name] for name in names if self.rates_hz.get(name)), None)


@dataclass(frozen=True)
class Sender:
    """One sender.

    Args:
        what: for people, such as `x-IMU3 "back"`.
        address: of the device, as a rig file's `device` has it.
        source: what receives it in a rig file; None if no format reads it.
        parts: what it sends; empty if that is not known without a connection.
        battery_percent: charge that it announces.
        signal: strength of its radio, for people.
        note: what is not clear, and what to do.
        name: that it has by itself, such as what was written into a unit; "" for none.
    """

    what: str
    address: str
    source: Source | None
    parts: tuple[DevicePart, ...] = ()
    battery_percent: float | None = None
    signal: str = ""
    note: str = ""
    name: str = ""


@dataclass(frozen=True)
class ScanProblem:
    """Where a scan could not look.

    Args:
        where: such as "Bluetooth".
        text: why, and what to do.
    """

    where: str
    text: str


@dataclass(frozen=True)
class Scan:
    """All that a scan has found."""

    seconds: float
    findings: tuple[Sender, ...]
    problems: tuple[ScanProblem, ...]
    others: tuple[Sender, ...] = ()
    """Bluetooth devices of no known kind."""


def sends(names: Sequence[str]) -> str:
    """Quantities for people: "gyro, accel"."""
    ordered = sorted(names, key=lambda name: _FIRST.index(name) if name in _FIRST else len(_FIRST))
    return ", ".join(_QUANTITIES.get(name, name) for name in ordered if name not in OWN_STATE)


@dataclass(frozen=True)
class ScanDevice:
    """One device of a source.

    Args:
        name: as `device` of a rig file has it.
        finding: what was heard of it.
        part: which part of what it sends; None if that is not known.
    """

    name: str
    finding: Sender
    part: DevicePart | None


def devices_of(findings: Sequence[Sender]) -> list[ScanDevice]:
    """The devices of one source, by the shortest names that tell them apart."""
    every: list[tuple[Sender, DevicePart | None]] = []
    for one in findings:
        every += [(one, part) for part in one.parts or (None,)]
    names = [_names(one, part) for one, part in every]
    return [
        ScanDevice(next((name for name in own if sum(name in o for o in names) == 1), own[-1]), one, part)
        for own, (one, part) in zip(names, every, strict=True)
    ]


def _names(one: Sender, part: DevicePart | None) -> list[str]:
    """The names by which a rig file may call it, the shortest first."""
    whole = [one.address]
    if one.source is not None and one.source.transport == "udp" and ":" in one.address:
        whole.insert(0, one.address.rpartition(":")[0])
    return (
        [part.name, *(f"{name}/{part.name}" for name in whole)] if part is not None and part.name else whole
    )


def received_together(findings: Sequence[Sender]) -> list[tuple[Source, list[Sender]]]:
    """The sources of a rig file that receive all findings, and which finding each receives."""
    groups: dict[object, tuple[Source, list[Sender]]] = {}
    for finding in findings:
        source = finding.source
        if source is None:
            continue
        plain = sorted((key, repr(value)) for key, value in source.options.items() if key not in LISTS)
        key = (source.format, source.transport, *plain)
        if key in groups:
            before, found = groups[key]
            groups[key] = (
                replace(before, options=_joined(before.options, source.options)),
                [*found, finding],
            )
        else:
            groups[key] = (source, [finding])
    return list(groups.values())


def _joined(one: Mapping[str, object], other: Mapping[str, object]) -> dict[str, object]:
    """Options with the lists of devices of both."""
    found = dict(one)
    for key in LISTS:
        both = [*_listed(one.get(key)), *_listed(other.get(key))]
        if both:
            found[key] = list(dict.fromkeys(both))
    return found


def _listed(value: object) -> list[object]:
    return list(value) if isinstance(value, list | tuple) else []
