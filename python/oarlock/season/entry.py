"""`Entry`: what a season knows of a recording without opening it; its commit record."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from oarlock.season.layout import ENTRY_FILE, ENTRY_FORMAT
from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable, toml_text

Kind: TypeAlias = Literal["recording", "export"]
KINDS: tuple[Kind, ...] = ("recording", "export")
_SESSION_COLUMNS = ("boat", "seat", "rig")
"""Keys of a session that are columns of the catalogue."""


@dataclass(frozen=True)
class Entry:
    """What a season knows of one recording.

    Args:
        recording: its name in the season, made of its contents.
        athlete: the pseudonym.
        kind: a recording of streams, or an export of a device: strokes, or points in time.
        start: the moment at which it began, UTC; None if nothing says so.
        duration_s: None if unknown.
        session: what `session.toml` said, with the pseudonym.
        files: SHA-256 by name in its folder.
    """

    recording: str
    athlete: str
    kind: Kind
    start: datetime.datetime | None
    duration_s: float | None
    session: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def month(self) -> str:
        """The month of the start, such as 2026-03; "unknown" without one."""
        return "unknown" if self.start is None else f"{self.start:%Y-%m}"

    def toml(self) -> bytes:
        """The commit record."""
        known = {
            "format": ENTRY_FORMAT,
            "recording": self.recording,
            "athlete": self.athlete,
            "kind": self.kind,
            "start": None if self.start is None else self.start.isoformat(),
            "duration_s": self.duration_s,
            "session": dict(self.session),
            "files": dict(sorted(self.files.items())),
        }
        return toml_text({key: value for key, value in known.items() if value is not None}).encode()

    @classmethod
    def parsed(cls, contents: bytes, where: str) -> Entry:
        """The entry of a commit record.

        Raises:
            DataError: it is damaged.
        """
        table = parsed_toml(contents, where)
        table.check_format(ENTRY_FORMAT)
        kind = table.string("kind")
        if kind not in KINDS:
            raise DataError(f'{table.where("kind")}: is "{kind}"; expected {" or ".join(KINDS)}')
        length = table.number("duration_s", -1.0)
        return cls(
            recording=table.string("recording"),
            athlete=table.string("athlete"),
            kind=kind,
            start=moment(table.string("start"), where) if "start" in table.values else None,
            duration_s=None if length < 0.0 else length,
            session=texts(table.table("session", {})),
            files=texts(table.table("files", {})),
        )

    def shown_session(self) -> dict[str, str | None]:
        """The texts of the session that are columns of the catalogue."""
        return {key: self.session.get(key) for key in _SESSION_COLUMNS}


def entry_place(folder: str) -> str:
    """Name of the commit record in a recording's folder."""
    return f"{folder}/{ENTRY_FILE}"


def parsed_toml(contents: bytes, where: str) -> TomlTable:
    """A TOML file of a season.

    Raises:
        DataError: it is no UTF-8 or no TOML.
    """
    try:
        return TomlTable.parsed(contents.decode(), Path(where))
    except UnicodeDecodeError as error:
        raise DataError(f"{where}: is not UTF-8 text (byte {error.start}); the file is damaged") from None


def texts(table: TomlTable) -> dict[str, str]:
    """All entries of a table of texts."""
    return {key: table.string(key) for key in table.values}


def moment(text: str, where: str) -> datetime.datetime:
    """A moment in UTC.

    Raises:
        DataError: the text is none, or says no zone.
    """
    try:
        found = datetime.datetime.fromisoformat(text)
    except ValueError:
        raise DataError(
            f'{where}: "{text}" is no moment; expected one such as 2026-05-01T07:30:00Z'
        ) from None
    if found.tzinfo is None:
        raise DataError(f'{where}: "{text}" says no time zone; add Z for UTC')
    return found.astimezone(datetime.UTC)
