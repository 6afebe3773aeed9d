"""Who was recorded, when and where: `session.toml` beside a recording or a track. Never part of the measured contents.

`Recording.meta["session"]` and `Track.provenance["session"]` have the same texts. People may edit the file, so no
manifest lists it.
"""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import SESSION_FILE
from oarlock.storage.names import check_name, check_text
from oarlock.storage.toml import TomlTable, write_toml

SESSION_KEY = "session"
_PLAIN = ("athlete", "date", "place", "note")
"""Keys whose texts need no label."""
_LONGEST = 500


def session_info(meta: Mapping[str, object]) -> Mapping[str, str]:
    """The session of a recording's `meta` or a track's provenance; empty if there is none.

    An ``athlete`` in `meta` itself, as mapping files have it, counts if the session names nobody.
    """
    found = meta.get(SESSION_KEY)
    given = dict(found) if isinstance(found, Mapping) else {}
    given.setdefault("athlete", meta.get("athlete"))
    return _in_order({key: text for key, text in given.items() if isinstance(text, str) and text})


def session_text(info: Mapping[str, str]) -> str:
    """The session in one line, such as "A07, 2026-05-01, seat 3"; empty if there is none."""
    return ", ".join(text if key in _PLAIN else f"{key} {text}" for key, text in info.items())


def checked_session(given: Mapping[str, object], where: str) -> Mapping[str, str]:
    """The texts of a session, without empty ones.

    Args:
        given: texts by key: ``athlete``, ``date``, ``place``, ``note`` and any others. A date may be a `datetime.date`.
        where: names the source in an error.

    Raises:
        DataError: A value is no text, or the date is not one.
    """
    found = {}
    for key, value in given.items():
        check_name(key, where)
        text = value.isoformat() if isinstance(value, datetime.date) else value
        if isinstance(text, int) and not isinstance(text, bool):
            text = str(text)
        if not isinstance(text, str):
            raise DataError(f"{where}, {key}: is {value!r}; expected a text in quotes")
        if text := " ".join(text.split()):
            _check_line(text, f"{where}, {key}")
            found[key] = _date(text, where) if key == "date" else text
    return _in_order(found)


def _in_order(found: Mapping[str, str]) -> Mapping[str, str]:
    """Who, when and where first, the note last."""
    others = [key for key in found if key not in _PLAIN]
    return MappingProxyType({key: found[key] for key in (*_PLAIN[:3], *others, _PLAIN[3]) if key in found})


def without_session(meta: Mapping[str, object]) -> tuple[Mapping[str, str], dict[str, object]]:
    """The session of a `meta` and its other entries. An entry of this name that is no session stays where it is."""
    found = meta.get(SESSION_KEY)
    if not isinstance(found, Mapping):
        return MappingProxyType({}), dict(meta)
    others = {key: value for key, value in meta.items() if key != SESSION_KEY}
    return checked_session(found, f'meta["{SESSION_KEY}"]'), others


def read_session(folder: Path) -> Mapping[str, str]:
    """The session of a folder; empty without the file.

    Raises:
        DataError: The file is not valid.
    """
    file = folder / SESSION_FILE
    return checked_session(TomlTable.read(file).values, str(file)) if file.is_file() else MappingProxyType({})


def write_session(folder: Path, info: Mapping[str, str]) -> None:
    """Write the file; nothing is written without an entry."""
    if info:
        write_toml(folder / SESSION_FILE, dict(info))


def _check_line(text: str, where: str) -> None:
    check_text(text, where)
    if len(text) > _LONGEST or not text.isprintable():
        raise DataError(f"{where}: has {len(text)} characters; expected one line of at most {_LONGEST}")


def _date(text: str, where: str) -> str:
    try:
        datetime.datetime.fromisoformat(text)
    except ValueError:
        raise DataError(f'{where}, date: "{text}" is no date; expected one such as 2026-05-01') from None
    return text
