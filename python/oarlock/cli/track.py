"""`oarlock track`: from a recording to joint angles with their uncertainty."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock import Config
from oarlock.cli.model import posture
from oarlock.cli.options import Force, Json, ModelName, OutFolder, Settings, assignments, example, names
from oarlock.cli.tables import write_summary
from oarlock.cli.terminal import UsageError, fresh_folder, print_json, progress, say, steps, verb

if TYPE_CHECKING:
    from oarlock import Calibration, Evaluation, Model, Recording, Track

RUN_FILE = "run.toml"
RECORDING_FILE = "recording.toml"


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


class Filter(StrEnum):
    """Which filter tracks."""

    ukf = "ukf"
    ekf = "ekf"
    iekf = "iekf"
    factorised = "factorised"


_FILTER = Filter(_DEFAULT["filter"])
_PROCESS_NOISE = ProcessNoise(_DEFAULT["process_noise"])
_MAGNETOMETER = Magnetometer(_DEFAULT["magnetometer"])


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
        Filter,
        typer.Option(
            "--filter",
            help="Sigma points; linearised once (faster), or until it settles; or limb by limb (docs/filters.md).",
        ),
    ] = _FILTER,
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
    csv: Annotated[bool, typer.Option("--csv", help="Also write the tables as CSV.")] = False,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Track a recording: write joint angles with uncertainty, run.toml and report.html into a folder."""
    from oarlock import load_model, load_recording
    from oarlock.calibration import load_calibration

    body = load_model(model, parameters=assignments(settings, "--set"))
    start = assignments(initial_q, "--initial-q")
    config = Config(
        estimate=names(estimate),
        closures=closures,
        process_noise=process_noise.value,
        magnetometer=magnetometer.value,
        filter=filter_name.value,
        initial_q=posture(body.describe(), start, "--initial-q") if start else None,
        gate=gate,
        gate_patience_s=gate_patience_s,
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
    result = run_filter(body, measured, wearing, config, smooth)
    write_folder(result, out, csv)
    if json_output:
        print_json(document(result, out))
        return
    say(f"Tracked {recording}", style="bold")
    write_summary(result)
    say(f"\nWrote {out}: track, sensors and beliefs (.parquet), model.toml, run.toml, report.html")
    steps(f"open {out / 'report.html'}", f"oarlock evaluate {out} TRUTH        if you have a reference")


def run_filter(
    model: Model, recording: Recording, calibration: Calibration | None, config: Config | None, smooth: bool
) -> Track:
    """Tracks with a progress bar, and smooths if asked."""
    import oarlock

    with progress("tracking") as told:
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
    from oarlock.report import write_report

    result.save(out)
    report = write_report(result, out / "report.html", evaluation=evaluation, truth=truth)
    if csv:
        from pyarrow import csv as arrow_csv
        from pyarrow import parquet

        for name in ("track", "sensors"):
            arrow_csv.write_csv(parquet.read_table(out / f"{name}.parquet"), out / f"{name}.csv")
    return report


def document(result: Track, out: Path) -> dict[str, object]:
    """The summary for machines."""
    from oarlock.track_summary import summarize

    summary = summarize(result)
    return {
        "out": out,
        "report": out / "report.html",
        **{key: value for key, value in vars(summary).items() if key != "sensors"},
        "sensors": {sensor.name: sensor.to_dict() for sensor in summary.sensors},
        "provenance": dict(result.provenance),
    }
