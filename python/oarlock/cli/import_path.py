"""`oarlock import PATH`: recognises the recordings of a place and writes one, or all."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from oarlock.cli.options import Force, Json, metavar_of
from oarlock.cli.terminal import (
    EXIT_DATA,
    UsageError,
    check_folder,
    number,
    output_folder,
    pairs,
    print_json,
    say,
    steps,
    table,
)
from oarlock.cli.unit_options import UNIT_OPTIONS, Naming, naming_of, taken_naming
from oarlock.formats.importers import FORMATS

if TYPE_CHECKING:
    from oarlock import Recording
    from oarlock.formats.contents import Contents
    from oarlock.formats.listing import FileMatch
    from oarlock.recording.streams import Stream


_MEANINGS = {
    "athlete": "Name or pseudonym of the person.",
    "date": "Date of the recording, such as 2026-05-01.",
    "place": "Place or water.",
    "boat": "Boat or boat class.",
    "rig": "Rig or setting.",
    "seat": "Seat in the boat.",
    "note": "Anything else.",
}
_METAVARS = {"athlete": "NAME", "date": "DATE"}
SESSION_OPTIONS: list[tuple[str, Any]] = [
    (name, Annotated[str | None, typer.Option(f"--{name}", metavar=_METAVARS.get(name, "TEXT"), help=about)])
    for name, about in _MEANINGS.items()
]
"""Name and annotation of each option, for session.toml."""
NoQuestions = Annotated[bool, typer.Option("--no-questions", help="Ask nothing, on a terminal too.")]


def taken_session(options: dict[str, Any]) -> dict[str, str]:
    """The session among the options of a verb, which are removed from them.

    Raises:
        UsageError: a date is none, or a text cannot be stored.
    """
    from oarlock.recording.session_info import checked_session
    from oarlock.storage.errors import DataError

    given = {name: text for name in _MEANINGS if (text := options.pop(name, None)) is not None}
    try:
        return dict(checked_session(given, "option"))
    except DataError as error:
        raise UsageError(str(error)) from None


def asks_questions(no_questions: bool, json_output: bool) -> bool:
    """Whether a person sits at the terminal."""
    return not (no_questions or json_output) and sys.stdin.isatty() and sys.stdout.isatty()


def asked_session(known: Mapping[str, str], date: str) -> dict[str, str]:
    """Answers to one question for each part of the session; Enter leaves it out.

    Args:
        known: what is known already.
        date: of the recording, if its clock has one; the default of that question.
    """
    from oarlock.recording.session_info import checked_session
    from oarlock.storage.errors import DataError

    say("Who and when, for reports (Enter leaves it out):")
    found = dict(known)
    for name, about in _MEANINGS.items():
        while name not in known:
            default = date if name == "date" else ""
            words = f"  {name} ({about.rstrip('.').lower()})"
            answer = typer.prompt(words, default=default, show_default=bool(default))
            try:
                found |= checked_session({name: answer}, "answer")
                break
            except DataError as error:
                say(str(error), indent=2)
    return {name: found[name] for name in _MEANINGS if name in found}


def reader_options() -> list[tuple[str, Any, Any]]:
    """Name, annotation and default of each optional parameter of a reader."""
    found: dict[str, tuple[str, Any, Any]] = {}
    for one in (option for format in FORMATS for option in format.options if option.default is not ...):
        owners = ", ".join(_owners(one.name))
        kind: Any = bool if one.kind is bool else one.kind | None  # type: ignore[operator]
        option = typer.Option(
            metavar=metavar_of(one.name, one.kind), help=f"{one.about.rstrip('.')} ({owners})."
        )
        found.setdefault(one.name, (one.name, Annotated[kind, option], False if kind is bool else None))
    return list(found.values())


def taken_reading(options: dict[str, Any]) -> dict[str, object]:
    """The readers' options among those of the verb, which are removed from them; only those that were given."""
    values = {name: options.pop(name) for name, _, _ in reader_options()}
    return {name: value for name, value in values.items() if value is not None and value is not False}


def of_format(reading: Mapping[str, object], format: str) -> dict[str, object]:
    """Those that a format has."""
    return {name: value for name, value in reading.items() if format in _owners(name)}


def refuse_others(reading: Mapping[str, object], format: str) -> None:
    """Refuse an option that the format does not have.

    Raises:
        UsageError: names the option and the formats that have it.
    """
    for name in reading:
        if format not in _owners(name):
            flag = f"--{name.replace('_', '-')}"
            owners = _owners(name)
            raise UsageError(
                f"{flag}: the format {format} has no such option "
                f"({', '.join(owners)} {'has' if len(owners) == 1 else 'have'} it)"
            )


def _owners(name: str) -> list[str]:
    return [one.name for one in FORMATS if any(option.name == name for option in one.options)]


PATH_VERB: Final = "PATH"
"""Name of the verb in the help; no format has capitals."""
_LISTED_FILES = 5


PATH_OPTIONS: Final[list[tuple[str, Any, Any]]] = [
    (
        "path",
        Annotated[Path, typer.Argument(metavar="PATH", help="File, folder or zip file with recordings.")],
        ...,
    ),
    (
        "out",
        Annotated[
            Path | None,
            typer.Option(
                "--out", "-o", metavar="FOLDER", help="Folder to write; default: NAME-recording, here."
            ),
        ],
        None,
    ),
    (
        "every",
        Annotated[
            bool, typer.Option("--all", help="Write every recording, each into its own folder in FOLDER.")
        ],
        False,
    ),
    (
        "pick",
        Annotated[str | None, typer.Option(metavar="NAME", help="Write only the recording of this name.")],
        None,
    ),
    (
        "together",
        Annotated[
            bool,
            typer.Option(
                "--together", help="All files are units of one recording; their names name the units."
            ),
        ],
        False,
    ),
    *reader_options(),
    *UNIT_OPTIONS,
    *((name, kind, None) for name, kind in SESSION_OPTIONS),
    ("no_questions", NoQuestions, False),
    ("force", Force, False),
    ("json_output", Json, False),
]
"""Name, annotation and default of each option of `oarlock import PATH`."""


def import_path(
    path: Path,
    out: Path | None,
    every: bool,
    pick: str | None,
    together: bool,
    no_questions: bool,
    force: bool,
    json_output: bool,
    **options: Any,
) -> None:
    """Recognise the recordings of a file, a folder or a zip file, and convert them."""
    session = taken_session(options)
    naming = taken_naming(options, path)
    reading = taken_reading(options)
    if sum((every, pick is not None, together)) > 1:
        raise UsageError("--all, --pick and --together contradict each other")
    asks = asks_questions(no_questions, json_output)
    contents = _found(path, asks)
    if len(contents.recordings) > 1 and pick is None and not every and not together:
        _list(contents, path, json_output)
        return
    if every:
        folder = out or Path(f"{_plain(path)}-recordings")
        _write_all(contents, folder, session, naming, reading, asks, force, json_output)
        return
    recording, name, about = (
        _read_together(contents, path, asks, reading)
        if together
        else _read_only(contents, pick, asks, reading)
    )
    recording = naming.named_or_asked(recording, asks)
    session = _session(recording, session, asks)
    target = out or Path(f"{_plain(Path(name))}-recording")
    recording = written(recording, session, target, force)
    if json_output:
        others = [contents.relative(file) for file in contents.others]
        print_json({**document(recording, path, target, about), **naming.document(), "others": others})
        return
    write_summary(recording, path, target, about)
    naming.say()
    _say_others(contents)
    if "save_mapping" in reading:
        say(f"Wrote {reading['save_mapping']}")
    say_next(target, naming.model or "MODEL")


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
    from oarlock import load_recording
    from oarlock.recording.folder import INDEX_FILE
    from oarlock.recording.session_info import checked_session

    is_ours = (path / INDEX_FILE).is_file()
    if is_ours and units is None and athlete is None:
        return path
    asks = asks_questions(False, json_output)
    if is_ours:
        recording = load_recording(path)
    else:
        contents = _found(path, asks)
        recording, *_ = (
            _read_together(contents, path, asks, {}) if together else _read_only(contents, pick, asks, {})
        )
    recording = naming_of(model, units, path).named_or_asked(recording, asks)
    return _with_session(
        recording, {} if athlete is None else checked_session({"athlete": athlete}, "option")
    )


def written(recording: Recording, session: Mapping[str, str], out: Path, force: bool) -> Recording:
    """Write a recording's folder; the recording with its session."""
    recording = _with_session(recording, session, out)
    with output_folder(out, "recording", force) as stage:
        recording.save(stage)
    return recording


def say_next(out: Path, model: str) -> None:
    """Prints what to do with the recording."""
    steps(f"oarlock track {out} --model {model} --out {out}-track")


def _with_session(recording: Recording, session: Mapping[str, str], out: Path | None = None) -> Recording:
    """The recording with its session: as given, else as the file says, else that of the folder that is replaced."""
    from oarlock import Recording
    from oarlock.recording.session_info import SESSION_KEY, read_session, session_info

    before = {} if out is None else read_session(out)
    known = {**before, **session_info(recording.meta), **session}
    return Recording(recording.streams, {**recording.meta, SESSION_KEY: known}) if known else recording


def _found(path: Path, asks: bool) -> Contents:
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


def _read(found: FileMatch, asks: bool, options: Mapping[str, object]) -> Recording:
    """Read a recording; on a terminal ask what is not clear."""
    from oarlock.formats.choices import UnclearError
    from oarlock.formats.contents import format_of, read_found

    answers: dict[str, object] = dict(options)
    known = {option.name for option in format_of(found).options}
    while True:
        try:
            return read_found(found, answers)
        except UnclearError as unclear:
            if not asks or unclear.option in answers or unclear.option not in known:
                raise
            answers[unclear.option] = _answer(unclear)


def _read_only(
    contents: Contents, pick: str | None, asks: bool, reading: Mapping[str, object]
) -> tuple[Recording, str, str]:
    """The recording of a place, or the picked one, with its name and what it is."""
    found = contents.only(pick)
    refuse_others(reading, found.format)
    return _read(found, asks, reading), found.name, found.about


def _read_together(
    contents: Contents, path: Path, asks: bool, reading: Mapping[str, object]
) -> tuple[Recording, str, str]:
    """All recordings of a place as one, with its name and what it is."""
    from oarlock.formats.together import joined

    parts = []
    for found in contents.recordings:
        refuse_others(reading, found.format)
        parts.append((found.name, _read(found, asks, reading)))
    return joined(parts), _plain(path), f"{len(parts)} files of one recording"


def _answer(unclear: Any) -> object:
    say(str(unclear))
    if not unclear.choices:
        return typer.prompt("  your answer", type=float)
    for choice, meaning in unclear.choices.items():
        say(f"{choice}: {meaning}", indent=2)
    valid = list(unclear.choices)
    while True:
        answer = str(typer.prompt(f"  which of {', '.join(valid)}"))
        if answer in valid:
            return answer


def _session(recording: Recording, session: Mapping[str, str], asks: bool) -> dict[str, str]:
    from oarlock.recording.session_info import session_info

    known = {**session_info(recording.meta), **session}
    if not asks or session:
        return known
    return asked_session(known, _date(recording.epoch))


def _date(epoch: str | None) -> str:
    """The date of the recording's clock; empty if it has none."""
    return epoch[:10] if epoch and len(epoch) > 10 and epoch[4] == "-" else ""


def _plain(path: Path) -> str:
    """A name for a folder from the name of a file."""
    return path.resolve().stem if path.is_file() else path.resolve().name


def _list(contents: Contents, path: Path, json_output: bool) -> None:
    rows = [
        (one.name, one.format, one.start, one.about, contents.relative(one.path))
        for one in contents.recordings
    ]
    if json_output:
        keys = ("name", "format", "start", "about", "path")
        others = [contents.relative(file) for file in contents.others]
        print_json({"recordings": [dict(zip(keys, row, strict=True)) for row in rows], "others": others})
        return
    say(f"{path} contains {len(rows)} recordings", style="bold")
    table(["name", "format", "start", "what", "path"], rows)
    _say_others(contents)
    steps(
        f"oarlock import {path} --pick {rows[0][0]}",
        f"oarlock import {path} --all --out FOLDER",
        f"oarlock import {path} --together   (if they are units of one recording)",
    )


def _say_others(contents: Contents) -> None:
    if not contents.others:
        return
    shown = ", ".join(contents.relative(file) for file in contents.others[:_LISTED_FILES])
    more = len(contents.others) - _LISTED_FILES
    count = len(contents.others)
    files = "1 file belongs" if count == 1 else f"{count} files belong"
    say(f"{files} to no recording: {shown}{f' and {more} more' if more > 0 else ''}")


def _write_all(
    contents: Contents,
    out: Path,
    session: Mapping[str, str],
    naming: Naming,
    reading: Mapping[str, object],
    asks: bool,
    force: bool,
    json_output: bool,
) -> None:
    """Write each recording into a folder of its own. What cannot be read is reported, and the others are written."""
    for one in contents.recordings:
        check_folder(out / _safe(one.name), force)
    if asks and not session:
        session = asked_session({}, "")
    done: list[dict[str, object]] = []
    refused: list[dict[str, str]] = []
    for one in contents.recordings:
        target = out / _safe(one.name)
        try:
            recording = naming.named(_read(one, asks, of_format(reading, one.format)))
        except ValueError as error:
            refused.append({"name": one.name, "message": str(error)})
            continue
        recording = written(recording, session, target, force)
        done.append(document(recording, one.path, target, one.about))
        if not json_output:
            say(
                f"Wrote {target}: {one.about}, {len(recording.streams)} streams, {recording.duration_s:.1f} s"
            )
    others = [contents.relative(file) for file in contents.others]
    if json_output:
        print_json({"recordings": done, "refused": refused, "others": others})
    else:
        for problem in refused:
            say(f"Not written: {problem['name']}: {problem['message']}")
        _say_others(contents)
    if refused:
        raise typer.Exit(EXIT_DATA)


def _safe(name: str) -> str:
    """A name of a folder that every file system has."""
    from oarlock.storage.names import file_names

    return file_names([name], "x")[0].removesuffix(".x")


_FACTOR = re.compile(r" \(1 unit = [^()]*\)")
_SHORT = {"gyro_rad_s": "gyro", "accel_m_s2": "accel", "mag_ut": "mag", "quat_wxyz": "orientation"}


def document(recording: Recording, source: Path, out: Path, about: str) -> dict[str, object]:
    """The summary for `--json`."""
    from oarlock.recording.packets import missing_packets, missing_share, quantity_rates, stream_rate_hz
    from oarlock.recording.reader_notes import reader_notes
    from oarlock.recording.session_info import session_info
    from oarlock.storage.epoch import moment_text

    return {
        "recording": out,
        "source": source,
        "about": about,
        "session": dict(session_info(recording.meta)),
        "start_s": recording.start_s,
        "start": moment_text(recording.epoch, recording.start_s),
        "epoch": recording.epoch,
        "notes": reader_notes(recording.meta),
        "end_s": recording.end_s,
        "streams": [
            {
                "name": s.name,
                "kind": s.kind,
                "samples": len(s),
                "rate_hz": stream_rate_hz(recording, s),
                "quantities": quantity_rates(recording, s),
                "missing_packets": missing_packets(recording, s),
                "missing_share": missing_share(recording, s),
            }
            for s in recording.streams
        ],
    }


def write_summary(recording: Recording, source: Path, out: Path, about: str) -> None:
    """Prints the summary."""
    from oarlock.recording.packets import lost_packets
    from oarlock.recording.reader_notes import reader_notes
    from oarlock.recording.session_info import session_info, session_text
    from oarlock.storage.epoch import moment_text

    say(f"Wrote {out} from {source}", style="bold")
    units = [s for s in recording.streams if s.kind == "imu"]
    start = moment_text(recording.epoch, recording.start_s)
    pairs(
        [
            ("format", about),
            ("session", session_text(session_info(recording.meta))),
            ("duration", "" if start else f"{recording.duration_s:.1f} s"),
            ("units", f"{len(units)} inertial" if units else "none inertial"),
            ("clock", _clock(recording)),
            ("counter", _counter(recording)),
            ("absent", _absent(units)),
        ]
    )
    if start:
        say(f"start {start}, {recording.duration_s:.1f} s", indent=2)
    _write_streams(recording)
    for note in joined_notes(reader_notes(recording.meta)):
        say(note, indent=2)
    for stream in recording.streams:
        if (lost := lost_packets(recording, stream)) is not None and lost.text():
            say(f"{stream.name}: {lost.text()}", indent=2)


def joined_notes(notes: Sequence[str]) -> list[str]:
    """The notes; those that differ only in the unit and its factor become one that names all units."""
    joined: dict[str, list[str]] = {}
    for note in notes:
        name, colon, rest = note.partition(": ")
        joined.setdefault(_FACTOR.sub("", rest) if colon else note, []).append(name if colon else "")
    single = {_FACTOR.sub("", note.partition(": ")[2]): note for note in notes}
    return [
        f"{', '.join(names)}: {text}" if len(names) > 1 and all(names) else single.get(text, text)
        for text, names in joined.items()
    ]


def _write_streams(recording: Recording) -> None:
    from oarlock.evaluation.summary import rate_text
    from oarlock.recording.packets import missing_share, stream_rate_hz

    table(
        ["stream", "kind", ">samples", ">rate Hz", ">missing %", "measures"],
        [
            (
                s.name,
                s.kind,
                len(s),
                rate_text(stream_rate_hz(recording, s)),
                number(100 * missing_share(recording, s), ".1f"),
                _measures(recording, s),
            )
            for s in recording.streams
        ],
    )


def _measures(recording: Recording, stream: Stream) -> str:
    """The quantities of a stream, with the rate of those that are slower than its rows."""
    from oarlock.evaluation.summary import rate_text
    from oarlock.recording.packets import quantity_rates, stream_rate_hz

    whole = stream_rate_hz(recording, stream)
    rates = quantity_rates(recording, stream)
    return ", ".join(
        f"{_SHORT.get(name, name)} at {rate_text(rate)} Hz" if rate < 0.98 * whole else _SHORT.get(name, "")
        for name, rate in rates.items()
        if name in _SHORT
    )


def _clock(recording: Recording) -> str:
    """The kind of the time stamps."""
    from collections.abc import Mapping

    kinds = {
        "relative": "seconds from an unnamed start",
        "samples": "counted samples",
        "utc": "UTC",
        "local": "local time without a zone",
        "clock": "time of day without a date",
    }
    clock = recording.meta.get("clock")
    kind = clock.get("kind") if isinstance(clock, Mapping) else None
    return kinds.get(str(kind), "")


def _counter(recording: Recording) -> str:
    """The streams whose packets the device counted."""
    from collections.abc import Mapping

    counted = recording.meta.get("packets")
    names = list(counted) if isinstance(counted, Mapping) else []
    if not names:
        return ""
    return "all streams" if len(names) == len(recording.streams) else ", ".join(map(str, names))


def _absent(units: Sequence[Stream]) -> str:
    """The quantities that no unit, or only some units have."""
    lines = []
    for field in ("gyro_rad_s", "accel_m_s2", "mag_ut"):
        lack = [unit.name for unit in units if field not in unit.values]
        if lack:
            whose = "" if len(lack) == len(units) else f" of {', '.join(lack)}"
            lines.append(f"{_SHORT[field]}{whose}")
    return ", ".join(lines)
