"""Reads TOML with errors that name file, line and key; writes TOML with exact numbers."""

import datetime
import re
import sys
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_text
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.write_file import write_file

_HEADER = re.compile(r"\s*\[{1,2}\s*([^\[\]]+?)\s*\]{1,2}\s*(#.*)?$")
_LINE_KEY = re.compile(r"\s*((?:[\"']?[A-Za-z0-9_-]+[\"']?\s*\.\s*)*[\"']?[A-Za-z0-9_-]+[\"']?)\s*=")
_INLINE_KEY = re.compile(r"[{,]\s*[\"']?([A-Za-z0-9_-]+)[\"']?\s*=")
_MISSING = object()
_LARGEST = sys.float_info.max

KeyPath: TypeAlias = tuple[str | int, ...]


@dataclass(frozen=True)
class TomlTable:
    """One table of a TOML file, which knows where it stands.

    Args:
        values: the table's keys and values.
        file: the file it was read from.
        text: the whole file.
        path: keys and list positions that lead to the table, such as ("file", 0, "sensor", 1).
    """

    values: Mapping[str, object]
    file: Path
    text: str
    path: KeyPath = ()

    @classmethod
    def read(cls, file: Path) -> "TomlTable":
        """Parse a file; a `DataError` tells where it is no TOML."""
        return cls.parsed(read_text(file, "utf-8-sig"), file)

    @classmethod
    def parsed(cls, text: str, file: Path) -> "TomlTable":
        """Parse a text; errors name it like a file."""
        try:
            return cls(tomllib.loads(text), file, text)
        except (ValueError, RecursionError) as error:
            # Numbers of thousands of digits and brackets in thousands of brackets are not the parser's own errors.
            raise DataError(f"{file}: is not valid TOML: {error}") from error

    def where(self, key: str | None = None) -> str:
        """``file:line, key "name"`` for a key of this table, or the table itself."""
        line = self._line(key)
        place = f"{self.file}:{line}" if line else str(self.file)
        named = ".".join(f"[{p + 1}]" if isinstance(p, int) else p for p in self.path).replace(".[", "[")
        if key is None:
            return f"{place}, table [{named}]" if named else place
        return f'{place}, key "{key}"' + (f" of [{named}]" if named else "")

    def check_keys(self, valid: Iterable[str]) -> None:
        """Refuse a key that is not in `valid`, naming the nearest one that is."""
        known = sorted(valid)
        for key in self.values:
            if key not in known:
                raise DataError(f"{self.where(key)}: is unknown. {did_you_mean(key, known)}")

    def check_format(self, supported: int) -> None:
        """Refuse a file of another format number."""
        found = self.require("format")
        if found != supported:
            raise DataError(
                f"{self.where('format')}: is {found!r}; this version of Oarlock reads format {supported}"
            )

    def require(self, key: str) -> object:
        """The value of a key that must be there."""
        if key not in self.values:
            raise DataError(f'{self.where()}: the key "{key}" is missing')
        return self.values[key]

    def string(self, key: str, default: object = _MISSING) -> str:
        """A text; required where there is no default."""
        value = self.require(key) if default is _MISSING else self.values.get(key, default)
        if not isinstance(value, str):
            raise self._wrong(key, value, "a text in quotes")
        return value

    def integer(self, key: str, default: int) -> int:
        """A whole number that is not negative."""
        value = self.values.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise self._wrong(key, value, "a whole number, 0 or more")
        return value

    def number(self, key: str, default: float) -> float:
        """A finite number."""
        value = self.values.get(key, default)
        if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) <= _LARGEST:
            raise self._wrong(key, value, "a finite number")
        return float(value)

    def boolean(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.values.get(key, default)
        if not isinstance(value, bool):
            raise self._wrong(key, value, "true or false")
        return value

    def table(self, key: str, default: object = _MISSING) -> "TomlTable":
        """A table inside this one."""
        value = self.require(key) if default is _MISSING else self.values.get(key, default)
        if not isinstance(value, dict):
            raise self._wrong(key, value, "a table, { ... }")
        return TomlTable(value, self.file, self.text, (*self.path, key))

    def tables(self, key: str) -> list["TomlTable"]:
        """A list of tables, ``[[key]]``, with at least one entry."""
        value = self.require(key)
        if not isinstance(value, list) or not value or not all(isinstance(v, dict) for v in value):
            raise self._wrong(key, value, "one or more tables [[...]]")
        return [TomlTable(v, self.file, self.text, (*self.path, key, i)) for i, v in enumerate(value)]

    def _wrong(self, key: str, value: object, expected: str) -> DataError:
        return DataError(f"{self.where(key)}: is {value!r}; expected {expected}")

    def _line(self, key: str | None) -> int | None:
        """Line of the key, or of the table; the nearest enclosing header where the text hides it."""
        path = self.path if key is None else (*self.path, key)
        lines = key_lines(self.text)
        while path and path not in lines:
            path = path[:-1]
        return lines.get(path)


def key_lines(text: str) -> dict[KeyPath, int]:
    """Line of every key that starts a line, and of every table header."""
    lines: dict[KeyPath, int] = {}
    counts: dict[KeyPath, int] = {}
    here: KeyPath = ()
    owner = here
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(line):
            here = _resolve(header[1], line.lstrip().startswith("[["), counts)
            lines.setdefault(here, number)
            continue
        bare = line.split("#")[0]
        if starts := _LINE_KEY.match(bare):
            owner = (*here, *(part.strip().strip("\"'") for part in starts[1].split(".")))
            lines.setdefault(owner, number)
        for key in _INLINE_KEY.findall(bare):
            lines.setdefault((*owner, key), number)
    return lines


def _resolve(dotted: str, is_list: bool, counts: dict[KeyPath, int]) -> KeyPath:
    """Path of a header, with the list positions that it implies."""
    path: KeyPath = ()
    parts = [p.strip().strip("\"'") for p in dotted.split(".")]
    for depth, part in enumerate(parts):
        path = (*path, part)
        if is_list and depth == len(parts) - 1:
            counts[path] = counts.get(path, -1) + 1
        if path in counts:
            path = (*path, counts[path])
    return path


def write_toml(file: Path, document: Mapping[str, object]) -> None:
    """Write a document of texts, numbers, booleans, dates, lists and tables. The file is replaced as a whole.

    Raises:
        DataError: A value that TOML cannot hold, or the file cannot be written.
    """
    write_file(file, toml_text(document))


def toml_text(document: Mapping[str, object]) -> str:
    """The document as TOML text: plain keys first, then tables and lists of tables."""
    import tomlkit

    return tomlkit.dumps(_plain(document, ()))


def _plain(value: Any, path: tuple[str, ...]) -> Any:
    """The value with NumPy's numbers and arrays as Python's, which TOML can hold; numbers keep every bit."""
    if hasattr(value, "tolist") and not isinstance(value, type):  # of numpy, which help does not import
        value = value.tolist()
    if isinstance(value, Mapping):
        return {_key(key, path): _plain(inner, (*path, str(key))) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry, path) for entry in value]
    if isinstance(value, bool | str | int | float | datetime.datetime | datetime.date | datetime.time):
        return value
    raise DataError(
        f'"{".".join(path)}" is {value!r} ({type(value).__name__}), which TOML cannot hold. '
        "Use texts, numbers, booleans, lists and tables, and leave out what is unknown."
    )


def _key(key: object, path: tuple[str, ...]) -> str:
    if not isinstance(key, str):
        raise DataError(f"key {key!r} of [{'.'.join(path)}] is not a text, so it cannot be written")
    return key
