"""`oarlock evaluate`: scores a track against ground truth or optical markers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from oarlock.cli.markers import mapping
from oarlock.cli.options import Json, example
from oarlock.cli.tables import write_evaluation, write_marker_evaluation
from oarlock.cli.terminal import UsageError, print_json, say, verb

if TYPE_CHECKING:
    from oarlock.markers import Attachment

MARKER_ENDINGS: Final = (".c3d", ".trc", ".csv", ".tsv", ".txt")
CLOCKS: Final[dict[str, bool | str]] = {"offset": True, "drift": "drift", "same": False}

TruthFolder = Annotated[
    Path,
    typer.Argument(
        metavar="TRUTH",
        help="Track folder with the ground truth, recording that contains truth/, or markers: .c3d, .trc, .csv, .tsv.",
    ),
]


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "evaluate",
        epilog=example(
            "oarlock evaluate out trial/truth",
            "oarlock evaluate out trial --start-s 5",
            "oarlock evaluate out trial/truth --json | jq .mean_rmse_deg",
            "oarlock evaluate out trial.c3d --frames LELB=l_elbow,LWRI=l_wrist,RELB=r_elbow",
            "oarlock evaluate out trial.trc --attachments person.toml --clock drift",
        ),
    )(evaluate)


@verb
def evaluate(
    out: Annotated[Path, typer.Argument(metavar="TRACK", help="A folder that `oarlock track` wrote.")],
    truth: TruthFolder,
    start_s: Annotated[
        float,
        typer.Option(
            "--start-s", metavar="S", help="Exclude the first seconds, in which the filter converges."
        ),
    ] = 2.0,
    frames: Annotated[
        str | None,
        typer.Option(
            "--frames",
            metavar="MARKER=FRAME,...",
            help="Markers: which marker is on which frame; default: equal names.",
        ),
    ] = None,
    attachments: Annotated[
        Path | None,
        typer.Option(
            "--attachments", "-a", metavar="FILE", help="Markers: their positions on the model, .toml."
        ),
    ] = None,
    clock: Annotated[
        str, typer.Option("--clock", metavar="offset|drift|same", help="Markers: clock errors to fit.")
    ] = "offset",
    align_frame: Annotated[
        bool,
        typer.Option(
            "--align-frame/--no-align-frame",
            help="Markers: fit the transformation between their axes and the track's.",
        ),
    ] = True,
    unit: Annotated[
        str | None, typer.Option("--length-unit", metavar="m|cm|mm", help="Markers: unit of length.")
    ] = None,
    json_output: Json = False,
) -> None:
    """Compute RMSE, correlation, coverage and NEES per joint against ground truth; positions against markers."""
    import oarlock

    track = oarlock.load_track(out)
    if truth.suffix.lower() in MARKER_ENDINGS and not truth.is_dir():
        if clock not in CLOCKS:
            raise UsageError(f"--clock {clock}: choose one of {', '.join(CLOCKS)}")
        against = oarlock.markers.evaluate_markers(
            track,
            oarlock.markers.load_markers(truth, unit),
            _pairs(frames, attachments),
            align_clock=CLOCKS[clock],
            align_frame=align_frame,
            start_s=start_s,
        )
        if json_output:
            print_json(against.to_dict())
            return
        say(f"{out} against {truth}", style="bold")
        write_marker_evaluation(against)
        return
    if frames is not None or attachments is not None:
        raise UsageError("--frames and --attachments need a marker file; they do not apply to a truth folder")
    scores = oarlock.evaluate(track, oarlock.load_track(truth_folder(truth)), start_s=start_s)
    if json_output:
        print_json(scores.to_dict())
        return
    say(f"{out} against {truth_folder(truth)}", style="bold")
    write_evaluation(scores)


def _pairs(frames: str | None, attachments: Path | None) -> dict[str, str] | tuple[Attachment, ...] | None:
    from oarlock.markers import load_attachments

    if frames is not None and attachments is not None:
        raise UsageError("give --frames or --attachments, not both")
    if attachments is not None:
        return load_attachments(attachments)
    return None if frames is None else mapping(frames, "--frames")


def truth_folder(folder: Path) -> Path:
    """Return the folder itself, or truth/ inside a simulated recording."""
    return folder / "truth" if (folder / "truth").is_dir() else folder
