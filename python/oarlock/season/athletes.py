"""`Athlete`: a pseudonym with attributes and consent; `NamesFile`: the names of people, outside the season.

A pseudonym is random. Movements can identify a person, so data under a pseudonym are still personal data.
"""

from __future__ import annotations

import datetime
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from oarlock.season.records import parsed_toml
from oarlock.storage.errors import DataError
from oarlock.storage.names import check_name
from oarlock.storage.toml import TomlTable, toml_text, write_toml

PSEUDONYM_LETTERS = "ABCDEFGHJKMNPQRSTVWXYZ23456789"
"""Without those that look alike."""
PSEUDONYM_LENGTH = 6
SCOPES = ("coaching", "research", "sharing")
"""What an athlete may consent to."""
ATTRIBUTES = {"stature_m": (0.5, 2.5), "mass_kg": (10.0, 250.0)}
"""Smallest and largest number of a person."""
_NAMES_FORMAT = 1


@dataclass(frozen=True)
class Athlete:
    """One athlete.

    Args:
        pseudonym: random, the only name in the season.
        attributes: numbers by the names of `ATTRIBUTES`.
        consent: for each scope of `SCOPES` the day on which it was given, as ISO text.
        withdrawn: the day on which all consent was withdrawn; empty if it was not.
        guardian: whether a guardian gave the consent.
        setup: name of the athlete's own setup; empty for that of the season.
    """

    pseudonym: str
    attributes: Mapping[str, float] = field(default_factory=dict)
    consent: Mapping[str, str] = field(default_factory=dict)
    withdrawn: str = ""
    guardian: bool = False
    setup: str = ""

    def allows(self, scope: str) -> bool:
        """Whether the athlete consents to a use."""
        return scope in self.consent and not self.withdrawn

    def toml(self) -> bytes:
        """The contents of the athlete's file."""
        consent = {**self.consent, "withdrawn": self.withdrawn, "guardian": self.guardian}
        return toml_text({**self.attributes, "setup": self.setup, "consent": consent}).encode()

    @classmethod
    def parsed(cls, contents: bytes, pseudonym: str, where: str) -> Athlete:
        """The athlete of a file."""
        table = parsed_toml(contents, where)
        table.check_keys((*ATTRIBUTES, "setup", "consent"))
        consent = table.table("consent", {})
        consent.check_keys((*SCOPES, "withdrawn", "guardian"))
        return cls(
            pseudonym,
            {key: table.number(key, 0.0) for key in ATTRIBUTES if key in table.values},
            {key: checked_day(consent.string(key), where) for key in SCOPES if key in consent.values},
            consent.string("withdrawn", ""),
            consent.boolean("guardian", False),
            table.string("setup", ""),
        )


def new_pseudonym(taken: Mapping[str, object]) -> str:
    """A random pseudonym that is not in use."""
    while True:
        pseudonym = "".join(secrets.choice(PSEUDONYM_LETTERS) for _ in range(PSEUDONYM_LENGTH))
        if pseudonym not in taken and not pseudonym.isdigit():
            return pseudonym


def check_scope(scope: str) -> None:
    """Raises a DataError if `scope` is not one of `SCOPES`."""
    if scope not in SCOPES:
        scopes = f"{', '.join(SCOPES[:-1])} or {SCOPES[-1]}"
        raise DataError(f'"{scope}" is not a scope of consent; choose {scopes}')


def checked_day(text: str, where: str) -> str:
    """A day as ISO text."""
    try:
        return datetime.date.fromisoformat(text).isoformat()
    except ValueError:
        raise DataError(f'{where}: "{text}" is no day; expected one such as 2026-05-01') from None


@dataclass(frozen=True)
class NamesFile:
    """The file of names: the pseudonym of each person, in a file outside the season."""

    path: Path
    pseudonyms: Mapping[str, str]

    @classmethod
    def read(cls, path: Path) -> NamesFile:
        """The file; empty if it is not there."""
        if not path.exists():
            return cls(path, {})
        table = TomlTable.read(path)
        table.check_keys(("format", "pseudonyms"))
        table.check_format(_NAMES_FORMAT)
        names = table.table("pseudonyms", {})
        return cls(path, {name: names.string(name) for name in names.values})

    def with_name(self, name: str, pseudonym: str) -> NamesFile:
        """The file with one more name."""
        check_name(name, "athlete")
        return NamesFile(self.path, {**self.pseudonyms, name: pseudonym})

    def without(self, pseudonym: str) -> NamesFile:
        """The file without the person of this pseudonym."""
        return NamesFile(self.path, {n: p for n, p in self.pseudonyms.items() if p != pseudonym})

    def write(self) -> None:
        """Write the file, readable for its owner alone."""
        write_toml(self.path, {"format": _NAMES_FORMAT, "pseudonyms": dict(self.pseudonyms)})
        self.path.chmod(0o600)
