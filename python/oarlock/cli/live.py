"""`oarlock live`: tracks sensors while they send, records all that they sent, and shows it on a page."""

from __future__ import annotations

import asyncio
import secrets
import signal
import subprocess
import sys
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import typer

from oarlock.cli import live_scan
from oarlock.cli.terminal import details, output_folder, progress, say, steps
from oarlock.cli.verbs import Incomplete, NewFolder, command

if TYPE_CHECKING:
    from oarlock import Calibration, Model, Track
    from oarlock.live.guide.lead import Lead
    from oarlock.live.live import Live
    from oarlock.live.outputs.table import Outputs
    from oarlock.live.rig import Rig
    from oarlock.live.server import PageServer
    from oarlock.rowing import StrokeFollower

_AWAITED_S: Final = 5.0

group = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Track sensors while they send: record, estimate, show on a page.",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    command(
        group,
        "oarlock live run rig.toml --out today",
        metavars={"rig": "RIG", "out": "FOLDER", "udp": "HOST:PORT", "osc": "HOST:PORT"},
    )(run)
    command(group, "oarlock live demo", metavars={"out": "FOLDER"})(demo)
    command(group, "oarlock live recover today", metavars={"folder": "FOLDER"})(recover)
    live_scan.add_to(group)
    command(
        group,
        "oarlock live track today --out today/track",
        "oarlock track today/recording --model sculler --smooth --out best",
        show=_show_track,
        metavars={"folder": "FOLDER"},
    )(track)
    app.add_typer(group, name="live")


@dataclass(frozen=True, kw_only=True)
class LivePage:
    """Where the page of a session is.

    Args:
        port: port of the page; 0: any that is free.
        share: let other machines of the network see the page, with a token in its address.
        no_page: record and track without a page.
    """

    port: int = 8123
    share: bool = False
    no_page: bool = False

    def serve(self, live: Live) -> None:
        """Gives a session its page."""
        if self.no_page:
            return
        from oarlock.live.page import page_server

        columns = getattr(live.follower, "columns", None)
        more = None if columns is None else {"strokes": {"columns": columns}}
        token = secrets.token_urlsafe(12) if self.share else ""
        page_server(live, "0.0.0.0" if self.share else "127.0.0.1", self.port, token, more=more)


def run(
    rig: Path,
    *,
    out: Path,
    page: LivePage,
    udp: list[str] | None = None,
    osc: list[str] | None = None,
    lsl: list[str] | None = None,
    duration_s: float | None = None,
    no_guide: bool = False,
    plan: Path | None = None,
    pose: Literal["N", "T", "sitting"] = "N",
) -> dict[str, Any]:
    """Record, track and show what a rig's sensors send.

    Every packet is on the disk within a second, before anything is estimated. Ctrl-C ends the session and writes its
    recording. Without a calibration the page leads through a guided session first, which can be skipped.

    Args:
        rig: a rig file: which stream feeds which sensor.
        out: folder of the session; new.
        page: where the page of the session is.
        udp: send estimates, strokes and events there as JSON lines.
        osc: the same as Open Sound Control.
        lsl: the same as streams of the Lab Streaming Layer; oarlock[lsl].
        duration_s: end after so long; default: Ctrl-C ends it.
        no_guide: no guided start on the page: track at once, with the mounts of the model.
        plan: plan of the guided start; default: the model's own.
        pose: still pose of the session: N (arms hanging), T (arms level) or sitting.
    """
    import oarlock
    from oarlock.live.outputs.table import Outputs
    from oarlock.live.rig import Rig

    setup, outputs = Rig.load(rig), Outputs(tuple(udp or ()), tuple(osc or ()), tuple(lsl or ()))
    calibration = None if setup.calibration is None else oarlock.load_calibration(setup.calibration)
    model = oarlock.load_model(setup.model)
    live = _session(setup, model, calibration, out, outputs)
    if not (no_guide or page.no_page) and setup.feeds:
        live.lead = _lead(model, calibration, plan, pose)
    return _run(live, page, duration_s)


def demo(
    *,
    out: Path | None = None,
    page: LivePage,
    duration_s: float | None = None,
    guided: bool = False,
) -> dict[str, Any]:
    """Show a sculler whose sensors are emulated on this machine: drifting clocks, losses, a magnet, a dropout.

    Args:
        out: folder of the session; default: a new one.
        page: where the page of the session is.
        duration_s: end after so long; default: Ctrl-C ends it.
        guided: units on unknown mounts, and a sculler who does what the guided start asks.
    """
    import oarlock
    from oarlock.live.folder import dated_folder
    from oarlock.live.simulated_devices import lines_rig
    from oarlock.live.transports.udp import free_port
    from oarlock.rowing.simulation.emulated import RATE_HZ, STREAMS

    model, sent_to = oarlock.load_model("sculler"), free_port()
    rig = lines_rig(model, "sculler", sent_to, RATE_HZ, STREAMS)
    live = _session(rig, model, None, out or dated_folder(Path("out")))
    if guided:
        return _run(live, page, duration_s, _guided(live, sent_to))
    words = [sys.executable, "-m", "oarlock.rowing.simulation.emulated", str(sent_to), str(RATE_HZ)]
    emulator = subprocess.Popen(words, stdout=subprocess.PIPE)
    assert emulator.stdout is not None
    try:
        emulator.stdout.readline()
        return _run(live, page, duration_s)
    finally:
        emulator.terminate()
        emulator.stdout.close()
        emulator.wait()


def recover(folder: Path) -> dict[str, Any]:
    """Write the recording of a session that was killed, or whose machine lost power.

    Status 1: packets that were received are missing; the recording has all the others.

    Args:
        folder: a folder that `oarlock live run` wrote.
    """
    import oarlock
    from oarlock.live.folder import RECORDING, LiveFolder

    place = LiveFolder.load(folder)
    ending = place.finish(oarlock.load_model(place.rig().model))
    recording = ending.recording
    result: dict[str, Any] = {
        "damage": [{"file": d.file.name, "at_byte": d.at_byte, "length": d.length} for d in ending.damage],
        "refused": ending.refused,
        "missing": ending.missing,
        "notes": place.disk.news(),
        "written": None,
    }
    if recording is None:
        result["notes"].append("The packets have no reading of the rig's sensors, so there is no recording.")
    else:
        result |= {
            "streams": len(recording.streams),
            "duration_s": recording.end_s,
            "written": folder / RECORDING,
        }
        result["next"] = [f"oarlock live track {folder} --out {folder}/track"]
    if ending.missing:
        raise Incomplete(result)
    return result


def track(folder: Path, *, out: NewFolder, csv: bool = False, force: bool = False) -> LiveTrack:
    """Write a session's estimates as a track, exactly as they were shown live: bit for bit.

    Other settings, smoothing or the best angles: use `oarlock track` with the recording in the same folder.

    Args:
        folder: a folder that `oarlock live run` wrote.
        out: folder to write.
        csv: also write the tables as CSV.
        force: replace what is there.
    """
    import oarlock
    from oarlock.cli.track_folder import TRACK, write_folder
    from oarlock.live.folder import RECORDING, LiveFolder
    from oarlock.live.live_track import live_track

    place = LiveFolder.load(folder)
    name = place.rig().model
    with output_folder(out, TRACK, force) as stage:
        with progress("repeating the session") as share:
            estimates = live_track(place, oarlock.load_model(name), share)
        write_folder(estimates, stage, csv)
    best = f"oarlock track {folder / RECORDING} --model {name} --smooth --out BEST"
    return LiveTrack(estimates, out, best)


@dataclass(frozen=True)
class LiveTrack:
    """The track of a session, its folder, and the command that gives the best angles."""

    track: Track
    out: Path
    best: str

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        from oarlock.cli.result import result_of
        from oarlock.cli.track_folder import document

        return {**document(self.track, self.out), **result_of(self.track), "next": [self.best]}


def _show_track(result: LiveTrack) -> None:
    from oarlock.cli.result import write_result
    from oarlock.cli.tables import write_summary

    with details():
        write_summary(result.track)
        say()
    write_result(result.track, result.out / "report.html")
    steps(result.best)


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


def _guided(live: Live, sent_to: int) -> Callable[[], Awaitable[None]]:
    """Gives a session a guided start, and an emulated sculler who looks at what the page shows."""
    from oarlock.live.transports.transport import now_ns
    from oarlock.rowing.simulation.guided import GuidedSculler, send_guided

    live.lead = _lead(live.model, None, None, "N")
    assert live.lead is not None
    guide, sculler = live.lead.guide, GuidedSculler(live.model)

    async def send() -> None:
        await live.started.wait()
        await send_guided(sculler, sent_to, lambda: (guide.told(), live.session.intake.seconds(now_ns())))

    return send


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
    live: Live, page: LivePage, duration_s: float | None, beside: Callable[[], Awaitable[None]] | None = None
) -> dict[str, Any]:
    """Runs a session, and something beside it; what was written, and what to do with it."""
    from oarlock.live.folder import RECORDING

    page.serve(live)
    asyncio.run(_until_stopped(live, duration_s, beside))
    recording = live.folder / RECORDING
    return {
        "estimates": live.estimates if live.rig.feeds else None,
        "recording": recording if recording.is_dir() else None,
        "written": live.folder,
        **(_tracked(live, recording) if live.rig.feeds else _channels(live)),
    }


def _tracked(live: Live, recording: Path) -> dict[str, list[str]]:
    """Why a session has no recording or estimates, and how to go on."""
    out, check = live.folder, _check(live)
    if not recording.is_dir():
        return {"notes": ["No sensor of the rig was heard, so there is no recording."], "next": [check]}
    best = f"oarlock track {recording} --model {live.rig.model} --smooth --out {out}/best"
    if live.estimates:
        return {
            "next": [f"oarlock live track {out} --out {out}/track    what was shown, with a report", best]
        }
    silent = sorted({feed.stream for feed in live.rig.feeds} - set(live.session.intake.heard()))
    why = f"nothing came of {', '.join(silent)}" if silent else "its sensors were never all heard together"
    return {"notes": [f"It was not tracked, because {why}."], "next": [check, best]}


def _channels(live: Live) -> dict[str, list[Any]]:
    """What a session has whose rig feeds no sensor."""
    from oarlock.live.channel_tables import FOLDER, channels

    note, out = "The rig feeds no sensor of the model, so nothing was tracked.", live.folder
    if not (out / FOLDER).is_dir():
        return {"notes": [note], "next": [_check(live)]}
    where = f"{out / FOLDER} has them as Parquet; in Python: oarlock.live.channels({str(out)!r})"
    rows = [{"name": name, "rows": len(channel.time_s)} for name, channel in channels(out).items()]
    return {"channels": rows, "notes": [note, where]}


def _check(live: Live) -> str:
    """The command that says what is wrong with the sensors."""
    from oarlock.live.folder import RIG

    return f"oarlock live doctor {live.folder / RIG}    why nothing came"


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
