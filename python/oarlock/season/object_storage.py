"""A season in an object store: S3 and what speaks its protocol, Google, Azure, or memory for tests.

One object appears as a whole; a folder counts from the moment at which its commit record, written last, is there.
Credentials, region and endpoint come from the environment, as the store's own tools have them (`AWS_ENDPOINT_URL`).
"""

from __future__ import annotations

import datetime
import hashlib
import os
import shutil
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from oarlock.season.storage import FolderStorage, SeasonStorage, checked_name
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file

if TYPE_CHECKING:
    from obstore.store import ObjectStore

Result = TypeVar("Result")
_AT_ONCE, _VERSIONS_AT_ONCE = 500, 1000
_CONNECT_S, _ANSWER_S, _RETRY_S = 5, 60, 20
"""An endpoint that cannot be reached is an error within seconds; a large file may take the longer time."""
_RETRIES = 4
_OTHER_WRITER_S = 30.0
"""Files without a commit record that are older are of a writer that was stopped, and are written over."""
_POLL_S = 0.2
_COPY_S = 600.0
"""Former copies in the cache are removed when they are older: another process may be reading them."""
_IN_MEMORY: dict[str, ObjectStore] = {}
"""Stores of this process by address."""


def open_storage(address: str) -> SeasonStorage:
    """The storage at an address: a path, or an object store such as `s3://bucket/season`."""
    if "://" not in address:
        return FolderStorage(Path(address))
    if address.startswith("file://"):
        return open_storage(address.removeprefix("file://"))
    return _open_objects(address)


def _open_objects(address: str) -> SeasonStorage:
    """The season at an address such as `s3://bucket/season`."""
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

    def put_folder(self, folder: str, files: Mapping[str, bytes], record: str) -> bool:
        """As `SeasonStorage.put_folder`: each object is created only if it is not there, the commit record last.

        Writers of one folder begin with the same file, so of two whose contents differ one creates the first file
        that differs, and the other one waits for its commit record. If none comes, that writer was stopped, and its
        files are written over.
        """
        if self.exists(f"{folder}/{record}"):
            return False
        names = sorted(files, key=lambda name: (name == record, name))
        for name, whole in ((f"{folder}/{name}", files[name]) for name in names):
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

    def remove_empty(self, folder: str) -> None:
        """As `SeasonStorage.remove_empty`: there are no folders."""

    def on_disk(self, name: str) -> Path:
        """As `SeasonStorage.on_disk`: a copy in the user cache, named by the object's ETag, so that no copy is old."""
        import obstore

        head = self._head(name)
        if head is None:
            raise FileNotFoundError(name)
        copy = self._copy(name, head)
        if not copy.is_file():
            found = self._asked(lambda: obstore.get(self.store, checked_name(name)), name)
            copy = self._copy(name, found.meta)
            write_file(copy, bytes(found.bytes()))
            for former in copy.parent.glob(f"{copy.stem.partition('-')[0]}-*{copy.suffix}"):
                with suppress(FileNotFoundError):
                    if former != copy and time.time() - former.stat().st_mtime > _COPY_S:
                        former.unlink()
            if not self.exists(name):  # removed meanwhile: its copy must not stay
                copy.unlink(missing_ok=True)
                raise FileNotFoundError(name)
        return copy

    def forget_copies(self, but: Collection[str] = ()) -> int:
        """As `SeasonStorage.forget_copies`."""
        gone = [one for one in self._cache().glob("*") if one.name not in but]
        count = sum(file.is_file() for one in gone for file in one.rglob("*"))
        for one in gone:
            shutil.rmtree(one, ignore_errors=True)
        return count

    def _copy(self, name: str, head: Any) -> Path:
        mark = hashlib.sha256(f"{head['e_tag']} {head['last_modified']}".encode()).hexdigest()[:12]
        file = self._cache() / checked_name(name)
        return file.with_name(f"{file.stem}-{mark}{file.suffix}")

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


class FormerVersions:
    """Versions of the objects below a folder. A bucket with versions keeps what was removed until they are removed too.

    Attributes:
        unseen: why they cannot be seen; empty if they can, or if the place keeps none.
    """

    def __init__(self, place: SeasonStorage, folder: str) -> None:
        self._client: Any = None
        self.unseen = ""
        address = place.address
        if "://" not in address or address.startswith("memory:"):
            return
        if not address.startswith(("s3://", "s3a://")):
            self.unseen = (
                "cannot be seen in this kind of store; look with its own tools whether it keeps versions"
            )
            return
        try:
            import boto3  # type: ignore[import-untyped]
        except ImportError:
            self.unseen = 'cannot be seen without boto3: pip install "oarlock[s3]", then erase again'
            return
        self._bucket, _, prefix = address.partition("://")[2].partition("/")
        self._prefix = "/".join(filter(None, (prefix.strip("/"), folder))) + "/"
        region = os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION")
        self._client = boto3.client("s3", region_name=region)

    def names(self) -> list[tuple[str, str]]:
        """Key and version of each, delete markers too; none if they cannot be seen."""
        found: list[tuple[str, str]] = []
        if self._client is None:
            return found
        try:
            pages = self._client.get_paginator("list_object_versions")
            for page in pages.paginate(Bucket=self._bucket, Prefix=self._prefix):
                listed = (*page.get("Versions", ()), *page.get("DeleteMarkers", ()))
                found += [(one["Key"], one["VersionId"]) for one in listed]
        except _store_errors() as error:
            self.unseen = f"cannot be seen ({error}); erase again with rights to list and remove versions"
            return []
        return found

    def remove(self) -> int:
        """Remove them, and the parts of uploads that a stopped writer left; returns how many versions."""
        gone = [{"Key": key, "VersionId": version} for key, version in self.names()]
        if self._client is None or self.unseen:
            return 0
        try:
            for first in range(0, len(gone), _VERSIONS_AT_ONCE):
                part = {"Objects": gone[first : first + _VERSIONS_AT_ONCE], "Quiet": True}
                self._client.delete_objects(Bucket=self._bucket, Delete=part)
            uploads = self._client.list_multipart_uploads(Bucket=self._bucket, Prefix=self._prefix)
            for one in uploads.get("Uploads", ()):
                self._client.abort_multipart_upload(
                    Bucket=self._bucket, Key=one["Key"], UploadId=one["UploadId"]
                )
        except _store_errors() as error:
            self.unseen = f"could not be removed ({error}); erase again with rights to remove versions"
        return len(gone)


def _store_errors() -> tuple[type[Exception], ...]:
    from botocore.exceptions import (  # type: ignore[import-untyped]
        BotoCoreError,
        ClientError,
    )

    return BotoCoreError, ClientError
