"""Serial ports of this machine. None is opened: opening one resets some boards."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from oarlock.live.scan.finding import ScanProblem, Sender


def ports(asked: frozenset[str] = frozenset()) -> tuple[list[Sender], list[ScanProblem]]:
    """The ports but for those that are read already."""
    try:
        listing: Any = import_module("serial.tools.list_ports")
    except ImportError:
        return [], [ScanProblem("Serial ports", "need pyserial: pip install 'oarlock[serial]'")]
    found = [
        Sender(
            f"serial port, {port.description}" if port.description not in ("", "n/a") else "serial port",
            port.device,
            None,
            note=f"was not opened; to see what it sends: oarlock live scan --source serial:{port.device}",
        )
        for port in sorted(listing.comports())
        if port.device not in asked
    ]
    return found, []
