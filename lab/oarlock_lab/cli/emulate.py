"""`oarlock lab emulate`: sends what a device would, for whoever has none."""

from __future__ import annotations

import asyncio
import signal
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Json, ModelName, Replace, example
from oarlock.cli.terminal import QUIET, UsageError, print_json, say, set_verbosity, steps, table, verb

if TYPE_CHECKING:
    from oarlock_lab.emulators.emulated import Emulated
    from oarlock_lab.emulators.kinds import EmulatorKind


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "emulate",
        epilog=example(
            "oarlock lab emulate --list",
            "oarlock lab emulate lines --model arm --rig-file rig.toml",
            "oarlock lab emulate lines --model arm --drift-ppm 50 --jitter-ms 10 --burst 3 --loss 0.03",
            "oarlock lab emulate lines --transport serial --path unit --model pendulum3",
            "oarlock lab emulate lines --replay trial --dropout back:20:25",
        ),
    )(emulate)


@verb
def emulate(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="Which device; see --list.")] = "",
    show: Annotated[bool, typer.Option("--list", help="List the kinds and end.")] = False,
    model: ModelName = "arm",
    folder: Annotated[
        Path | None,
        typer.Option("--replay", metavar="FOLDER", help="Send the readings of this recording, once."),
    ] = None,
    units: Annotated[
        str, typer.Option("--sensors", metavar="NAMES", help="Only these sensors. Default: all.")
    ] = "",
    transport: Annotated[
        str, typer.Option("--transport", metavar="NAME", help="udp, tcp, serial, ...; see --list.")
    ] = "",
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Who gets datagrams, or where to serve TCP.")
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option("--port", metavar="N", help="Port of the receiver, or of the first unit by TCP."),
    ] = None,
    path: Annotated[
        Path | None, typer.Option("--path", metavar="FILE", help="Where the serial line appears.")
    ] = None,
    adapter: Annotated[
        str, typer.Option("--adapter", metavar="NAME", help="Bluetooth adapter for bumble, such as usb:0.")
    ] = "",
    rate_hz: Annotated[
        float | None, typer.Option("--rate-hz", metavar="HZ", min=1.0, help="Default: the device's own.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Seed of movement, noise and faults.")] = 0,
    drift_ppm: Annotated[
        float, typer.Option("--drift-ppm", metavar="PPM", help="Clocks are fast or slow by this.")
    ] = 0.0,
    least_ms: Annotated[float, typer.Option("--least-ms", min=0.0, help="Least time on the way, ms.")] = 0.0,
    jitter_ms: Annotated[float, typer.Option("--jitter-ms", min=0.0, help="Mean of what is added.")] = 0.0,
    burst: Annotated[int, typer.Option("--burst", min=1, help="Readings that are sent together.")] = 1,
    loss: Annotated[float, typer.Option("--loss", min=0.0, max=1.0, help="Share of lost messages.")] = 0.0,
    dropout: Annotated[
        list[str] | None,
        typer.Option("--dropout", metavar="NAME:FROM:TO", help="A sensor is silent, s. Repeatable."),
    ] = None,
    rig: Annotated[
        Path | None, typer.Option("--rig-file", metavar="FILE", help="Write the rig file that receives it.")
    ] = None,
    force: Replace = False,
    seconds: Annotated[
        float | None, typer.Option("--duration-s", metavar="S", help="End after so long; default: Ctrl-C.")
    ] = None,
    json_output: Json = False,
) -> None:
    """Send what a device would send, without the device.

    The movement is a swing of a shipped body, strokes for bodies that row, or a recording. Clocks that drift, delays,
    bursts, losses and dropouts can be added.
    """
    from oarlock.live.simulated_devices import Faults
    from oarlock_lab.emulators.emulated import Destination

    if json_output:
        set_verbosity(QUIET)
    if show or not kind:
        kinds = _list()
        if json_output:
            print_json({"kinds": kinds})
        return
    chosen = _kind(kind)
    faults = Faults(drift_ppm, least_ms, jitter_ms, burst, loss, tuple(map(_dropout, dropout or ())))
    asked = _moving(model, folder, rate_hz or chosen.rate_hz, seed)
    place = Destination(transport, host, port, path, adapter)
    emulated = chosen.emulated(replace(_only(asked, units), faults=faults, seed=seed, place=place, say=say))
    if rig is not None:
        _write_rig(chosen, emulated, model, rig, force)
    asyncio.run(_until_stopped(chosen, emulated, seconds))
    if json_output:
        print_json({"kind": chosen.name, "rig": rig})


def _list() -> list[dict[str, object]]:
    """Prints and returns the kinds of devices."""
    from oarlock_lab.emulators.kinds import KINDS

    rows = [
        (k.name, ", ".join(k.transports), f"{k.rate_hz:g}", k.port or "", k.about) for k in KINDS.values()
    ]
    columns = ("kind", "transports", ">Hz", ">port", "sends")
    table(columns, rows)
    return [dict(zip((name.removeprefix(">").lower() for name in columns), row, strict=True)) for row in rows]


def _kind(name: str) -> EmulatorKind:
    from oarlock.storage.suggest import did_you_mean
    from oarlock_lab.emulators.kinds import KINDS

    if name not in KINDS:
        raise UsageError(f"{name}: no such device. {did_you_mean(name, sorted(KINDS))}")
    return KINDS[name]


def _dropout(text: str) -> tuple[str, float, float]:
    name, _, times = text.partition(":")
    with suppress(ValueError):
        from_s, to_s = (float(part) for part in times.split(":"))
        return name, from_s, to_s
    raise UsageError(f"--dropout {text}: expected NAME:FROM:TO, for example back:20:25")


def _moving(model: str, folder: Path | None, rate_hz: float, seed: int) -> Emulated:
    """What moves: a recording, a rower, or a body that swings."""
    import oarlock
    from oarlock.rowing.simulation import emulated
    from oarlock_lab.emulators.emulated import Emulated
    from oarlock_lab.emulators.swinging import PERIOD_S, swinging

    if folder is not None:
        return Emulated(oarlock.load_recording(folder))
    body = oarlock.load_model(model)
    if {"seat", *emulated.STREAMS} <= {sensor.name for sensor in body.describe().sensors}:
        return Emulated(emulated.endless_sculling(body, seed, rate_hz), emulated.PERIOD_S)
    return Emulated(swinging(body, rate_hz, seed)[1], PERIOD_S)


def _only(asked: Emulated, units: str) -> Emulated:
    from oarlock import Recording

    wanted = [name.strip() for name in units.split(",") if name.strip()]
    for name in wanted:
        if name not in asked.recording.names:
            known = ", ".join(asked.recording.names)
            raise UsageError(f"--sensors {name}: no such sensor; there are {known}")
    if not wanted:
        return asked
    return replace(asked, recording=Recording([s for s in asked.recording.streams if s.name in wanted]))


def _write_rig(kind: EmulatorKind, emulated: Emulated, model: str, file: Path, force: bool) -> None:
    import oarlock
    from oarlock.live.rig import rig_document
    from oarlock.storage.toml import write_toml
    from oarlock_lab.emulators.kinds import rig_of

    if file.exists() and not force:
        raise UsageError(f"{file} exists; --force replaces it")
    found = rig_of(kind, emulated, oarlock.load_model(model), model)
    write_toml(file, rig_document(found))
    if not found.feeds:
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
