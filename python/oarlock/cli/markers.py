"""`oarlock markers`: shows optical markers, attaches them to a model and simulates sensors from them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from oarlock.cli.show import show_document
from oarlock.cli.terminal import heading, output_folder, progress, say, table
from oarlock.cli.verbs import NewFile, NewFolder, command, text_assignments

if TYPE_CHECKING:
    from oarlock.cli.body import Body as SizedBody
    from oarlock.evaluation.markers.body_fit import BodyFit
    from oarlock.markers import Markers

group = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Optical markers: C3D, TRC, CSV.")
_MOST_GAPS = 12


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    app.add_typer(group, name="markers")


@dataclass(frozen=True)
class MarkerSource:
    """A file of markers, and how it is read."""

    file: Path
    length_unit: str | None
    axes: str | None

    def load(self) -> Markers:
        """The markers."""
        from oarlock.markers import load_markers

        return load_markers(self.file, self.length_unit, axes=self.axes)


def marker_source(
    file: Path, *, length_unit: Literal["m", "cm", "mm"] | None = None, axes: str | None = None
) -> MarkerSource:
    """A file of markers.

    Args:
        file: markers: .c3d, .trc, .csv or .tsv.
        length_unit: unit of length, if the file does not state it.
        axes: rotate the axes: y-up-from-z-up or z-up-from-y-up.
    """
    return MarkerSource(file, length_unit, axes)


def _show_markers(result: dict[str, Any]) -> None:
    gaps = result.pop("gaps")
    show_document({name: value for name, value in result.items() if name != "names"})
    _show_gaps(gaps)


@command(group, "oarlock markers show walk.c3d", "oarlock markers show walk.trc --json", show=_show_markers)
def show(file: MarkerSource, *, gap_s: float = 0.2) -> dict[str, Any]:
    """Show a marker file: names, rate, range and gaps of each marker.

    Args:
        file: of markers.
        gap_s: longest gap to fill, s.
    """
    from oarlock.markers import fill_gaps

    markers = file.load()
    gaps = fill_gaps(markers, gap_s).gaps
    seen = 100.0 * markers.seen.mean(axis=0)
    return {
        "file": file.file,
        "frames": len(markers),
        "rate_hz": round(markers.rate_hz, 3),
        "start_s": float(markers.time_s[0]),
        "end_s": float(markers.time_s[-1]),
        "missing_percent": round(100.0 - float(seen.mean()), 2),
        "names": list(markers.names),
        "markers": {
            name: {
                "seen_percent": float(share),
                "gaps": sum(gap.marker == name for gap in gaps),
                **dict(zip(("x_m", "y_m", "z_m"), map(float, middle), strict=True)),
            }
            for name, share, middle in zip(markers.names, seen, markers.middle_m, strict=True)
        },
        "gaps": [gap.row for gap in gaps],
    }


@command(
    group,
    "oarlock markers attach static.c3d --model arm7 --frames LELB=elbow,LWRA=wrist,LWRB=wrist --out person.toml",
    metavars={"frames": "MARKER=FRAME,...", "posture": "JOINT=RAD"},
    defaults={"model": "sculler"},
)
def attach(
    file: MarkerSource,
    *,
    out: NewFile,
    frames: str,
    model: SizedBody,
    posture: dict[str, float] | None = None,
) -> dict[str, Any]:
    """Attach markers to a model from a static trial in a known posture, in the model's root axes.

    Args:
        file: of markers.
        out: file to write, .toml.
        frames: the frame of each marker.
        model: the body.
        posture: value of a joint in the trial; default 0. Repeatable.
    """
    from oarlock.markers import attach_markers, save_attachments

    attachments = attach_markers(model.model, file.load(), frames_by_marker(frames), posture or {})
    save_attachments(attachments, out)
    return {
        "attachments": [
            {"marker": a.marker, "frame": a.frame, **dict(zip(("x_m", "y_m", "z_m"), a.point_m, strict=True))}
            for a in attachments
        ],
        "written": out,
    }


def _show_study(result: dict[str, Any]) -> None:
    result = dict(result)
    gaps, notes = result.pop("gaps"), result.pop("notes")
    then = result.pop("next")
    show_document(result)
    _show_gaps(gaps)
    show_document({"notes": notes, "next": then})


@command(
    group,
    "oarlock markers simulate trial.c3d --model arm7 --attachments person.toml --out study",
    "oarlock markers simulate trial.trc --model arm7 --attachments person.toml --estimate l_ua,l_fa --out study",
    "oarlock markers simulate trial.c3d --model my.toml --attachments person.toml --axes y-up-from-z-up "
    "--estimate root --gyro-bias-rad-s 0.01 --accel-bias-m-s2 0.01 --out study",
    show=_show_study,
    defaults={"model": "sculler"},
)
def simulate(
    file: MarkerSource,
    *,
    out: NewFolder,
    attachments: Path,
    model: SizedBody,
    estimate: tuple[str, ...] = (),
    gap_s: float = 0.2,
    cutoff_hz: float = 10.0,
    rate_hz: float = 125.0,
    gyro_bias_rad_s: float = 0.0,
    accel_bias_m_s2: float = 0.0,
    seed: int = 0,
    force: bool = False,
) -> dict[str, Any]:
    """Simulate sensors from a marker session: write a recording with its ground truth.

    Short gaps are filled, positions are filtered, joint angles are fitted to the model, and the model's sensors are
    simulated for this movement.

    Args:
        file: of markers.
        out: folder to write.
        attachments: positions of the markers on the model, .toml.
        model: the body.
        estimate: fit first: lengths by name, `offsets` of all markers, `root`: position of the model.
        gap_s: longest gap to fill, s.
        cutoff_hz: cut-off of the markers' low-pass filter; 0: no filter.
        rate_hz: rate of the simulated sensors.
        gyro_bias_rad_s: constant, on every axis.
        accel_bias_m_s2: constant, on every axis.
        seed: seed of the noise.
        force: replace what is there.
    """
    import oarlock
    from oarlock.report.markers import write_marker_report

    markers = file.load()
    placed = oarlock.markers.load_attachments(attachments)
    body: BodyFit | None = None
    loaded = model.model
    if estimate:
        with progress("fitting the body"):
            body = oarlock.markers.fit_body(
                loaded,
                markers,
                placed,
                parameters=[name for name in estimate if name not in ("offsets", "root")],
                offsets=("all",) if "offsets" in estimate else (),
                place_root="root" in estimate,
            )
        placed = body.attachments
        loaded = oarlock.load_model(model.name, parameters={**model.parameters, **body.parameters})
    with progress("fitting postures") as share:
        study = oarlock.markers.simulate_from_markers(
            loaded,
            markers,
            placed,
            longest_s=gap_s,
            cutoff_hz=cutoff_hz or None,
            root_from_markers=None if body is None else body.root_from_markers,
            seed=seed,
            rate_hz=rate_hz,
            gyro_bias_rad_s=gyro_bias_rad_s,
            accel_bias_m_s2=accel_bias_m_s2,
            progress=share,
        )
    with output_folder(out, "recording", force) as stage:
        study.save(stage)
        oarlock.markers.save_attachments(placed, stage / "attachments.toml")
        if body is not None:
            body.calibration().save(stage / "calibration.toml")
        write_marker_report(study, stage, title=f"Markers of {file.file.name}")
    calibration = "" if body is None or not body.parameters else f" --calibration {out / 'calibration.toml'}"
    return {
        "recording": out,
        "start_s": study.recording.start_s,
        "end_s": study.recording.end_s,
        "streams": study.recording.names,
        "truth": out / "truth",
        "markers": out / "markers.trc",
        "report": out / "report.html",
        "body": None if body is None else _body_row(body),
        "joints": study.fit.rows(),
        "marker_errors": {name: {"rmse_mm": 1e3 * value} for name, value in study.fit.rmse_m.items()},
        "gaps": [gap.row for gap in study.gaps],
        "notes": [*(body.notes if body is not None else ()), *study.fit.notes],
        "next": [
            f"oarlock track {out} {model.words}{calibration} --out {out}-track",
            f"oarlock evaluate {out}-track {out}/truth",
            f"oarlock evaluate {out}-track {out / 'markers.trc'} --attachments {out / 'attachments.toml'}",
        ],
    }


def _body_row(body: BodyFit) -> dict[str, Any]:
    return {
        "frames": body.frames,
        "rms_m": body.rms_m,
        "root_from_markers": body.root_from_markers.tolist(),
        "lengths": {
            name: {"length_m": length, "std_m": body.parameter_std[name]}
            for name, length in body.parameters.items()
        },
    }


def frames_by_marker(text: str) -> dict[str, str]:
    """What `--frames` says: `"LELB=l_elbow,LWRI=l_wrist"` as a dictionary."""
    parts = [part.strip() for part in text.split(",") if part.strip()]
    return text_assignments(parts, "--frames", "LELB=l_elbow", "MARKER=FRAME")


def _show_gaps(gaps: list[dict[str, Any]]) -> None:
    """The gaps that were not filled first."""
    left = [gap for gap in gaps if not gap["filled"]]
    heading("Gaps", f"{len(gaps) - len(left)} filled, {len(left)} left")
    shown = (left + [gap for gap in gaps if gap["filled"]])[:_MOST_GAPS]
    times = ("start_s", "end_s", "duration_s")
    table(
        ["marker", ">from s", ">to s", ">length s", ""],
        [(g["marker"], *(f"{g[key]:.3f}" for key in times), g["reason"] or "filled") for g in shown],
    )
    if len(gaps) > len(shown):
        say(f"  and {len(gaps) - len(shown)} more")
