"""Emulated devices by their real transports in real time: what a session received, against the offline track."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import oarlock
from oarlock import Model, Recording, Track
from oarlock.live.folder import LiveFolder
from oarlock.live.live import Live
from oarlock.live.reading import Packet
from oarlock.live.rig import Rig
from oarlock.live.session import COMMANDS, Estimate, LiveSession, command, recorded
from oarlock.live.simulated_devices import Faults
from oarlock.live.transports import opened
from oarlock.storage.arrays import Floats
from oarlock_lab.emulators.dot import Together
from oarlock_lab.emulators.emulated import Destination, Emulated
from oarlock_lab.emulators.kinds import KINDS, EmulatorKind, rig_of
from oarlock_lab.emulators.swinging import swinging
from oarlock_lab.soak.loopback import (
    COMPARED_FROM_S,
    FAULTY,
    LATE_S,
    PERFECT,
    START_NS,
    TRACKED_FROM_S,
    WAIT_S,
    Compared,
    angles_of,
    as_received,
    emulated_by,
    lived,
    packets_of,
    pendulum_with,
    rms,
    track_angles,
)

Carriers = tuple[Callable[..., Any], Callable[[Emulated], Coroutine[Any, Any, None]]]
"""What opens a source, and what sends for the emulated devices."""
LONG_WAIT_S = 5.0
"""Estimates wait so long: what a busy machine delivers late is used all the same."""
TRANSIT_S = 0.3
"""After all is sent."""
PATIENCE_S = 300.0
UNITS = 5
"""Ports that are asked for: of the receiver and of each unit."""


@dataclass(frozen=True)
class Ran:
    """What a session received by a real transport, in real time.

    Args:
        packets: in the order of arrival.
        start_ns: of the session.
        model, kind, emulated: what was run.
        rig: of the session.
    """

    packets: list[Packet]
    start_ns: int
    model: oarlock.Model
    kind: EmulatorKind
    emulated: Emulated
    rig: Rig


@dataclass(frozen=True)
class InTime:
    """What became of a run in real time.

    Args:
        angles: the live track beside the offline track of the same readings without faults.
        clocks_s: largest difference of a device's clock from the mean of all, at any time.
        virtual_clocks_s: the same where every message arrives when it is due: what the faults alone do.
        fastest_deg_s: how fast a link turns at most: the angles of all joints before it add up.
        lost: readings that this machine lost.
    """

    angles: Compared
    clocks_s: float
    virtual_clocks_s: float
    fastest_deg_s: float
    lost: int

    @property
    def machine_deg(self) -> float:
        """By how much an angle may be wrong because this machine delivered late all that could tell the clocks.

        An angle is that between two links, whose clocks may be off in opposite directions.
        """
        return 2.0 * self.fastest_deg_s * max(self.clocks_s - self.virtual_clocks_s, 0.0)


def free_ports(count: int) -> int:
    """The first of so many ports in a row at which nothing listens now."""
    while True:
        with socket.socket() as listener:
            listener.bind(("127.0.0.1", 0))
            first: int = listener.getsockname()[1]
        try:
            for port in range(first, first + count):
                for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
                    with socket.socket(type=kind) as listener:
                        listener.bind(("127.0.0.1", port))
        except (OSError, OverflowError):
            continue
        return first


def place_of(transport: str, folder: Path) -> Destination:
    """A place of this machine that is free."""
    if transport in ("ble", "lsl"):
        return Destination(transport)
    return Destination(transport, port=free_ports(UNITS), path=folder / "line")


def move_pendulum(pendulum: Model, name: str, folder: Path) -> tuple[Model, Track, Recording]:
    """A body with sensors that a kind can be, the truth, and what they measure."""
    is_marker = KINDS[name].streams == ("vector",)
    model = pendulum_with("position", folder) if is_marker else pendulum
    return model, *swinging(model, KINDS[name].rate_hz, seed=2)


def own_lsl_session(name: str) -> None:
    """Streams of the Lab Streaming Layer that nobody else finds; only before its first use in a process."""
    import pylsl

    pylsl.set_config_content(f"[lab]\nSessionID = {name}\n[multicast]\nResolveScope = machine\n")


async def run_for_real(kind: EmulatorKind, emulated: Emulated, model: Model, folder: Path) -> Ran:
    """Runs emulated devices and a session, connected by their transport, until all is sent."""
    rig = replace(rig_of(kind, emulated, model, model.name), wait_s=WAIT_S)
    transport_of, emulate = _by_bluetooth(kind) if emulated.place.transport == "ble" else _by_wire(kind)
    live = Live(rig, model, folder, transport_of=transport_of)
    running = asyncio.create_task(live.run())
    if emulated.place.transport == "udp":
        await live.started.wait()
    emulating = asyncio.create_task(emulate(replace(emulated, say=lambda text: None)))
    await asyncio.wait([emulating, running], return_when=asyncio.FIRST_COMPLETED)
    await _all_taken(live)
    for task in (emulating, running):
        task.cancel()
    await asyncio.gather(emulating, running, return_exceptions=True)
    place = LiveFolder.load(folder)
    return Ran(list(place.read()), place.start_ns, model, kind, emulated, rig)


async def _all_taken(live: Live) -> None:
    """Waits until nothing more arrives: a busy session has a queue."""
    before = -1
    while (received := sum(device.readings for device in live.session.intake.devices.values())) != before:
        before = received
        await asyncio.sleep(TRANSIT_S)


def _by_wire(kind: EmulatorKind) -> Carriers:
    return opened, kind.device.emulate


def _by_bluetooth(kind: EmulatorKind) -> Carriers:
    """Units and a radio on a link of this process."""
    from oarlock.live.transports.ble import Ble
    from oarlock.live.transports.transport import Options
    from oarlock_lab.emulators import dot
    from oarlock_lab.emulators.bluetooth import Air, VirtualRadio

    air = Air()

    def transport_of(source: Any) -> Any:
        options = {"profile": "dot", **source.decoder, **source.options}
        return Ble(source.name, Options(source.name, options), VirtualRadio(air.device()))

    async def emulate(emulated: Emulated) -> None:
        units = kind.device.wiring(emulated).senders
        barrier, waited = Together(len(units)), sum(1 for _ in kind.device.messages(emulated))
        done = asyncio.Event()

        def sent(_: object) -> None:
            nonlocal waited
            waited -= 1
            if not waited:
                done.set()

        devices = [
            asyncio.create_task(
                dot.be(air.device(own.address), emulated, unit, begun=barrier.begun, sent=sent)
            )
            for unit, own in units.items()
        ]
        try:
            await done.wait()
            await asyncio.sleep(TRANSIT_S)
        finally:
            for device in devices:
                device.cancel()
            with suppress(asyncio.CancelledError):
                await asyncio.gather(*devices, return_exceptions=True)

    return transport_of, emulate


def compared_in_time(ran: Ran, truth: Track, wait_s: float = LONG_WAIT_S) -> InTime:
    """The live track of what was received beside the offline track of what was measured.

    The offline track has the readings later by as much as the session's clocks have them in the mean: that is the way
    through this machine. By how much devices differ from that is the error of their clocks.

    Args:
        ran: a run.
        truth: of the movement.
        wait_s: how long estimates wait for late readings.
    """
    from_devices = [packet for packet in ran.packets if packet.source != COMMANDS]
    # A session on a busy machine may begin to track late.
    track = command(from_devices[0].arrival_ns + round(1e9 * TRACKED_FROM_S), "track")
    stop = command(from_devices[-1].arrival_ns + 1, "stop")
    packets = sorted([*from_devices, track, stop], key=lambda packet: packet.arrival_ns)
    begins_s = (from_devices[0].arrival_ns - ran.start_ns) / 1e9 + COMPARED_FROM_S
    session = LiveSession(replace(ran.rig, wait_s=wait_s), ran.model, ran.start_ns)
    estimates, late_s = _tracked(session, ran, packets)
    assert not session.problems and estimates
    mean_s, clocks_s = _spread(late_s, begins_s)
    carried = ran.kind.device.wiring(ran.emulated).values
    carried_on = as_received(ran.emulated.recording, carried, mean_s)
    assert session.from_s is not None
    measured, lost = _arrived(ran, carried_on, session.from_s)
    whole = oarlock.track(ran.model, measured, config=session.config)
    live, offline = angles_of(ran.model, estimates), track_angles(ran.model, whole)
    true = track_angles(ran.model, truth, mean_s)
    time_s = live.time_s[(live.time_s >= begins_s) & (live.time_s <= offline.time_s[-1])]
    assert len(time_s) > 100
    live_deg, offline_deg, true_deg = (angles.at(time_s) for angles in (live, offline, true))
    comparison = Compared(
        float(np.abs(live_deg - offline_deg).max()),
        rms(live_deg - true_deg),
        rms(offline_deg - true_deg),
        session,
    )
    fastest_deg_s = float(np.abs(np.gradient(true.deg, true.time_s, axis=0)).sum(axis=1).max())
    return InTime(comparison, clocks_s, _clocks_without_a_machine_s(ran), fastest_deg_s, lost)


def _arrived(ran: Ran, measured: Recording, from_s: float) -> tuple[Recording, int]:
    """Where devices lose nothing, what the session tracked from a time on. And how many readings this machine lost.

    It begins with the very readings with which the session began: a track remembers its first sample for seconds.
    """
    if ran.emulated.faults.loss:
        return measured.slice(start_s=from_s), 0
    came, streams, lost = recorded(ran.packets, ran.rig, ran.start_ns), [], 0
    for stream in measured.streams:
        time_s = np.concatenate([[-np.inf], came[stream.name].time_s, [np.inf]])
        after = np.searchsorted(time_s, stream.time_s)
        is_next = time_s[after] - stream.time_s < stream.time_s - time_s[after - 1]
        nearest_s = time_s[np.where(is_next, after, after - 1)]
        has_come = np.abs(nearest_s - stream.time_s) < 0.5 / stream.rate_hz
        lost += int((~has_come).sum())
        rows = has_come & (nearest_s >= from_s)
        streams.append(stream.at_rows(rows, stream.time_s[rows]))
    return oarlock.Recording(streams), lost


def _tracked(
    session: LiveSession, ran: Ran, packets: Iterable[Packet]
) -> tuple[list[Estimate], dict[tuple[str, str, str], Floats]]:
    """Estimates, and for each device when a packet came and by how much its clock was late then, s."""
    on_time = replace(PERFECT, drift_ppm=ran.emulated.faults.drift_ppm)
    calibration, _ = lived(ran.kind, replace(ran.emulated, faults=on_time), ran.model)
    estimates: list[Estimate] = []
    late_s: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for packet in packets:
        estimates += session.take(packet)
        arrival_s = session.intake.seconds(packet.arrival_ns)
        for key, device in session.intake.devices.items():
            if device.streams and device.clock.offset_s is not None:
                offset_s = calibration.intake.devices[key].clock.offset_s
                assert offset_s is not None
                true_s = offset_s - LATE_S
                late_s.setdefault(key, []).append((arrival_s, device.clock.offset_s - true_s))
    return estimates, {key: np.array(values) for key, values in late_s.items()}


def _spread(late_s: Mapping[tuple[str, str, str], Floats], from_s: float) -> tuple[float, float]:
    """The mean of all clocks from a time on, and the largest difference from it at any time, s.

    What a clock was wrong by at the start has a part in later angles, by the biases that were learnt with it.
    """
    mean_s = float(np.mean([values[values[:, 0] >= from_s, 1].mean() for values in late_s.values()]))
    return mean_s, max(float(np.abs(values[:, 1] - mean_s).max()) for values in late_s.values())


def _clocks_without_a_machine_s(ran: Ran) -> float:
    """The error of clocks where every message arrives when it is due."""
    session = LiveSession(ran.rig, ran.model, START_NS)
    _, late_s = _tracked(session, ran, packets_of(ran.kind, ran.emulated))
    return _spread(late_s, COMPARED_FROM_S)[1]


WAYS = [(name, transport) for name, kind in KINDS.items() if kind.streams for transport in kind.transports]
"""Kinds that measure a movement, by each of their transports."""
FAULTS = {"perfect": PERFECT, "faulty": FAULTY}


def measured(ways: Sequence[tuple[str, str]] = WAYS) -> list[dict[str, Any]]:
    """Each kind by each transport, with perfect clocks and with faults; a row for each."""
    own_lsl_session("oarlock-bench")
    pendulum = oarlock.load_model("pendulum3")
    return [_row(pendulum, name, transport) for name, transport in ways]


def _row(pendulum: Model, name: str, transport: str) -> dict[str, Any]:
    figures: dict[str, dict[str, float]] = {}
    for label, faults in FAULTS.items():
        with TemporaryDirectory() as folder:
            comparison = run_and_compare(pendulum, name, transport, faults, Path(folder))
        figures[label] = {
            "difference_deg": comparison.angles.difference_deg,
            "live_deg": comparison.angles.live_deg,
            "offline_deg": comparison.angles.offline_deg,
            "clocks_ms": 1e3 * comparison.clocks_s,
            "lost": comparison.lost,
        }
    print(name, transport, figures, flush=True)
    return {"kind": name, "transport": transport, "rate_hz": KINDS[name].rate_hz, **figures}


def run_and_compare(pendulum: Model, name: str, transport: str, faults: Faults, folder: Path) -> InTime:
    """One kind by one transport.

    Args:
        pendulum: with inertial units.
        name: of the kind.
        transport: that it uses.
        faults: of its devices.
        folder: empty, for the session.
    """
    model, truth, recording = move_pendulum(pendulum, name, folder)
    kind, emulated = emulated_by(name, recording, faults, place=place_of(transport, folder))
    running = run_for_real(kind, emulated, model, folder / "today")
    return compared_in_time(asyncio.run(asyncio.wait_for(running, PATIENCE_S)), truth)
