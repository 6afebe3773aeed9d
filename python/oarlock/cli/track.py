"""`oarlock track`: from a recording to joint angles with their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock import Config
from oarlock.cli.model import posture
from oarlock.cli.options import Force, Json, ModelName, OutFolder, Settings, assignments, example, names
from oarlock.cli.suspects import explained, look_for_suspects, write_suspects
from oarlock.cli.tables import write_summary
from oarlock.cli.terminal import UsageError, fresh_folder, print_json, progress, say, steps, verb
from oarlock.evaluation.comparison.estimators import LIMB_FILTER, tree_filters
from oarlock.evaluation.comparison.orientation_track import ORIENTATION_FILTERS

if TYPE_CHECKING:
    from oarlock import Calibration, Evaluation, Model, Recording, Suspect, Track

RUN_FILE = "run.toml"
RECORDING_FILE = "recording.toml"


OTHER_FILTERS = (LIMB_FILTER, *ORIENTATION_FILTERS)

# the engine's own defaults, shown in the help text
_DEFAULT = Config().to_dict()


class ProcessNoise(StrEnum):
    """How joints move by themselves."""

    jerk = "jerk"
    paper = "paper"


class Magnetometer(StrEnum):
    """What is done with magnetometers."""

    gated = "gated"
    on = "on"
    off = "off"


# the engine's own, then those that go over a whole recording
_FILTERS = (*tree_filters(), *OTHER_FILTERS)


class Consider(StrEnum):
    """What is made of mounts, lengths and places of units that are not estimated."""

    learnt = "learnt"
    always = "always"
    off = "off"


_PROCESS_NOISE = ProcessNoise(_DEFAULT["process_noise"])
_MAGNETOMETER = Magnetometer(_DEFAULT["magnetometer"])
_CONSIDER = Consider(_DEFAULT["consider"])


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "track",
        short_help="Turn a recording into joint angles with uncertainty.",
        epilog=example(
            "oarlock track trial --model sculler --out out",
            "oarlock track trial --model my.toml --set l_ua_r=0.31 --smooth --csv --out out",
            "oarlock track rec --model pendulum3 --calibration cal.toml --only upper,middle,lower --out out",
            "oarlock track trial --model sculler --out out --json | jq .steps_per_s",
            "oarlock track monday tuesday friday --model sculler --threads 2 --out season",
        ),
    )(track)


@verb
def track(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING...",
            help="A recording folder; or several, tracked side by side, each into FOLDER/its name.",
        ),
    ],
    model: ModelName,
    out: OutFolder,
    settings: Settings = None,
    calibration: Annotated[
        Path | None, typer.Option("--calibration", metavar="FILE", help="Mounts and lengths of this wearing.")
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(
            "--only",
            metavar="NAMES",
            help="Streams to use, with commas; the recording's others are left out.",
        ),
    ] = None,
    smooth: Annotated[bool, typer.Option("--smooth", help="Smooth over the whole recording.")] = False,
    estimate: Annotated[
        str,
        typer.Option(
            "--estimate",
            metavar="NAMES",
            help="Slow states: gyro_bias, accel_bias, surge, with commas; or none.",
        ),
    ] = ",".join(_DEFAULT["estimate"]),
    closures: Annotated[
        bool, typer.Option("--closures/--no-closures", help="Use the model's closures.")
    ] = _DEFAULT["closures"],
    process_noise: Annotated[
        ProcessNoise, typer.Option("--process-noise", help="White jerk, or Q of the paper's eq. 6.")
    ] = _PROCESS_NOISE,
    magnetometer: Annotated[
        Magnetometer, typer.Option("--magnetometer", help="Gate disturbed readings, use all, or none.")
    ] = _MAGNETOMETER,
    filter_name: Annotated[
        str,
        typer.Option(
            "--filter",
            metavar="NAME",
            help="Sigma points (ukf), or linearised, which is faster (ekf). To compare with: "
            f"one filter per limb (limbs); one per inertial unit, then inverse kinematics "
            f"({', '.join(ORIENTATION_FILTERS)}).",
        ),
    ] = _DEFAULT["filter"],
    initial_q: Annotated[
        list[str] | None,
        typer.Option(
            "--initial-q",
            metavar="JOINT=VALUE",
            help="Posture that the fit of the start begins with (rad or m; a ball's coordinate is hip.rx); "
            "else at rest. Repeatable.",
        ),
    ] = None,
    gate: Annotated[bool, typer.Option("--gate/--no-gate", help="Reject improbable readings.")] = _DEFAULT[
        "gate"
    ],
    gate_patience_s: Annotated[
        float, typer.Option(metavar="S", help="Believe a reading again that is rejected for longer.")
    ] = _DEFAULT["gate_patience_s"],
    consider: Annotated[
        Consider,
        typer.Option(help="Widen bands by what mounts and lengths may be off: as learnt, always, or never."),
    ] = _CONSIDER,
    start_window_s: Annotated[
        float, typer.Option(metavar="S", help="Samples fitted together to find the start.")
    ] = _DEFAULT["start_window_s"],
    merge_s: Annotated[float, typer.Option(metavar="S", help="Closer stamps form one sample.")] = _DEFAULT[
        "merge_s"
    ],
    belief_interval_s: Annotated[
        float, typer.Option(metavar="S", help="How often the full covariance is kept.")
    ] = _DEFAULT["belief_interval_s"],
    output_rate_hz: Annotated[
        float | None, typer.Option(metavar="HZ", help="Thin the output to this rate; else every sample.")
    ] = _DEFAULT["output_rate_hz"],
    alpha: Annotated[float, typer.Option(metavar="X", help="Spread of the sigma points, 0 to 1.")] = _DEFAULT[
        "alpha"
    ],
    beta: Annotated[
        float, typer.Option(metavar="X", help="Second-order weight, at least alpha^2.")
    ] = _DEFAULT["beta"],
    kappa: Annotated[float, typer.Option(metavar="X", help="Scaling, usually 0.")] = _DEFAULT["kappa"],
    threads: Annotated[
        int | None,
        typer.Option("--threads", metavar="N", min=1, help="Recordings tracked at a time; else all cores."),
    ] = None,
    suspects: Annotated[
        bool,
        typer.Option(
            "--suspects/--no-suspects", help="Look for faults of sensors first, in the liveliest second."
        ),
    ] = True,
    csv: Annotated[bool, typer.Option("--csv", help="Also write the tables as CSV.")] = False,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Track a recording: write joint angles with uncertainty, run.toml and report.html into a folder."""
    from oarlock import load_model, load_recording
    from oarlock.recording.calibration import load_calibration

    if filter_name not in _FILTERS:
        raise UsageError(f"--filter {filter_name}: choose one of {', '.join(_FILTERS)}")
    body = load_model(model, parameters=assignments(settings, "--set"))
    start = assignments(initial_q, "--initial-q")
    config = Config(
        estimate=names(estimate),
        closures=closures,
        process_noise=process_noise.value,
        magnetometer=magnetometer.value,
        filter=_DEFAULT["filter"] if filter_name in OTHER_FILTERS else filter_name,
        initial_q=posture(body.describe(), start, "--initial-q") if start else None,
        gate=gate,
        gate_patience_s=gate_patience_s,
        consider=consider.value,
        start_window_s=start_window_s,
        merge_s=merge_s,
        belief_interval_s=belief_interval_s,
        output_rate_hz=output_rate_hz,
        alpha=alpha,
        beta=beta,
        kappa=kappa,
    )

    def load(folder: Path) -> Recording:
        measured = load_recording(folder)
        return measured if only is None else measured.only(names(only))

    if filter_name in OTHER_FILTERS and (smooth or len(recordings) > 1):
        asked = "--smooth" if smooth else "several recordings at once"
        raise UsageError(f"--filter {filter_name} has no {asked}; {', '.join(tree_filters())} have")
    if len(recordings) > 1:
        from oarlock.cli.track_several import folders_for, track_several

        wearing = load_calibration(calibration) if calibration is not None else None
        folders = folders_for(recordings, out, force)
        track_several(
            body,
            load,
            folders,
            wearing,
            config,
            smooth=smooth,
            threads=threads,
            look=suspects,
            csv=csv,
            json_output=json_output,
        )
        return
    recording = recordings[0]
    measured = load(recording)
    wearing = load_calibration(calibration) if calibration is not None else None
    if (out / RECORDING_FILE).exists():
        raise UsageError(f"{out} is a recording; results go into a folder of their own")
    fresh_folder(out, RUN_FILE, force)
    found = look_for_suspects(body, measured, wearing, config) if suspects else ()
    with explained(found, out, f"Track of {body.name}"):
        result = run_filter(body, measured, wearing, config, smooth, filter_name)
    result = result.with_notes(*(suspect.note for suspect in found))
    write_folder(result, out, csv)
    if json_output:
        print_json(document(result, out, found))
        return
    write_suspects(found)
    say(f"Tracked {recording}", style="bold")
    write_summary(result)
    tables = ["track", *_beside(result)]
    say(f"\nWrote {out}: {', '.join(tables)} (.parquet), model.toml, run.toml, report.html")
    steps(f"open {out / 'report.html'}", f"oarlock evaluate {out} TRUTH        if you have a reference")


def run_filter(
    model: Model,
    recording: Recording,
    calibration: Calibration | None,
    config: Config | None,
    smooth: bool,
    filter_name: str = "",
) -> Track:
    """Tracks with a progress bar, and smooths if asked. `filter_name` may name one that `Config` does not know."""
    import oarlock

    with progress("tracking") as told:
        if filter_name == LIMB_FILTER:
            return oarlock.track_limbs(model, recording, calibration, config, progress=told)
        if filter_name in ORIENTATION_FILTERS:
            return oarlock.track_orientations(model, recording, filter_name, calibration, progress=told)
        result = oarlock.track(model, recording, calibration=calibration, config=config, progress=told)
    if smooth:
        with progress("smoothing") as told:
            result = oarlock.smooth(result, progress=told)
    return result


def write_folder(
    result: Track,
    out: Path,
    csv: bool = False,
    evaluation: Evaluation | None = None,
    truth: Track | None = None,
) -> Path:
    """Writes the track's tables, run.toml and a report; `csv` adds each table as CSV. The report's path."""
    from oarlock.cli.report import write_any_report

    result.save(out)
    report = write_any_report(result, out / "report.html", evaluation, truth)[0]
    if csv:
        from pyarrow import csv as arrow_csv
        from pyarrow import parquet

        for name in ("track", *(n for n in _beside(result) if n == "sensors")):
            arrow_csv.write_csv(parquet.read_table(out / f"{name}.parquet"), out / f"{name}.csv")
    return report


def _beside(result: Track) -> list[str]:
    """Tables beside the track's own: filters on single units report neither sensors nor beliefs."""
    found = {"sensors": result.info, "beliefs": result.beliefs}
    return [name for name, table in found.items() if table is not None]


def document(result: Track, out: Path, found: Sequence[Suspect] = ()) -> dict[str, object]:
    """The summary for machines; `found` are the suspects of the recording."""
    from oarlock.evaluation.summary import summarize

    summary = summarize(result)
    return {
        "out": out,
        "report": out / "report.html",
        "suspects": [suspect.to_dict() for suspect in found],
        **{key: value for key, value in vars(summary).items() if key != "sensors"},
        "sensors": {sensor.name: sensor.to_dict() for sensor in summary.sensors},
        "provenance": dict(result.provenance),
    }
