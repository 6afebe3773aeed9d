"""What the Bluetooth transport needs of a radio: five methods, which a radio by bleak and a virtual one have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

_STANDARD_END = "-0000-1000-8000-00805f9b34fb"


class RadioError(OSError):
    """The radio could not do it: no adapter, a device out of reach, a lost connection, no such characteristic."""


@dataclass(frozen=True)
class BleAdvertisement:
    """A device that advertises.

    Args:
        address: by which it can be connected: of the device, or a UUID of this machine on macOS.
        name: that it advertises; "" for none.
        services: UUIDs that it advertises, in full and small letters.
        rssi_dbm: strength of its signal.
    """

    address: str
    name: str
    services: tuple[str, ...]
    rssi_dbm: float


class Radio(Protocol):
    """A Bluetooth adapter. Characteristics are given by their UUID in full, in small letters.

    All methods raise `RadioError`, or `TimeoutError`, if they cannot do it.
    """

    async def scan(self, duration_s: float) -> list[BleAdvertisement]:
        """The devices that advertise within a time."""

    async def connect(self, address: str, lost: Callable[[], None]) -> None:
        """Connect a device.

        Args:
            address: as `scan` gives it.
            lost: called when the connection has ended, for whatever reason.
        """

    async def subscribe(self, address: str, characteristic: str, receive: Callable[[bytes], None]) -> None:
        """Have a characteristic of a connected device notify; `receive` is called at once with each value."""

    async def write(self, address: str, characteristic: str, data: bytes) -> None:
        """Write a characteristic of a connected device, and wait for its answer."""

    async def disconnect(self, address: str) -> None:
        """End a connection; nothing happens if there is none."""


def standard(number: int) -> str:
    """The UUID of a service or characteristic of the Bluetooth SIG: 0x2A37 -> `00002a37-0000-1000-...`."""
    return f"{number:08x}{_STANDARD_END}"


def short(uuid: str) -> str:
    """A UUID for people and channels: `2A37` of the Bluetooth SIG's, the first eight digits of others'."""
    digits = uuid.lower()
    return digits[4:8].upper() if digits.endswith(_STANDARD_END) else digits[:8].upper()
