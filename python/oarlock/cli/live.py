"""`oarlock live`: tracks sensors while they send, records all that they sent, and shows it on a page."""

from __future__ import annotations

import asyncio
import secrets
import signal
import subprocess
import sys
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli import live_doctor, live_init, live_scan, live_track
from oarlock.cli.body import Pose
from oarlock.cli.options import Json, example
from oarlock.cli.terminal import EXIT_DATA, QUIET, print_json, say, set_verbosity, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Calibration, Model
    from oarlock.live.guide.lead import Lead
    from oarlock.live.live import Live
    from oarlock.live.outputs.table import Outputs
    from oarlock.live.rig import Rig
    from oarlock.live.server import PageServer
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
    float | None,
    typer.Option("--duration-s", metavar="S", help="End after so long; default: Ctrl-C ends it."),
]
NoPage = Annotated[bool, typer.Option("--no-page", help="Record and track without a page.")]
UdpTo = Annotated[
    list[str] | None,
    typer.Option(
        "--udp", metavar="HOST:PORT", help="Send estimates, strokes and events there as JSON lines."
    ),
]
OscTo = Annotated[
    list[str] | None, typer.Option("--osc", metavar="HOST:PORT", help="The same as Open Sound Control.")
]
LslAs = Annotated[
    list[str] | None,
    typer.Option(
        "--lsl", metavar="NAME", help="The same as streams of the Lab Streaming Layer; oarlock[lsl]."
    ),
]


NoGuide = Annotated[
    bool,
    typer.Option(
        "--no-guide", help="No guided start on the page: track at once, with the mounts of the model."
    ),
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
    osc: OscTo = None,
    lsl: LslAs = None,
    seconds: Seconds = None,
    no_guide: NoGuide = False,
    plan: Annotated[
        Path | None,
        typer.Option("--plan", metavar="FILE", help="Plan of the guided start; default: the model's own."),
    ] = None,
    pose: Pose = "N",
    json_output: Json = False,
) -> None:
    """Record, track and show what a rig's sensors send.

    Every packet is on the disk within a second, before anything is estimated. Ctrl-C ends the session and writes its
    recording. Without a calibration the page leads through a guided session first, which can be skipped.
    """
    import oarlock
    from oarlock.live.outputs.table import Outputs
    from oarlock.live.rig import Rig

    _silent(json_output)
    found, wanted = Rig.load(rig), Outputs(tuple(udp or ()), tuple(osc or ()), tuple(lsl or ()))
    calibration = None if found.calibration is None else oarlock.load_calibration(found.calibration)
    model = oarlock.load_model(found.model)
    live = _session(found, model, calibration, out, wanted)
    if not (no_guide or no_page) and found.feeds:
        live.lead = _lead(model, calibration, plan, pose)
    _run(live, port, share, no_page, seconds, json_output=json_output)


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
    guided: Annotated[
        bool,
        typer.Option(
            "--guided", help="Units on unknown mounts, and a sculler who does what the guided start asks."
        ),
    ] = False,
    json_output: Json = False,
) -> None:
    """Show a sculler whose sensors are emulated on this machine: drifting clocks, losses, a magnet, a dropout."""
    import oarlock
    from oarlock.live.folder import dated_folder
    from oarlock.live.simulated_devices import lines_rig
    from oarlock.live.transports.udp import free_port
    from oarlock.rowing.simulation.emulated import RATE_HZ, STREAMS

    _silent(json_output)
    model, sent_to = oarlock.load_model("sculler"), free_port()
    rig = lines_rig(model, "sculler", sent_to, RATE_HZ, STREAMS)
    live = _session(rig, model, None, out or dated_folder(Path("out")))
    if guided:
        _run_guided(live, sent_to, port, share, seconds, json_output)
        return
    words = [sys.executable, "-m", "oarlock.rowing.simulation.emulated", str(sent_to), str(RATE_HZ)]
    emulator = subprocess.Popen(words, stdout=subprocess.PIPE)
    assert emulator.stdout is not None
    try:
        emulator.stdout.readline()
        _run(live, port, share, no_page, seconds, json_output=json_output)
    finally:
        emulator.terminate()
        emulator.stdout.close()
        emulator.wait()


@group.command("recover", epilog=example("oarlock live recover today"))
@verb
def recover(folder: Session, json_output: Json = False) -> None:
    """Write the recording of a session that was killed, or whose machine lost power.

    Status 1: packets that were received are missing; the recording has all the others.
    """
    import oarlock
    from oarlock.live.folder import LiveFolder

    place = LiveFolder.load(folder)
    ending = place.finish(oarlock.load_model(place.rig().model))
    recording = ending.recording
    if json_output:
        lost = [{"file": d.file.name, "at_byte": d.at_byte, "length": d.length} for d in ending.damage]
        where = None if recording is None else str(folder / "recording")
        print_json({"recording": where, "damage": lost, "refused": ending.refused, "missing": ending.missing})
        raise typer.Exit(EXIT_DATA if ending.missing else 0)
    for one in ending.damage:
        say(f"{one.file.name}: {one.length:,} bytes at {one.at_byte:,} are not whole and were left out")
    for text in (*place.disk.news(), *ending.refused, *ending.missing):
        say(text)
    if recording is None:
        say("The packets have no reading of the rig's sensors, so there is no recording.")
    else:
        say(f"Wrote {folder / 'recording'}: {len(recording.streams)} streams, {recording.end_s:.1f} s")
        steps(f"oarlock live track {folder} --out {folder}/track")
    if ending.missing:
        raise typer.Exit(EXIT_DATA)


def _lead(model: Model, calibration: Calibration | None, plan: Path | None, pose: str) -> Lead | None:
    """The guided start of a model; None if it has no inertial units or no steps for them."""
    import oarlock
    from oarlock.live.guide.lead import Lead
    from oarlock.live.guide.steps import Guide

    followed = (
        oarlock.calibration.default_plan(model, pose)
        if plan is None
        else oarlock.calibration.load_session_plan(plan, pose)
    )
    followed.check(model)
    guide = Guide(followed, phase="offered" if calibration is None else "closed")
    return Lead(guide) if guide.progress and model.describe().inertial_units else None


def _silent(json_output: bool) -> None:
    """With --json nothing but the document at the end is printed."""
    if json_output:
        set_verbosity(QUIET)


def _run_guided(
    live: Live, sent_to: int, port: int, share: bool, seconds: float | None, json_output: bool
) -> None:
    """The demo of the guided start: its emulated sculler looks at what the page shows."""
    from oarlock.live.transports.transport import now_ns
    from oarlock.rowing.simulation.guided import GuidedSculler, send_guided

    live.lead = _lead(live.model, None, None, "N")
    assert live.lead is not None
    guide, sculler = live.lead.guide, GuidedSculler(live.model)

    async def send() -> None:
        await live.started.wait()
        await send_guided(sculler, sent_to, lambda: (guide.told(), live.session.intake.seconds(now_ns())))

    _run(live, port, share, False, seconds, send, json_output)


def _session(
    rig: Rig, model: Model, calibration: Calibration | None, out: Path, wanted: Outputs | None = None
) -> Live:
    from oarlock.live.live import Live
    from oarlock.live.outputs.choose import outputs_of
    from oarlock.live.picture import LivePicture
    from oarlock.rowing import live_look

    follower, drawn = _strokes(model), live_look(model)
    picture = LivePicture.of(model) if drawn is None else LivePicture.of(model, drawn.look, drawn.strands)
    live = Live(rig, model, out, calibration, picture=picture, follower=follower, on_event=say)
    live.outputs = outputs_of(model, rig.rate_hz, rig.outputs, *([wanted] if wanted else []))
    return live


def _run(
    live: Live,
    port: int,
    share: bool,
    no_page: bool,
    seconds: float | None,
    beside: Callable[[], Awaitable[None]] | None = None,
    json_output: bool = False,
) -> None:
    """Runs a session, and something beside it."""
    if not no_page:
        from oarlock.live.page import page_server

        columns = getattr(live.follower, "columns", None)
        more = None if columns is None else {"strokes": {"columns": columns}}
        token = secrets.token_urlsafe(12) if share else ""
        page_server(live, "0.0.0.0" if share else "127.0.0.1", port, token, more=more)
    asyncio.run(_until_stopped(live, seconds, beside))
    if json_output:
        recording = live.folder / "recording"
        print_json(
            {
                "folder": live.folder,
                "recording": recording if recording.is_dir() else None,
                "estimates": live.estimates,
            }
        )
        return
    _write_end(live, live.folder)


def _write_end(live: Live, out: Path) -> None:
    """Says what was written, and what to do with it."""
    from oarlock.live.folder import RECORDING, RIG

    if not live.rig.feeds:
        _say_channels(out)
        return
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


def _say_channels(out: Path) -> None:
    """The end of a session whose rig feeds no sensor."""
    from oarlock.live.channel_tables import FOLDER, channels
    from oarlock.live.folder import RIG

    say(f"Wrote {out}. Its rig feeds no sensor of the model, so nothing was tracked.")
    if not (out / FOLDER).is_dir():
        steps(f"oarlock live doctor {out / RIG}    why nothing came")
        return
    rows = [(name, len(one.time_s)) for name, one in sorted(channels(out).items())]
    table(("channel", ">rows"), rows)
    say(f"{out / FOLDER} has them as Parquet; in Python: oarlock.live.channels({str(out)!r})")


def _strokes(model: Model) -> StrokeFollower | None:
    """What finds strokes; None for a body that does not row."""
    from oarlock import DataError
    from oarlock.rowing import StrokeFollower

    with suppress(DataError):
        return StrokeFollower(model)
    return None


async def _until_stopped(
    live: Live, seconds: float | None, beside: Callable[[], Awaitable[None]] | None
) -> None:
    """Runs a session until Ctrl-C, the end of the terminal or the time is up, so that its recording is written."""
    running = asyncio.ensure_future(live.run(seconds))
    loop = asyncio.get_running_loop()
    for stopped in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError):  # Windows has no handlers of an event loop
            loop.add_signal_handler(stopped, running.cancel)
    started = asyncio.ensure_future(live.started.wait())
    other = None if beside is None else asyncio.ensure_future(beside())
    await asyncio.wait([running, started], return_when=asyncio.FIRST_COMPLETED)
    started.cancel()
    if live.server is not None and not running.done():
        with suppress(OSError):  # a terminal that is gone ends no session
            _say_addresses(live.server)
    waiting = asyncio.ensure_future(_say_who_is_awaited(live))
    with suppress(asyncio.CancelledError):
        await running
    waiting.cancel()
    if other is not None:
        other.cancel()


def _say_addresses(server: PageServer) -> None:
    """Where the page is: on this machine, and for others if it is shared."""
    from oarlock.live.doctor.network import own_address

    say(server.url)
    if not server.token:
        return
    address = own_address()
    if address is None:
        say("This machine has no network, so phones and other laptops cannot open the page.")
    else:
        say("On phones and laptops of the same network:")
        say(server.url_at(address))


async def _say_who_is_awaited(live: Live) -> None:
    """Names the streams without which tracking does not begin, if they have not come by now."""
    await asyncio.sleep(_AWAITED_S)
    missing = sorted({feed.stream for feed in live.rig.feeds} - set(live.session.intake.heard()))
    if missing and not live.estimates:
        say(f"waits for {', '.join(missing)}; `oarlock live doctor` says why they do not come")
