"""Serial ports of this machine. None is opened: opening one resets some boards."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from oarlock.live.scan.finding import Finding, Problem


def ports(asked: frozenset[str] = frozenset()) -> tuple[list[Finding], list[Problem]]:
    """The ports but for those that are read already."""
    try:
        listing: Any = import_module("serial.tools.list_ports")
    except ImportError:
        return [], [Problem("Serial ports", "need pyserial: pip install 'oarlock[serial]'")]
    found = [
        Finding(
            f"serial port, {port.description}" if port.description not in ("", "n/a") else "serial port",
            port.device,
            None,
            note=f"was not opened; to see what it sends: oarlock live scan --source serial:{port.device}",
        )
        for port in sorted(listing.comports())
        if port.device not in asked
    ]
    return found, []
