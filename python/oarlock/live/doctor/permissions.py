"""Whether this user may open serial lines and the Bluetooth adapter."""

from __future__ import annotations

import contextlib
import os
import platform
from collections.abc import Collection, Iterator
from pathlib import Path

from oarlock.live.doctor.check import NOTE, OK, Diagnosis, prevents

_LINES = ("ttyUSB*", "ttyACM*", "rfcomm*")
_BUS = Path("/run/dbus/system_bus_socket")
_ADAPTERS, _SWITCHES = Path("/sys/class/bluetooth"), Path("/sys/class/rfkill")


def permissions(lines: Collection[str], needs_bluetooth: bool) -> Iterator[Diagnosis]:
    """Checks of serial lines and Bluetooth.

    Args:
        lines: serial lines of the rig.
        needs_bluetooth: whether the rig has a Bluetooth device.
    """
    found = sorted({*lines, *(str(p) for pattern in _LINES for p in Path("/dev").glob(pattern))})
    for line in found:
        yield _line(line, line in lines)
    yield from _bluetooth(needs_bluetooth)


def _line(line: str, is_needed: bool) -> Diagnosis:
    path = Path(line)
    if platform.system() == "Windows":
        return Diagnosis("serial", OK, f"{line}: Windows needs no permission")
    if not path.exists():
        tries = (
            "Is the cable in, and the receiver on? oarlock live scan --places serial lists the lines there are.",
        )
        return Diagnosis("serial", prevents(is_needed), f"{line} is not there", tries)
    if os.access(path, os.R_OK | os.W_OK):
        return Diagnosis("serial", OK, f"{line}: this user may open it")
    return Diagnosis(
        "serial",
        prevents(is_needed),
        f"{line}: this user may not open it",
        (f"sudo usermod -aG {_group(path)} $USER, then log out and in again",),
    )


def _group(path: Path) -> str:
    with contextlib.suppress(KeyError, OSError, NotImplementedError):
        return path.group()
    return "dialout"


def _bluetooth(is_needed: bool) -> Iterator[Diagnosis]:
    state, system = prevents(is_needed), platform.system()
    if system == "Darwin":
        tries = ("System Settings, Privacy, Bluetooth: allow your terminal",)
        yield Diagnosis("bluetooth", NOTE, "macOS asks once whether your terminal may use Bluetooth", tries)
    if system != "Linux":
        return
    adapters = sorted(p.name for p in _ADAPTERS.glob("hci*")) if _ADAPTERS.is_dir() else []
    if not adapters:
        yield Diagnosis("bluetooth", state, "this machine has no Bluetooth adapter", ("Plug one in.",))
        return
    if not _BUS.exists():
        tries = ("sudo systemctl start dbus bluetooth",)
        yield Diagnosis("bluetooth", state, f"adapter {', '.join(adapters)}, but no Bluetooth service", tries)
        return
    blocked = [p.name for p in _SWITCHES.glob("rfkill*") if _is_blocked(p)] if _SWITCHES.is_dir() else []
    if blocked:
        yield Diagnosis("bluetooth", state, "Bluetooth is switched off", ("rfkill unblock bluetooth",))
        return
    yield Diagnosis("bluetooth", OK, f"adapter {', '.join(adapters)}")


def _is_blocked(switch: Path) -> bool:
    with contextlib.suppress(OSError):
        texts = {name: (switch / name).read_text().strip() for name in ("type", "soft", "hard")}
        return texts["type"] == "bluetooth" and "1" in (texts["soft"], texts["hard"])
    return False
