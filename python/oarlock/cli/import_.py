"""`oarlock import`: converts other formats to a recording folder, one verb per entry of `FORMATS`."""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.options import Force, Json, OutFolder, example
from oarlock.cli.terminal import number, output_folder, print_json, say, steps, table, verb
from oarlock.formats.importers import FORMATS, Format

if TYPE_CHECKING:
    from oarlock import Recording

group = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Convert other formats to a recording.")


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    app.add_typer(group, name="import")


def _reader(one: Format) -> Callable[..., None]:
    """The verb of a format. Typer takes the options from the signature."""

    def run(path: Path, out: Path, force: bool, json_output: bool, **options: object) -> None:
        _write(one.read(path, **options), path, out, force, json_output)

    place = typer.Argument(metavar=one.place, help=one.contents)
    wanted: list[tuple[str, Any, Any]] = [("path", Annotated[Path, place], ...), ("out", OutFolder, ...)]
    wanted += [(o.name, Annotated[o.kind, typer.Option(help=o.about)], o.default) for o in one.options]
    wanted += [("force", Force, False), ("json_output", Json, False)]
    run.__signature__ = Signature(  # type: ignore[attr-defined]
        [
            Parameter(
                name,
                Parameter.KEYWORD_ONLY,
                annotation=kind,
                default=Parameter.empty if default is ... else default,
            )
            for name, kind, default in wanted
        ]
    )
    return verb(run)


for _format in FORMATS:
    group.command(_format.name, help=_format.summary, epilog=example(_format.command))(_reader(_format))


def _write(recording: Recording, source: Path, out: Path, force: bool, json_output: bool) -> None:
    from oarlock.evaluation.summary import rate_text
    from oarlock.recording.epoch import clock_notes
    from oarlock.recording.packets import lost_packets, missing_packets, missing_share, own_rate_hz
    from oarlock.storage.epoch import moment_text

    notes = clock_notes(recording.meta)
    with output_folder(out, "recording", force, fresh=True) as stage:
        recording.save(stage)
    if json_output:
        print_json(
            {
                "recording": out,
                "source": source,
                "start_s": recording.start_s,
                "start": moment_text(recording.epoch, recording.start_s),
                "epoch": recording.epoch,
                "notes": notes,
                "end_s": recording.end_s,
                "streams": [
                    {
                        "name": s.name,
                        "kind": s.kind,
                        "samples": len(s),
                        "rate_hz": own_rate_hz(recording, s),
                        "missing_packets": missing_packets(recording, s),
                        "missing_share": missing_share(recording, s),
                    }
                    for s in recording.streams
                ],
            }
        )
        return
    say(f"Wrote {out} from {source}", style="bold")
    if start := moment_text(recording.epoch, recording.start_s):
        say(f"start {start}, {recording.duration_s:.1f} s", indent=2)
    for note in notes:
        say(note, indent=2)
    table(
        ["stream", "kind", ">samples", ">rate Hz", ">missing %"],
        [
            (
                s.name,
                s.kind,
                len(s),
                rate_text(own_rate_hz(recording, s)),
                number(100 * missing_share(recording, s), ".1f"),
            )
            for s in recording.streams
        ],
    )
    for stream in recording.streams:
        if (lost := lost_packets(recording, stream)) is not None and lost.text():
            say(f"{stream.name}: {lost.text()}", indent=2)
    steps(f"oarlock track {out} --model MODEL --out {out}-track")
