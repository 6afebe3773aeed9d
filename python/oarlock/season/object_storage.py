"""A season in an object store: S3 and what speaks its protocol, Google, Azure, or memory for tests.

Credentials, region and endpoint come from the environment, as the store's own tools have them (`AWS_ENDPOINT_URL`).
"""

from __future__ import annotations

import datetime
import hashlib
import os
import shutil
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from oarlock.season.storage import FolderStorage, SeasonStorage, checked_name
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file

if TYPE_CHECKING:
    from obstore.store import ObjectStore

Result = TypeVar("Result")
_AT_ONCE, _VERSIONS_AT_ONCE = 500, 1000
_CONNECT_S, _ANSWER_S, _RETRY_S, _RETRIES = 5, 60, 20, 4
"""An endpoint that cannot be reached is an error within seconds; a large file may take the longer time."""
_COPY_S = 600.0
"""Former copies in the cache are removed when they are older: another process may be reading them."""
_IN_MEMORY: dict[str, ObjectStore] = {}
"""Stores of this process by address."""


def open_storage(address: str) -> SeasonStorage:
    """The storage at an address: a path, or an object store such as `s3://bucket/season`."""
    if "://" not in address or address.startswith("file://"):
        return FolderStorage(Path(address.removeprefix("file://")))
    try:
        from obstore.store import from_url
    except ImportError:
        raise DataError(
            f'{address}: object stores need one more package: pip install "oarlock[season]"'
        ) from None
    if address.startswith("memory:"):
        return ObjectStorage(address, _IN_MEMORY.setdefault(address.rstrip("/"), from_url("memory:///")))
    seconds = datetime.timedelta
    client: Any = {"connect_timeout": seconds(seconds=_CONNECT_S), "timeout": seconds(seconds=_ANSWER_S)}
    if os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://"):
        client["allow_http"] = True
    again: Any = {"max_retries": _RETRIES, "retry_timeout": seconds(seconds=_RETRY_S)}
    try:
        return ObjectStorage(address, from_url(address, client_options=client, retry_config=again))
    except Exception as error:  # each store has errors of its own
        raise DataError(f"{address}: cannot be opened ({_first_line(error)})") from error


class ObjectStorage(SeasonStorage):
    """The season below one prefix of a store."""

    def __init__(self, address: str, store: ObjectStore) -> None:
        import obstore

        self.address, self.store, self._api = address.rstrip("/"), store, obstore

    def read(self, name: str) -> bytes:
        """As `SeasonStorage.read`."""
        return self._answer(lambda: bytes(self._api.get(self.store, checked_name(name)).bytes()), name)

    def write(self, name: str, contents: bytes) -> None:
        """As `SeasonStorage.write`."""
        try:
            self._answer(lambda: self._api.put(self.store, checked_name(name), contents), name)
        except FileNotFoundError as error:
            raise self._no_bucket() from error

    def create(self, name: str, contents: bytes) -> bool:
        """As `SeasonStorage.create`."""
        from obstore.exceptions import AlreadyExistsError, NotSupportedError

        try:
            self._api.put(self.store, checked_name(name), contents, mode="create")
        except AlreadyExistsError:
            return False
        except NotSupportedError:  # a store without conditions
            self.write(name, contents)
        except Exception as error:
            raise self._refusal(error, name) from error
        return True

    def children(self, folder: str) -> list[str]:
        """As `SeasonStorage.children`."""
        listing = self._answer(lambda: self._api.list_with_delimiter(self.store, folder), folder)
        paths = [*listing["common_prefixes"], *(each["path"] for each in listing["objects"])]
        return sorted(path.rsplit("/", 1)[-1] for path in paths)

    def files(self, folder: str = "") -> Iterator[tuple[str, int]]:
        """As `SeasonStorage.files`."""
        batches = iter(self._api.list(self.store, folder.rstrip("/") or None))
        while (batch := self._answer(lambda: next(batches, None), folder)) is not None:
            yield from ((each["path"], each["size"]) for each in batch)

    def age_s(self, name: str) -> float | None:
        """As `SeasonStorage.age_s`."""
        try:
            written = self._head(name)["last_modified"]
        except FileNotFoundError:
            return None
        return max(0.0, float((datetime.datetime.now(datetime.UTC) - written).total_seconds()))

    def remove(self, names: Sequence[str]) -> None:
        """As `SeasonStorage.remove`."""
        for first in range(0, len(names), _AT_ONCE):
            part = [checked_name(name) for name in names[first : first + _AT_ONCE]]
            try:
                self._answer(lambda part=part: self._api.delete(self.store, part), part[0])  # type: ignore[misc]
            except FileNotFoundError:  # of one of them; a store may stop there
                for name in part if len(part) > 1 else ():
                    self.remove([name])

    def on_disk(self, name: str) -> Path:
        """As `SeasonStorage.on_disk`: a copy in the user cache, named by the object's ETag, so that no copy is old."""
        head = self._head(name)
        mark = hashlib.sha256(f"{head['e_tag']} {head['last_modified']}".encode()).hexdigest()[:12]
        place = self._cache() / checked_name(name)
        copy = place.with_name(f"{place.stem}-{mark}{place.suffix}")
        if not copy.is_file():
            write_file(copy, self.read(name))
            for former in copy.parent.glob(f"{place.stem}-*{place.suffix}"):
                with suppress(FileNotFoundError):
                    if former != copy and time.time() - former.stat().st_mtime > _COPY_S:
                        former.unlink()
            if not self.exists(name):  # removed meanwhile: its copy must not stay
                copy.unlink(missing_ok=True)
                raise FileNotFoundError(name)
        return copy

    def forget_copies(self, but: Collection[str] = ()) -> int:
        """As `SeasonStorage.forget_copies`."""
        others = [folder for folder in self._cache().glob("*") if folder.name not in but]
        count = sum(file.is_file() for folder in others for file in folder.rglob("*"))
        for folder in others:
            shutil.rmtree(folder, ignore_errors=True)
        return count

    def _cache(self) -> Path:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        return Path(base, "oarlock", "season", hashlib.sha256(self.address.encode()).hexdigest()[:16])

    def _head(self, name: str) -> Any:
        return self._answer(lambda: self._api.head(self.store, checked_name(name)), name)

    def _answer(self, request: Callable[[], Result], name: str) -> Result:
        """What the store answers; its errors in our words."""
        try:
            return request()
        except FileNotFoundError:
            raise
        except Exception as error:
            raise self._refusal(error, name) from error

    def _refusal(self, error: Exception, name: str) -> DataError:
        words = _first_line(error)
        if "NoSuchBucket" in str(error):
            return self._no_bucket()
        if "error sending request" in words or "onnect" in words:
            return DataError(
                f"{self.address}: the object store cannot be reached; look at the network and AWS_ENDPOINT_URL "
                f"({words})"
            )
        return DataError(f"{self.address}/{name}: the object store refuses ({words})")

    def _no_bucket(self) -> DataError:
        return DataError(f"{self.address}: there is no such bucket; make it with the store's own tools")


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
        scheme, _, path = place.address.rpartition("://")
        if scheme in ("", "memory"):
            return
        if scheme not in ("s3", "s3a"):
            self.unseen = (
                "cannot be seen in this kind of store; look with its own tools whether it keeps versions"
            )
            return
        try:
            import boto3  # type: ignore[import-untyped]
        except ImportError:
            self.unseen = 'cannot be seen without boto3: pip install "oarlock[s3]", then erase again'
            return
        bucket, _, prefix = path.partition("/")
        self._at = {"Bucket": bucket, "Prefix": "/".join(filter(None, (prefix.strip("/"), folder))) + "/"}
        region = os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION")
        self._client = boto3.client("s3", region_name=region)

    def names(self) -> list[tuple[str, str]]:
        """Key and version of each, delete markers too; none if they cannot be seen."""
        return self._try(
            self._listing, "cannot be seen ({}); erase again with rights to list and remove versions"
        )

    def remove(self) -> int:
        """Remove them, and the parts of uploads that a stopped writer left; returns how many versions."""
        names = self.names()
        if not self.unseen:
            how = "could not be removed ({}); erase again with rights to remove versions"
            self._try(lambda: self._removed(names), how)
        return len(names)

    def _try(self, request: Callable[[], list[tuple[str, str]]], refused: str) -> list[tuple[str, str]]:
        if self._client is None:
            return []
        from botocore.exceptions import BotoCoreError, ClientError  # type: ignore[import-untyped]

        try:
            return request()
        except (BotoCoreError, ClientError) as error:
            self.unseen = refused.format(error)
            return []

    def _listing(self) -> list[tuple[str, str]]:
        pages = self._client.get_paginator("list_object_versions").paginate(**self._at)
        listed = [
            each for page in pages for kind in ("Versions", "DeleteMarkers") for each in page.get(kind, ())
        ]
        return [(each["Key"], each["VersionId"]) for each in listed]

    def _removed(self, names: list[tuple[str, str]]) -> list[tuple[str, str]]:
        bucket = self._at["Bucket"]
        for first in range(0, len(names), _VERSIONS_AT_ONCE):
            part = names[first : first + _VERSIONS_AT_ONCE]
            objects = [{"Key": key, "VersionId": version} for key, version in part]
            self._client.delete_objects(Bucket=bucket, Delete={"Objects": objects, "Quiet": True})
        for upload in self._client.list_multipart_uploads(**self._at).get("Uploads", ()):
            self._client.abort_multipart_upload(Bucket=bucket, Key=upload["Key"], UploadId=upload["UploadId"])
        return names
