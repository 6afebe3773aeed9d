"""`oarlock import`: converts other formats to a recording folder: by content, or one verb per entry of `FORMATS`.

What is not clear is asked at the terminal, for `oarlock run`, too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer
from typer.core import TyperGroup

from oarlock.cli.calibrate_units import named_units
from oarlock.cli.session_options import METAVARS, Session, asked_session, session_of
from oarlock.cli.show import show_document
from oarlock.cli.terminal import UsageError, asks_questions, check_folder, output_folder, say
from oarlock.cli.verbs import REQUIRED, FunctionText, Incomplete, ModelName, Option, add_verb
from oarlock.formats.importers import FORMATS, ImportFormat

if TYPE_CHECKING:
    from oarlock import Recording
    from oarlock.formats.choices import UnclearError
    from oarlock.formats.contents import Contents
    from oarlock.formats.listing import FileMatch
    from oarlock.recording.streams import Stream
    from oarlock.storage.paths import AnyPath

PATH_VERB: Final = "PATH"
"""Name of the verb in the help; no format has capitals."""
ANNOTATIONS: Final = {"save_mapping": "NewFile", "mounted": "str"}
"""In place of those of the readers."""
CLOCKS = {
    "relative": "seconds from an unnamed start",
    "samples": "counted samples",
    "utc": "UTC",
    "local": "local time without a zone",
    "clock": "time of day without a date",
}
"""Kinds of time stamps."""
QUANTITIES = {"gyro_rad_s": "gyro", "accel_m_s2": "accel", "mag_ut": "mag", "quat_wxyz": "orientation"}
LISTED_FILES = 5
TABLES = (".csv", ".tsv", ".txt")
_FACTOR = re.compile(r" \(1 unit = [^()]*\)")


class FormatOrPath(TyperGroup):
    """Reads `oarlock import PATH ...` where the first word is no format."""

    def parse_args(self, context: Any, words: list[str]) -> list[str]:
        """Put the verb that recognises files before words that begin with none."""
        if words and words[0] not in self.commands and words[0] not in context.help_option_names:
            words = [PATH_VERB, *words]
        return super().parse_args(context, words)


group = typer.Typer(
    cls=FormatOrPath,
    no_args_is_help=True,
    rich_markup_mode=None,
    subcommand_metavar="PATH|FORMAT [ARGS]...",
    help="Convert files of other devices and programs to a recording. PATH, a file, a folder or a zip file, is "
    "recognised by its content; a format's name in front of it reads it as that format.",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    readers = {one.name: _reader_options(one) for one in FORMATS}
    text = FunctionText.of(import_path)
    add_verb(
        group,
        PATH_VERB,
        replace(text, options=(*text.only(without=("reading",)), *_optional(readers))),
        import_path,
        show_import,
        "oarlock import trial.csv",
        "oarlock import session.zip --all --out monday",
        "oarlock import measurements --pick trial_03 --out rec --athlete A07",
        changes={"metavar": {**METAVARS, "path": "PATH", "out": "FOLDER"}},
    )
    for one in FORMATS:
        _add_format(one, readers[one.name])
    app.add_typer(group, name="import")


def _add_format(one: ImportFormat, options: tuple[Option, ...]) -> None:
    """Adds the verb of a format."""

    def read(path: Path, out: Path, session: Session, force: bool, **reading: object) -> dict[str, Any]:
        return summary(written(one.read(path, **reading), session, out, force), path, out, one.title)

    place = Option("path", "Path", REQUIRED, one.contents, True, one.place)
    out = Option("out", "NewFolder", REQUIRED, "Folder to write.")
    whole = (place, out, *options, Option("session", "Session", REQUIRED))
    text = FunctionText(whole, one.summary, lambda: read)
    add_verb(group, one.name, text, read, show_import, one.command, changes={"metavar": METAVARS})


def _reader_options(one: ImportFormat) -> tuple[Option, ...]:
    """Options of a format: further parameters of its reader."""
    if not one.options:
        return ()
    options = FunctionText.at(f"{one.module}:read_{one.name}").only(*one.options)
    return tuple(replace(own, annotation=ANNOTATIONS.get(own.name, own.annotation)) for own in options)


def _optional(readers: dict[str, tuple[Option, ...]]) -> Iterator[Option]:
    """Each optional parameter of a reader once, without default; its help names the formats."""
    first: dict[str, Option] = {}
    for option in (option for options in readers.values() for option in options):
        first.setdefault(option.name, option)
    for option in (option for option in first.values() if option.default is not REQUIRED):
        about = f"{option.about.rstrip('.')} ({', '.join(owners(option.name))})."
        yield replace(option, about=about, default=False if option.annotation == "bool" else None)


# --- what is written ----------------------------------------------------------------------------------


def import_path(
    path: Path,
    *,
    out: Path | None = None,
    all_: bool = False,
    pick: str | None = None,
    together: bool = False,
    model: ModelName | None = None,
    units: Mapping[str, str] | AnyPath | None = None,
    session: Session,
    no_questions: bool = False,
    force: bool,
    json_output: bool,
    **reading: object,
) -> dict[str, Any]:
    """Recognise the recordings of a file, a folder or a zip file by their content, and convert them.

    Args:
        path: file, folder or zip file with recordings.
        out: folder to write; default: NAME-recording, here.
        all_: write every recording, each into its own folder in FOLDER.
        pick: write only the recording of this name.
        together: all files are units of one recording; their names name the units.
        model: name the units as this model's sensors, by their own names.
        units: which unit sits where: its name or device id; or a units.toml. Default: units.toml beside the files, then
            names.
        session: who was recorded, when and where.
        no_questions: ask nothing, on a terminal too.
        force: replace what is there.
        json_output: ask nothing.
        reading: options of readers.
    """
    from oarlock import load_model
    from oarlock.recording.unit_names import units_of

    if sum((all_, pick is not None, together)) > 1:
        raise UsageError("--all, --pick and --together contradict each other")
    options = {name: value for name, value in reading.items() if value is not False}
    asks, body = asks_questions(no_questions, json_output), None if model is None else load_model(model)
    named = partial(named_units, body=body, units=units_of(units, path), path=path)
    contents = _contents(path, asks)
    unused = {"unused_files": [contents.relative(file) for file in contents.others]}
    if all_:
        folder = out or Path(f"{_stem(path)}-recordings")
        result = {
            **_write_all(contents, folder, session, named, options, asks, force),
            **unused,
        }
        if result["refused"]:
            raise Incomplete(result)
        return result
    if len(contents.recordings) > 1 and pick is None and not together:
        raise Incomplete(
            {**_listing(contents), **unused},
            f"nothing was written: {path} contains {len(contents.recordings)} recordings. Choose one with --pick NAME, "
            "or write --all, or one of --together if they are units of one recording",
        )
    recording, name, about = _read_one(contents, pick, together, asks, options)
    recording, assignment = named(recording, asks=asks)
    if asks and not session:
        session = _asked(recording)
    out = out or Path(f"{_stem(Path(name))}-recording")
    found = summary(written(recording, session, out, force), path, out, about, model or "MODEL")
    tables = [file for file in unused["unused_files"] if Path(file).suffix.lower() in TABLES]
    if together and tables:
        found["notes"] = [
            *found["notes"],
            f"No format recognises {', '.join(tables)}. For a table such as an encoder's write a mapping file of all "
            "files and use `oarlock import csv mapping.toml`; see docs/import.md",
        ]
    mapping = {"mapping": options["save_mapping"]} if "save_mapping" in options else {}
    return {**found, **assignment, **unused, **mapping}


def asked_recording(
    path: Path,
    pick: str | None,
    together: bool,
    model: str,
    units: Mapping[str, str] | Path | None,
    athlete: str | None,
    json_output: bool,
) -> Recording | Path:
    """A folder of Oarlock's as it is; else a recording with named units, of which a terminal asks what is not clear."""
    from oarlock import load_model, load_recording
    from oarlock.recording.folder import INDEX_FILE
    from oarlock.recording.unit_names import units_of

    is_ours = (path / INDEX_FILE).is_file()
    if is_ours and units is None and athlete is None:
        return path
    asks = asks_questions(False, json_output)
    if is_ours:
        recording = load_recording(path)
    else:
        recording, *_ = _read_one(_contents(path, asks), pick, together, asks, {})
    recording, _ = named_units(recording, load_model(model), units_of(units, path), path, asks)
    return _with_session(recording, session_of(athlete=athlete))


def written(recording: Recording, session: Session, out: Path, force: bool) -> Recording:
    """Write a recording's folder; the recording with its session."""
    recording = _with_session(recording, session, out)
    with output_folder(out, "recording", force) as stage:
        recording.save(stage)
    return recording


def owners(option: str) -> list[str]:
    """The formats that have an option."""
    return [one.name for one in FORMATS if option in one.options]


# --- what is read -------------------------------------------------------------------------------------


def _contents(path: Path, asks: bool) -> Contents:
    """What is recognised; on a terminal ask for the format where several recognise the same files."""
    from oarlock.formats.choices import UnclearError
    from oarlock.formats.contents import find_recordings

    prefer: list[str] = []
    while True:
        try:
            return find_recordings(path, prefer)
        except UnclearError as unclear:
            if not asks:
                raise
            prefer.append(str(_answer(unclear)))


def _read_one(
    contents: Contents, pick: str | None, together: bool, asks: bool, options: Mapping[str, object]
) -> tuple[Recording, str, str]:
    """The recording of a place, the picked one, or all as one, with its name and what it is.

    Raises:
        UsageError: an option that its format does not have.
    """
    from oarlock.formats.together import joined

    matches = contents.recordings if together else (contents.only(pick),)
    for match in matches:
        for name in options:
            if match.format not in (formats := owners(name)):
                raise UsageError(
                    f"--{name.replace('_', '-')}: the format {match.format} has no such option "
                    f"({', '.join(formats)} {'has' if len(formats) == 1 else 'have'} it)"
                )
    parts = [(match.name, _read(match, asks, options)) for match in matches]
    if together:
        return joined(parts), _stem(contents.path), f"{len(parts)} files of one recording"
    return parts[0][1], matches[0].name, matches[0].about


def _read(match: FileMatch, asks: bool, options: Mapping[str, object]) -> Recording:
    """Read a recording; on a terminal ask what is not clear."""
    from oarlock.formats.choices import UnclearError
    from oarlock.formats.contents import format_of, read_found

    answers: dict[str, object] = dict(options)
    while True:
        try:
            return read_found(match, answers)
        except UnclearError as unclear:
            option = unclear.option
            if not asks or option in answers or option not in format_of(match).options:
                raise
            answers[option] = _answer(unclear)


def _answer(unclear: UnclearError) -> object:
    say(str(unclear))
    if not unclear.choices:
        return typer.prompt("  your answer", type=float)
    for choice, meaning in unclear.choices.items():
        say(f"{choice}: {meaning}", indent=2)
    valid = list(unclear.choices)
    while (answer := str(typer.prompt(f"  which of {', '.join(valid)}"))) not in valid:
        pass
    return answer


def _asked(recording: Recording) -> Session:
    """The session as the file says and as the person at the terminal answers."""
    from oarlock.recording.session_info import session_info

    epoch = recording.epoch or ""
    is_dated = len(epoch) > 10 and epoch[4] == "-"
    return asked_session(session_info(recording.meta), epoch[:10] if is_dated else "")


def _with_session(recording: Recording, session: Session, out: Path | None = None) -> Recording:
    """The recording with its session: as given, else as the file says, else that of the folder that is replaced."""
    from oarlock import Recording
    from oarlock.recording.session_info import SESSION_KEY, read_session, session_info

    before = {} if out is None else read_session(out)
    known = {**before, **session_info(recording.meta), **session}
    return Recording(recording.streams, {**recording.meta, SESSION_KEY: known}) if known else recording


def _stem(path: Path) -> str:
    """A name for a folder from the name of a file."""
    return path.resolve().stem if path.is_file() else path.resolve().name


def _listing(contents: Contents) -> dict[str, Any]:
    """The recordings of a place, none of which was chosen."""
    rows = [
        {
            "name": one.name,
            "format": one.format,
            "start": one.start,
            "about": one.about,
            "path": contents.relative(one.path),
        }
        for one in contents.recordings
    ]
    place = contents.path
    return {
        "place": place,
        "recordings": rows,
        "next": [
            f"oarlock import {place} --pick {contents.recordings[0].name}",
            f"oarlock import {place} --all --out FOLDER",
            f"oarlock import {place} --together   (if they are units of one recording)",
        ],
    }


def _write_all(
    contents: Contents,
    out: Path,
    session: Session,
    named: Callable[..., tuple[Recording, dict[str, Any]]],
    options: Mapping[str, object],
    asks: bool,
    force: bool,
) -> dict[str, Any]:
    """Write each recording into a folder of its own. What cannot be read is reported, and the others are written."""
    from oarlock.storage.names import file_names

    folders = [out / file_names([one.name], "x")[0].removesuffix(".x") for one in contents.recordings]
    for folder in folders:
        check_folder(folder, force)
    if asks and not session:
        session = asked_session({}, "")
    done, refused = [], []
    for one, folder in zip(contents.recordings, folders, strict=True):
        own = {name: value for name, value in options.items() if one.format in owners(name)}
        try:
            recording, assignment = named(_read(one, asks, own), asks=False)
        except ValueError as error:
            refused.append({"name": one.name, "message": str(error)})
            continue
        found = summary(written(recording, session, folder, force), one.path, folder, one.about)
        done.append({**found, **assignment})
        say(f"Wrote {folder}: {one.about}, {len(recording.streams)} streams, {recording.duration_s:.1f} s")
    return {"recordings": done, "refused": refused}


# --- what is shown ------------------------------------------------------------------------------------


def summary(
    recording: Recording, source: Path, out: Path, about: str, model: str = "MODEL"
) -> dict[str, Any]:
    """What was written."""
    from oarlock.recording.packets import lost_packets
    from oarlock.recording.reader_notes import reader_notes
    from oarlock.recording.session_info import session_info
    from oarlock.storage.epoch import moment_text

    clock = recording.meta.get("clock")
    losses = [
        f"{stream.name}: {lost.text()}"
        for stream in recording.streams
        if (lost := lost_packets(recording, stream)) is not None and lost.text()
    ]
    return {
        "source": source,
        "about": about,
        "start": moment_text(recording.epoch, recording.start_s),
        "duration_s": recording.duration_s,
        "clock": CLOCKS.get(str(clock.get("kind"))) if isinstance(clock, Mapping) else None,
        "epoch": recording.epoch,
        "session": session_info(recording.meta),
        "streams": [_stream_row(recording, stream) for stream in recording.streams],
        "notes": [*_joined_notes(reader_notes(recording.meta)), *losses],
        "written": out,
        "next": [f"oarlock track {out} --model {model} --out {out}-track"],
    }


def show_import(result: Mapping[str, Any]) -> None:
    """Prints the result; those of --all were printed when they were written."""
    files = result.get("unused_files", ())
    more = f" and {len(files) - LISTED_FILES} more" if len(files) > LISTED_FILES else ""
    shown = {**result, "epoch": None, "unused_files": ", ".join(files[:LISTED_FILES]) + more}
    show_document({**shown, "recordings": []} if "refused" in result else shown)


def _stream_row(recording: Recording, stream: Stream) -> dict[str, Any]:
    from oarlock.recording.packets import missing_packets, missing_share, quantity_rates, stream_rate_hz

    rates = quantity_rates(recording, stream)
    return {
        "name": stream.name,
        "kind": stream.kind,
        "samples": len(stream),
        "rate_hz": stream_rate_hz(recording, stream),
        "missing_packets": missing_packets(recording, stream),
        "missing_percent": 100.0 * missing_share(recording, stream),
        "quantities_hz": {QUANTITIES.get(name, name): rate for name, rate in rates.items()},
    }


def _joined_notes(notes: Sequence[str]) -> list[str]:
    """The notes; those that differ only in the unit and its factor become one that names all units."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for note in notes:
        name, _, text = note.partition(": ")
        groups.setdefault(_FACTOR.sub("", text) or note, []).append((name, note))
    return [
        f"{', '.join(name for name, _ in group)}: {text}" if len(group) > 1 else group[0][1]
        for text, group in groups.items()
    ]
