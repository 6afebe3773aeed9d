"""Finished parts of a reproduction, kept in files so that a stopped `oarlock lab reproduce` goes on from there."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import oarlock
from oarlock import _core
from oarlock.storage.regular_file import read_bytes
from oarlock.storage.write_file import write_file
from oarlock_lab.reproduce.contents import Cell, Chart, Claim, EstimateCurve, PaperPart, Table

KIND = "@"
FOLDER = "parts"
"""Folder of them beside the report."""
MAX_BYTES = 1 << 30
_KINDS = {kind.__name__: kind for kind in (Cell, Chart, Claim, EstimateCurve, PaperPart, Table)}


@dataclass(frozen=True)
class PartCache:
    """A file for each finished part, with what made it: version, files of the package, seeds and duration.

    Args:
        folder: of the files; made when something is kept.
        seeds: of stroke variation and noise.
        duration_s: of each recording.
    """

    folder: Path
    seeds: tuple[int, ...]
    duration_s: float

    def __post_init__(self) -> None:
        _package_hash()  # of what runs now, not of what the files become meanwhile

    def read(self, key: str) -> PaperPart | None:
        """A part that was made by the same; None without."""
        file = self.folder / f"{key}.json"
        try:
            stored_part = json.loads(read_bytes(file, MAX_BYTES), object_hook=_made)
            part = stored_part["part"] if stored_part["made_by"] == self._made_by() else None
        except (OSError, ValueError, KeyError, TypeError):
            return None  # not there, or damaged: it is made again
        return part if isinstance(part, PaperPart) else None

    def write(self, part: PaperPart) -> None:
        """Keeps a part; rows of its studies are no longer needed.

        Raises:
            DataError: it cannot be written.
        """
        document = {"made_by": self._made_by(), "part": part}
        write_file(self.folder / f"{part.key}.json", json.dumps(_plain(document)))
        self.forget_runs(part.key)

    def runs(self, key: str) -> Path:
        """Folder for finished runs of a part's studies, which other files of the package would not continue."""
        return self.folder / f"{key}-{self._made_by()['files'][:12]}"

    def forget(self, key: str) -> None:
        """Removes a part and its runs."""
        (self.folder / f"{key}.json").unlink(missing_ok=True)
        self.forget_runs(key)

    def forget_runs(self, key: str) -> None:
        """Removes the finished runs of a part's studies, also those that other files of the package made."""
        if self.folder.is_symlink():
            return
        for place in self.folder.glob(f"{key}-*"):
            own = re.fullmatch(rf"{re.escape(key)}-[0-9a-f]{{12}}", place.name)
            if own and place.is_dir() and not place.is_symlink():
                shutil.rmtree(place)

    def _made_by(self) -> dict[str, Any]:
        return {
            "oarlock": oarlock.__version__,
            "files": _package_hash(),
            "seeds": list(self.seeds),
            "duration_s": self.duration_s,
        }


@cache
def _package_hash() -> str:
    """A hash of the engine, the Python files and the models: between two versions they change, too."""
    digest = hashlib.sha256(read_bytes(Path(str(_core.__file__))))
    for root in (Path(oarlock.__file__).parent, Path(__file__).parents[1]):
        for file in sorted(f for end in ("py", "toml") for f in root.rglob(f"*.{end}")):
            digest.update(file.relative_to(root).as_posix().encode() + read_bytes(file))
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    """Dataclasses as objects with their names, arrays as lists; tuples are told from lists."""
    if is_dataclass(value) and not isinstance(value, type):
        own = {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
        return {KIND: type(value).__name__, **own}
    if isinstance(value, np.ndarray):
        return {KIND: "array", "values": value.tolist()}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple):
        return {KIND: "tuple", "values": [_plain(entry) for entry in value]}
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(entry) for entry in value]
    return value


def _made(stored: dict[str, Any]) -> Any:
    """The inverse of `_plain`, for each object of the JSON document."""
    kind = stored.get(KIND)
    if kind == "array":
        return np.array(stored["values"], dtype=np.float64)
    if kind == "tuple":
        return tuple(stored["values"])
    if kind in _KINDS and {KIND, *(field.name for field in fields(_KINDS[kind]))} == set(stored):
        return _KINDS[kind](**{name: field_value for name, field_value in stored.items() if name != KIND})
    return stored
