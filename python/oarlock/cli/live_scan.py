"""`oarlock live scan`: lists the sensors that can be heard now."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Coroutine
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.options import Json, example
from oarlock.cli.terminal import (
    Result,
    Told,
    UsageError,
    heading,
    number,
    print_json,
    progress,
    say,
    steps,
    table,
    verb,
)

if TYPE_CHECKING:
    from oarlock.live.rig import Source
    from oarlock.live.scan.finding import Scan, ScanDevice, ScanProblem, Sender
    from oarlock.live.scan.scan import ScanRequest

_TICK_S = 0.1
PLACES = "network, ble, lsl, serial"
LookSeconds = Annotated[
    float, typer.Option("--duration-s", metavar="S", min=0.1, max=600.0, help="How long to listen.")
]
Only = Annotated[
    str | None, typer.Option("--places", metavar="PLACES", help=f"Where to look, some of {PLACES}, or none.")
]
Sources = Annotated[
    list[str] | None,
    typer.Option(
        "--source",
        metavar="WORDS",
        help="Open this, too: udp:PORT, tcp:HOST:PORT, serial:DEVICE[@BAUD], each with :FORMAT if you know it. "
        "Repeatable.",
    ),
]


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "scan",
        epilog=example(
            "oarlock live scan",
            "oarlock live scan --places network --duration-s 10",
            "oarlock live scan --source serial:/dev/ttyUSB0@115200",
            "oarlock live scan --source tcp:192.168.1.20:7000:ximu3 --json",
        ),
    )(scan)


@verb
def scan(
    seconds: LookSeconds = 5.0,
    only: Only = None,
    source: Sources = None,
    connect: Annotated[
        bool,
        typer.Option("--connect", help="Connect to the x-IMU3 units that are found, to see what they send."),
    ] = False,
    every: Annotated[
        bool, typer.Option("--all", help="List Bluetooth devices that are no sensors, too.")
    ] = False,
    json_output: Json = False,
) -> None:
    """List the sensors that can be heard now: in the network, by Bluetooth, LSL and serial ports.

    Serial ports are listed and not opened, and no device is connected, unless you ask for it.
    """
    found = look(asked(seconds, only, source, connect))
    if json_output:
        print_json(found)
        return
    write_scan(found, every)
    steps(
        "oarlock live init --model MODEL --out rig.toml    a rig file of what was found",
        "oarlock live doctor                               if a sensor is missing here",
    )


def asked(seconds: float, only: str | None, sources: list[str] | None, connects: bool) -> ScanRequest:
    """What the options of a scan ask for.

    Raises:
        UsageError: a place that does not exist, or words that are no source.
    """
    from oarlock.cli.options import names
    from oarlock.live.scan import scan as places
    from oarlock.live.scan.source_words import source_of
    from oarlock.storage.errors import DataError

    chosen = places.PLACES if only is None else names(only)
    for place in chosen:
        if place not in places.PLACES:
            raise UsageError(f"--places {place}: choose some of {PLACES}, or none")
    try:
        opened = [source_of(text) for text in sources or ()]
    except DataError as error:
        raise UsageError(str(error)) from None
    return places.ScanRequest(seconds, chosen, opened, connects)


def look(what: ScanRequest) -> Scan:
    """Scan, with a bar that shows the time."""
    from oarlock.live.scan.scan import scan as look_everywhere

    with progress("listening") as told:
        return asyncio.run(timed(look_everywhere(what), what.seconds, told))


async def timed(work: Coroutine[Any, Any, Result], seconds: float, told: Told) -> Result:
    """What takes about so long, with a progress bar that shows the time."""
    task, begun_s = asyncio.ensure_future(work), time.monotonic()
    while not (await asyncio.wait([task], timeout=_TICK_S))[0]:
        told(min((time.monotonic() - begun_s) / seconds, 1.0))
    return task.result()


def write_scan(found: Scan, every: bool = False) -> None:
    """Prints what was found, by the source that receives it."""
    from oarlock.live.scan.finding import received_together

    if not found.findings:
        say(f"Nothing was heard in {found.seconds:g} s. Are the sensors on, and in this network?")
    for source, senders in received_together(found.findings):
        _write_source(source, senders)
    unread = [one for one in found.findings if one.source is None]
    if unread:
        heading("Not read")
        for one in unread:
            say(f"{one.address}  {one.what}", indent=2)
            say(one.note, indent=4)
    if every and found.others:
        heading("Bluetooth devices that are no sensors")
        table(["address", "name", ">signal"], [(one.address, one.what, one.signal) for one in found.others])
    elif found.others:
        say(f"\n{len(found.others)} Bluetooth devices are no known sensors; --all lists them.")
    write_problems(found.problems)


def write_problems(problems: tuple[ScanProblem, ...]) -> None:
    """Prints where the scan could not look."""
    if problems:
        heading("Could not look everywhere")
        for problem in problems:
            say(f"{problem.where}: {problem.text}", indent=2)


def _write_source(source: Source, senders: list[Sender]) -> None:
    from oarlock.live.decoders import DECODERS
    from oarlock.live.scan.finding import devices_of
    from oarlock.live.scan.source_words import words_of

    kinds = list(dict.fromkeys(one.what for one in senders))
    heading(kinds[0] if len(kinds) == 1 else DECODERS[source.format].about.partition(":")[0])
    devices = devices_of(senders)
    table(
        ["device", "sends", ">Hz", ">battery", ">lost", ">signal", "from"],
        [_row(one, one.finding.what if len(kinds) > 1 else one.finding.address) for one in devices],
    )
    for note in dict.fromkeys(one.note for one in senders if one.note):
        say(note, indent=2)
    say(f"rig file: {words_of(source)}", style="dim", indent=2)


def _row(one: ScanDevice, origin: str) -> tuple[str, ...]:
    from oarlock.live.scan.finding import sends

    part, found = one.part, one.finding
    battery = found.battery_percent
    if part is not None and part.battery_percent is not None:
        battery = part.battery_percent
    return (
        one.name,
        "unknown before a connection" if part is None else sends(tuple(part.rates_hz)),
        "" if part is None else number(part.rate_hz, ".4g", ""),
        _percent(battery),
        "" if part is None else _percent(part.lost_percent or None, 1),
        found.signal,
        "" if origin == one.name else origin,
    )


def _percent(value: float | None, digits: int = 0) -> str:
    return "" if value is None else f"{value:.{digits}f} %"
