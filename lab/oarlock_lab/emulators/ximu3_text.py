"""Emulates x-IMU3 units whose messages are set to text."""

from __future__ import annotations

from collections.abc import Iterator

from oarlock_lab.emulators import ximu3
from oarlock_lab.emulators.emulated import DeviceMessage, Emulated
from oarlock_lab.emulators.ximu3 import wiring

__all__ = ["emulate", "messages", "wiring"]


def messages(emulated: Emulated) -> Iterator[DeviceMessage]:
    """As binary units, in text."""
    return ximu3.messages(emulated, ximu3.text)


async def emulate(emulated: Emulated) -> None:
    """Send until the movement ends, or it is cancelled."""
    await ximu3.emulate(emulated, ximu3.text)
