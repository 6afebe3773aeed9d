"""`oarlock run`: from the files of a recording to angles and a report: import, calibrate, track, report."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from oarlock.cli.body import Mass, Pose, Stature, Units
from oarlock.cli.calibrate_sagittal import balls_of
from oarlock.cli.options import Force, example
from oarlock.cli.session_options import asks_questions
from oarlock.cli.terminal import UsageError, say, steps, verb, without_next_steps


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "run",
        epilog=example(
            "oarlock run measurements.zip --body lower_body --stature 1.78 --mass 74 --out walk",
            "oarlock run arm.csv --body arm --units thorax,upper_arm_r,forearm_r --out reach",
            "oarlock run trial --body full_body --session session --stature 1.71 --out trial-out",
            "oarlock run trial.csv --body arm --units-file units.toml --stature 1.71 --out trial-out",
            "oarlock run trial --body my.toml --calibration cal.toml --out trial-out",
        ),
    )(run)


@verb
def run(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH", help="File, folder or zip file of a recording, of any format of import."
        ),
    ],
    body: Annotated[
        str,
        typer.Option(
            "--body", "-m", metavar="NAME|FILE", help="Model: full_body, lower_body, arm, ..., or a file."
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="FOLDER", help="Folder to write: recording, calibration, track."),
    ],
    units: Units = None,
    stature_m: Stature = None,
    mass_kg: Mass = None,
    pick: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which recording, if the place has several.")
    ] = None,
    session: Annotated[
        Path | None,
        typer.Option("--session", metavar="PATH", help="A recording of the guided calibration session."),
    ] = None,
    pose: Pose = "N",
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", metavar="FILE", help="A calibration; nothing is calibrated then."),
    ] = None,
    units_file: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="units.toml of oarlock assign, if names of units say nothing."),
    ] = None,
    athlete: Annotated[
        str | None, typer.Option(metavar="NAME", help="Who was recorded; a pseudonym is enough.")
    ] = None,
    low_pass_hz: Annotated[
        float,
        typer.Option("--low-pass", metavar="HZ", help="Cut-off of the readings of inertial units; 0: none."),
    ] = 0.0,
    force: Force = False,
) -> None:
    """Import, calibrate with what is there, track, smooth and report: one command from files to angles.

    Mounts come from --calibration, or from the guided session, or from the recording itself: it begins with two
    seconds of standing still in the rest posture, and most movement is forward and backward. An elbow whose axes this
    does not determine is tracked as a ball. Each step's own command is printed; run it again to change something.
    """
    if session is not None and calibration is not None:
        raise UsageError("--session and --calibration contradict each other")
    if session is None and pose != "N":
        raise UsageError(f"--pose {pose} is the still pose of a guided session: give it with --session")
    steps_done = _Steps(out, force)
    naming = (body, units_file)
    recording = steps_done.imported(path, "recording", naming, pick, athlete)
    cut = units if units is not None else _units_there(recording, body)
    chosen = _options(("--stature", stature_m), ("--mass", mass_kg), ("--units", cut))
    known, balls = calibration, list[str]()
    if session is not None:
        measured = steps_done.imported(session, "session", naming, None, None)
        words = ("calibrate", "session", measured, "--model", body, "--pose", pose, *chosen)
        known = steps_done.run(*words, out="calibration.toml", may_fail=True)
    elif calibration is None:
        words = ("calibrate", "sagittal", recording, "--model", body, *chosen)
        known = steps_done.run(*words, out="calibration.toml")
        balls = _balls(known)
    smooth = ("--smooth", *(("--low-pass", low_pass_hz) if low_pass_hz > 0.0 else ()))
    steps_done.run(
        "track", recording, "--model", body, *chosen, *balls, "--calibration", known, *smooth, out="track"
    )
    say(f"\nWrote {out}", style="bold")
    track = out / "track"
    steps(f"open {track / 'report.html'}", f"oarlock view {track}", f"oarlock export {track} --to FOLDER")


@dataclass(frozen=True)
class _Steps:
    """Runs verbs that write into a folder, and prints each as it can be typed."""

    out: Path
    force: bool

    def run(self, *words: object, out: str, may_fail: bool = False, option: str = "--out") -> Path:
        """Run one verb; returns what it wrote. With `may_fail` a status other than 0 ends nothing if it wrote."""
        target = self.out / out
        command = [str(word) for word in (*words, option, target, *(["--force"] if self.force else []))]
        typer.echo(f"\n$ oarlock {shlex.join(command)}")  # on one line, so that it can be copied
        status = _status(command)
        if status and not (may_fail and target.exists()):
            raise typer.Exit(status)
        return target

    def imported(
        self,
        path: Path,
        name: str,
        naming: tuple[str, Path | None],
        pick: str | None,
        athlete: str | None,
    ) -> Path:
        """A recording of Oarlock as it is; anything else is imported, with units named as the body's sensors."""
        body, units_file = naming
        if (path / "recording.toml").is_file():
            return path if units_file is None else self.named(path, name, body, units_file)
        asked = _options(("--pick", pick), ("--athlete", athlete), ("--units-file", units_file))
        quiet = () if asks_questions(False, False) else ("--no-questions",)
        return self.run("import", path, "--model", body, *asked, *quiet, out=name)

    def named(self, path: Path, name: str, body: str, units_file: Path) -> Path:
        """A recording of Oarlock with its units named as the body's sensors."""
        words = ("assign", path, "--body", body, "--units-file", units_file)
        self.run(*words, out=name, option="--write")
        return self.out / name


def _status(command: Sequence[str]) -> int:
    from typer.main import get_command

    from oarlock.cli import app

    try:
        with without_next_steps():
            code = get_command(app).main(args=list(command), prog_name="oarlock", standalone_mode=False)
    except SystemExit as exit_:
        code = exit_.code
    except typer.Exit as exit_:
        code = exit_.exit_code
    return code if isinstance(code, int) else 0


def _options(*pairs: tuple[str, object]) -> list[str]:
    return [str(word) for name, value in pairs if value is not None for word in (name, value)]


def _balls(calibration: Path) -> list[str]:
    """`--ball` for the hinges whose axes the recording did not determine."""
    from oarlock import load_calibration

    return [word for ball in balls_of(load_calibration(calibration)) for word in ("--ball", ball)]


def _units_there(folder: Path, body: str) -> str | None:
    """The model's units that were recorded, if some are missing: the body is cut to them."""
    from oarlock import load_model
    from oarlock.recording.folder import stream_names

    there, sensors = stream_names(folder), [s.name for s in load_model(body).describe().inertial_units]
    found = [name for name in sensors if name in there]
    return ",".join(found) if found and len(found) < len(sensors) else None
