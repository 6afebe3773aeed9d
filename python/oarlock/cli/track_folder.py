"""Runs a filter and writes the folder of its track, for `track`, `demo` and `track_several`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from oarlock.cli.terminal import heading, progress, say
from oarlock.evaluation.comparison.filter_names import LIMB_FILTER, ORIENTATION_FILTERS
from oarlock.storage.folder_writer import replaced_folder

if TYPE_CHECKING:
    from oarlock import Calibration, Config, Model, Recording, Track
    from oarlock.evaluation import Evaluation, Suspect

TRACK = "track"
"""What the manifest of such a folder says."""
RECORDING_FILE = "recording.toml"


def run_filter(
    model: Model,
    recording: Recording,
    calibration: Calibration | None,
    config: Config | None,
    smooth: bool,
    filter_name: str = "",
) -> Track:
    """Tracks with a progress bar, and smooths if asked. `filter_name` may be one that `Config` does not know."""
    import oarlock

    with progress("tracking") as told:
        if filter_name == LIMB_FILTER:
            return oarlock.studies.track_independent_chains(
                model, recording, calibration, config, progress=told
            )
        if filter_name in ORIENTATION_FILTERS:
            return oarlock.studies.track_orientations(
                model, recording, filter_name, calibration, progress=told
            )
        result = oarlock.track(model, recording, calibration=calibration, config=config, progress=told)
    if smooth:
        with progress("smoothing") as told:
            result = oarlock.smooth(result, progress=told)
    return result


def write_folder(
    result: Track,
    stage: Path,
    csv: bool = False,
    evaluation: Evaluation | None = None,
    truth: Track | None = None,
) -> None:
    """Write the track's tables, run.toml and report.html into a folder of `output_folder`; `csv` adds CSV tables."""
    from oarlock.pipeline import write_track

    with replaced_folder(stage, TRACK) as place:
        write_track(result, place, evaluation, truth, progress=True)
        if csv:
            from oarlock.storage.csv_cells import write_csv
            from oarlock.storage.parquet_table import read_table

            for name in ("track", *(n for n in beside(result) if n == "sensors")):
                write_csv(read_table(place / f"{name}.parquet").columns, place / f"{name}.csv")


def beside(result: Track) -> list[str]:
    """Further tables of the track: filters on single units have neither sensors nor beliefs."""
    found = {"sensors": result.info, "beliefs": result.beliefs}
    return [name for name, table in found.items() if table is not None]


def document(result: Track, out: Path, found: Sequence[Suspect] = ()) -> dict[str, object]:
    """Return the summary for `--json`; `found` are the suspects of the recording."""
    from oarlock.evaluation.summary import summarize

    summary = summarize(result)
    return {
        "out": out,
        "report": out / "report.html" if (out / "report.html").exists() else None,
        "suspects": [suspect.to_dict() for suspect in found],
        **{key: value for key, value in vars(summary).items() if key != "sensors"},
        "sensors": {sensor.name: sensor.to_dict() for sensor in summary.sensors},
        "provenance": dict(result.provenance),
    }


def write_suspects(found: Sequence[Suspect]) -> None:
    """Prints one or two sentences for each suspect."""
    if not found:
        return
    heading("Suspects", "sensors that appear to be faulty; nothing was corrected")
    for suspect in found:
        say(f"- {suspect}", indent=2)
    say()


@contextmanager
def explained(out: Path, title: str, force: bool) -> Iterator[list[Suspect]]:
    """Gives a list for suspects. If the data stop the run, adds them to the error and writes a page about them.

    The page is refused.html: a track that was in the folder before is still there, with its own report.
    """
    from oarlock import DataError, DivergedError

    found: list[Suspect] = []
    try:
        yield found
    except (DataError, DivergedError) as error:
        if found:
            from oarlock.report.refusal import write_refusal

            reason, page = str(error), out / "refused.html"
            with replaced_folder(out, TRACK, force, adds=True) as stage:
                write_refusal(stage / page.name, title, [s.note for s in found], reason)
            error.args = ("\n".join([reason, *(s.note for s in found), f"Wrote {page}"]),)
        raise
