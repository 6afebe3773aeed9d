"""`oarlock-manifest.toml`: the files that Oarlock wrote into a folder, with their SHA-256, for readers and writers."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular
from oarlock.storage.toml import TomlTable, toml_text

MANIFEST = "oarlock-manifest.toml"
SESSION_FILE = "session.toml"
"""Who was recorded, when and where. People edit it, so it is never listed; it is replaced with the rest."""
FORMAT = 1
_HEAD = """\
# The files that Oarlock wrote into this folder, with their SHA-256. A file that differs is not read.
# If you changed a file on purpose, remove its line.
"""


@dataclass(frozen=True)
class Manifest:
    """What stands in `oarlock-manifest.toml`.

    Args:
        folder: where.
        kinds: for each thing that the folder holds ("recording", "track", ...) the hash of each file, by its path in
            the folder with `/`.
    """

    folder: Path
    kinds: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path) -> Manifest | None:
        """The manifest of a folder; None if there is none, as in folders that a person made.

        Raises:
            DataError: it is damaged.
        """
        file = folder / MANIFEST
        if not file.is_file():
            return None
        top = TomlTable.read(file)
        top.check_format(FORMAT)
        top.check_keys({"format", "sha256"})
        kinds = top.table("sha256")
        return cls(folder, {kind: _hashes(kinds.table(kind)) for kind in kinds.values})

    @property
    def sha256(self) -> dict[str, str]:
        """The hashes of all files."""
        return {name: value for files in self.kinds.values() for name, value in files.items()}

    def with_files(self, kind: str, files: Mapping[str, str]) -> Manifest:
        """The manifest in which these are the files of a kind."""
        others = {
            other: {name: value for name, value in kept.items() if name not in files}
            for other, kept in self.kinds.items()
            if other != kind
        }
        return Manifest(self.folder, {kind: files, **others})

    def with_nested(self) -> Manifest:
        """The manifest with the present lines of the manifests in listed folders, such as that of `truth/`.

        Pages that were added there later are ours, too.
        """
        kinds = {}
        for kind, files in self.kinds.items():
            found = dict(files)
            for name in files:
                place = Path(name).parent
                if Path(name).name != MANIFEST or _leads_out(self.folder, place):
                    continue
                nested = Manifest.read(self.folder / place)
                if nested is not None:
                    found |= {(place / own).as_posix(): value for own, value in nested.sha256.items()}
                    found[name] = sha256_of(self.folder / name)
            kinds[kind] = found
        return Manifest(self.folder, kinds)

    def text(self) -> str:
        """The manifest as TOML."""
        kinds = {kind: dict(files) for kind, files in self.kinds.items() if files}
        return _HEAD + toml_text({"format": FORMAT, "sha256": kinds})

    def is_unchanged(self, name: str) -> bool:
        """Whether a file is a regular file, listed, and as it was written."""
        file = self.folder / name
        return (
            name in self.sha256
            and file.is_file()
            and not file.is_symlink()
            and sha256_of(file) == self.sha256[name]
        )

    def check(self, names: Iterable[str]) -> None:
        """Refuse files that are listed and differ from what was written. Those that are not listed pass.

        Call it after the files were read: then it also refuses what a writer replaced in the meantime.

        Raises:
            DataError: a file was changed or cannot be read; names it.
        """
        for name in names:
            if name in self.sha256 and sha256_of(self.folder / name) != self.sha256[name]:
                raise DataError(
                    f"{self.folder / name}: is not the file that was written here (its SHA-256 differs from "
                    f"{MANIFEST}). Write the folder again; if you changed the file on purpose, remove its line from "
                    f"{self.folder / MANIFEST}."
                )


def sha256_of(file: Path) -> str:
    """Hash of a regular file, hexadecimal."""
    with open_regular(file) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _hashes(table: TomlTable) -> dict[str, str]:
    found = {}
    for name, value in table.values.items():
        if not isinstance(value, str) or Path(name).is_absolute() or ".." in Path(name).parts:
            raise DataError(f"{table.where(name)}: is damaged; write the folder again")
        found[name] = value
    return found


def _leads_out(folder: Path, place: Path) -> bool:
    return any((folder / part).is_symlink() for part in (place, *list(place.parents)[:-1]))
