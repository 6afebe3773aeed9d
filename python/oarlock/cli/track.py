"""`oarlock track`: estimates joint angles with their uncertainty from a recording, or from several."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.body import hinge_pairs, with_loose_joints
from oarlock.cli.settings import DEFAULTS, configuration, settings_help, settings_of_file, split
from oarlock.cli.terminal import (
    UsageError,
    check_folder,
    details,
    number,
    output_folder,
    progress,
    say,
    steps,
    table,
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
from oarlock.cli.verbs import Incomplete, ModelName, command
from oarlock.evaluation.comparison.filter_names import LIMB_FILTER, ORIENTATION_FILTERS, TREE_FILTERS
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.write_file import check_writable

if TYPE_CHECKING:
    from oarlock import Calibration, Config, Model, Recording, Track
    from oarlock.evaluation import Suspect
    from oarlock.tracking.many import Failure

OTHER_FILTERS = (LIMB_FILTER, *ORIENTATION_FILTERS)
# the engine's filters, then those that process a whole recording at once
_FILTERS = (*TREE_FILTERS, *OTHER_FILTERS)


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock track trial --model sculler --out out",
        "oarlock track trial --model my.toml --set l_ua_r=0.31 --smooth --csv --out out",
        "oarlock track rec --model pendulum3 --calibration cal.toml --streams upper,middle,lower --out out",
        "oarlock track trial --model sculler --out out --json | jq .steps_per_s",
        "oarlock track monday tuesday friday --model sculler --jobs 2 --out season",
        "oarlock track walk --model lower_body --stature-m 1.78 --mass-kg 74 --out out",
        "oarlock track again --model sculler --config out/run.toml --set gate=false --out again",
        show=_show,
        metavars={
            "recordings": "RECORDING",
            "out": "FOLDER",
            "set_": "KEY=VALUE",
            "ball": "HINGE,HINGE",
            "play": "HINGE=DEG",
        },
        epilog=settings_help().strip(),
    )(track)


@dataclass(frozen=True)
class WrittenTrack:
    """A track, its folder and the suspects of its recording."""

    track: Track
    out: Path
    suspects: Sequence[Suspect]

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        from oarlock.cli.result import result_of

        return {**document(self.track, self.out, self.suspects), **result_of(self.track)}


@dataclass(frozen=True)
class WrittenTracks:
    """Summaries of tracks, or the `error` of each that failed, by the name of their folder in `out`."""

    out: Path
    recordings: dict[str, dict[str, Any]]

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return {"recordings": self.recordings}


def track(
    recordings: list[Path],
    *,
    model: ModelName,
    out: Path,
    set_: list[str] | None = None,
    config: Path | None = None,
    calibration: Calibration | None = None,
    streams: tuple[str, ...] | None = None,
    without: tuple[str, ...] | None = None,
    low_pass_hz: float | None = None,
    stature_m: float | None = None,
    mass_kg: float | None = None,
    sensors: tuple[str, ...] | None = None,
    ball: list[str] | None = None,
    play: list[str] | None = None,
    smooth: bool = False,
    filter: str | None = None,
    output_rate_hz: float | None = None,
    jobs: int | None = None,
    suspects: bool = True,
    csv: bool = False,
    force: bool = False,
) -> WrittenTrack | WrittenTracks:
    """Track a recording: write joint angles with uncertainty, run.toml and report.html into a folder.

    Args:
        recordings: a recording folder; or several, tracked in parallel, each into FOLDER/its name.
        model: name of a shipped model, or a model file.
        out: folder to write.
        set_: a model parameter, e.g. l_ua_r=0.31 (SI), or a setting of the filter, see below. Repeatable.
        config: settings of the filter: a TOML file, or an earlier run.toml.
        calibration: calibration file with mounts and lengths.
        streams: streams to use, comma-separated; default: all that the model has a sensor for.
        without: streams to leave out, comma-separated.
        low_pass_hz: first remove faster vibration of units; for --set structure=tree.
        stature_m: standing height, m: sets the lengths of a body, e.g. 1.78.
        mass_kg: mass, kg, with --stature-m: sets the radii of limbs, e.g. 74.
        sensors: inertial units that are worn, comma-separated; the body is cut to what they measure.
        ball: make one ball of two hinges whose axes are unknown, e.g. elbow_flexion_r,elbow_pronation_r. Repeatable.
        play: a hinge that also turns across its axis, and the standard deviation, e.g. knee_flexion_r=3. Repeatable.
        smooth: smooth over the whole recording.
        filter: sigma points (ukf), or linearised and faster (ekf). For comparison: one filter per limb (limbs); one per
            inertial unit, then inverse kinematics (vqf, madgwick, quaternion_ekf, quest_ekf, vector_kf).
        output_rate_hz: rate of the rows, 0: one for every sample; default: found, see docs.
        jobs: recordings tracked in parallel; default: all cores.
        suspects: first look for sensor faults, in the second with the most motion.
        csv: also write the tables as CSV.
        force: replace what is there.
    """
    from oarlock import load_model, load_recording
    from oarlock.pipeline import ball_note, searched_suspects

    parameters, settings = split(set_, load_model(model).parameters)
    body = load_model(model, parameters=parameters, stature_m=stature_m, mass_kg=mass_kg)
    body = body if sensors is None else body.with_units(sensors)
    body = with_loose_joints(body, ball or (), play or ())
    settings = {**(settings_of_file(config) if config else {}), **settings}
    if output_rate_hz is not None:
        settings["output_rate_hz"] = output_rate_hz
    name = filter or settings.get("filter", DEFAULTS["filter"])
    if name not in _FILTERS:
        raise UsageError(f"--filter {name}: choose one of {', '.join(_FILTERS)}")
    if name in OTHER_FILTERS and (smooth or len(recordings) > 1):
        lacks = "--smooth" if smooth else "several recordings at once"
        raise UsageError(f"--filter {name} has no {lacks}; {', '.join(TREE_FILTERS)} have")
    engine_filter = DEFAULTS["filter"] if name in OTHER_FILTERS else name
    chosen = configuration(body, {**settings, "filter": engine_filter})

    def load(folder: Path) -> Recording:
        recording = load_recording(folder)
        recording = recording if streams is None else recording.only(streams)
        recording = recording if without is None else recording.without(without)
        return recording if low_pass_hz is None else recording.low_passed(low_pass_hz)

    def search(recording: Recording) -> tuple[Suspect, ...]:
        return searched_suspects(body, recording, calibration, chosen) if suspects else ()

    if len(recordings) > 1:
        folders = folders_for(recordings, out, force)
        tracks = _several(body, load, folders, calibration, chosen, smooth, jobs, search, csv, force)
        result = WrittenTracks(out, dict(tracks))
        if failures := [one["error"] for one in result.recordings.values() if "error" in one]:
            count = f"{len(failures)} of {len(recordings)} recordings failed; the others are written"
            raise Incomplete(result, "\n".join([count, *failures]))
        return result
    recording = load(recordings[0])
    if (out / RECORDING_FILE).exists():
        raise UsageError(f"{out} is a recording; choose another folder for the results")
    with explained(out, f"Track of {body.name}", force) as faults, output_folder(out, TRACK, force) as stage:
        faults += search(recording)
        estimate = run_filter(body, recording, calibration, chosen, smooth, name)
        notes = map(ball_note, hinge_pairs(ball or ()))
        estimate = estimate.with_notes(*(suspect.note for suspect in faults), *notes)
        write_folder(estimate, stage, csv)
    return WrittenTrack(estimate, out, faults)


def folders_for(recordings: Sequence[Path], out: Path, force: bool) -> dict[Path, Path]:
    """A folder inside `out` for each recording, with its name.

    Raises:
        UsageError: two recordings have the same name, or a folder contains other files.
    """
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out} is a file; --out names a folder")
    by_name: dict[str, Path] = {}
    for recording in recordings:
        folder = recording.resolve()
        name = folder.parent.name if folder.name == RECORDING_FILE else folder.name
        if name in by_name:
            raise UsageError(
                f"{by_name[name]} and {recording} would both write {out / name}\n"
                "Rename a folder, or track them one at a time, each with its own --out."
            )
        if (out / name / RECORDING_FILE).exists():
            raise UsageError(f"{out / name} is a recording; choose another folder for the results")
        by_name[name] = recording
    for name in by_name:
        check_folder(out / name, force)
        check_writable(out / name)
    return {path: out / name for name, path in by_name.items()}


def _several(
    body: Model,
    load: Callable[[Path], Recording],
    folders: dict[Path, Path],
    calibration: Calibration | None,
    config: Config,
    smooth: bool,
    jobs: int | None,
    search: Callable[[Recording], tuple[Suspect, ...]],
    csv: bool,
    force: bool,
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Tracks and writes as many recordings at a time as there are jobs, to limit memory; name and summary of each."""
    from oarlock.tracking.many import outcomes

    paths, width = list(folders), jobs or os.cpu_count() or 1
    with progress("tracking") as share:
        for first in range(0, len(paths), width):
            batch: dict[str, tuple[Recording, Calibration | None, Config]] = {}
            results: dict[str, Track | Failure] = {}
            for path in paths[first : first + width]:
                try:
                    batch[str(path)] = load(path), calibration, config
                except DataError as error:
                    results[str(path)] = DataError(f"{path}: {error}")

            def batch_share(done: float, first: int = first, count: int = len(batch)) -> None:
                share((first + done * count) / len(paths))

            tracks = outcomes(
                body, batch, smooth=smooth, threads=jobs, stop_on_refusal=False, progress=batch_share
            )
            results |= dict(zip(batch, tracks, strict=True))
            for path in paths[first : first + width]:
                result, place = results[str(path)], folders[path]
                faults = search(batch[str(path)][0]) if str(path) in batch else ()
                notes = [suspect.note for suspect in faults]
                if isinstance(result, Exception):
                    yield place.name, {"error": "\n".join([str(result), *notes])}
                    continue
                result = result.with_notes(*notes)
                try:
                    with replaced_folder(place, TRACK, force) as stage:
                        write_folder(result, stage, csv)
                    yield place.name, document(result, place, faults)
                except DataError as error:
                    yield place.name, {"error": str(error)}


def _show(result: WrittenTrack | WrittenTracks) -> None:
    if isinstance(result, WrittenTracks):
        _show_several(result)
        return
    from oarlock.cli.result import write_result
    from oarlock.cli.tables import write_summary

    report = result.out / "report.html"
    write_suspects(result.suspects)
    with details():
        write_summary(result.track)
        say()
    write_result(result.track, report if report.exists() else None)
    with details():
        tables = ", ".join(f"{name}.parquet" for name in ("track", *beside(result.track)))
        say(f"\nWrote {result.out}: {tables}, model.toml, run.toml{', report.html' * report.exists()}")
        steps(f"oarlock evaluate {result.out} TRUTH        if you have a reference")


def _show_several(result: WrittenTracks) -> None:
    from oarlock.cli.tables import write_contradiction

    tracks = {name: one for name, one in result.recordings.items() if "error" not in one}
    for name, one in tracks.items():
        write_contradiction(one["notes"], name)
    if tracks:
        say("Tracked in parallel", style="bold")
        table(
            ["recording", ">rows", ">s", ">steps/s", ">notes"],
            [
                (
                    name,
                    one["samples"],
                    number(one["duration_s"], ".1f"),
                    number(one["steps_per_s"], ".0f"),
                    len(one["notes"]),
                )
                for name, one in tracks.items()
            ],
        )
        files = "track, sensors and beliefs (.parquet), model.toml, run.toml, report.html"
        say(f"\nWrote a folder for each into {result.out}: {files}")
        steps(f"open {result.out / next(iter(tracks)) / 'report.html'}")
