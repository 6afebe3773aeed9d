"""`oarlock markers`: shows optical markers, attaches them to a model and simulates sensors from them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Force, Json, ModelName, OutFolder, Settings, assignments, example
from oarlock.cli.options import names as listed
from oarlock.cli.terminal import (
    UsageError,
    check_folder,
    free_file,
    heading,
    number,
    output_folder,
    pairs,
    print_json,
    progress,
    say,
    steps,
    table,
    verb,
)

if TYPE_CHECKING:
    from oarlock import Model
    from oarlock.evaluation.markers.body_fit import BodyFit
    from oarlock.evaluation.markers.gaps import Gap
    from oarlock.evaluation.markers.simulated import MarkerStudy
    from oarlock.markers import Markers

group = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Optical markers: C3D, TRC, CSV.")

MarkerFile = Annotated[Path, typer.Argument(metavar="FILE", help="Markers: .c3d, .trc, .csv or .tsv.")]
Unit = Annotated[
    str | None,
    typer.Option("--length-unit", metavar="m|cm|mm", help="Unit of length, if the file does not state it."),
]
Axes = Annotated[
    str | None,
    typer.Option("--axes", metavar="NAME", help="Rotate the axes: y-up-from-z-up or z-up-from-y-up."),
]
LongestGap = Annotated[float, typer.Option("--gap-s", metavar="S", help="Longest gap to fill, s.")]
_MOST_GAPS = 12


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    app.add_typer(group, name="markers")


@group.command(
    "show", epilog=example("oarlock markers show walk.c3d", "oarlock markers show walk.trc --json")
)
@verb
def show(
    file: MarkerFile,
    unit: Unit = None,
    axes: Axes = None,
    longest_s: LongestGap = 0.2,
    json_output: Json = False,
) -> None:
    """Show a marker file: names, rate, range and gaps of each marker."""
    from oarlock.markers import fill_gaps, load_markers

    markers = load_markers(file, unit, axes=axes)
    filled = fill_gaps(markers, longest_s)
    if json_output:
        print_json({**_described(markers), "gaps": [gap.row for gap in filled.gaps]})
        return
    say(f"{file}", style="bold")
    pairs([(key, value) for key, value in _described(markers).items() if key != "names"])
    table(
        ["marker", ">seen", ">gaps", ">x m", ">y m", ">z m"],
        [
            (
                name,
                f"{share:.1%}",
                sum(gap.marker == name for gap in filled.gaps),
                *(number(v, ".3f") for v in middle),
            )
            for name, share, middle in zip(
                markers.names, markers.seen.mean(axis=0), markers.middle_m, strict=True
            )
        ],
    )
    _write_gaps(filled.gaps)


@group.command(
    "attach",
    short_help="Attach markers to a model from a static trial.",
    epilog=example(
        "oarlock markers attach static.c3d --model arm7 --frames LELB=elbow,LWRA=wrist,LWRB=wrist --out person.toml"
    ),
)
@verb
def attach(
    file: MarkerFile,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="File to write, .toml.")],
    on: Annotated[
        str, typer.Option("--frames", metavar="MARKER=FRAME,...", help="The frame of each marker.")
    ],
    model: ModelName = "sculler",
    posture: Annotated[
        list[str] | None,
        typer.Option(
            "--posture", metavar="JOINT=RAD", help="Value of a joint in the trial; default 0. Repeatable."
        ),
    ] = None,
    settings: Settings = None,
    unit: Unit = None,
    axes: Axes = None,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Attach markers to a model from a static trial in a known posture, in the model's root axes."""
    import oarlock

    free_file(out, force)
    loaded = oarlock.load_model(model, parameters=assignments(settings, "--set"))
    found = oarlock.markers.attach_markers(
        loaded,
        oarlock.markers.load_markers(file, unit, axes=axes),
        mapping(on, "--on"),
        assignments(posture, "--posture"),
    )
    oarlock.markers.save_attachments(found, out)
    if json_output:
        print_json({"attachments": out, "markers": [a.marker for a in found]})
        return
    say(f"Wrote {out}", style="bold")
    table(
        ["marker", "frame", ">x m", ">y m", ">z m"],
        [(a.marker, a.frame, *(number(v, ".4f") for v in a.point_m)) for a in found],
    )


@group.command(
    "simulate",
    short_help="Simulate sensors from a marker session.",
    epilog=example(
        "oarlock markers simulate trial.c3d --model arm7 --attachments person.toml --out study",
        "oarlock markers simulate trial.trc --model arm7 --attachments person.toml --estimate l_ua,l_fa --out study",
        "oarlock markers simulate trial.c3d --model my.toml --attachments person.toml --axes y-up-from-z-up "
        "--estimate root --gyro-bias-rad-s 0.01 --accel-bias-m-s2 0.01 --out study",
    ),
)
@verb
def simulate(
    file: MarkerFile,
    out: OutFolder,
    attachments: Annotated[
        Path,
        typer.Option(
            "--attachments", "-a", metavar="FILE", help="Positions of the markers on the model, .toml."
        ),
    ],
    model: ModelName = "sculler",
    settings: Settings = None,
    unit: Unit = None,
    axes: Axes = None,
    estimate: Annotated[
        str,
        typer.Option(
            "--estimate",
            metavar="NAMES",
            help="Fit first: lengths by name, `offsets` of all markers, `root`: position of the model.",
        ),
    ] = "",
    longest_s: LongestGap = 0.2,
    cutoff_hz: Annotated[
        float,
        typer.Option(
            "--cutoff-hz", metavar="HZ", help="Cut-off of the markers' low-pass filter; 0: no filter."
        ),
    ] = 10.0,
    rate_hz: Annotated[
        float, typer.Option("--rate-hz", metavar="HZ", help="Rate of the simulated sensors.")
    ] = 125.0,
    gyro_bias_rad_s: Annotated[
        float, typer.Option("--gyro-bias-rad-s", metavar="RAD/S", help="Constant, on every axis.")
    ] = 0.0,
    accel_bias_m_s2: Annotated[
        float, typer.Option("--accel-bias-m-s2", metavar="M/S2", help="Constant, on every axis.")
    ] = 0.0,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Seed of the noise.")] = 0,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Simulate sensors from a marker session: write a recording with its ground truth.

    Short gaps are filled, positions are filtered, joint angles are fitted to the model, and the model's sensors are
    simulated for this movement.
    """
    import oarlock
    from oarlock.report.markers import write_marker_report

    values = assignments(settings, "--set")
    loaded = oarlock.load_model(model, parameters=values)
    markers = oarlock.markers.load_markers(file, unit, axes=axes)
    placed = oarlock.markers.load_attachments(attachments)
    check_folder(out, force)
    body = None
    if estimate:
        with progress("fitting the body"):
            body = _body(loaded, markers, placed, listed(estimate))
        placed = body.attachments
        loaded = oarlock.load_model(model, parameters=values | dict(body.parameters))
    with progress("fitting postures") as told:
        study = oarlock.markers.simulate_from_markers(
            loaded,
            markers,
            placed,
            longest_s=longest_s,
            cutoff_hz=cutoff_hz or None,
            root_from_markers=None if body is None else body.root_from_markers,
            seed=seed,
            rate_hz=rate_hz,
            gyro_bias_rad_s=gyro_bias_rad_s,
            accel_bias_m_s2=accel_bias_m_s2,
            progress=told,
        )
    with output_folder(out, "recording", force) as stage:
        study.save(stage)
        oarlock.markers.save_attachments(placed, stage / "attachments.toml")
        if body is not None:
            body.calibration().save(stage / "calibration.toml")
        write_marker_report(study, stage, title=f"Markers of {file.name}")
    if json_output:
        print_json(_document(study, body, out))
        return
    _write_study(study, body, file, out)
    lengths = "" if body is None or not body.parameters else f" --calibration {out / 'calibration.toml'}"
    steps(
        f"oarlock track {out} --model {model}{lengths} --out {out}-track",
        f"oarlock evaluate {out}-track {out}/truth",
        f"oarlock evaluate {out}-track {out / 'markers.trc'} --attachments {out / 'attachments.toml'}",
    )


def mapping(text: str, flag: str) -> dict[str, str]:
    """`"LELB=l_elbow,LWRI=l_wrist"` as a dictionary.

    Raises:
        UsageError: a part is not MARKER=FRAME, or a marker comes twice.
    """
    found: dict[str, str] = {}
    for part in (part.strip() for part in text.split(",") if part.strip()):
        marker, equals, frame = (piece.strip() for piece in part.rpartition("="))
        if not (marker and equals and frame):
            raise UsageError(f"{flag} {part}: expected MARKER=FRAME, for example {flag} LELB=l_elbow")
        if marker in found:
            raise UsageError(f"{flag}: {marker} is given twice")
        found[marker] = frame
    return found


def _body(model: Model, markers: Markers, attachments: object, wanted: tuple[str, ...]) -> BodyFit:
    from oarlock.markers import fit_body

    return fit_body(
        model,
        markers,
        attachments,  # type: ignore[arg-type]
        parameters=[name for name in wanted if name not in ("offsets", "root")],
        offsets=("all",) if "offsets" in wanted else (),
        place_root="root" in wanted,
    )


def _described(markers: Markers) -> dict[str, object]:
    return {
        "markers": len(markers.names),
        "frames": len(markers),
        "rate_hz": round(markers.rate_hz, 3),
        "start_s": float(markers.time_s[0]),
        "end_s": float(markers.time_s[-1]),
        "missing_share": round(1.0 - float(markers.seen.mean()), 4),
        "names": list(markers.names),
    }


def _write_gaps(gaps: tuple[Gap, ...]) -> None:
    refused = [gap for gap in gaps if not gap.filled]
    heading("Gaps", f"{len(gaps) - len(refused)} filled, {len(refused)} left")
    shown = (refused + [gap for gap in gaps if gap.filled])[:_MOST_GAPS]
    table(
        ["marker", ">from s", ">to s", ">length s", ""],
        [
            (g.marker, f"{g.start_s:.3f}", f"{g.end_s:.3f}", f"{g.duration_s:.3f}", g.reason or "filled")
            for g in shown
        ],
    )
    if len(gaps) > len(shown):
        say(f"  and {len(gaps) - len(shown)} more")


def _write_study(study: MarkerStudy, body: BodyFit | None, file: Path, out: Path) -> None:
    say(f"Wrote {out} from {file}", style="bold")
    pairs(
        [
            ("recording", f"{out}  ({study.recording.start_s:.2f} to {study.recording.end_s:.2f} s)"),
            ("streams", ", ".join(study.recording.names)),
            ("truth", out / "truth"),
            ("markers", f"{out / 'markers.trc'}  (filled, filtered, in root axes)"),
            ("report", out / "report.html"),
        ]
    )
    if body is not None and body.parameters:
        heading("Lengths", f"from {body.frames} frames")
        table(
            ["parameter", ">mm", ">std mm"],
            [
                (name, number(1e3 * value, ".1f"), number(1e3 * body.parameter_std[name], ".1f"))
                for name, value in body.parameters.items()
            ],
        )
    heading("Joints", "fitted to the markers; std from the fit")
    table(
        ["joint", ">lowest", ">highest", ">std", "unit", ">determined"],
        [
            (
                row["joint"],
                number(row["lowest"], ".1f"),
                number(row["highest"], ".1f"),
                number(row["std"], ".2f"),
                row["unit"],
                f"{row['determined']:.0%}",
            )
            for row in study.fit.rows()
        ],
    )
    heading("Markers", "root mean square distance from their points on the model")
    table(["marker", ">mm"], [(name, number(1e3 * v, ".1f")) for name, v in study.fit.rmse_m.items()])
    _write_gaps(study.gaps)
    for note in (*(body.notes if body is not None else ()), *study.fit.notes):
        say(f"- {note}", indent=2)


def _document(study: MarkerStudy, body: BodyFit | None, out: Path) -> dict[str, object]:
    return {
        "recording": out,
        "truth": out / "truth",
        "streams": study.recording.names,
        "joints": study.fit.rows(),
        "rmse_m": study.fit.rmse_m,
        "gaps": [gap.row for gap in study.gaps],
        "notes": study.fit.notes,
        "body": None
        if body is None
        else {
            "parameters": body.parameters,
            "parameter_std": body.parameter_std,
            "root_from_markers": body.root_from_markers.tolist(),
            "rms_m": body.rms_m,
            "notes": body.notes,
        },
    }
