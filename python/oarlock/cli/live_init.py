"""`oarlock live init`: writes a rig file from the sensors that can be heard now."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.live_scan import LookSeconds, Only, Sources, asked, look, write_problems
from oarlock.cli.options import Json, ModelName, Replace, example
from oarlock.cli.terminal import UsageError, free_file, heading, number, print_json, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Model
    from oarlock.live.scan.finding import Scan
    from oarlock.live.scan.matching import DeviceCandidate
    from oarlock.live.scan.rig_text import RigDraft


def add_to(group: typer.Typer) -> None:
    """Registers the verb."""
    group.command(
        "init",
        epilog=example(
            "oarlock live init --model sculler --out rig.toml",
            "oarlock live init --model sculler --calibration cal.toml --source udp:9000:lines --out rig.toml",
            "oarlock live init --model sculler --feed back=65577B49 --feed seat=left_slide:mm --out rig.toml",
        ),
    )(init)


@verb
def init(
    model: ModelName,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Rig file to write.")],
    calibration: Annotated[
        Path | None, typer.Option("--calibration", metavar="FILE", help="Calibration file with mounts.")
    ] = None,
    seconds: LookSeconds = 5.0,
    only: Only = None,
    source: Sources = None,
    feed: Annotated[
        list[str] | None,
        typer.Option("--feed", metavar="STREAM=DEVICE", help="This device feeds this stream. Repeatable."),
    ] = None,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Write a rig file: which sensor feeds which stream of the model, with units and measured rates.

    Sensors must be on and sending. A sensor with the name of a stream, such as "back" or "right forearm", feeds it;
    on a terminal you are asked about the others. x-IMU3 units that announce themselves are connected for a moment.
    """
    import oarlock
    from oarlock.live.rig import Rig
    from oarlock.live.scan.matching import Sources as Found
    from oarlock.live.scan.matching import matched
    from oarlock.live.scan.rig_text import RigDraft
    from oarlock.storage.write_file import write_file

    body, by_hand = oarlock.load_model(model), _by_hand(feed or [])
    free_file(out, force)
    if calibration is not None:
        oarlock.load_calibration(calibration)
    found = look(asked(seconds, only, source, connects=True))
    sources, streams = Found.of(found.findings), _kinds(body)
    is_asked = is_terminal() and not json_output
    feeds = matched(streams, sources, by_hand, _chosen if is_asked else lambda stream, free: None)
    near = out.parent
    draft = RigDraft(body, _beside(model, near), _beside(calibration, near), sources, feeds)
    write_file(out, draft.text())
    Rig.load(out, body)
    if json_output:
        print_json(_document(draft, out, found))
        return
    _write(draft, found, out)


def is_terminal() -> bool:
    """Whether somebody can be asked."""
    return sys.stdin.isatty()


def _kinds(body: Model) -> dict[str, str]:
    from oarlock.live.rig import streams_of

    return {stream: kind for stream, (kind, _) in streams_of(body).items()}


def _by_hand(texts: Sequence[str]) -> dict[str, str]:
    found = {}
    for text in texts:
        stream, equals, device = (piece.strip() for piece in text.partition("="))
        if not (stream and equals and device):
            raise UsageError(f"--feed {text}: expected STREAM=DEVICE, for example --feed back=65577B49")
        found[stream] = device
    return found


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
    while True:
        answer = str(typer.prompt("  number; Enter: none", default="", show_default=False)).strip()
        if not answer:
            return None
        if answer.isdigit() and 0 < int(answer) <= len(free):
            return free[int(answer) - 1]
        say(f'"{answer}" is none of 1 to {len(free)}', indent=2)


def _document(draft: RigDraft, out: Path, found: Scan) -> dict[str, object]:
    return {
        "rig": out,
        "streams": {s: {"source": one.source, "device": one.device.name} for s, one in draft.feeds.items()},
        "free": draft.free,
        "unused": draft.unused,
        "problems": found.problems,
    }


def _write(draft: RigDraft, found: Scan, out: Path) -> None:
    say(f"Wrote {out}: {len(draft.feeds)} of {len(draft.feeds) + len(draft.free)} streams are fed")
    table(
        ["stream", "device", "source", ">Hz"],
        [(s, one.title, one.source, number(one.rate_hz, ".4g", "")) for s, one in draft.feeds.items()],
    )
    if draft.free:
        say(f"Fed by nothing: {', '.join(draft.free)}", indent=2)
    if draft.unused:
        say(f"Feed nothing: {', '.join(draft.unused)}", indent=2)
    unread = [one for one in found.findings if one.source is None]
    if unread:
        heading("Not read")
        for one in unread:
            say(f"{one.address}  {one.what}: {one.note}", indent=2)
    write_problems(found.problems)
    if draft.free and draft.feeds:
        say("\nStreams that are fed by nothing stand in the file as comments, with what could feed them.")
    check = f"oarlock live doctor {out}"
    if not draft.feeds:
        steps(f"edit {out}: name a source and its devices", check)
    else:
        steps(f"{check}            whether all of it arrives", f"oarlock live run {out} --out today")
