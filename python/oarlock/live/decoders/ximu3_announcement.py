"""Reads what x-IMU3 units broadcast in a network, for whoever looks for units.

Source: x-io Technologies, x-IMU3 User Manual, "Network announcement".
"""

from __future__ import annotations

import json
from dataclasses import dataclass

PORT = 10000
"""UDP."""


@dataclass(frozen=True)
class Announcement:
    """What a unit broadcasts once a second to UDP port 10000.

    Args:
        name, serial: of the unit.
        address: its IP address.
        tcp_port: where it serves its stream.
        udp_listens, udp_sends_to: its own UDP port, and the port of the host to which it sends.
        rssi_percent: -1 for a unit that is the access point.
        battery_percent: charge.
    """

    name: str
    serial: str
    address: str
    tcp_port: int
    udp_listens: int
    udp_sends_to: int
    rssi_percent: float
    battery_percent: float


def announcement(data: bytes) -> Announcement | None:
    """The announcement in a datagram; None if it is none."""
    try:
        told = json.loads(data)
        name, serial, address = (str(told[key]) for key in ("name", "sn", "ip"))
        tcp, listens, sends = (int(told[key]) for key in ("port", "receive", "send"))
        rssi, battery = float(told["rssi"]), float(told["battery"])
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError):
        return None
    return Announcement(name, serial, address, tcp, listens, sends, rssi, battery)
