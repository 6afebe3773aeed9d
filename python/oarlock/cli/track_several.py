"""`oarlock track` with several recordings: tracks in parallel and writes one folder for each."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import typer
from rich.text import Text

from oarlock.cli.terminal import (
    EXIT_DATA,
    Told,
    UsageError,
    check_folder,
    number,
    page,
    print_json,
    progress,
    say,
    steps,
    table,
)
from oarlock.cli.track_folder import RECORDING_FILE, TRACK, document, write_folder
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.write_file import check_writable

if TYPE_CHECKING:
    from oarlock import Calibration, Config, Model, Recording, Track
    from oarlock.evaluation import Suspect
    from oarlock.tracking.many import Failure, Job


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
