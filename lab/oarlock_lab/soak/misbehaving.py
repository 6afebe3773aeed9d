"""A sculler's devices that vanish, return, restart their clocks, send rubbish and swap addresses, by a plan.

`python -m oarlock_lab.soak.misbehaving PORT SECONDS RATE_HZ` sends in true time what the plan says; the soak compares a
session's events with the plan.
"""

from __future__ import annotations

import heapq
import json
import random
import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

from oarlock import Model, load_model
from oarlock.live.simulated_devices import Delivery, Faults, endless, json_line
from oarlock.rowing.simulation.emulated import PERIOD_S, STREAMS, endless_sculling

FIRST_S, CYCLE_S = 10.0, 100.0
"""The plan begins when the clocks have settled, and repeats itself."""
VANISHES, RESTARTS, RETURNS_RESTARTED, ABSURD = "l_forearm", "r_upperarm", "seat", "l_upperarm"
SWAPPED = ("back", "r_forearm")
GONE_S, GONE_RESTARTED_S, RESTART_S, RUBBISH_S, SWAP_S = (10.0, 14.0), (85.0, 89.0), 30.0, 45.0, (60.0, 75.0)
ABSURD_S = (50.0, 50.2)
RUBBISH = 40
FAULTS = Faults(drift_ppm=40.0, least_ms=2.0, jitter_ms=4.0, loss=0.01)


@dataclass(frozen=True, order=True)
class Sent:
    """A datagram.

    Args:
        due_s: when it arrives, s from the start.
        sender: number of the socket that sends it; each has an address of its own.
        data: the bytes.
    """

    due_s: float
    sender: int
    data: bytes


@dataclass(frozen=True)
class Planted:
    """Something that goes wrong, and what the event must contain that names it."""

    at_s: float
    words: tuple[str, ...]


def planted(seconds: float) -> list[Planted]:
    """The plan, without what begins in the last seconds."""
    faults = []
    for cycle in range(int((seconds - FIRST_S) // CYCLE_S) + 1):
        begun_s = FIRST_S + cycle * CYCLE_S
        faults += [
            Planted(begun_s + at_s, words) for at_s, words in _cycle() if begun_s + at_s < seconds - 3.0
        ]
    return faults


def _cycle() -> Iterator[tuple[float, tuple[str, ...]]]:
    yield GONE_S[0], (f"{VANISHES} is silent",)
    yield GONE_S[1], (f"{VANISHES} is back",)
    yield RESTART_S, ("the clock of", f"/{RESTARTS} ", "was set")
    yield RUBBISH_S, ("messages of lines could not be decoded",)
    yield ABSURD_S[0], (f"readings of {ABSURD} are beyond",)
    for at_s in SWAP_S:
        for unit in SWAPPED:
            yield at_s, (f"{unit} comes from", "now, before from")
    yield GONE_RESTARTED_S[0], (f"{RETURNS_RESTARTED} is silent",)
    yield GONE_RESTARTED_S[1], (f"{RETURNS_RESTARTED} is back",)
    yield GONE_RESTARTED_S[1], ("the clock of", f"/{RETURNS_RESTARTED} ", "was set")


def sent(model: Model, seconds: float, rate_hz: float, seed: int = 0) -> Iterator[Sent]:
    """All datagrams in the order of their arrival."""
    devices = endless(endless_sculling(model, seed, rate_hz), PERIOD_S, FAULTS, seed)
    restarts = Restarts()
    good = (_sent(delivery, restarts) for delivery in _until(devices, seconds) if not _is_gone(delivery))
    yield from heapq.merge(good, _rubbish(seconds, seed), key=lambda delivery: delivery.due_s)


def _until(devices: Iterator[Delivery], seconds: float) -> Iterator[Delivery]:
    for device in devices:
        # A packet that is late at the end of a round comes after the first ones of the next.
        if device.due_s > seconds + 1.0:
            return
        if device.due_s <= seconds:
            yield device


def _in_cycle(due_s: float) -> tuple[int, float]:
    cycle, at_s = divmod(due_s - FIRST_S, CYCLE_S)
    return int(cycle), at_s


def _is_gone(delivery: Delivery) -> bool:
    cycle, at_s = _in_cycle(delivery.due_s)
    gone = {VANISHES: GONE_S, RETURNS_RESTARTED: GONE_RESTARTED_S}.get(delivery.device)
    return gone is not None and cycle >= 0 and gone[0] <= at_s < gone[1]


class Restarts:
    """The clocks of the devices, and the moment at which each was switched on last."""

    def __init__(self) -> None:
        self._since: dict[str, tuple[int, float, int]] = {}

    def stamped(self, delivery: Delivery) -> Delivery:
        """The delivery with the stamp and the count of a device that has restarted."""
        cycle, at_s = _in_cycle(delivery.due_s)
        at = {RESTARTS: RESTART_S, RETURNS_RESTARTED: GONE_RESTARTED_S[1]}.get(delivery.device)
        if at is None:
            return delivery
        last = cycle if at_s >= at else cycle - 1
        source, clock_s, count = self._since.get(delivery.device, (-1, 0.0, 0))
        if last > source:
            clock_s, count = delivery.clock_s - 1.0, delivery.count
            self._since[delivery.device] = (last, clock_s, count)
        # One that was on its way when the clock was set
        return replace(
            delivery, clock_s=max(delivery.clock_s - clock_s, 0.0), count=max(delivery.count - count, 0)
        )


def _sent(delivery: Delivery, restarts: Restarts) -> Sent:
    cycle, at_s = _in_cycle(delivery.due_s)
    stamped = restarts.stamped(delivery)
    if cycle >= 0 and delivery.device == ABSURD and ABSURD_S[0] <= at_s < ABSURD_S[1]:
        stamped = replace(stamped, values=dict.fromkeys(stamped.values, (1000000.0, -1000000.0, 1000000.0)))
    sender = STREAMS.index(delivery.device)
    if delivery.device in SWAPPED and cycle >= 0 and SWAP_S[0] <= at_s < SWAP_S[1]:
        sender = STREAMS.index(SWAPPED[1 - SWAPPED.index(delivery.device)])
    return Sent(delivery.due_s, sender, json_line(stamped))


def _rubbish(seconds: float, seed: int) -> Iterator[Sent]:
    """Each cycle from another sender, and a little with the name of a unit."""
    drawn = random.Random(seed)
    for cycle in range(int(max(seconds - FIRST_S, 0.0) // CYCLE_S) + 1):
        begun_s = FIRST_S + cycle * CYCLE_S + RUBBISH_S
        for number in range(RUBBISH):
            due_s = begun_s + 0.02 * number
            if due_s < seconds:
                sender = 0 if number % 4 == 0 else len(STREAMS) + cycle
                yield Sent(due_s, sender, _nonsense(drawn, number))


def _nonsense(drawn: random.Random, number: int) -> bytes:
    if number % 4 == 1:
        return drawn.randbytes(drawn.randrange(2000))
    if number % 4 == 2:
        return json.dumps({"device": "back", "t_us": number, "gyro_rad_s": [1e300, -1e300, 0.0]}).encode()
    return b'{"device": "back", "t_us": ' + b"[" * drawn.randrange(1, 900)


def main() -> None:
    """Sends in true time; says the start by the monotonic clock, ns, when the movement is simulated."""
    port, seconds, rate_hz = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
    packets = sent(load_model("sculler"), seconds, rate_hz)
    first = next(packets)
    begun_ns = time.monotonic_ns()
    print(begun_ns, flush=True)
    sockets: dict[int, socket.socket] = {}
    for delivery in heapq.merge([first], packets, key=lambda packet: packet.due_s):
        while (early_s := delivery.due_s - (time.monotonic_ns() - begun_ns) / 1e9) > 0.0:
            time.sleep(early_s)
        # A sender of rubbish is switched off before the next comes.
        for old in [n for n in sockets if len(STREAMS) <= n < delivery.sender]:
            sockets.pop(old).close()
        if delivery.sender not in sockets:
            sockets[delivery.sender] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sockets[delivery.sender].sendto(delivery.data, ("127.0.0.1", port))
    for own in sockets.values():
        own.close()


if __name__ == "__main__":
    main()
