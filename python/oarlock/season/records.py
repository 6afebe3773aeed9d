"""Records of a season: `Entry` of a recording, `Setup` and `RunRecord` of a result; names of folders and files.

[What lies where](../../../docs/season.md#what-lies-where) in a season. The commit record of a folder is written last.
"""

from __future__ import annotations

import datetime
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, TypeAlias, cast

from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable, toml_text

SEASON_FILE: Final = "season.toml"
ATHLETE_FILE: Final = "athlete.toml"
ENTRY_FILE: Final = "entry.toml"
"""Commit record of a recording."""
RUN_FILE: Final = "run.toml"
"""Commit record of a result."""
STROKES_FILE: Final = "strokes.parquet"
ENTRY_FORMAT: Final = 1
RUN_FORMAT: Final = 1
_EXPORT_RULES: Final = 2
"""Part of the name of an export's run: results of other rules are made again. 2: with `in_averages`."""
_DIGITS = 20
"""Hexadecimal digits of a name made of contents: among a billion, two are alike with a chance of 1 in 2 million."""

Kind: TypeAlias = Literal["recording", "export"]
Status: TypeAlias = Literal["done", "failed"]


def athlete_folder(athlete: str) -> str:
    """The folder that has everything of an athlete, and nothing of others."""
    return f"athlete={athlete}"


def recording_folder(athlete: str, recording: str) -> str:
    """The folder of a recording."""
    return f"{athlete_folder(athlete)}/recordings/{recording}"


def result_folder(athlete: str, recording: str, run: str) -> str:
    """The folder of a result."""
    return f"{athlete_folder(athlete)}/results/{recording}.{run}"


def named_by(*parts: bytes) -> str:
    """A name made of contents."""
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "little"))
        total.update(part)
    return total.hexdigest()[:_DIGITS]


def _named_by_document(document: Mapping[str, object]) -> str:
    return named_by(json.dumps(document, sort_keys=True, ensure_ascii=True, allow_nan=False).encode())


@dataclass(frozen=True)
class Entry:
    """What a season knows of one recording without opening it; its commit record.

    Args:
        recording: its name in the season, made of its contents.
        kind: a recording of streams, or an export of a device: strokes, or points in time.
        start: the moment at which it began, UTC; None if nothing says so.
        session: texts of `session.toml`, with the pseudonym.
        files: SHA-256 by name in its folder.
        device: the device or the format of its source; empty if the source does not say.
        file: name of its source, a file or folder; empty unless it was compared with the names of people.
    """

    recording: str
    athlete: str
    kind: Kind
    start: datetime.datetime | None
    duration_s: float | None
    session: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    device: str = ""
    file: str = ""

    @property
    def month(self) -> str:
        """The month of the start, such as 2026-03; "unknown" without one."""
        return "unknown" if self.start is None else f"{self.start:%Y-%m}"

    @property
    def folder(self) -> str:
        """Its folder in the season."""
        return recording_folder(self.athlete, self.recording)

    def toml(self) -> bytes:
        """The commit record."""
        values = {
            **vars(self),
            "start": self.start and self.start.isoformat(),
            "files": dict(sorted(self.files.items())),
        }
        known = {key: value for key, value in values.items() if value not in (None, "")}
        return toml_text({"format": ENTRY_FORMAT, **known}).encode()

    @classmethod
    def parsed(cls, contents: bytes, where: str) -> Entry:
        """The entry of a commit record."""
        table = parsed_toml(contents, where)
        table.check_format(ENTRY_FORMAT)
        length, start = table.number("duration_s", -1.0), table.string("start", "")
        try:
            moment = datetime.datetime.fromisoformat(start) if start else None
            if moment is not None and moment.utcoffset() != datetime.timedelta(0):
                raise ValueError
        except ValueError:
            raise DataError(f'{table.where("start")}: "{start}" is no moment in UTC') from None
        return cls(
            table.string("recording"),
            table.string("athlete"),
            cast(Kind, _choice(table, "kind", "recording", "export")),
            moment,
            None if length < 0.0 else length,
            _texts(table.table("session", {})),
            _texts(table.table("files", {})),
            table.string("device", ""),
            table.string("file", ""),
        )

    def shown_session(self) -> dict[str, str | None]:
        """The texts of the session that are columns of tables."""
        return {key: self.session.get(key) for key in ("boat", "seat", "rig")}


@dataclass(frozen=True)
class Setup:
    """The files that a run uses beside the recording.

    Args:
        model: model file with everything that it extends; empty for exports, which need none.
        calibration: calibration file; empty without one.
        settings: settings file of the filter; empty for the defaults.
    """

    model: bytes = b""
    calibration: bytes = b""
    settings: bytes = b""

    @property
    def name(self) -> str:
        """Its name, made of its contents."""
        return named_by(self.model, self.calibration, self.settings)

    @property
    def files(self) -> dict[str, bytes]:
        """Contents by name of the files that are there."""
        return {f"{name}.toml": contents for name, contents in vars(self).items() if contents}

    def run(self, engine: str) -> str:
        """Name of the run of this setup by an engine of this version."""
        return run_name(engine, self.name)

    def comparable(self, engine: str) -> str:
        """Name of the runs whose numbers may be compared: one engine, model, settings and kind of calibration."""
        same = {"engine": engine, "model": named_by(self.model), "settings": named_by(self.settings)}
        return _named_by_document({**same, "calibrated": bool(self.calibration)})[:8]


def run_name(engine: str, setup: str) -> str:
    """Name of the run of a setup of this name by an engine of this version."""
    rules = {"rules": _EXPORT_RULES} if setup == Setup().name else {}
    return _named_by_document({"engine": engine, "setup": setup, "format": RUN_FORMAT, **rules})


@dataclass(frozen=True)
class RunRecord:
    """How one run over one recording ended; the commit record of its result. It has no times and no hosts.

    Args:
        comparable: numbers of runs with the same text may be compared.
        fault: why it failed, a sentence; empty if it did not.
        strokes: rows of its file of strokes.
        files: SHA-256 by name in the result's folder.
        health: numbers about the sensors, by name.
        left_out: strokes that count in no mean: misread ones, paddling, starts (`in_averages`).
    """

    recording: str
    run: str
    engine: str
    setup: str
    comparable: str
    status: Status
    fault: str = ""
    strokes: int = 0
    files: Mapping[str, str] = field(default_factory=dict)
    health: Mapping[str, float] = field(default_factory=dict)
    left_out: int = 0

    @classmethod
    def done(
        cls,
        recording: str,
        setup: Setup,
        engine: str,
        strokes: bytes,
        count: int,
        health: Mapping[str, float],
        left_out: int = 0,
    ) -> RunRecord:
        """The record of a run with a file of `count` strokes; without strokes no file is stored."""
        files = {STROKES_FILE: hashlib.sha256(strokes).hexdigest()} if count else {}
        run, comparable = setup.run(engine), setup.comparable(engine)
        return cls(recording, run, engine, setup.name, comparable, "done", "", count, files, health, left_out)

    def toml(self) -> bytes:
        """The commit record."""
        ordered = {key: dict(sorted(getattr(self, key).items())) for key in ("files", "health")}
        return toml_text({"format": RUN_FORMAT, **vars(self), **ordered}).encode()

    @classmethod
    def parsed(cls, contents: bytes, where: str) -> RunRecord:
        """The record of a file."""
        table = parsed_toml(contents, where)
        table.check_format(RUN_FORMAT)
        health = table.table("health", {})
        return cls(
            **{key: table.string(key) for key in ("recording", "run", "engine", "setup", "comparable")},
            status=cast(Status, _choice(table, "status", "done", "failed")),
            fault=table.string("fault"),
            strokes=table.integer("strokes", 0),
            files=_texts(table.table("files", {})),
            health={key: health.number(key, 0.0) for key in health.values},
            left_out=table.integer("left_out", 0),
        )


def parsed_toml(contents: bytes, where: str) -> TomlTable:
    """A TOML file of a season."""
    try:
        return TomlTable.parsed(contents.decode(), Path(where))
    except UnicodeDecodeError as error:
        raise DataError(f"{where}: is not UTF-8 text (byte {error.start}); the file is damaged") from None


def _choice(table: TomlTable, key: str, *choices: str) -> str:
    if (text := table.string(key)) not in choices:
        raise DataError(f'{table.where(key)}: is "{text}"; expected {" or ".join(choices)}')
    return text


def _texts(table: TomlTable) -> dict[str, str]:
    return {key: table.string(key) for key in table.values}
