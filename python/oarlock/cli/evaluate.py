"""`oarlock evaluate`: scores a track against ground truth or optical markers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import typer

from oarlock.cli.markers import frames_by_marker
from oarlock.cli.tables import write_evaluation, write_marker_evaluation
from oarlock.cli.terminal import UsageError
from oarlock.cli.verbs import command

if TYPE_CHECKING:
    from oarlock.evaluation import Evaluation
    from oarlock.markers import Attachment, MarkerEvaluation

MARKER_ENDINGS: Final = (".c3d", ".trc", ".csv", ".tsv", ".txt")
CLOCKS: Final[dict[str, bool | str]] = {"offset": True, "drift": "drift", "same": False}


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock evaluate out trial/truth",
        "oarlock evaluate out trial --start-s 5",
        "oarlock evaluate out trial/truth --json | jq .mean_rmse_deg",
        "oarlock evaluate out trial.c3d --frames LELB=l_elbow,LWRI=l_wrist,RELB=r_elbow",
        "oarlock evaluate out trial.trc --attachments person.toml --clock drift",
        show=_show,
        metavars={"track": "TRACK", "truth": "TRUTH", "frames": "MARKER=FRAME,..."},
    )(evaluate)


def evaluate(
    track: Path,
    truth: Path,
    *,
    start_s: float = 2.0,
    frames: str | None = None,
    attachments: Path | None = None,
    clock: Literal["offset", "drift", "same"] = "offset",
    align_frame: bool = True,
    length_unit: Literal["m", "cm", "mm"] | None = None,
) -> Evaluation | MarkerEvaluation:
    """Compute RMSE, correlation, coverage and NEES per joint against ground truth; positions against markers.

    Args:
        track: a folder that `oarlock track` wrote.
        truth: track folder with the ground truth, recording that contains truth/, or markers: .c3d, .trc, .csv, .tsv.
        start_s: exclude the first seconds, in which the filter converges.
        frames: markers: which marker is on which frame; default: equal names.
        attachments: markers: their positions on the model, .toml.
        clock: markers: clock errors to fit.
        align_frame: markers: fit the transformation between their axes and the track's.
        length_unit: markers: unit of length.
    """
    import oarlock

    estimate = oarlock.load_track(track)
    if truth.suffix.lower() in MARKER_ENDINGS and not truth.is_dir():
        return oarlock.markers.evaluate_markers(
            estimate,
            oarlock.markers.load_markers(truth, length_unit),
            _pairs(frames, attachments),
            align_clock=CLOCKS[clock],
            align_frame=align_frame,
            start_s=start_s,
        )
    if frames is not None or attachments is not None:
        raise UsageError("--frames and --attachments need a marker file; they do not apply to a truth folder")
    return oarlock.evaluate(estimate, oarlock.load_track(truth_folder(truth)), start_s=start_s)


def _show(scores: Any) -> None:
    (write_marker_evaluation if hasattr(scores, "clock_offset_s") else write_evaluation)(scores)


def _pairs(frames: str | None, attachments: Path | None) -> dict[str, str] | tuple[Attachment, ...] | None:
    from oarlock.markers import load_attachments

    if frames is not None and attachments is not None:
        raise UsageError("give --frames or --attachments, not both")
    if attachments is not None:
        return load_attachments(attachments)
    return None if frames is None else frames_by_marker(frames)


def truth_folder(folder: Path) -> Path:
    """Return the folder itself, or truth/ inside a simulated recording."""
    return folder / "truth" if (folder / "truth").is_dir() else folder
