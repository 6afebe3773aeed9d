"""`oarlock track`: estimates joint angles with their uncertainty from a recording."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from rich.text import Text

from oarlock.cli.body import Balls, Mass, Plays, Sensors, Stature, chosen_body, hinge_pairs
from oarlock.cli.options import CalibrationFile, Force, Json, ModelName, OutFolder, example, names
from oarlock.cli.settings import (
    DEFAULTS,
    configuration,
    settings_help,
    settings_of_file,
    split,
)
from oarlock.cli.terminal import (
    EXIT_DATA,
    Told,
    UsageError,
    check_folder,
    details,
    number,
    output_folder,
    page,
    print_json,
    progress,
    say,
    steps,
    table,
    verb,
)
from oarlock.cli.track_folder import (
    RECORDING_FILE,
    TRACK,
    beside,
    document,
    explained,
    run_filter,
    write_folder,
    write_suspects,
)
from oarlock.evaluation.comparison.filter_names import LIMB_FILTER, ORIENTATION_FILTERS, TREE_FILTERS
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.write_file import check_writable

if TYPE_CHECKING:
    from oarlock import Calibration, Config, Model, Recording, Track
    from oarlock.evaluation import Suspect
    from oarlock.tracking.many import Failure, Job

OTHER_FILTERS = (LIMB_FILTER, *ORIENTATION_FILTERS)
# the engine's filters, then those that process a whole recording at once
_FILTERS = (*TREE_FILTERS, *OTHER_FILTERS)


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "track",
        epilog=example(
            "oarlock track trial --model sculler --out out",
            "oarlock track trial --model my.toml --set l_ua_r=0.31 --smooth --csv --out out",
            "oarlock track rec --model pendulum3 --calibration cal.toml --streams upper,middle,lower --out out",
            "oarlock track trial --model sculler --out out --json | jq .steps_per_s",
            "oarlock track monday tuesday friday --model sculler --jobs 2 --out season",
            "oarlock track walk --model lower_body --stature-m 1.78 --mass-kg 74 --out out",
            "oarlock track again --model sculler --config out/run.toml --set gate=false --out again",
        )
        + settings_help(),
    )(track)


@verb
def track(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING",
            help="A recording folder; or several, tracked in parallel, each into FOLDER/its name.",
        ),
    ],
    model: ModelName,
    out: OutFolder,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="A model parameter, e.g. l_ua_r=0.31 (SI), or a setting of the filter, see below. Repeatable.",
        ),
    ] = None,
    config_file: Annotated[
        Path | None,
        typer.Option(
            "--config", metavar="FILE", help="Settings of the filter: a TOML file, or an earlier run.toml."
        ),
    ] = None,
    calibration: CalibrationFile = None,
    streams: Annotated[
        str | None,
        typer.Option(
            "--streams",
            metavar="NAMES",
            help="Streams to use, comma-separated; default: all that the model has a sensor for.",
        ),
    ] = None,
    without: Annotated[
        str | None, typer.Option("--without", metavar="NAMES", help="Streams to leave out, comma-separated.")
    ] = None,
    low_pass_hz: Annotated[
        float | None,
        typer.Option(
            "--low-pass-hz",
            metavar="HZ",
            help="First remove faster vibration of units; for --set structure=tree.",
        ),
    ] = None,
    stature_m: Stature = None,
    mass_kg: Mass = None,
    sensors: Sensors = None,
    balls: Balls = None,
    plays: Plays = None,
    smooth: Annotated[bool, typer.Option("--smooth", help="Smooth over the whole recording.")] = False,
    filter_name: Annotated[
        str | None,
        typer.Option(
            "--filter",
            metavar="NAME",
            help="Sigma points (ukf), or linearised and faster (ekf). For comparison: "
            f"one filter per limb (limbs); one per inertial unit, then inverse kinematics "
            f"({', '.join(ORIENTATION_FILTERS)}).",
        ),
    ] = None,
    output_rate_hz: Annotated[
        float | None,
        typer.Option(
            metavar="HZ", help="Rate of the rows, 0: one for every sample; default: found, see docs."
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", metavar="N", min=1, help="Recordings tracked in parallel; default: all cores."
        ),
    ] = None,
    suspects: Annotated[
        bool,
        typer.Option(
            "--suspects/--no-suspects",
            help="First look for sensor faults, in the second with the most motion.",
        ),
    ] = True,
    csv: Annotated[bool, typer.Option("--csv", help="Also write the tables as CSV.")] = False,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Track a recording: write joint angles with uncertainty, run.toml and report.html into a folder."""
    from oarlock import load_calibration, load_model
    from oarlock.cli.result import result_of, write_result
    from oarlock.pipeline import ball_note, searched_suspects

    body = load_model(model)
    parameters, chosen = split(settings, body.parameters)
    body = chosen_body(model, parameters, stature_m, mass_kg, sensors, balls or (), plays or ())
    chosen = {**(settings_of_file(config_file) if config_file else {}), **chosen}
    if output_rate_hz is not None:
        chosen["output_rate_hz"] = output_rate_hz
    asked = filter_name or chosen.get("filter", DEFAULTS["filter"])
    if asked not in _FILTERS:
        raise UsageError(f"--filter {asked}: choose one of {', '.join(_FILTERS)}")
    config = configuration(
        body, {**chosen, "filter": DEFAULTS["filter"] if asked in OTHER_FILTERS else asked}
    )

    def load(folder: Path) -> Recording:
        return _measured(folder, streams, without, low_pass_hz)

    if asked in OTHER_FILTERS and (smooth or len(recordings) > 1):
        lacks = "--smooth" if smooth else "several recordings at once"
        raise UsageError(f"--filter {asked} has no {lacks}; {', '.join(TREE_FILTERS)} have")
    wearing = load_calibration(calibration) if calibration is not None else None
    if len(recordings) > 1:
        folders = folders_for(recordings, out, force)
        track_several(
            body,
            load,
            folders,
            wearing,
            config,
            smooth=smooth,
            threads=jobs,
            look=suspects,
            csv=csv,
            force=force,
            json_output=json_output,
        )
        return
    measured = load(recordings[0])
    if (out / RECORDING_FILE).exists():
        raise UsageError(f"{out} is a recording; choose another folder for the results")
    with explained(out, f"Track of {body.name}", force) as found, output_folder(out, TRACK, force) as stage:
        found += searched_suspects(body, measured, wearing, config) if suspects else ()
        result = run_filter(body, measured, wearing, config, smooth, asked)
        result = result.with_notes(*(suspect.note for suspect in found), *map(ball_note, hinge_pairs(balls)))
        write_folder(result, stage, csv)
    if json_output:
        print_json({**document(result, out, found), **result_of(result)})
        return
    report = out / "report.html"
    write_suspects(found)
    with details():
        from oarlock.cli.tables import write_summary

        write_summary(result)
        say()
    write_result(result, report if report.exists() else None)
    with details():
        tables = ", ".join(f"{name}.parquet" for name in ("track", *beside(result)))
        say(f"\nWrote {out}: {tables}, model.toml, run.toml{', report.html' * report.exists()}")
        steps(f"oarlock evaluate {out} TRUTH        if you have a reference")


def _measured(folder: Path, streams: str | None, without: str | None, low_pass_hz: float | None) -> Recording:
    from oarlock import load_recording

    measured = load_recording(folder)
    if streams is not None:
        measured = measured.only(names(streams))
    if without is not None:
        measured = measured.without(names(without))
    return measured if low_pass_hz is None else measured.low_passed(low_pass_hz)


def folders_for(recordings: Sequence[Path], out: Path, force: bool) -> dict[Path, Path]:
    """A folder inside `out` for each recording, with its name.

    Raises:
        UsageError: two recordings have the same name, or a folder contains other files.
    """
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out} is a file; --out names a folder")
    taken: dict[str, Path] = {}
    for recording in recordings:
        folder = recording.resolve()
        name = folder.parent.name if folder.name == RECORDING_FILE else folder.name
        if name in taken:
            raise UsageError(
                f"{taken[name]} and {recording} would both write {out / name}\n"
                "Rename a folder, or track them one at a time, each with its own --out."
            )
        if (out / name / RECORDING_FILE).exists():
            raise UsageError(f"{out / name} is a recording; choose another folder for the results")
        taken[name] = recording
    for name in taken:
        check_folder(out / name, force)
        check_writable(out / name)
    return {path: out / name for name, path in taken.items()}


def track_several(
    body: Model,
    load: Callable[[Path], Recording],
    folders: Mapping[Path, Path],
    wearing: Calibration | None,
    config: Config,
    *,
    smooth: bool,
    threads: int | None,
    look: bool,
    csv: bool,
    force: bool,
    json_output: bool,
) -> None:
    """Tracks and writes each recording. If one failed, exits with status 1 after the others are written."""
    rows: list[tuple[object, ...]] = []
    documents: dict[str, object] = {}
    notes: dict[str, Sequence[str]] = {}
    failed: list[str] = []
    with progress("tracking") as told:
        for path, result, suspects in _results(
            body, load, list(folders), wearing, config, smooth, threads, look, told
        ):
            out = folders[path]
            if not isinstance(result, Exception):
                result = result.with_notes(*(suspect.note for suspect in suspects))
                try:
                    with replaced_folder(out, TRACK, force) as stage:
                        write_folder(result, stage, csv)
                except DataError as error:
                    result = error
            if isinstance(result, Exception):
                failed.append(str(result))
                documents[out.name] = {"error": str(result)}
                continue
            documents[out.name] = document(result, out, suspects)
            notes[out.name] = result.notes
            rows.append(_row(out, result))
    if json_output:
        print_json({"recordings": documents})
    elif rows:
        from oarlock.cli.tables import write_contradiction

        for name, sentences in notes.items():
            write_contradiction(sentences, name)
        _write(rows, out.parent)
    if failed:
        _leave(failed, len(folders))


def _results(
    body: Model,
    load: Callable[[Path], Recording],
    paths: list[Path],
    wearing: Calibration | None,
    config: Config,
    smooth: bool,
    threads: int | None,
    look: bool,
    told: Told,
) -> Iterator[tuple[Path, Track | Failure, tuple[Suspect, ...]]]:
    """Tracks as many recordings at a time as there are threads, to limit memory."""
    from oarlock.pipeline import searched_suspects
    from oarlock.tracking.many import outcomes

    width = threads or os.cpu_count() or 1
    for first in range(0, len(paths), width):
        batch = paths[first : first + width]
        jobs, broken = _loaded(load, batch, wearing, config)

        def share(done: float, first: int = first, count: int = len(batch)) -> None:
            told((first + done * count) / len(paths))

        tracked = outcomes(body, jobs, smooth=smooth, threads=threads, stop_on_refusal=False, progress=share)
        found = broken | dict(zip(jobs, tracked, strict=True))
        for path in batch:
            job = jobs.get(str(path)) if look else None
            looked = () if job is None else searched_suspects(body, *job)
            yield path, _with_reason(found[str(path)], looked), looked


def _with_reason(result: Track | Failure, found: tuple[Suspect, ...]) -> Track | Failure:
    if isinstance(result, Exception) and found:
        result.args = ("\n".join([str(result), *(suspect.note for suspect in found)]),)
    return result


def _loaded(
    load: Callable[[Path], Recording], paths: list[Path], wearing: Calibration | None, config: Config
) -> tuple[dict[str, Job], dict[str, Track | Failure]]:
    from oarlock import DataError

    jobs: dict[str, Job] = {}
    broken: dict[str, Track | Failure] = {}
    for path in paths:
        try:
            jobs[str(path)] = load(path), wearing, config
        except DataError as error:
            broken[str(path)] = DataError(f"{path}: {error}")
    return jobs, broken


def _row(out: Path, result: Track) -> tuple[object, ...]:
    from oarlock.cli.tables import speed
    from oarlock.evaluation.summary import summarize

    summary = summarize(result)
    return out.name, summary.samples, number(summary.duration_s, ".1f"), speed(summary), len(summary.notes)


def _write(rows: list[tuple[object, ...]], out: Path) -> None:
    say("Tracked in parallel", style="bold")
    table(["recording", ">rows", ">s", "speed", ">notes"], rows)
    files = "track, sensors and beliefs (.parquet), model.toml, run.toml, report.html"
    say(f"\nWrote a folder for each into {out}: {files}")
    steps(f"open {out / str(rows[0][0]) / 'report.html'}")


def _leave(failed: list[str], count: int) -> NoReturn:
    console = page(stderr=True)
    failures = f"{len(failed)} of {count} recordings failed; the others are written"
    console.print(Text.assemble(("error: ", "bold red"), failures), soft_wrap=True)
    for text in failed:
        for line in text.splitlines():
            console.print(Text(f"  {line.strip()}"), soft_wrap=True)
    raise typer.Exit(EXIT_DATA)
