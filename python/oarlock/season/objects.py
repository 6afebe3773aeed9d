"""A season in an object store: S3 and what speaks its protocol, Google, Azure, or memory for tests.

One object appears as a whole; a folder counts from the moment at which its commit record, written last, is there.
Credentials, region and endpoint come from the environment, as the store's own tools have them (`AWS_ENDPOINT_URL`).
"""

from __future__ import annotations

import datetime
import hashlib
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from oarlock.season.place import Place, checked_name
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file

if TYPE_CHECKING:
    from obstore.store import ObjectStore

Result = TypeVar("Result")
_AT_ONCE = 500


def open_objects(address: str) -> Place:
    """The season at an address such as `s3://bucket/season`.

    Raises:
        DataError: obstore is not installed, or cannot open the address.
    """
    try:
        from obstore.store import from_url
    except ImportError:
        raise DataError(
            f'{address}: object stores need one more package: pip install "oarlock[season]"'
        ) from None
    plain = {"allow_http": True} if os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://") else {}
    try:
        return Objects(address, from_url(address, client_options=plain or None))  # type: ignore[arg-type]
    except Exception as error:  # each store has errors of its own
        raise DataError(f"{address}: cannot be opened ({_first_line(error)})") from error


class Objects:
    """The season below one prefix of a store."""

    def __init__(self, address: str, store: ObjectStore) -> None:
        self.address = address.rstrip("/")
        self.store = store

    def read(self, name: str) -> bytes:
        """As `Place.read`."""
        import obstore

        return self._asked(lambda: bytes(obstore.get(self.store, checked_name(name)).bytes()), name)

    def write(self, name: str, contents: bytes) -> None:
        """As `Place.write`."""
        import obstore

        self._asked(lambda: obstore.put(self.store, checked_name(name), contents), name)

    def exists(self, name: str) -> bool:
        """As `Place.exists`."""
        return self._head(name) is not None

    def children(self, folder: str) -> list[str]:
        """As `Place.children`."""
        import obstore

        found = self._asked(lambda: obstore.list_with_delimiter(self.store, folder), folder)
        paths = [*found["common_prefixes"], *(one["path"] for one in found["objects"])]
        return sorted(path.rsplit("/", 1)[-1] for path in paths)

    def files(self, folder: str = "") -> Iterator[tuple[str, int]]:
        """As `Place.files`."""
        import obstore

        for batch in obstore.list(self.store, folder or None):
            yield from ((one["path"], one["size"]) for one in batch)

    def age_s(self, name: str) -> float:
        """As `Place.age_s`."""
        head = self._head(name)
        if head is None:
            return 0.0
        now = datetime.datetime.now(datetime.UTC)
        return max(0.0, float((now - head["last_modified"]).total_seconds()))

    def put_folder(self, folder: str, files: Mapping[str, bytes | Path], record: str) -> bool:
        """As `Place.put_folder`; two writers of one folder write equal contents, whose names contain their hash."""
        if self.exists(f"{folder}/{record}"):
            return False
        for name in sorted(files, key=lambda name: (name == record, name)):
            contents = files[name]
            whole = contents.read_bytes() if isinstance(contents, Path) else contents
            self.write(f"{folder}/{name}", whole)
        return True

    def remove(self, names: Sequence[str]) -> None:
        """As `Place.remove`."""
        import obstore

        for first in range(0, len(names), _AT_ONCE):
            part = [checked_name(name) for name in names[first : first + _AT_ONCE]]
            try:
                self._asked(lambda part=part: obstore.delete(self.store, part), part[0])  # type: ignore[misc]
            except FileNotFoundError:
                continue

    def remove_folder(self, folder: str, record: str = "") -> None:
        """As `Place.remove_folder`."""
        if record:
            self.remove([f"{folder}/{record}"])
        self.remove([name for name, _ in self.files(f"{folder}/")])

    def on_disk(self, names: Sequence[str]) -> list[Path]:
        """As `Place.on_disk`: copies under the user's cache. Table names contain their hash, so a copy is never old."""
        return [self._copy(name) for name in names]

    def forget_copies(self) -> int:
        """As `Place.forget_copies`."""
        found = sum(1 for file in self._cache().rglob("*") if file.is_file())
        shutil.rmtree(self._cache(), ignore_errors=True)
        return found

    def _copy(self, name: str) -> Path:
        copy = self._cache() / checked_name(name)
        if not copy.is_file():
            write_file(copy, self.read(name))
        return copy

    def _cache(self) -> Path:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        return Path(base, "oarlock", "season", hashlib.sha256(self.address.encode()).hexdigest()[:16])

    def _head(self, name: str) -> Any:
        import obstore

        try:
            return self._asked(lambda: obstore.head(self.store, checked_name(name)), name)
        except FileNotFoundError:
            return None

    def _asked(self, ask: Callable[[], Result], name: str) -> Result:
        """What the store answers; its errors in our words."""
        try:
            return ask()
        except FileNotFoundError:
            raise
        except Exception as error:
            raise DataError(
                f"{self.address}/{name}: the object store refuses ({_first_line(error)})"
            ) from error


def _first_line(error: Exception) -> str:
    return str(error).strip().split("\n", 1)[0]
