"""A sculler who never stops, for emulated devices: the same strokes again and again, without a seam."""

from __future__ import annotations

import asyncio
import itertools
import sys
from collections.abc import Iterator
from contextlib import suppress

from oarlock import Calibration, Model, Recording, load_model, simulate
from oarlock.live.simulated_devices import Delivery, Faults, at_zero, endless, send
from oarlock.rowing.simulation.motion import sculling

STROKES, RATE_SPM, RATE_HZ = 8, 24.0, 100.0
PERIOD_S = STROKES * 60.0 / RATE_SPM
_LEAD_S = 5.0

STREAMS = (
    *("back", "r_upperarm", "r_forearm", "l_upperarm", "l_forearm"),
    *("seat", "r_oar_phi", "r_oar_alpha", "l_oar_phi", "l_oar_alpha"),
)
"""The sculler's devices: five units, and encoders of the seat and of the oars."""

USUAL_FAULTS = Faults(
    drift_ppm=40.0,
    least_ms=2.0,
    jitter_ms=4.0,
    loss=0.01,
    dropouts=tuple(("l_forearm", 60.0 + 180.0 * k, 63.0 + 180.0 * k) for k in range(100)),
    magnet=tuple(("back", 100.0 + 180.0 * k, 108.0 + 180.0 * k, 30.0) for k in range(100)),
)
"""A usual day in a boathouse: clocks that drift, Wi-Fi that queues and loses, a unit that drops out, a magnet."""


def endless_sculling(
    model: Model, seed: int = 0, rate_hz: float = RATE_HZ, calibration: Calibration | None = None
) -> Recording:
    """One period of strokes that are all alike, whose end joins its start, as the sensors of a model measure it.

    Args:
        model: a sculler.
        seed: of the noise.
        rate_hz: of the sensors.
        calibration: the mounts; None for the model's.
    """
    motion = sculling(model, _LEAD_S + PERIOD_S + 1.0, RATE_SPM, surge=False, variation=0.0, seed=seed)
    _, recording = simulate(model, motion, STREAMS, seed, rate_hz=rate_hz, calibration=calibration)
    return at_zero(recording, _LEAD_S, PERIOD_S)


def rowing_devices(
    model: Model, faults: Faults = USUAL_FAULTS, seed: int = 0, rate_hz: float = RATE_HZ
) -> Iterator[Delivery]:
    """What the devices of a sculler send who rows until she is stopped."""
    return endless(endless_sculling(model, seed, rate_hz), PERIOD_S, faults, seed)


def main() -> None:
    """Sends to the port, and at the rate in Hz, of the command line; says "ready" when the movement is simulated."""
    devices = rowing_devices(load_model("sculler"), rate_hz=float(sys.argv[2]))
    first = next(devices)
    print("ready", flush=True)
    with suppress(KeyboardInterrupt):  # Ctrl-C of a terminal reaches this process too
        asyncio.run(send(itertools.chain((first,), devices), "127.0.0.1", int(sys.argv[1])))


if __name__ == "__main__":  # a process of its own, so that it does not share the tracker's time
    main()
