"""Emulated devices through real sockets and serial lines: every byte, and the angles of the offline track."""

import asyncio
import os
from contextlib import suppress

import pytest

from oarlock_lab.emulators.kinds import KINDS
from oarlock_lab.soak.loopback import FAULTY, PERFECT, emulated_by
from oarlock_lab.soak.real_time import move_pendulum, own_lsl_session, place_of, run_and_compare, run_for_real

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


def by_address(packets):
    joined = {}
    for packet in packets:
        if packet.source:
            joined.setdefault(packet.address, []).append(packet.data)
    return joined


@pytest.mark.parametrize(("name", "transport"), WAYS)
def test_every_byte_arrives(pendulum, tmp_path, name, transport):
    model, _, recording = move_pendulum(pendulum, name, tmp_path)
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


IN_TIME = pytest.mark.parametrize(
    ("name", "transport"), [*WAYS, pytest.param("dot", "ble"), pytest.param("lsl", "lsl")]
)


@pytest.fixture(scope="module", autouse=True)
def streams_of_our_own():
    with suppress(ImportError, RuntimeError):
        own_lsl_session("oarlock-transports")


def for_real(pendulum, name, transport, faults, folder):
    if transport == "lsl":
        pytest.importorskip("pylsl", reason="needs pylsl, an extra")
    found = run_and_compare(pendulum, name, transport, faults, folder)
    print(name, transport, found.angles, f"clocks {1e3 * found.clocks_s:.2f} ms")
    return found


@pytest.mark.long
@IN_TIME
def test_in_real_time_the_angles_are_those_of_the_offline_track(pendulum, tmp_path, name, transport):
    found = for_real(pendulum, name, transport, PERFECT, tmp_path)
    # The arrivals of a busy machine say how well clocks can be known.
    assert found.angles.difference_deg < 0.1 + found.machine_deg


@pytest.mark.long
@IN_TIME
def test_in_real_time_faults_increase_the_error_by_a_fifth_at_most(pendulum, tmp_path, name, transport):
    found = for_real(pendulum, name, transport, FAULTY, tmp_path)
    assert found.angles.live_deg < 1.2 * found.angles.offline_deg + found.machine_deg
