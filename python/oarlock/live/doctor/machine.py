"""Versions and extras, and how punctual this machine is."""

from __future__ import annotations

import asyncio
import os
import platform
import time
from collections.abc import Collection, Iterator, Mapping
from importlib import import_module, metadata
from types import MappingProxyType

from oarlock._core import __version__
from oarlock.live.doctor.check import NOTE, OK, Diagnosis, prevents

_EXTRAS: Mapping[str, tuple[str, str, str]] = MappingProxyType(
    {
        "ble": ("bleak", "bleak", "Bluetooth"),
        "lsl": ("pylsl", "pylsl", "the Lab Streaming Layer"),
        "mqtt": ("paho.mqtt.client", "paho-mqtt", "MQTT"),
        "serial": ("serial", "pyserial", "serial lines"),
    }
)
"""Transport, which is the name of the extra, too -> module, package, and what it is for."""
_WAKES, _NAP_S, _LATE_S = 200, 0.002, 0.02


def versions(needed: Collection[str]) -> Iterator[Diagnosis]:
    """Of Oarlock and of what its transports need.

    Args:
        needed: transports of the rig.
    """
    here = f"{platform.system()} {platform.release()}, {platform.machine()}"
    yield Diagnosis("versions", OK, f"Oarlock {__version__}, Python {platform.python_version()}, {here}")
    for transport, (module, package, what) in _EXTRAS.items():
        install = f"pip install 'oarlock[{transport}]'"
        try:
            version = metadata.version(package)
            import_module(module)
        except metadata.PackageNotFoundError:
            state = prevents(transport in needed)
            yield Diagnosis("versions", state, f"{package} is not installed; {what} needs it", (install,))
        except (ImportError, RuntimeError, OSError) as error:
            state = prevents(transport in needed)
            yield Diagnosis("versions", state, f"{package} {version} does not load: {error}", (install,))
        else:
            yield Diagnosis("versions", OK, f"{package} {version}{_library(module)}, for {what}")


def _library(module: str) -> str:
    """Which liblsl is used: several on one machine are a known trouble."""
    if module != "pylsl":
        return ""
    lsl = import_module(module)
    number = int(lsl.library_version())
    return f" with liblsl {number // 100}.{number % 100}"


async def clocks() -> Diagnosis:
    """How late this machine wakes a program that waits, which delays estimates but no stamp."""
    late_s = []
    for _ in range(_WAKES):
        due_s = time.monotonic() + _NAP_S
        await asyncio.sleep(_NAP_S)
        late_s.append(time.monotonic() - due_s)
    late_s.sort()
    often, worst = late_s[int(0.99 * _WAKES)], late_s[-1]
    text = (
        f"programs are woken {1e3 * often:.1f} ms late in 1 of 100 cases, {1e3 * worst:.1f} ms at most; the clock of "
        f"arrivals has steps of {1e9 * time.get_clock_info('monotonic').resolution:.0f} ns"
    )
    if often < _LATE_S:
        return Diagnosis("clock", OK, text)
    busy = (
        f" ({os.getloadavg()[0]:.1f} programs want its {os.cpu_count()} cores)"
        if hasattr(os, "getloadavg")
        else ""
    )
    return Diagnosis(
        "clock", NOTE, f"{text}{busy}", ("Close other programs, and connect the laptop to power.",)
    )
