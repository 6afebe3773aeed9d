"""Emulated devices through real sockets and serial lines: every byte, and the angles of the offline track."""

import asyncio
import os
import socket

import pytest
from loopback import PERFECT, compared_in_time, emulated_by, pendulum_with, run_for_real

from oarlock.live.emulators.emulated import Place
from oarlock.live.emulators.kinds import KINDS
from oarlock.live.emulators.swinging import swinging

SOCKETS = ("udp", "tcp", "serial")
WAYS = [
    pytest.param(
        *(name, transport),
        id=f"{name}-{transport}",
        marks=[pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals")]
        * (transport == "serial"),
    )
    for name, kind in KINDS.items()
    if kind.streams
    for transport in kind.transports
    if transport in SOCKETS
]


def free_ports(count):
    """The first of so many ports in a row at which nothing listens now."""
    while True:
        with socket.socket() as one:
            one.bind(("127.0.0.1", 0))
            first = one.getsockname()[1]
        try:
            for port in range(first, first + count):
                for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
                    with socket.socket(type=kind) as one:
                        one.bind(("127.0.0.1", port))
        except (OSError, OverflowError):
            continue
        return first


def moved(pendulum, name, folder):
    """A body with sensors that a kind can be, the truth, and what they measure."""
    is_marker = KINDS[name].streams == ("vector",)
    model = pendulum_with("position", folder) if is_marker else pendulum
    return model, *swinging(model, KINDS[name].rate_hz, seed=2)


def place_of(transport, folder):
    return Place(transport, port=free_ports(5), path=folder / "line")


def by_address(packets):
    joined = {}
    for packet in packets:
        if packet.source:
            joined.setdefault(packet.address, []).append(packet.data)
    return joined


@pytest.mark.parametrize(("name", "transport"), WAYS)
def test_every_byte_arrives(pendulum, tmp_path, name, transport):
    model, _, recording = moved(pendulum, name, tmp_path)
    place = place_of(transport, tmp_path)
    kind, emulated = emulated_by(name, recording.slice(end_s=0.8), PERFECT, place=place)
    ran = asyncio.run(asyncio.wait_for(run_for_real(kind, emulated, model, tmp_path / "today"), 60))
    wired = kind.device.wiring(emulated)
    sent = {}
    for message in kind.device.messages(emulated):
        sent.setdefault(wired.senders[message.unit].address, []).append(message.data)
    heard = by_address(ran.packets)
    assert heard.keys() == sent.keys()
    for address, parts in sent.items():
        if transport == "udp":
            assert heard[address] == parts
        else:
            replies = parts.pop(0) if name == "shimmer3" else b""
            told, expected = b"".join(heard[address]), b"".join(parts)
            assert told.startswith(replies)
            told = told.removeprefix(replies)
            # What was sent before all lines were open is lost, and what the device had not sent when it ended.
            assert told in expected and len(told) > 0.4 * len(expected)


@pytest.mark.long
@pytest.mark.parametrize(("name", "transport"), WAYS)
def test_in_real_time_the_angles_are_those_of_the_offline_track(pendulum, tmp_path, name, transport):
    model, truth, recording = moved(pendulum, name, tmp_path)
    kind, emulated = emulated_by(name, recording, PERFECT, place=place_of(transport, tmp_path))
    ran = asyncio.run(asyncio.wait_for(run_for_real(kind, emulated, model, tmp_path / "today"), 60))
    found, spread_s, fastest_deg_s = compared_in_time(ran, truth)
    print(name, transport, found, f"clocks {1e3 * spread_s:.2f} ms")
    # The arrivals of a busy machine say how well clocks can be known.
    assert found.difference_deg < 0.1 + fastest_deg_s * spread_s
