"""`oarlock live scan`, `init` and `doctor`: sensors that can be heard, their rig file, and why nothing comes."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Coroutine, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer

from oarlock.cli.terminal import Result, Told, UsageError, asks_questions, checklist, progress, say, steps
from oarlock.cli.verbs import Incomplete, ModelName, NewFile, command, text_assignments

if TYPE_CHECKING:
    from oarlock.live.scan.finding import Scan, ScanDevice
    from oarlock.live.scan.matching import DeviceCandidate
    from oarlock.live.scan.scan import ScanRequest

_TICK_S: Final = 0.1
_PLACES: Final = ("network", "ble", "lsl", "serial")
_BOUNDS: Final = {"duration_s": (0.1, 600.0)}
_METAVARS: Final = {"places": "PLACES", "source": "WORDS"}


def add_to(group: typer.Typer) -> None:
    """Registers the verbs."""
    command(
        group,
        "oarlock live scan",
        "oarlock live scan --places network --duration-s 10",
        "oarlock live scan --source serial:/dev/ttyUSB0@115200",
        "oarlock live scan --source tcp:192.168.1.20:7000:ximu3 --json",
        metavars=_METAVARS,
        bounds=_BOUNDS,
    )(scan)
    command(
        group,
        "oarlock live init --model sculler --out rig.toml",
        "oarlock live init --model sculler --calibration cal.toml --source udp:9000:lines --out rig.toml",
        "oarlock live init --model sculler --feed back=65577B49 --feed seat=left_slide:mm --out rig.toml",
        metavars={**_METAVARS, "feed": "STREAM=DEVICE"},
        bounds=_BOUNDS,
    )(init)
    command(
        group,
        "oarlock live doctor",
        "oarlock live doctor rig.toml --duration-s 20 --out today",
        show=_show_checks,
        metavars={"rig": "RIG", "out": "FOLDER"},
        bounds=_BOUNDS,
    )(doctor)


def scan_request(
    *, duration_s: float = 5.0, places: tuple[str, ...] = _PLACES, source: list[str] | None = None
) -> ScanRequest:
    """Where to look for sensors, and how long.

    Args:
        duration_s: how long to listen.
        places: where to look, some of network, ble, lsl, serial, or none.
        source: open this, too: udp:PORT, tcp:HOST:PORT, serial:DEVICE[@BAUD], each with :FORMAT if you know it.
            Repeatable.

    Raises:
        UsageError: a place that does not exist, or words that are no source.
    """
    from oarlock.live.scan.scan import ScanRequest
    from oarlock.live.scan.source_words import source_of
    from oarlock.storage.errors import DataError

    for place in places:
        if place not in _PLACES:
            raise UsageError(f"--places {place}: choose some of {', '.join(_PLACES)}, or none")
    try:
        return ScanRequest(duration_s, places, [source_of(text) for text in source or ()])
    except DataError as error:
        raise UsageError(str(error)) from None


# --- scan ---------------------------------------------------------------------------------------------


def scan(*, request: ScanRequest, connect: bool = False, all_: bool = False) -> dict[str, Any]:
    """List the sensors that can be heard now: in the network, by Bluetooth, LSL and serial ports.

    Serial ports are listed and not opened, and no device is connected, unless you ask for it.

    Args:
        request: where to look.
        connect: connect to the x-IMU3 units that are found, to see what they send.
        all_: list Bluetooth devices that are no sensors, too.
    """
    from oarlock.live.scan.finding import devices_of
    from oarlock.live.scan.matching import Sources
    from oarlock.live.scan.source_words import words_of

    heard = _heard(replace(request, connects=connect))
    sources = Sources.of(heard.findings)
    notes = [f"{one.address}: {one.note}" for one in heard.findings if one.source is not None and one.note]
    if not heard.findings:
        notes.append(f"Nothing was heard in {heard.seconds:g} s. Are the sensors on, and in this network?")
    if heard.others and not all_:
        notes.append(f"{len(heard.others)} Bluetooth devices are no known sensors; --all lists them.")
    return {
        "devices": [
            _row(device, source.name) for source, senders in sources.named for device in devices_of(senders)
        ],
        "rig_sources": {source.name: words_of(source) for source, _ in sources.named},
        **_unread(heard),
        "other_devices": [
            {"address": one.address, "name": one.what, "signal": one.signal} for one in heard.others if all_
        ],
        "notes": list(dict.fromkeys(notes)),
        "next": [
            "oarlock live init --model MODEL --out rig.toml    a rig file of what was found",
            "oarlock live doctor                               if a sensor is missing here",
        ],
    }


def _heard(request: ScanRequest) -> Scan:
    """What is heard, with a bar that shows the time."""
    from oarlock.live.scan.scan import scan as look

    with progress("listening") as share:
        return asyncio.run(_timed(look(request), request.seconds, share))


async def _timed(work: Coroutine[Any, Any, Result], seconds: float, share: Told) -> Result:
    """What takes about so long, with a progress bar that shows the time."""
    task, begun_s = asyncio.ensure_future(work), time.monotonic()
    while not (await asyncio.wait([task], timeout=_TICK_S))[0]:
        share(min((time.monotonic() - begun_s) / seconds, 1.0))
    return task.result()


def _row(device: ScanDevice, source: str) -> dict[str, object]:
    from oarlock.live.scan.finding import sends

    part, sender = device.part, device.finding
    row: dict[str, object] = {"device": device.name, "kind": sender.what}
    if part is None:
        row |= {"sends": "not connected", "battery_percent": sender.battery_percent}
    else:
        battery = sender.battery_percent if part.battery_percent is None else part.battery_percent
        row |= {"sends": sends(tuple(part.rates_hz)), "rate_hz": part.rate_hz, "battery_percent": battery}
        row["lost_percent"] = part.lost_percent
    if not sender.address.startswith(device.name):
        row["address"] = sender.address
    return {**row, "signal": sender.signal, "source": source}


def _unread(heard: Scan) -> dict[str, list[Any]]:
    """What no format reads, and where the scan could not look."""
    unread = [one for one in heard.findings if one.source is None]
    return {
        "not_read": [f"{one.address}  {one.what}: {one.note}" for one in unread],
        "could_not_look": [f"{problem.where}: {problem.text}" for problem in heard.problems],
    }


# --- init ---------------------------------------------------------------------------------------------


def init(
    *,
    model: ModelName,
    out: NewFile,
    calibration: Path | None = None,
    request: ScanRequest,
    feed: list[str] | None = None,
    json_output: bool,
) -> dict[str, Any]:
    """Write a rig file: which sensor feeds which stream of the model, with units and measured rates.

    Sensors must be on and sending. A sensor with the name of a stream, such as "back" or "right forearm", feeds it;
    on a terminal you are asked about the others. x-IMU3 units that announce themselves are connected for a moment.

    Args:
        model: name of a shipped model, or a model file.
        out: rig file to write.
        calibration: calibration file with mounts.
        request: where to look.
        feed: this device feeds this stream. Repeatable.
        json_output: ask nothing.
    """
    import oarlock
    from oarlock.live.rig import Rig, streams_of
    from oarlock.live.scan.matching import Sources, matched
    from oarlock.live.scan.rig_text import RigDraft
    from oarlock.storage.write_file import write_file

    body, by_hand = oarlock.load_model(model), text_assignments(feed, "--feed", "back=65577B49")
    if calibration is not None:
        oarlock.load_calibration(calibration)
    heard = _heard(replace(request, connects=True))
    sources = Sources.of(heard.findings)
    kinds = {stream: kind for stream, (kind, _) in streams_of(body).items()}
    ask = _chosen if asks_questions(False, json_output) else lambda stream, free: None
    feeds = matched(kinds, sources, by_hand, ask)
    near = out.parent
    draft = RigDraft(body, _beside(model, near), _beside(calibration, near), sources, feeds)
    write_file(out, draft.text())
    Rig.load(out, body)
    check = f"oarlock live doctor {out}"
    then = [f"edit {out}: name a source and its devices", check]
    if feeds:
        then = [f"{check}            whether all of it arrives", f"oarlock live run {out} --out today"]
    notes = ["Free streams stand in the file as comments, with what could feed them."]
    return {
        "streams": {
            stream: {"source": one.source, "device": one.device.name, "rate_hz": one.rate_hz}
            for stream, one in feeds.items()
        },
        "free_streams": draft.free,
        "unused_devices": draft.unused,
        **_unread(heard),
        "notes": notes if feeds and draft.free else [],
        "written": out,
        "next": then,
    }


def _beside(file: str | Path | None, folder: Path) -> str:
    """A path as a file in `folder` has it; the name of a shipped model as it is."""
    if file is None:
        return ""
    path = Path(file)
    return Path(os.path.relpath(path, folder)).as_posix() if path.suffix == ".toml" else str(file)


def _chosen(stream: str, free: Sequence[DeviceCandidate]) -> DeviceCandidate | None:
    """The device that the person at the terminal names."""
    say(f"\nWhich device feeds {stream}?")
    for place, one in enumerate(free, 1):
        say(f"{place}  {one.title}", indent=2)
    while answer := str(typer.prompt("  number; Enter: none", default="", show_default=False)).strip():
        if answer.isdigit() and 0 < int(answer) <= len(free):
            return free[int(answer) - 1]
        say(f'"{answer}" is none of 1 to {len(free)}', indent=2)
    return None


# --- doctor -------------------------------------------------------------------------------------------


def doctor(rig: Path | None = None, *, duration_s: float = 5.0, out: Path = Path()) -> dict[str, Any]:
    """Say why nothing comes from the sensors, and what to try.

    Without RIG it looks at this machine: versions, network, ports, firewall, permissions, clock and disk. With it, each
    source is opened, and you see which stream gets what. The exit status is 1 if something prevents a session.

    Args:
        rig: a rig file; its sources are opened for some seconds.
        duration_s: how long to listen.
        out: where you will record: room and speed are tried there.
    """
    from oarlock.live.doctor.check import PROBLEM
    from oarlock.live.doctor.doctor import arrival_checks, machine_checks, read_rig

    setup, model, checks = (None, None, []) if rig is None else read_rig(rig)
    checks = [*asyncio.run(machine_checks(setup, out)), *checks]
    if setup is not None and model is not None:
        with progress("listening") as share:
            checks += asyncio.run(_timed(arrival_checks(setup, model, duration_s), duration_s, share))
    problems = sum(check.state == PROBLEM for check in checks)
    result = {"checks": checks, "problems": problems}
    if problems:
        raise Incomplete(result)
    then = [f"oarlock live run {rig} --out {'today' if out == Path() else out}"]
    if rig is None:
        then = ["oarlock live scan               what can be heard"]
        then.append("oarlock live doctor RIG         what of it arrives")
    return {**result, "next": then}


def _show_checks(result: dict[str, Any]) -> None:
    checklist([(check.state, check.about, check.text, check.tries) for check in result["checks"]])
    if problems := result["problems"]:
        say(f"\n{problems} finding{'s prevent' if problems > 1 else ' prevents'} a session.")
    else:
        steps(*result["next"])
