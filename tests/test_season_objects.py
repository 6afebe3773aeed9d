"""Seasons in every kind of place: long listings, writers at once, former versions of objects, errors, full disks."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import season_places
import season_support as support
from oarlock import DataError
from oarlock.season import Admission, Season, create_season, open_season
from oarlock.season.erase import erase
from oarlock.season.exports import export_athlete
from oarlock.season.object_storage import open_storage
from oarlock.season.tables import update_tables
from oarlock.season.upkeep import check

for _package in ("obstore", "moto", "boto3"):
    pytest.importorskip(_package)
GONE, STAYS = "K7QMVA", "R9TWXB"


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_listings_of_several_pages_are_whole(season_address: str) -> None:
    place = open_storage(season_address)
    count = 2 * int(season_places.PAGE) + 3
    names = [f"many/{k:03d}/x" for k in range(count)]
    for name in names:
        place.write(name, b"x")
    place.write("many.txt", b"")
    assert place.children("many") == [f"{k:03d}" for k in range(count)]
    assert sorted(name for name, _ in place.files("many")) == names
    assert place.children("") == ["many", "many.txt"]
    assert list(place.files("none")) == place.children("none") == []
    place.remove(["many/none", *names[:-1], "none"])
    assert [name for name, _ in place.files("many")] == names[-1:]


def test_folders_that_are_stored_at_once_are_whole(season_address: str) -> None:
    """Each of several writers has contents of its own; those of one of them are there."""
    place = open_storage(season_address)
    for round_ in range(4):
        folder = f"recordings/{round_}"
        files = [
            {"a": b"same", "b": bytes([k]) * 9, "c": bytes([k]) * 9, "entry": bytes([k])} for k in range(4)
        ]
        with ThreadPoolExecutor(4) as pool:
            new = list(pool.map(lambda own: place.put_folder(folder, own, "entry"), files))  # noqa: B023
        assert sum(new) == 1
        found = {name: place.read(f"{folder}/{name}") for name in "abc"}
        own = files[place.read(f"{folder}/entry")[0]]
        assert found == {name: own[name] for name in "abc"}


def test_files_of_a_stopped_writer_are_written_over(
    season_address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("oarlock.season.storage._OTHER_WRITER_S", -1.0)
    place = open_storage(season_address)
    place.write("recordings/one/a", b"left")
    assert place.put_folder("recordings/one", {"a": b"new", "entry": b"x"}, "entry")
    assert place.read("recordings/one/a") == b"new"


def test_an_endpoint_that_is_not_there_and_a_bucket_that_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    season_places.use_server(monkeypatch)
    with pytest.raises(DataError, match="there is no such bucket"):
        create_season("s3://nobodys/season", "club")
    monkeypatch.setattr("oarlock.season.object_storage._RETRIES", 0)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(DataError, match=r"cannot be reached; look at the network and AWS_ENDPOINT_URL"):
        open_season("s3://nobodys/season")
    with pytest.raises(DataError, match="cannot be reached"):
        list(open_storage("s3://nobodys/season").files())


def filled(address: str, scratch: Path) -> tuple[Season, dict[str, list[str]]]:
    season = create_season(address, "club")
    support.squad(season, GONE, STAYS)
    names: dict[str, list[str]] = {GONE: [], STAYS: []}
    for seed, athlete in enumerate((GONE, STAYS, GONE)):
        names[athlete].append(support.add_noise(season, athlete, seed))
        support.add_strokes(season, names[athlete][-1], scratch, seed)
        update_tables(season)
    return season, names


def test_an_athlete_is_erased_in_every_kind_of_place(season_address: str, tmp_path: Path) -> None:
    season, names = filled(season_address, tmp_path)
    export_athlete(season, GONE, tmp_path / "out")
    found = erase(season, GONE, dry_run=False)
    if not season.place.on_disk(f"athlete={STAYS}/strokes.parquet").is_relative_to(tmp_path / "season"):
        assert found.removed["copies in the cache"] >= 1
    assert (found.left, found.elsewhere) == ([], [])
    assert found.is_proven
    assert season.recordings() == dict.fromkeys(names[STAYS], STAYS)
    assert check(season) == []
    assert not (tmp_path / "out" / GONE).exists()
    cached = [file for file in (tmp_path / "cache").rglob("*") if file.is_file()]
    assert not any(GONE.encode() in str(file).encode() + file.read_bytes() for file in cached)


def objects(client: Any, bucket: str) -> list[tuple[str, bytes]]:
    """Key and contents of every version."""
    found = []
    for page in client.get_paginator("list_object_versions").paginate(Bucket=bucket):
        found += [(one["Key"], b"") for one in page.get("DeleteMarkers", ())]
        for one in page.get("Versions", ()):
            body = client.get_object(Bucket=bucket, Key=one["Key"], VersionId=one["VersionId"])["Body"]
            found.append((one["Key"], body.read()))
    return found


def test_former_versions_are_erased(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    client, bucket = season_places.new_bucket(monkeypatch, versions=True)
    season, names = filled(f"s3://{bucket}/club", tmp_path)
    former = support.add_noise(season, GONE, 77)  # removed before: only its former versions are there
    season.place.remove_folder(f"athlete={GONE}/recordings/{former}", "entry.toml")
    client.put_object(Bucket=bucket, Key="other/season", Body=b"not ours")
    found = erase(season, GONE, dry_run=False)
    assert found.left == []
    assert found.is_proven
    assert found.removed["object versions"] > 20
    everything = objects(client, bucket)
    sought = (GONE, *names[GONE], former)
    assert not [
        key
        for key, contents in everything
        if any(name.encode() in key.encode() + contents for name in sought)
    ]
    assert ("other/season", b"not ours") in everything
    assert season.recordings() == dict.fromkeys(names[STAYS], STAYS)
    assert check(season) == []


def test_versions_that_cannot_be_seen_are_said_to_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, bucket = season_places.new_bucket(monkeypatch)
    season, _ = filled(f"s3://{bucket}/club", tmp_path)
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "boto3", None)
        found = erase(season, GONE, dry_run=False)
    assert not found.is_proven
    assert [one.split(": ", 1)[1].split("versions ")[1] for one in found.left] == [
        'cannot be seen without boto3: pip install "oarlock[s3]", then erase again'
    ]

    def refused(*args: object, **named: object) -> object:
        from botocore.exceptions import ClientError

        raise ClientError({"Error": {"Code": "AccessDenied", "Message": "no"}}, "ListObjectVersions")

    class Refuses:
        get_paginator = list_multipart_uploads = refused

    import boto3

    filled_again, _ = filled(f"s3://{bucket}/other", tmp_path)
    monkeypatch.setattr(boto3, "client", lambda *_, **__: Refuses())
    refusal = erase(filled_again, GONE, dry_run=False)
    assert not refusal.is_proven
    assert "AccessDenied" in refusal.left[0]


def test_another_machine_forgets_its_copies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, bucket = season_places.new_bucket(monkeypatch)
    season, _ = filled(f"s3://{bucket}/club", tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "elsewhere"))
    update_tables(season)

    def copies() -> set[str]:
        return {file.parent.name for file in (tmp_path / "elsewhere").rglob("*.parquet")}

    season.place.on_disk(f"athlete={GONE}/strokes.parquet")
    season.place.on_disk(f"athlete={STAYS}/strokes.parquet")
    assert copies() == {f"athlete={GONE}", f"athlete={STAYS}"}
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    erase(season, GONE, dry_run=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "elsewhere"))
    update_tables(season)
    assert copies() == {f"athlete={STAYS}"}


_FILLER = """
import sys, resource
sys.path.insert(0, {tests!r})
import season_support as support
from pathlib import Path
from oarlock import DataError
from oarlock.season import Admission, create_season
from oarlock.season.upkeep import check
from oarlock.season.tables import update_tables
season = create_season({season!r}, "club")
support.squad(season, "AAAAAA")
limit = {limit!r}
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
for seed in range(500):
    try:
        noise = support.noise(seed, seconds=0.4 * (seed + 1))
        name = Admission(season, "AAAAAA").add_recording(noise, {{}}).entry.recording
        support.add_strokes(season, name, Path({scratch!r}), seed)
        update_tables(season)
    except DataError as error:
        print(error)
        break
print(len(season.recordings()), [one.what for one in check(season) if one.is_damage])
"""


@pytest.mark.parametrize("how", ["a small disk", "a limit on files"])
def test_a_full_disk_is_an_error_and_the_season_in_order(how: str, tmp_path: Path) -> None:
    place = tmp_path / "disk"
    place.mkdir()
    limit = 0 if how == "a small disk" else 9_000
    code = _FILLER.format(
        tests=str(Path(__file__).parent), season=str(place / "season"), scratch=str(tmp_path), limit=limit
    )
    command = [sys.executable, "-c", code]
    if how == "a small disk":
        if os.getuid() != 0 or shutil.which("unshare") is None:
            pytest.skip("only root can mount a small disk")
        # The disk is gone with the process, whenever it ends.
        mount = f'mount -t tmpfs -o size=400k tmpfs "{place}" && exec "$@"'
        command = ["unshare", "--mount", "sh", "-c", mount, "sh", *command]
    done = subprocess.run(command, capture_output=True, text=True)
    if "unshare" in done.stderr or "mount" in done.stderr:
        pytest.skip(f"no small disk here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    words, counts = done.stdout.splitlines()
    assert "cannot be written (" in words
    assert ("Free some space" in words) if limit == 0 else ("limit on file sizes" in words)
    assert counts.endswith(" []")
    if limit == 0:
        assert not counts.startswith("0 ")
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 9_000


def test_two_admissions_and_updates_of_tables_at_once(season_address: str, tmp_path: Path) -> None:
    season = create_season(season_address, "club")
    support.squad(season, GONE, STAYS)

    def add(athlete: str, first: int) -> None:
        admission = Admission(season, athlete)
        for seed in range(first, first + 8):
            one = admission.add_recording(support.noise(seed), {}).entry.recording
            support.add_strokes(season, one, tmp_path, seed)

    with ThreadPoolExecutor(4) as pool:
        jobs = [pool.submit(add, GONE, 0), pool.submit(add, STAYS, 100), pool.submit(add, STAYS, 104)]
        jobs += [pool.submit(update_tables, season) for _ in range(3)]
        for job in jobs:
            job.result()
    assert len(season.recordings()) == 20
    update_tables(season)
    assert check(season) == []
    from oarlock.season import season_summary

    assert season_summary(season).counts["strokes"] == 100
