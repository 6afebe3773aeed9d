"""A season in an object store: S3 and what speaks its protocol, Google, Azure, or memory for tests.

One object appears as a whole; a folder counts from the moment at which its commit record, written last, is there.
Credentials, region and endpoint come from the environment, as the store's own tools have them (`AWS_ENDPOINT_URL`).
"""

from __future__ import annotations

import datetime
import hashlib
import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from oarlock.season.place import SeasonStorage, checked_name
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_bytes
from oarlock.storage.write_file import TEMPORARY, write_file

if TYPE_CHECKING:
    from obstore.store import ObjectStore

Result = TypeVar("Result")
_AT_ONCE = 500
_CONNECT_S, _ANSWER_S, _RETRY_S = 5, 60, 20
"""An endpoint that cannot be reached is an error within seconds; a large file may take the longer time."""
_RETRIES = 4
_OTHER_WRITER_S = 30.0
"""Files without a commit record that are older are of a writer that was stopped, and are written over."""
_POLL_S = 0.2
_ATTEMPTS = 20
_IN_MEMORY: dict[str, ObjectStore] = {}
"""Stores of this process by address."""


def open_objects(address: str) -> SeasonStorage:
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
    if address.startswith("memory:"):
        store = _IN_MEMORY.setdefault(address.rstrip("/"), from_url("memory:///"))
        return ObjectStorage(address, store)
    seconds = datetime.timedelta
    client: Any = {
        "connect_timeout": seconds(seconds=_CONNECT_S),
        "timeout": seconds(seconds=_ANSWER_S),
    }
    if os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://"):
        client["allow_http"] = True
    again: Any = {"max_retries": _RETRIES, "retry_timeout": seconds(seconds=_RETRY_S)}
    try:
        return ObjectStorage(address, from_url(address, client_options=client, retry_config=again))
    except Exception as error:  # each store has errors of its own
        raise DataError(f"{address}: cannot be opened ({_first_line(error)})") from error


class ObjectStorage:
    """The season below one prefix of a store."""

    def __init__(self, address: str, store: ObjectStore) -> None:
        self.address = address.rstrip("/")
        self.store = store

    def read(self, name: str) -> bytes:
        """As `SeasonStorage.read`."""
        import obstore

        return self._asked(lambda: bytes(obstore.get(self.store, checked_name(name)).bytes()), name)

    def write(self, name: str, contents: bytes) -> None:
        """As `SeasonStorage.write`."""
        import obstore

        try:
            self._asked(lambda: obstore.put(self.store, checked_name(name), contents), name)
        except FileNotFoundError as error:
            self._no_bucket(error)

    def exists(self, name: str) -> bool:
        """As `SeasonStorage.exists`."""
        return self._head(name) is not None

    def children(self, folder: str) -> list[str]:
        """As `SeasonStorage.children`."""
        import obstore

        found = self._asked(lambda: obstore.list_with_delimiter(self.store, folder), folder)
        paths = [*found["common_prefixes"], *(one["path"] for one in found["objects"])]
        return sorted(path.rsplit("/", 1)[-1] for path in paths)

    def files(self, folder: str = "") -> Iterator[tuple[str, int]]:
        """As `SeasonStorage.files`."""
        import obstore

        batches = iter(obstore.list(self.store, folder.rstrip("/") or None))
        while (batch := self._asked(lambda: next(batches, None), folder)) is not None:
            yield from ((one["path"], one["size"]) for one in batch)

    def age_s(self, name: str) -> float:
        """As `SeasonStorage.age_s`."""
        head = self._head(name)
        if head is None:
            return 0.0
        now = datetime.datetime.now(datetime.UTC)
        return max(0.0, float((now - head["last_modified"]).total_seconds()))

    def put_folder(self, folder: str, files: Mapping[str, bytes | Path], record: str) -> bool:
        """As `SeasonStorage.put_folder`: each object is created only if it is not there, the commit record last.

        Writers of one folder begin with the same file, so of two whose contents differ one creates the first file
        that differs, and the other one waits for its commit record. If none comes, that writer was stopped, and its
        files are written over.
        """
        if self.exists(f"{folder}/{record}"):
            return False
        names = sorted(files, key=lambda name: (name == record, name))
        wholes = ((f"{folder}/{name}", files[name]) for name in names)
        for name, contents in wholes:
            whole = read_bytes(contents) if isinstance(contents, Path) else contents
            if self._create(name, whole):
                continue
            if name.endswith(f"/{record}"):
                return False  # another writer of the same contents was first
            if not self._is(name, whole):
                if self._is_committed(folder, record, name):
                    return False
                self.write(name, whole)
        return True

    def _create(self, name: str, contents: bytes) -> bool:
        """Write an object if there is none; False if there is one."""
        import obstore
        from obstore.exceptions import AlreadyExistsError, NotSupportedError

        try:
            obstore.put(self.store, checked_name(name), contents, mode="create")
        except AlreadyExistsError:
            return False
        except NotSupportedError:  # a store without conditions
            self.write(name, contents)
        except Exception as error:
            self._refused(error, name)
        return True

    def _is(self, name: str, contents: bytes) -> bool:
        try:
            return self.read(name) == contents
        except FileNotFoundError:
            return False

    def _is_committed(self, folder: str, record: str, name: str) -> bool:
        """Whether the writer of a file commits, or has stopped."""
        while not self.exists(f"{folder}/{record}"):
            if not self.exists(name) or self.age_s(name) > _OTHER_WRITER_S:
                return False
            time.sleep(_POLL_S)
        return True

    def remove(self, names: Sequence[str]) -> None:
        """As `SeasonStorage.remove`."""
        import obstore

        for first in range(0, len(names), _AT_ONCE):
            part = [checked_name(name) for name in names[first : first + _AT_ONCE]]
            try:
                self._asked(lambda part=part: obstore.delete(self.store, part), part[0])  # type: ignore[misc]
            except FileNotFoundError:  # of one of them; a store may stop there
                for name in part if len(part) > 1 else ():
                    self.remove([name])

    def remove_folder(self, folder: str, record: str = "") -> None:
        """As `SeasonStorage.remove_folder`."""
        if record:
            self.remove([f"{folder}/{record}"])
        self.remove([name for name, _ in self.files(f"{folder}/")])

    def on_disk(self, names: Sequence[str]) -> list[Path]:
        """As `SeasonStorage.on_disk`: copies in the user cache. Table names contain their hash: no copy is ever old."""
        return [self._copy(name) for name in names]

    def forget_copies(self, but: Collection[str] = ()) -> int:
        """As `SeasonStorage.forget_copies`."""
        found, kept = 0, {self._cache() / name for name in but}
        for file in list(self._cache().rglob("*")):
            if (
                file.is_file() and file not in kept
            ):  # folders stay, because another process may write into them
                file.unlink(missing_ok=True)
                found += not file.name.startswith(TEMPORARY)
        return found

    def _copy(self, name: str) -> Path:
        copy = self._cache() / checked_name(name)
        if copy.is_file():
            return copy
        for attempt in range(_ATTEMPTS):
            try:
                write_file(copy, self.read(name))
                break
            except DataError as error:
                # Another process has removed the copies of tables, this one too.
                if not isinstance(error.__cause__, FileNotFoundError) or attempt == _ATTEMPTS - 1:
                    raise
        if not self.exists(name):  # removed meanwhile: its copy must not stay
            copy.unlink(missing_ok=True)
            raise FileNotFoundError(name)
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
            self._refused(error, name)

    def _refused(self, error: Exception, name: str) -> NoReturn:
        words = _first_line(error)
        if "NoSuchBucket" in str(error):
            self._no_bucket(error)
        if "error sending request" in words or "onnect" in words:
            raise DataError(
                f"{self.address}: the object store cannot be reached; look at the network and AWS_ENDPOINT_URL "
                f"({words})"
            ) from error
        raise DataError(f"{self.address}/{name}: the object store refuses ({words})") from error

    def _no_bucket(self, error: Exception) -> NoReturn:
        words = "there is no such bucket; make it with the store's own tools"
        raise DataError(f"{self.address}: {words}") from error


def _first_line(error: Exception) -> str:
    return str(error).strip().split("\n", 1)[0]
