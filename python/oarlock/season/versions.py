"""Former versions of objects: a bucket with versions keeps what was removed until its versions are removed too."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from oarlock.season.layout import ENTRY_FILE, ERASED, EXPORTS, LOGS, RECORDINGS, SEASON_FILE, TABLES
from oarlock.season.place import SeasonStorage

_AT_ONCE = 1000
_REWRITTEN = (f"{TABLES}/", f"{LOGS}/", f"{EXPORTS}/", f"{ERASED}/", SEASON_FILE)
"""What an erasure writes anew: its former versions may have the athlete."""


@dataclass(frozen=True)
class Trace:
    """What is left of an athlete after an erasure: a file in the season, and what of it or why it cannot be seen."""

    file: str
    what: str


class NoVersions:
    """A place that keeps none, or of which nobody can see them.

    Args:
        where: address of the place.
        unseen: why they cannot be seen; empty if there are none.
    """

    def __init__(self, where: str = "", unseen: str = "") -> None:
        self.where, self.unseen = where, unseen

    def recordings_of(self, athlete: str) -> list[str]:
        """As `S3Versions.recordings_of`."""
        return []

    def remove(self, athlete: str, recordings: Collection[str]) -> int:
        """As `S3Versions.remove`."""
        return 0

    def left(self, athlete: str, recordings: Collection[str]) -> list[Trace]:
        """As `S3Versions.left`."""
        return [Trace(self.where, f"former versions {self.unseen}")] if self.unseen else []


def versions_of(place: SeasonStorage) -> Versions:
    """The former versions at a place."""
    address = place.address
    if "://" not in address or address.startswith("memory:"):
        return NoVersions()
    if not address.startswith(("s3://", "s3a://")):
        why = (
            "cannot be seen in this kind of store; look with its own tools whether the bucket keeps versions"
        )
        return NoVersions(address, why)
    try:
        import boto3  # type: ignore[import-untyped]
    except ImportError:
        return NoVersions(
            address, 'cannot be seen without boto3: pip install "oarlock[s3]", then erase again'
        )
    bucket, _, prefix = address.partition("://")[2].partition("/")
    region = os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION")
    return S3Versions(boto3.client("s3", region_name=region), bucket, prefix.strip("/"), address)


@dataclass(frozen=True)
class _Version:
    """One version of an object; `name` is that in the season."""

    name: str
    key: str
    version: str
    is_latest: bool
    is_marker: bool


class S3Versions:
    """The versions of the objects of a season on S3.

    Args:
        client: of boto3.
        bucket: name of the bucket.
        prefix: of the season in it, without a slash at its end.
        address: of the season.
    """

    def __init__(self, client: Any, bucket: str, prefix: str, address: str) -> None:
        self.client, self.bucket, self.address = client, bucket, address
        self.prefix = f"{prefix}/" if prefix else ""

    def recordings_of(self, athlete: str) -> list[str]:
        """Names of recordings of an athlete of which only former versions are there."""
        line = re.compile(rb'^athlete = "' + re.escape(athlete.encode()) + rb'"\r?$', re.MULTILINE)
        listed, _ = self._listed(f"{RECORDINGS}/")
        entries = [one for one in listed if one.name.endswith(f"/{ENTRY_FILE}") and not one.is_marker]
        found = [one for one in entries if not one.is_latest and line.search(self._read(one))]
        return sorted({one.name.split("/")[1] for one in found})

    def remove(self, athlete: str, recordings: Collection[str]) -> int:
        """Remove all versions of the athlete's files and former ones of what was written anew; returns how many."""
        own = set(recordings)
        listed, _ = self._listed()
        gone = [one for one in listed if self._is_to_go(one, athlete, own)]
        for first in range(0, len(gone), _AT_ONCE):
            part = [{"Key": one.key, "VersionId": one.version} for one in gone[first : first + _AT_ONCE]]
            try:
                self.client.delete_objects(Bucket=self.bucket, Delete={"Objects": part, "Quiet": True})
            except _errors():
                return first  # what is left is listed by the proof
        self._abort_uploads()
        return len(gone)

    def left(self, athlete: str, recordings: Collection[str]) -> list[Trace]:
        """Versions that `remove` should have removed and that are there; a reason if they cannot be seen."""
        own = set(recordings)
        listed, why = self._listed()
        if why:
            return [Trace(self.address, f"former versions {why}")]
        return [
            Trace(one.name, f"version {one.version}") for one in listed if self._is_to_go(one, athlete, own)
        ]

    def _is_to_go(self, one: _Version, athlete: str, own: set[str]) -> bool:
        top, _, rest = one.name.partition("/")
        second = re.split(r"[/.]", rest, maxsplit=1)[0]
        if top in ("recordings", "results") and second in own:
            return True
        if second == athlete:
            return True
        return one.name.startswith(_REWRITTEN) and (not one.is_latest or one.is_marker)

    def _read(self, one: _Version) -> bytes:
        answer = self.client.get_object(Bucket=self.bucket, Key=one.key, VersionId=one.version)
        return bytes(answer["Body"].read())

    def _listed(self, below: str = "") -> tuple[list[_Version], str]:
        """All versions and delete markers below a folder, and why they cannot be seen."""
        found: list[_Version] = []
        try:
            pages = self.client.get_paginator("list_object_versions")
            for page in pages.paginate(Bucket=self.bucket, Prefix=f"{self.prefix}{below}"):
                found += [self._version(one, False) for one in page.get("Versions", ())]
                found += [self._version(one, True) for one in page.get("DeleteMarkers", ())]
        except _errors() as error:
            return [], f"cannot be seen ({error}); erase again with rights to list, read and remove versions"
        return found, ""

    def _version(self, one: Mapping[str, Any], is_marker: bool) -> _Version:
        key = str(one["Key"])
        return _Version(
            key.removeprefix(self.prefix), key, str(one["VersionId"]), bool(one["IsLatest"]), is_marker
        )

    def _abort_uploads(self) -> None:
        """End uploads in parts that a stopped writer left; their parts are in no listing of objects."""
        try:
            listed = self.client.list_multipart_uploads(Bucket=self.bucket, Prefix=self.prefix)
            uploads: Sequence[Mapping[str, Any]] = listed.get("Uploads", ())
            for one in uploads:
                self.client.abort_multipart_upload(
                    Bucket=self.bucket, Key=one["Key"], UploadId=one["UploadId"]
                )
        except _errors():
            return


Versions: TypeAlias = NoVersions | S3Versions


def _errors() -> tuple[type[Exception], ...]:
    from botocore.exceptions import (  # type: ignore[import-untyped]
        BotoCoreError,
        ClientError,
    )

    return BotoCoreError, ClientError
