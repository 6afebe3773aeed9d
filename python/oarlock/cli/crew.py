"""`oarlock rowing crew`: the timing of several seats of one boat."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.strokes import track_or_recording
from oarlock.cli.terminal import UsageError, free_file, heading, say, table
from oarlock.cli.verbs import command

if TYPE_CHECKING:
    from oarlock import Recording
    from oarlock.rowing import CrewTiming


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock rowing crew bow two three stroke",
        "oarlock rowing crew a b --seats bow,stroke --clock-ms 0",
        "oarlock rowing crew out1 out2 --recording rec1 --recording rec2 --out crew.html",
        show=_show,
        metavars={"folders": "SEAT", "against": "SEAT", "recording": "FOLDER"},
    )(crew)


def crew(
    folders: list[Path],
    *,
    seats: tuple[str, ...] | None = None,
    against: str | None = None,
    clock_ms: float | None = None,
    movement: str | None = None,
    recording: list[Path] | None = None,
    out: Path = Path("crew.html"),
    force: bool = False,
) -> WrittenCrew:
    """Compare catch and finish of several seats of one boat, in ms with bands, and write a page.

    The name of a seat is taken from `seat` in its session.toml, or from --seats: bow, 2, 3 ... stroke. Loggers whose
    clocks are not known to agree show how evenly each seat follows, but not who is early: see docs/crew.md.

    Args:
        folders: a folder of each seat: a track or a recording.
        seats: bow,2,3,stroke in the order of the folders.
        against: compare with this seat, or mean; default: stroke.
        clock_ms: how well the loggers' clocks agree (SD, ms); 0: one logger.
        movement: movement to compare: oars, handle, seat, trunk.
        recording: recording behind each track, for the clocks. Repeatable.
        out: page to write; a CSV file is beside it.
        force: replace what is there.
    """
    from oarlock.rowing import crew_seats, crew_timing, write_crew_report

    page = out / "crew.html" if out.is_dir() else out
    for file in (page, page.with_suffix(".csv")):
        free_file(file, force)
    clocks = _recordings(recording, len(folders))
    pieces = [track_or_recording(folder) for folder in folders]
    timing = crew_timing(
        crew_seats(pieces, seats, clocks, movement), against, None if clock_ms is None else clock_ms / 1e3
    )
    return WrittenCrew(timing, write_crew_report(timing, page, progress=True))


@dataclass(frozen=True)
class WrittenCrew:
    """The timing of a crew, and the files of its page."""

    timing: CrewTiming
    files: tuple[Path, ...]

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        timing = self.timing
        from oarlock.rowing import crew_findings

        return {
            "seats": [{"name": seat.name, "session": dict(seat.session)} for seat in timing.seats],
            "against": timing.against,
            "strokes": int(timing.complete.sum()),
            "clocks": {
                "kind": timing.clocks.kind,
                "sentence": timing.clocks.sentence,
                "why": timing.clocks.why,
            },
            "delays": [
                {
                    "seat": one.seat,
                    "event": one.event,
                    "mean_s": one.mean_s,
                    "low_s": one.low_s,
                    "high_s": one.high_s,
                    "sd_s": one.strokes.own_sd,
                    "strokes": one.strokes.strokes,
                }
                for one in timing.delays
            ],
            "findings": [asdict(one) for one in crew_findings(timing)],
            "files": self.files,
        }


def _recordings(folders: list[Path] | None, count: int) -> list[Recording | None] | None:
    from oarlock import load_recording

    if not folders:
        return None
    if len(folders) != count:
        raise UsageError(
            f"--recording: {len(folders)} are given for {count} seats; give one a seat, in their order"
        )
    return [load_recording(folder) for folder in folders]


def _show(crew: WrittenCrew) -> None:
    from oarlock.report import capital
    from oarlock.rowing import crew_findings
    from oarlock.rowing.report.crew_page import finding, label

    timing = crew.timing
    against = timing.against if timing.against == "crew mean" else label(timing.against)
    say(f"{len(timing.seats)} seats, {int(timing.complete.sum())} strokes together", style="bold")
    rows = []
    for seat in timing.seats:
        delays = [timing.delay(seat.name, event) for event in ("catch", "finish", "drive")]
        cells = ["reference" if one is None else _cell(one.mean_s, one.half_width_s) for one in delays]
        rows.append((capital(label(seat.name)), seat.session.get("athlete", ""), *cells))
    heads = [">catch\nms", ">finish\nms", ">drive longer\nms"]
    table(["seat", "athlete", *heads], rows)
    say(f"Later than {against}; minus: earlier; +-: 95 % band.")
    say(timing.clocks.sentence)
    if findings := crew_findings(timing):
        heading("What stands out")
        for one in findings:
            say(f"- {finding(one, timing.against)}", indent=2)
    say(f"Wrote {crew.files[0]} and {crew.files[1]}")


def _cell(mean_s: float, half_s: float) -> str:
    return f"{1e3 * mean_s:+.1f} +- {1e3 * half_s:.1f}" if mean_s == mean_s else "not known"
