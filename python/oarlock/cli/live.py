"""`oarlock live`: tracks sensors while they send, records all that they sent, and shows it on a page."""

from __future__ import annotations

import asyncio
import secrets
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli import live_doctor, live_init, live_scan, live_track
from oarlock.cli.options import Json, example
from oarlock.cli.terminal import print_json, say, steps, verb

if TYPE_CHECKING:
    from oarlock import Calibration, Model
    from oarlock.live.live import Live
    from oarlock.live.rig import Rig
    from oarlock.rowing import StrokeFollower

_AWAITED_S = 5.0

group = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Track sensors while they send: record, estimate, show on a page.",
)

OutSession = Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Folder of the session; new.")]
Session = Annotated[Path, typer.Argument(metavar="FOLDER", help="A folder that `oarlock live run` wrote.")]
Port = Annotated[int, typer.Option("--port", metavar="N", help="Port of the page; 0: any that is free.")]
Share = Annotated[
    bool,
    typer.Option(
        "--share", help="Let other machines of the network see the page, with a token in its address."
    ),
]
Seconds = Annotated[
    float | None, typer.Option("--seconds", metavar="S", help="End after so long; default: Ctrl-C ends it.")
]
NoPage = Annotated[bool, typer.Option("--no-page", help="Record and track without a page.")]
UdpTo = Annotated[
    str | None,
    typer.Option("--udp", metavar="HOST:PORT", help="Send each estimate there as a line of JSON, too."),
]


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    live_doctor.add_to(group)
    live_init.add_to(group)
    live_scan.add_to(group)
    live_track.add_to(group)
    app.add_typer(group, name="live")


@group.command("run", epilog=example("oarlock live run rig.toml --out today"))
@verb
def run(
    rig: Annotated[Path, typer.Argument(metavar="RIG", help="A rig file: which stream feeds which sensor.")],
    out: OutSession,
    port: Port = 8123,
    share: Share = False,
    no_page: NoPage = False,
    udp: UdpTo = None,
    seconds: Seconds = None,
) -> None:
    """Record, track and show what a rig's sensors send.

    Every packet is on the disk within a second, before anything is estimated. Ctrl-C ends the session and writes its
    recording.
    """
    import oarlock
    from oarlock.live.rig import Rig

    found = Rig.load(rig)
    calibration = None if found.calibration is None else oarlock.load_calibration(found.calibration)
    _run(found, oarlock.load_model(found.model), calibration, out, port, share, no_page, udp, seconds)


@group.command("demo", epilog=example("oarlock live demo"))
@verb
def demo(
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FOLDER", help="Folder of the session; default: a new one."),
    ] = None,
    port: Port = 8123,
    share: Share = False,
    no_page: NoPage = False,
    seconds: Seconds = None,
) -> None:
    """Show a sculler whose sensors are emulated on this machine: drifting clocks, losses, a magnet, a dropout."""
    import oarlock
    from oarlock.live.emulators.rig import lines_rig
    from oarlock.live.folder import dated_folder
    from oarlock.live.transports.udp import free_port
    from oarlock.rowing.simulation.emulated import RATE_HZ, STREAMS

    model, sent_to = oarlock.load_model("sculler"), free_port()
    rig = lines_rig(model, "sculler", sent_to, RATE_HZ, STREAMS)
    words = [sys.executable, "-m", "oarlock.rowing.simulation.emulated", str(sent_to)]
    emulator = subprocess.Popen(words, stdout=subprocess.PIPE)
    assert emulator.stdout is not None
    try:
        emulator.stdout.readline()
        _run(rig, model, None, out or dated_folder(Path("out")), port, share, no_page, None, seconds)
    finally:
        emulator.terminate()
        emulator.stdout.close()
        emulator.wait()


@group.command("recover", epilog=example("oarlock live recover today"))
@verb
def recover(folder: Session, json_output: Json = False) -> None:
    """Write the recording of a session that was killed, or whose machine lost power."""
    import oarlock
    from oarlock.live.folder import LiveFolder

    place = LiveFolder.load(folder)
    model = oarlock.load_model(place.rig().model)
    recording, damage = place.finish(model)
    if json_output:
        lost = [{"file": d.file.name, "at_byte": d.at_byte, "length": d.length} for d in damage]
        print_json({"recording": None if recording is None else str(folder / "recording"), "damage": lost})
        return
    for one in damage:
        say(f"{one.file.name}: {one.length:,} bytes at {one.at_byte:,} are not whole and were left out")
    if recording is None:
        say("The packets have no reading of the rig's sensors, so there is no recording.")
        return
    say(f"Wrote {folder / 'recording'}: {len(recording.streams)} streams, {recording.end_s:.1f} s")
    steps(f"oarlock live track {folder} --out {folder}/track")


def _run(
    rig: Rig,
    model: Model,
    calibration: Calibration | None,
    out: Path,
    port: int,
    share: bool,
    no_page: bool,
    udp: str | None,
    seconds: float | None,
) -> None:
    from oarlock.live.live import Live
    from oarlock.live.outputs import UdpLines
    from oarlock.live.picture import LivePicture
    from oarlock.rowing import live_look

    follower, drawn = _strokes(model, calibration), live_look(model)
    picture = LivePicture.of(model) if drawn is None else LivePicture.of(model, drawn.look, drawn.strands)
    live = Live(rig, model, out, calibration, picture=picture, follower=follower, on_event=say)
    if udp is not None:
        host, _, to_port = udp.rpartition(":")
        live.outputs = [UdpLines(model, host or "127.0.0.1", int(to_port))]
    if not no_page:
        from oarlock.live.page import page_server

        more = None if follower is None else {"strokes": {"columns": follower.columns}}
        token = secrets.token_urlsafe(12) if share else ""
        page_server(live, "0.0.0.0" if share else "127.0.0.1", port, token, more=more)
    asyncio.run(_until_stopped(live, seconds))
    _write_end(live, out)


def _write_end(live: Live, out: Path) -> None:
    """Says what was written, and what to do with it."""
    from oarlock.live.folder import RECORDING, RIG

    say(f"{live.estimates:,} estimates")
    say(f"Wrote {out}")
    recording, check = out / RECORDING, f"oarlock live doctor {out / RIG}"
    if not recording.is_dir():
        say("No sensor of the rig was heard, so there is no recording.")
        steps(f"{check}    why nothing came")
        return
    best = f"oarlock track {recording} --model {live.rig.model} --smooth --out {out}/best"
    if live.estimates:
        steps(f"oarlock live track {out} --out {out}/track    what was shown, with a report", best)
        return
    silent = sorted({feed.stream for feed in live.rig.feeds} - set(live.session.intake.heard()))
    why = f"nothing came of {', '.join(silent)}" if silent else "its sensors were never all heard together"
    say(f"It was not tracked, because {why}.")
    steps(f"{check}    why they are silent", best)


def _strokes(model: Model, calibration: Calibration | None) -> StrokeFollower | None:
    """What finds strokes; None for a body that does not row."""
    from oarlock import DataError
    from oarlock.rowing import StrokeFollower

    with suppress(DataError):
        return StrokeFollower(model, calibration)
    return None


async def _until_stopped(live: Live, seconds: float | None) -> None:
    """Runs a session until Ctrl-C, the end of the terminal or the time is up, so that its recording is written."""
    running = asyncio.ensure_future(live.run(seconds))
    loop = asyncio.get_running_loop()
    for stopped in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError):  # Windows has no handlers of an event loop
            loop.add_signal_handler(stopped, running.cancel)
    started = asyncio.ensure_future(live.started.wait())
    await asyncio.wait([running, started], return_when=asyncio.FIRST_COMPLETED)
    started.cancel()
    if live.server is not None and not running.done():
        say(live.server.url)
    waiting = asyncio.ensure_future(_say_who_is_awaited(live))
    with suppress(asyncio.CancelledError):
        await running
    waiting.cancel()


async def _say_who_is_awaited(live: Live) -> None:
    """Names the streams without which tracking does not begin, if they have not come by now."""
    await asyncio.sleep(_AWAITED_S)
    missing = sorted({feed.stream for feed in live.rig.feeds} - set(live.session.intake.heard()))
    if missing and not live.estimates:
        say(f"waits for {', '.join(missing)}; `oarlock live doctor` says why they do not come")
