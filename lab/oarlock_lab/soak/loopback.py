"""Emulated devices to joint angles: what a session makes of their bytes, against the offline track and the truth."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

import oarlock
from oarlock import Model, Recording, Track
from oarlock.live.reading import Packet
from oarlock.live.session import Estimate, LiveSession, command
from oarlock.live.simulated_devices import Faults
from oarlock.recording.streams import Stream
from oarlock.storage.arrays import Floats
from oarlock_lab.emulators.emulated import Destination, Emulated
from oarlock_lab.emulators.kinds import KINDS, EmulatorKind, rig_of

START_NS = 7_000_000_000_000
TRACKED_FROM_S, COMPARED_FROM_S = 3.0, 5.0
"""Clocks settle in 2 s; a track needs a while to forget how it began."""
LATE_S = 1e-3
"""Least time on the way."""
PERFECT = Faults(least_ms=1e3 * LATE_S, jitter_ms=0.0)
FAULTY = Faults(drift_ppm=50.0, least_ms=1e3 * LATE_S, jitter_ms=10.0, burst=3, loss=0.03)
WAIT_S = 0.15
"""An estimate waits for late readings: bursts of three at 60 Hz, and ten times the mean of the jitter."""


LINKS = ("upper_link", "middle_link", "lower_link")
SENSORS = {"orientation": "std_rad = 0.01", "position": "std_m = 0.001\npoint = [0.1, 0, 0]"}


@dataclass(frozen=True)
class Angles:
    """Angles of hinges over the time of the movement.

    Args:
        time_s: (T,) of the movement.
        deg: (T, n) angles, degrees.
    """

    time_s: Floats
    deg: Floats

    def at(self, time_s: Floats) -> Floats:
        """(T, n) linear between samples."""
        return np.column_stack([np.interp(time_s, self.time_s, column) for column in self.deg.T])


@dataclass(frozen=True)
class Compared:
    """A live track beside the offline track of the same readings without faults.

    Args:
        difference_deg: largest difference of an angle.
        live_deg, offline_deg: root mean square errors to the ground truth.
        session: that made the live track.
    """

    difference_deg: float
    live_deg: float
    offline_deg: float
    session: LiveSession = field(repr=False)


def pendulum_with(kind: str, folder: Path) -> Model:
    """The shipped pendulum with other sensors on its links."""
    shipped = (resources.files("oarlock.model") / "shipped" / "pendulum3.toml").read_text()
    sensors = "\n".join(
        f'[[sensor]]\nname = "{link}_{kind}"\nkind = "{kind}"\nframe = "{link}"\n{SENSORS[kind]}\n'
        for link in LINKS
    )
    file = folder / f"{kind}.toml"
    file.write_text(shipped.partition("\n[[sensor]]\n")[0] + "\n" + sensors)
    return oarlock.load_model(file)


def emulated_by(
    name: str,
    recording: Recording,
    faults: Faults,
    seed: int = 0,
    place: Destination | None = None,
    **keys: Any,
) -> tuple[EmulatorKind, Emulated]:
    """A kind, and what it is asked to emulate."""
    kind = KINDS[name]
    emulated = Emulated(recording, faults=faults, seed=seed, place=place or Destination(), **keys)
    return kind, kind.emulated(emulated)


def packets_of(kind: EmulatorKind, emulated: Emulated) -> Iterator[Packet]:
    """Packets as a receiver's transport delivers them, at the times at which they are due."""
    wired = kind.device.wiring(emulated)
    for message in kind.device.messages(emulated):
        own = wired.senders[message.unit]
        arrival_ns = START_NS + round(1e9 * message.due_s)
        yield Packet(own.source, own.address, message.channel, arrival_ns, message.data)


def lived(
    kind: EmulatorKind, emulated: Emulated, model: Model, packets: Iterable[Packet] | None = None
) -> tuple[LiveSession, list[Estimate]]:
    """A session and its estimates from packets; tracking begins when the clocks have settled."""
    rig = replace(rig_of(kind, emulated, model, model.name), wait_s=WAIT_S)
    session, estimates = LiveSession(rig, model, START_NS), list[Estimate]()
    sequence = list(packets_of(kind, emulated) if packets is None else packets)
    track = command(START_NS + round(1e9 * TRACKED_FROM_S), "track")
    ordered = sorted([*sequence, track], key=lambda packet: packet.arrival_ns)
    for packet in [*ordered, command(ordered[-1].arrival_ns + 1, "stop")]:
        estimates += session.take(packet)
    assert not session.problems
    return session, estimates


def angles_of(model: Model, estimates: Sequence[Estimate]) -> Angles:
    """Angles of the hinges of estimates."""
    names = [joint.name for joint in model.describe().joints if joint.kind == "hinge"]
    columns = [estimates[0].belief.state_names.index(name) for name in names]
    time_s = np.array([estimate.time_s for estimate in estimates])
    return Angles(time_s, np.degrees([np.asarray(estimate.belief.mean)[columns] for estimate in estimates]))


def track_angles(model: Model, track: Track, late_s: float = 0.0) -> Angles:
    """Angles of the hinges of an offline track."""
    names = [joint.name for joint in model.describe().joints if joint.kind == "hinge"]
    columns = [track.coordinate_names.index(name) for name in names]
    return Angles(track.time_s + late_s, np.degrees(track.q[:, columns]))


def compared(
    kind: EmulatorKind,
    emulated: Emulated,
    model: Model,
    truth: Track,
    packets: Iterable[Packet] | None = None,
) -> Compared:
    """A session of an emulated device beside the offline track of what it measured, and the truth."""
    session, estimates = lived(kind, emulated, model, packets)
    live = angles_of(model, estimates)
    measured = as_received(emulated.recording, kind.device.wiring(emulated).values)
    whole = oarlock.track(model, measured.slice(start_s=TRACKED_FROM_S), config=session.config)
    offline, true = track_angles(model, whole), track_angles(model, truth, LATE_S)
    time_s = live.time_s[(live.time_s >= COMPARED_FROM_S) & (live.time_s <= offline.time_s[-1])]
    assert len(time_s) > 100
    live_deg, offline_deg, true_deg = (angles.at(time_s) for angles in (live, offline, true))
    return Compared(
        float(np.abs(live_deg - offline_deg).max()),
        rms(live_deg - true_deg),
        rms(offline_deg - true_deg),
        session,
    )


def as_received(recording: Recording, values: Collection[str], late_s: float = LATE_S) -> Recording:
    """A recording with the quantities that a wire carries, in the time of the receiver.

    That time is later by the least time on the way, which no clock can tell.
    """

    def cut(stream: Stream) -> Stream:
        if stream.kind != "imu":
            return stream.at_rows(slice(None), stream.time_s + late_s)
        columns = {name: rows for name, rows in stream.values.items() if name in values}
        return oarlock.recording.ImuStream(stream.name, stream.time_s + late_s, **columns)

    return oarlock.Recording([cut(stream) for stream in recording.streams])


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
