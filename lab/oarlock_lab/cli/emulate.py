"""`oarlock lab emulate`: sends what a device would, for whoever has none."""

from __future__ import annotations

import asyncio
import signal
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.terminal import UsageError, say, steps, table
from oarlock.cli.verbs import ModelName, NewFile, command

if TYPE_CHECKING:
    from oarlock import Recording
    from oarlock_lab.emulators.emulated import Emulated
    from oarlock_lab.emulators.kinds import EmulatorKind


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock lab emulate --list",
        "oarlock lab emulate lines --model arm --rig-file rig.toml",
        "oarlock lab emulate lines --model arm --drift-ppm 50 --jitter-ms 10 --burst 3 --loss 0.03",
        "oarlock lab emulate lines --transport serial --path unit --model pendulum3",
        "oarlock lab emulate lines --replay trial --dropout back:20:25",
        show=_show,
        metavars={
            "kind": "KIND",
            "replay": "FOLDER",
            "host": "ADDRESS",
            "dropout": "NAME:FROM:TO",
        },
        bounds={
            "rate_hz": (1.0, None),
            "least_ms": (0.0, None),
            "jitter_ms": (0.0, None),
            "burst": (1, None),
            "loss": (0.0, 1.0),
        },
    )(emulate)


def emulate(
    kind: str = "",
    *,
    list_: bool = False,
    model: ModelName = "arm",
    replay: Recording | None = None,
    sensors: tuple[str, ...] = (),
    transport: str = "",
    host: str = "127.0.0.1",
    port: int | None = None,
    path: Path | None = None,
    adapter: str = "",
    rate_hz: float | None = None,
    seed: int = 0,
    drift_ppm: float = 0.0,
    least_ms: float = 0.0,
    jitter_ms: float = 0.0,
    burst: int = 1,
    loss: float = 0.0,
    dropout: list[str] | None = None,
    rig_file: NewFile | None = None,
    duration_s: float | None = None,
) -> dict[str, Any]:
    """Send what a device would send, without the device.

    The movement is a swing of a shipped body, strokes for bodies that row, or a recording. Clocks that drift, delays,
    bursts, losses and dropouts can be added.

    Args:
        kind: which device; see --list.
        list_: list the kinds and end.
        model: name of a shipped model, or a model file.
        replay: send the readings of this recording, once.
        sensors: only these sensors; default: all.
        transport: such as udp, tcp or serial; see --list.
        host: who gets datagrams, or where to serve TCP.
        port: port of the receiver, or of the first unit by TCP.
        path: where the serial line appears.
        adapter: bluetooth adapter for bumble, such as usb:0.
        rate_hz: default: the device's own.
        seed: seed of movement, noise and faults.
        drift_ppm: clocks are fast or slow by this.
        least_ms: least time on the way, ms.
        jitter_ms: mean of what is added, ms.
        burst: readings that are sent together.
        loss: share of lost messages.
        dropout: a sensor is silent, s. Repeatable.
        rig_file: write the rig file that receives it.
        duration_s: end after so long; default: Ctrl-C.
    """
    from oarlock.live.simulated_devices import Faults
    from oarlock.storage.suggest import did_you_mean
    from oarlock_lab.emulators.emulated import Destination, Emulated
    from oarlock_lab.emulators.kinds import KINDS

    if list_ or not kind:
        names = ("name", "transports", "rate_hz", "port", "about")
        return {"kinds": [{name: getattr(own, name) or None for name in names} for own in KINDS.values()]}
    if kind not in KINDS:
        raise UsageError(f"{kind}: no such device. {did_you_mean(kind, sorted(KINDS))}")
    device = KINDS[kind]
    faults = Faults(drift_ppm, least_ms, jitter_ms, burst, loss, tuple(map(_dropout, dropout or ())))
    moving = _moving(model, rate_hz or device.rate_hz, seed) if replay is None else Emulated(replay)
    place = Destination(transport, host, port, path, adapter)
    emulated = device.emulated(
        replace(_only(moving, sensors), faults=faults, seed=seed, place=place, say=say)
    )
    if rig_file is not None:
        write_rig(device, emulated, model, rig_file)
    asyncio.run(_until_stopped(device, emulated, duration_s))
    return {"kind": device.name, "rig": rig_file}


def _show(result: dict[str, Any]) -> None:
    kinds = [[*kind.values()] for kind in result.get("kinds", ())]
    if kinds:
        table(
            ("kind", "transports", ">Hz", ">port", "sends"),
            [(name, ", ".join(own), f"{hz:g}", port or "", about) for name, own, hz, port, about in kinds],
        )


def _dropout(text: str) -> tuple[str, float, float]:
    name, _, times = text.partition(":")
    with suppress(ValueError):
        from_s, to_s = (float(part) for part in times.split(":"))
        return name, from_s, to_s
    raise UsageError(f"--dropout {text}: expected NAME:FROM:TO, for example back:20:25")


def _moving(model: str, rate_hz: float, seed: int) -> Emulated:
    """A rower, or a body that swings."""
    import oarlock
    from oarlock.rowing.simulation import emulated
    from oarlock_lab.emulators.emulated import Emulated
    from oarlock_lab.emulators.swinging import PERIOD_S, swinging

    body = oarlock.load_model(model)
    if {"seat", *emulated.STREAMS} <= {sensor.name for sensor in body.describe().sensors}:
        return Emulated(emulated.endless_sculling(body, seed, rate_hz), emulated.PERIOD_S)
    return Emulated(swinging(body, rate_hz, seed)[1], PERIOD_S)


def _only(moving: Emulated, sensors: tuple[str, ...]) -> Emulated:
    from oarlock import Recording

    for name in sensors:
        if name not in moving.recording.names:
            names = ", ".join(moving.recording.names)
            raise UsageError(f"--sensors {name}: no such sensor; there are {names}")
    if not sensors:
        return moving
    return replace(moving, recording=Recording([s for s in moving.recording.streams if s.name in sensors]))


def write_rig(kind: EmulatorKind, emulated: Emulated, model: str, file: Path) -> None:
    """Write the rig file that receives what a kind sends, and say what to do with it."""
    import oarlock
    from oarlock.live.rig import rig_document
    from oarlock.storage.toml import write_toml
    from oarlock_lab.emulators.kinds import rig_of

    rig = rig_of(kind, emulated, oarlock.load_model(model), model)
    write_toml(file, rig_document(rig))
    if not rig.feeds:
        say(
            f"{kind.name} feeds no sensor of a body: a session with this rig shows and records what it sends. To track "
            f"a body at the same time, add the sources and streams of its sensors to {file}."
        )
    steps(f"oarlock live run {file} --out today")


async def _until_stopped(kind: EmulatorKind, emulated: Emulated, seconds: float | None) -> None:
    running = asyncio.ensure_future(kind.device.emulate(emulated))
    loop = asyncio.get_running_loop()
    for stopped in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError):  # Windows has no handlers of an event loop
            loop.add_signal_handler(stopped, running.cancel)
    with suppress(asyncio.CancelledError, TimeoutError):
        await asyncio.wait_for(running, seconds)
