"""`oarlock run`: `oarlock.run` as a verb, which asks a person at the terminal for what is not clear."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.terminal import UsageError, check_folder, details, free_file, say, steps
from oarlock.cli.verbs import FunctionText, Option, add_verb

if TYPE_CHECKING:
    from oarlock import Track

TEXT = FunctionText.at("oarlock.pipeline:run")
OPTIONS = (
    replace(TEXT.only("recording")[0], is_argument=True),
    *TEXT.only(without=("recording", "progress", "settings")),
    Option("athlete", "str", None, "Who was recorded; a pseudonym is enough."),
    Option("output_rate_hz", "float", None, "Rate of the rows, 0: one for every sample."),
)


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    add_verb(
        app,
        "run",
        replace(TEXT, options=OPTIONS, doc=f"{TEXT.about}\n\nThe same in Python: oarlock.run."),
        run,
        _show,
        "oarlock run measurements.zip --model lower_body --stature-m 1.78 --mass-kg 74 --out walk",
        "oarlock run arm.csv --model arm --sensors thorax,upper_arm_r,forearm_r --out reach",
        "oarlock run trial --model full_body --session session --stature-m 1.71 --out trial-out",
        "oarlock run trial.csv --model arm --units thorax=00B421E6,forearm_r=00B421ED --out trial-out",
        "oarlock run trial --model my.toml --calibration cal.toml --out trial-out",
    )


def run(
    recording: Path,
    out: Path,
    model: str,
    force: bool,
    json_output: bool,
    athlete: str | None = None,
    output_rate_hz: float | None = None,
    units: Any = None,
    pick: str | None = None,
    together: bool = False,
    session: Path | None = None,
    **arguments: Any,
) -> RunResult:
    """Reads the recordings and calls `oarlock.run`."""
    import oarlock
    from oarlock.cli.import_ import asked_recording
    from oarlock.tracking.settings import Settings

    if session is not None and "calibration" in arguments:
        raise UsageError("--session and --calibration contradict each other")
    if session is None and arguments["pose"] != "N":
        raise UsageError(
            f"--pose {arguments['pose']} is the still pose of a guided session: give it with --session"
        )
    for place in (out / "recording", out / "track"):
        check_folder(place, force)
    if "calibration" not in arguments:
        free_file(out / "calibration.toml", force)
    read = asked_recording(recording, pick, together, model, units, athlete, json_output)
    if session is not None:
        arguments["session"] = asked_recording(session, None, False, model, units, None, json_output)
    settings: Settings = {} if output_rate_hz is None else {"output_rate_hz": output_rate_hz}
    track = oarlock.run(read, out, model=model, progress=True, force=force, **arguments, **settings)
    report = out / "track/report.html"
    return RunResult(track, out, report if report.exists() else None)


@dataclass(frozen=True)
class RunResult:
    """A track, its folder, and its page if there is one."""

    track: Track
    out: Path
    report: Path | None

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        from oarlock.cli.result import result_of

        return {
            "out": self.out,
            "report": self.report,
            **result_of(self.track),
            "notes": self.track.notes,
        }


def _show(result: RunResult) -> None:
    from oarlock.cli.result import write_result
    from oarlock.cli.tables import write_summary

    with details():
        write_summary(result.track)
        say()
    write_result(result.track, result.report, suspects=True)
    with details():
        steps(f"oarlock view {result.out}/track", f"oarlock export {result.out}/track --out FOLDER")
