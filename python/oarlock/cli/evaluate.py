"""`oarlock evaluate`: a track against truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from oarlock.cli.options import Json, example
from oarlock.cli.tables import write_evaluation
from oarlock.cli.terminal import print_json, say, verb

TruthFolder = Annotated[
    Path,
    typer.Argument(metavar="TRUTH", help="A track folder with the truth, or a recording that holds truth/."),
]


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "evaluate",
        short_help="Score a track against truth.",
        epilog=example(
            "oarlock evaluate out trial/truth",
            "oarlock evaluate out trial --start-s 5",
            "oarlock evaluate out trial/truth --json | jq .mean_rmse_deg",
        ),
    )(evaluate)


@verb
def evaluate(
    out: Annotated[Path, typer.Argument(metavar="TRACK", help="A folder that `oarlock track` wrote.")],
    truth: TruthFolder,
    start_s: Annotated[
        float, typer.Option("--start-s", metavar="S", help="Leave out the first seconds: the filter settles.")
    ] = 2.0,
    json_output: Json = False,
) -> None:
    """RMSE, correlation, coverage and NEES per joint, and positions, against truth."""
    import oarlock

    scores = oarlock.evaluate(
        oarlock.load_track(out), oarlock.load_track(truth_folder(truth)), start_s=start_s
    )
    if json_output:
        print_json(scores.to_dict())
        return
    say(f"{out} against {truth_folder(truth)}", style="bold")
    write_evaluation(scores)


def truth_folder(folder: Path) -> Path:
    """The folder itself, or the truth/ inside a simulated recording."""
    return folder / "truth" if (folder / "truth").is_dir() else folder
