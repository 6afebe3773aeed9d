"""What to ask of Bluetooth devices after connecting, in the order that each kind needs; for the transport.

Sources: Movella, "DOT BLE Services Specifications", XD0506P revision C; Concept2, "PM Bluetooth Smart
Communication Interface Definition", revision 1.30; Bluetooth SIG, services 0x180D, 0x1818 and 0x1826.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from oarlock.live.decoders.dot_messages import RATES_HZ, output_rate, start, stop
from oarlock.live.transports.radio import standard
from oarlock.live.transports.transport import Options
from oarlock.storage.errors import DataError

_PM5 = "ce06{:04x}-43e5-11e4-916c-0800200c9a66"
_DOT = "1517{:04x}-4947-11e9-8646-d663bd873d93"
_PERIODS_MS = (1000, 500, 250, 100)
# Characteristic of the payload by mode. Only the maker's software can decode the high-fidelity modes: left out.
_DOT_PAYLOADS = {
    **dict.fromkeys((2, 3, 7, 16, 18, 19, 20, 21, 22, 23, 24), 0x2003),
    **dict.fromkeys((4, 5, 6), 0x2004),
    26: 0x2002,
}


@dataclass(frozen=True)
class Subscribe:
    """Have a characteristic notify; one that is not `needed` may be absent."""

    characteristic: str
    needed: bool = True


@dataclass(frozen=True)
class Write:
    """Write a characteristic."""

    characteristic: str
    data: bytes


@dataclass(frozen=True)
class Profile:
    """A kind of device.

    Args:
        start: steps after connecting, in their order.
        stop: steps before disconnecting.
    """

    start: tuple[Subscribe | Write, ...]
    stop: tuple[Write, ...] = ()


@dataclass(frozen=True)
class BleDeviceKind:
    """How a kind of device is recognised and asked.

    Args:
        profile: its steps, by the options of a source.
        options: that `profile` reads.
        names: with which names that it advertises begin.
        service: that it advertises.
    """

    profile: Callable[[Options], Profile]
    options: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    service: str = ""


def _pm5(options: Options) -> Profile:
    period_ms = options.integer("period_ms", 250)
    if period_ms not in _PERIODS_MS:
        raise _refused(options, "period_ms", period_ms, _PERIODS_MS)
    told = [Subscribe(_PM5.format(number)) for number in (0x31, 0x32, 0x33, 0x35, 0x36)]
    # The first edition of the monitor has no force curve, old firmware no third status.
    new = [Subscribe(_PM5.format(number), needed=False) for number in (0x3D, 0x3E)]
    return Profile((Write(_PM5.format(0x34), bytes([_PERIODS_MS.index(period_ms)])), *told, *new))


def _dot(options: Options) -> Profile:
    """Rate, subscription, start: a unit that is started before anybody has subscribed sends nothing."""
    mode, rate_hz = options.integer("mode", 20), options.integer("rate_hz", 60)
    if mode not in _DOT_PAYLOADS:
        raise _refused(options, "mode", mode, sorted(_DOT_PAYLOADS))
    if rate_hz not in RATES_HZ:
        raise _refused(options, "rate_hz", rate_hz, RATES_HZ)
    return Profile(
        (
            Write(_DOT.format(0x1002), output_rate(rate_hz)),
            Subscribe(_DOT.format(_DOT_PAYLOADS[mode])),
            Subscribe(_DOT.format(0x3001), needed=False),
            Write(_DOT.format(0x2001), start(mode)),
        ),
        (Write(_DOT.format(0x2001), stop(mode)),),
    )


def _listening(characteristic: int) -> Callable[[Options], Profile]:
    return lambda options: Profile((Subscribe(standard(characteristic)),))


KINDS: Mapping[str, BleDeviceKind] = MappingProxyType(
    {
        "cycling_power": BleDeviceKind(_listening(0x2A63), service=standard(0x1818)),
        "dot": BleDeviceKind(_dot, ("mode", "rate_hz"), ("Movella DOT", "Xsens DOT")),
        "ftms": BleDeviceKind(_listening(0x2AD1), service=standard(0x1826)),
        "heart_rate": BleDeviceKind(_listening(0x2A37), service=standard(0x180D)),
        "pm5": BleDeviceKind(_pm5, ("period_ms",), ("PM5",)),
    }
)
"""Kinds of devices by the name of their wire format."""


def kind_of(name: str, services: tuple[str, ...]) -> str | None:
    """The kind of a device that advertises a name and services; None if it is none of `KINDS`."""
    by_name = (key for key, kind in KINDS.items() if kind.names and name.startswith(kind.names))
    by_service = (key for key, kind in KINDS.items() if kind.service and kind.service in services)
    return next(by_name, None) or next(by_service, None)


def _refused(options: Options, key: str, value: int, known: tuple[int, ...] | list[int]) -> DataError:
    return DataError(
        f"source '{options.source}': the option {key} is {value}; expected {', '.join(map(str, known))}"
    )
