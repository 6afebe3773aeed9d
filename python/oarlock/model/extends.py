"""Model files that name a base (`extends = "sculler"`) and only what differs, mirror or cut it; for `load_model`."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from oarlock.model.edit import NAMED, merged
from oarlock.model.mirror import with_mirror
from oarlock.model.part import with_part
from oarlock.model.shipped_files import model_names, model_path
from oarlock.storage.errors import DataError, ModelError
from oarlock.storage.regular_file import UnreadableFileError, read_text
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import key_lines, toml_text

_KEY = re.compile(r"^\s*(extends\s*=|\[?(mirror|part)\b)", re.MULTILINE)


@dataclass(frozen=True)
class ModelFile:
    """A file and those that it extends, the nearest first.

    Args:
        path: of the file.
        text: as it stands there, or with all bases put in.
        sources: path and text of every file that has part in it, the file itself first.
    """

    path: str
    text: str
    sources: tuple[tuple[str, str], ...]

    def located(self, message: str) -> str:
        """A message of the engine about the whole text, with files and lines where they really stand."""
        if self.text == self.sources[0][1]:
            return message
        lines = {line: path for path, line in reversed(key_lines(self.text).items())}
        found = re.compile(rf"^{re.escape(self.path)}:(\d+):", re.MULTILINE)
        return found.sub(lambda match: self._origin(lines, int(match[1])), message)

    def _origin(self, lines: dict[int, tuple[str | int, ...]], line: int) -> str:
        path = next((lines[k] for k in range(line, 0, -1) if k in lines), ())
        named = _by_name(path, tomllib.loads(self.text))
        while named:
            for file, text in self.sources:
                document = tomllib.loads(text)
                for there, number in key_lines(text).items():
                    if _by_name(there, document) == named:
                        return f"{file}:{number}:"
            named = named[:-1]
        return f"{self.path}:1:"


def model_file(path: Path, text: str, above: tuple[Path, ...] = ()) -> ModelFile:
    """A model file with its bases put in, mirrored and cut as it says.

    Args:
        path: of the file.
        text: what it holds.
        above: files that extend it.

    Raises:
        ModelError: a base is not there, or extends the file itself, or has nothing by a name that is changed.
    """
    alone = ModelFile(str(path), text, ((str(path), text),))
    if not _KEY.search(text):
        return alone
    try:
        document = tomllib.loads(text)
    except ValueError:
        # the engine says where it is no TOML
        return alone
    if not {"extends", "mirror", "part"} & set(document):
        return alone
    sources = alone.sources
    try:
        if "extends" in document:
            where = f"{path}:{key_lines(text).get(('extends',), 1)}: extends"
            base = _base(where, path, document["extends"], (*above, path))
            sources += base.sources
            document = merged(tomllib.loads(base.text), document)
        document = with_part(with_mirror(document))
    except DataError as error:
        raise ModelError(f"{path}: {error}") from None
    return ModelFile(str(path), toml_text(document), sources)


def _base(where: str, path: Path, name: Any, above: tuple[Path, ...]) -> ModelFile:
    if not isinstance(name, str):
        raise ModelError(
            f"{where}: is {name!r}; expected the name of a shipped model or the path of a model file"
        )
    shipped = model_names()
    base = model_path(name) if name in shipped else path.parent / name
    if base.resolve() in {file.resolve() for file in above}:
        chain = " extends ".join(str(file) for file in (*above, base))
        raise ModelError(f"{where}: the files extend each other in a circle: {chain}")
    try:
        text = read_text(base)
        tomllib.loads(text)
    except UnreadableFileError as error:
        raise ModelError(
            f"{where}: no shipped model is called '{name}', and {error}. {did_you_mean(name, shipped)}"
        ) from None
    except DataError as error:
        raise ModelError(str(error)) from None
    except ValueError as error:
        raise ModelError(f"{base}: is not valid TOML: {error}") from None
    return model_file(base, text, above)


def _by_name(path: tuple[str | int, ...], document: dict[str, Any]) -> tuple[str | int, ...]:
    """A path of keys with the names of tables in place of their numbers."""
    if len(path) > 1 and path[0] in NAMED and isinstance(path[1], int):
        return (path[0], document[str(path[0])][path[1]].get("name", path[1]), *path[2:])
    return path
