"""An athlete is erased from a season for good: everything goes, a search proves it, and backups bring nothing back."""

from __future__ import annotations

import gzip
import io
import json
import shutil
import threading
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import season_support as support
from command_line import run
from oarlock import DataError
from oarlock.season import Admission, Athlete, NamesFile, Season, Setup, create_season, open_season
from oarlock.season.check import check
from oarlock.season.compact import compact
from oarlock.season.disk import Disk
from oarlock.season.entry import Entry
from oarlock.season.erase import Erasure, erase
from oarlock.season.erase_again import erase_again
from oarlock.season.exports import export_athlete
from oarlock.season.layout import CURRENT_FILE
from oarlock.season.run.job import Ended, Job, Reply
from oarlock.season.run.run_log import RunLog
from oarlock.season.search import search
from oarlock.season.tombstones import kept, new_tombstone
from oarlock.season.traces import Sought, traces_in

GONE, STAYS = "K7QMVA", "R9TWXB"
OWN = Setup(model=b'name = "sculler"\n', calibration=b"arm = 0.31\n")


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "state"


@pytest.fixture
def season(tmp_path: Path) -> Season:
    season = create_season(str(tmp_path / "season"), "club")
    filled(season, tmp_path)
    return season


def filled(season: Season, scratch: Path) -> dict[str, list[str]]:
    """Two athletes with two recordings each, with results and tables."""
    support.squad(season, GONE, STAYS)
    names: dict[str, list[str]] = {GONE: [], STAYS: []}
    for seed, athlete in enumerate((GONE, STAYS, GONE, STAYS)):
        recording = support.add_noise(season, athlete, seed)
        support.add_strokes(season, recording, scratch, seed, setup=OWN if athlete == GONE else support.SETUP)
        names[athlete].append(recording)
    compact(season)
    return names


def of(season: Season, athlete: str) -> list[str]:
    return [entry.recording for entry in season.entries(season.recordings()) if entry.athlete == athlete]


def gone(season: Season, names: tuple[str, ...] = ()) -> Erasure:
    return erase(season, GONE, names=names, dry_run=False)


def everything(folder: Path) -> bytes:
    return b"\n".join(str(file).encode() + file.read_bytes() for file in folder.rglob("*") if file.is_file())


def test_all_of_an_athlete_goes_and_nothing_of_others(season: Season, tmp_path: Path, state: Path) -> None:
    mine, others = of(season, GONE), of(season, STAYS)
    pinned = Season(**{**vars(season), "setup": {GONE: OWN.name}})
    season.place.write("season.toml", pinned.toml())
    for athlete in (GONE, STAYS):
        export_athlete(season, athlete, tmp_path / "exports")
    before = erase(pinned, GONE)
    assert before.removed == {"recordings": 2, "results": 2, "rows": 10, "exports": 1}
    assert sorted(of(season, GONE)) == sorted(mine)
    found = gone(pinned)
    assert (found.is_proven, found.left, found.elsewhere) == (True, [], [])
    assert found.removed["setups"] == 1
    assert not (tmp_path / "exports" / GONE).exists()
    assert (tmp_path / "exports" / STAYS / "strokes.csv").exists()
    text = everything(tmp_path / "season") + everything(state)
    assert not any(name.encode() in text for name in (GONE, *mine, OWN.name))
    assert sorted(season.recordings()) == sorted(others)
    assert check(open_season(str(tmp_path / "season"))) == []
    tombstone = (tmp_path / "season" / new_tombstone(season, GONE).file).read_text()
    assert "recordings = 2" in tombstone
    with pytest.raises(DataError, match="was erased from this season"):
        support.add_noise(season, GONE, 7)
    with pytest.raises(DataError, match="was erased from this season"):
        season.put_athlete(Athlete(GONE))
    assert gone(season).is_proven  # once more does no harm
    assert f"recordings = {len(mine)}" in (tmp_path / "season" / new_tombstone(season, GONE).file).read_text()


def table(values: list[str], **options: object) -> bytes:
    out = io.BytesIO()
    parquet.write_table(
        pa.table({"number": np.arange(len(values)), "text": values}),
        out,
        **{"write_statistics": False, **options},
    )
    return out.getvalue()


def zipped(contents: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("inner.txt", contents)
    return out.getvalue()


def metadata(where: str) -> bytes:
    """The pseudonym in the metadata of a schema or of a field, which Arrow writes in Base64."""
    field = pa.field("x", pa.int32(), metadata={"by": GONE} if where == "field" else None)
    schema = pa.schema([field], metadata={"by": GONE} if where == "schema" else None)
    out = io.BytesIO()
    parquet.write_table(pa.table({"x": [1]}, schema), out)
    return out.getvalue()


def unused_word() -> bytes:
    """A dictionary with a word that no row has, in a compressed page."""
    words = pa.DictionaryArray.from_arrays(pa.array([0, 1, 0], pa.int32()), ["boat", "seat", *FILLER, GONE])
    out = io.BytesIO()
    parquet.write_table(pa.table({"text": words}), out, compression="snappy")
    return out.getvalue()


def orphan(before: bytes = b"") -> bytes:
    """A Parquet file with pages that its footer does not name, between its start and its first column."""
    hidden = table([GONE, *FILLER] * 3, compression="zstd")
    column = parquet.ParquetFile(io.BytesIO(hidden)).metadata.row_group(0).column(1)
    first = column.dictionary_page_offset
    planted = hidden[first : first + column.total_compressed_size]
    clean = parquet.ParquetFile(io.BytesIO(table(FILLER))).read()
    out = io.BytesIO()
    with parquet.ParquetWriter(out, clean.schema) as writer:
        writer.write_table(clean)
        out.write(before + planted)
    return out.getvalue()


FILLER = [f"word {k}" for k in range(50)]
VALUES = [*FILLER, GONE, *FILLER]
PLANTED = {
    **{
        f"a column by {codec}": table(VALUES, compression=codec)
        for codec in ("snappy", "gzip", "zstd", "brotli", "lz4")
    },
    "a column of pages of version 2": table(VALUES, compression="zstd", data_page_version="2.0"),
    "a column of differences": table(
        VALUES,
        compression="zstd",
        use_dictionary=False,
        column_encoding={"text": "DELTA_BYTE_ARRAY", "number": "PLAIN"},
    ),
    "a column of lists": table([["a", GONE]], compression="zstd"),  # type: ignore[list-item]
    "a word of a dictionary": unused_word(),
    "metadata of the schema": metadata("schema"),
    "metadata of a field": metadata("field"),
    "pages that nothing names": orphan(),
    "pages behind something else": orphan(b"something else"),
    "gzip": gzip.compress(f"by {GONE}".encode()),
    "zip in gzip": gzip.compress(zipped(GONE.encode())),
    "Parquet in zip": zipped(table(VALUES, compression="zstd")),
    "UTF-16": GONE.encode("utf-16"),
    "JSON": json.dumps({"name": "Änne Müster"}).encode(),
    "a name in capitals": "ÄNNE MÜSTER".encode(),
    "a name turned round": "müster, änne".encode("latin-1"),
}


@pytest.mark.parametrize("kind", PLANTED)
def test_a_residue_is_found_wherever_it_is(kind: str) -> None:
    contents = PLANTED[kind]
    sought = Sought.of(GONE, (), ["Änne Müster"])
    if kind in (
        "a column by gzip",
        "a column by zstd",
        "a column by brotli",
        "pages that nothing names",
        "zip in gzip",
    ):
        assert GONE.encode() not in contents
    assert any(not one.is_unsearched for one in traces_in("x", contents, sought)), kind
    others = Sought.of("ZZ9ZZ9", ["0" * 20], ["Bertha Beispiel"])
    assert traces_in("x", contents, others) == []


def test_empty_tables_are_searched() -> None:
    for options in ({}, {"compression": "zstd"}, {"use_dictionary": False}):
        assert traces_in("x", table([], **options), Sought.of(GONE)) == []


def test_short_names_are_sought_as_words() -> None:
    sought = Sought.of(GONE, (), ["Li"])
    assert traces_in("x", b"rowed with Li today", sought)
    assert not traces_in("x", b"limits of the list", sought)


def test_names_of_recordings_are_found_in_longer_digits_and_large_files() -> None:
    name = "0123456789abcdef0123"
    sought = Sought.of(GONE, [name])
    noise = np.random.default_rng(1).bytes(200_000)
    assert traces_in("x", noise, sought) == []
    for at in range(7):
        assert traces_in("x", noise[: 99_000 + at] + b"ff" + name.encode() + noise, sought)


def test_many_files_are_searched_by_several_processes(
    season: Season, monkeypatch: pytest.MonkeyPatch
) -> None:
    sought = Sought.of(GONE, of(season, GONE))
    expected = search(season.place, sought)
    monkeypatch.setattr("oarlock.season.search._MANY", 1)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    assert search(season.place, sought) == expected
    assert {one.what for one in expected} == {"the pseudonym", "the name of a recording"}


def test_what_cannot_be_removed_without_loss_is_named_and_the_erasure_not_proven(
    season: Season, tmp_path: Path
) -> None:
    other = of(season, STAYS)[0]
    place = tmp_path / "season"
    (place / "recordings" / other / "extra.parquet").write_bytes(table(VALUES, compression="zstd"))
    (place / "forgotten.parquet").write_bytes(PLANTED["a word of a dictionary"])
    (place / "broken.parquet").write_bytes(b"PAR1 is not enough")
    shown = run("season", "erase", place, "--athlete", GONE, "--yes", status=1).stdout
    assert f"recordings/{other}/extra.parquet: column text: the pseudonym" in " ".join(shown.split())
    assert "forgotten.parquet: page of column text: the pseudonym" in " ".join(shown.split())
    assert "broken.parquet: its contents: cannot be decoded" in " ".join(shown.split())
    assert "not proven" in shown
    for name in ("forgotten.parquet", "broken.parquet", f"recordings/{other}/extra.parquet"):
        (place / name).unlink()
    assert gone(season).is_proven


def test_notes_of_others_and_logs_are_cleared(season: Season, tmp_path: Path) -> None:
    mine = of(season, GONE)
    with_note = Admission(season, STAYS).add_recording(
        support.noise(9), {"note": f"with {GONE} and Anna Muster", "boat": "Anna Muster"}
    )
    compact(season)
    lines = [f'{{"recording": "{mine[0]}"}}\n', '{"recording": "other"}\n']
    season.place.write("logs/run.jsonl", "".join(lines).encode())
    season.place.write(".new/abc/x.parquet", table(VALUES, compression="zstd"))
    season.place.write(
        f"results/{with_note.entry.recording}.ff/strokes.parquet", table(VALUES, compression="zstd")
    )
    season.place.write("tables/strokes/month=2026-03/old.parquet", table(VALUES, compression="zstd"))
    found = gone(season, ("Anna Muster",))
    assert found.left == []
    assert found.is_proven
    assert {one.file.split("/")[0] for one in found.cleared} == {
        "recordings",
        "logs",
        ".new",
        "results",
        "tables",  # the boat is a column
    }
    assert season.place.read("logs/run.jsonl") == lines[1].encode()
    entry = season.entry(with_note.entry.recording)
    assert entry is not None
    assert entry.session["note"] == "with [erased] and [erased]"
    assert check(season) == []
    text = everything(tmp_path / "season")
    assert GONE.encode() not in text
    assert not search(season.place, Sought.of(GONE, mine, ["Anna Muster"]))


def test_a_restored_backup_is_erased_again(season: Season, tmp_path: Path, state: Path) -> None:
    place, backup, list_ = tmp_path / "season", tmp_path / "backup", tmp_path / "tombstones.toml"
    shutil.copytree(place, backup)
    erase(season, GONE, tombstones=list_, dry_run=False)

    def restored() -> Season:
        shutil.rmtree(place)
        shutil.copytree(backup, place)
        return open_season(str(place))

    back = {one.name.split("/")[0] for one in check(restored())}
    assert back == {"erased", "recordings", "athletes", "tables"}
    assert [one.athlete for one in erase_again(restored(), thorough=True)] == [GONE]
    assert check(season) == []
    restored()
    Admission(season, STAYS)  # any writer
    assert check(season) == []
    compacted = restored()
    compact(compacted)
    assert {one.name.split("/")[0] for one in check(compacted)} == {"recordings", "athletes"}
    shutil.rmtree(state)  # another machine, which has the file only
    assert check(restored()) == []
    assert {one.what for one in check(season, tombstones=list_)} == {"erased"}
    run("season", "check", place, "--tombstones", list_, status=1)
    run("season", "erase", place, "--again", "--tombstones", list_, "--yes")
    assert check(season, tombstones=list_) == []
    assert len(kept(season)) == 1
    next(state.rglob("*.toml")).write_text("damaged")
    assert {one.what for one in check(restored())} == {"erased"}


def test_an_add_that_began_before_the_erasure_does_not_win(
    season: Season, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = Admission(season, GONE)
    put = season.place.put_folder

    def late(*args: object) -> bool:
        if threading.current_thread() is writer:
            assert gone(season).is_proven
        return put(*args)  # type: ignore[arg-type]

    writer = threading.current_thread()
    monkeypatch.setattr(season.place, "put_folder", late)
    with pytest.raises(DataError, match="was erased from this season while"):
        slow.add_recording(support.noise(50), {})
    assert of(season, GONE) == []
    assert check(season) == []


def test_a_result_that_comes_late_is_not_stored(season: Season, tmp_path: Path) -> None:
    late = of(season, GONE)[0]
    gone(season)
    support.add_strokes(season, late, tmp_path, 3, "0.2.0", OWN)
    assert all(recording != late for recording, _ in season.results())


def test_a_compaction_that_began_before_the_erasure_does_not_win(
    season: Season, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    support.add_strokes(season, of(season, STAYS)[0], tmp_path, 9, "0.2.0")
    support.add_strokes(season, of(season, GONE)[0], tmp_path, 9, "0.2.0")
    from oarlock.season import compact as module

    write, is_late = season.place.write, [True]

    def late(name: str, contents: bytes) -> None:
        if name == CURRENT_FILE and is_late.pop() if is_late else False:
            assert gone(season).is_proven
        write(name, contents)

    monkeypatch.setattr(season.place, "write", late)
    compact(season)
    assert not is_late
    assert check(season) == []
    assert search(season.place, Sought.of(GONE)) == []
    assert module.Current.read(season).files


def test_an_erasure_that_was_interrupted_still_knows_what_to_search(
    season: Season, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = of(season, GONE)
    season.place.write("logs/run.log", f"{mine[0]} took 2 s\n".encode())
    with monkeypatch.context() as patch:
        patch.setattr("oarlock.season.erase.search", lambda *args: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            gone(season)
    assert of(season, GONE) == []
    assert [one.file for one in gone(season).cleared] == ["logs/run.log"]
    assert season.place.read("logs/run.log") == b""


@pytest.mark.parametrize("written", [0, 1])
def test_a_redaction_that_was_interrupted_is_completed(
    season: Season, monkeypatch: pytest.MonkeyPatch, written: int
) -> None:
    """Whichever of its two files is written, the next erasure leaves a season whose hashes are right."""
    Admission(season, STAYS).add_recording(support.noise(9), {"note": f"with {GONE}"})
    real, count = type(season.place).write, 0

    def interrupted(place: Disk, name: str, contents: bytes) -> None:
        nonlocal count
        if name.startswith("recordings/"):
            count += 1
            if count > written:
                raise KeyboardInterrupt
        real(place, name, contents)

    with monkeypatch.context() as patch:
        patch.setattr(type(season.place), "write", interrupted)
        with pytest.raises(KeyboardInterrupt):
            gone(season)
    assert count == written + 1
    assert gone(season).is_proven
    assert check(season) == []


def test_a_run_that_ends_after_an_erasure_logs_nothing_of_it(
    season: Season, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine, other = of(season, GONE)[0], of(season, STAYS)[0]
    log = RunLog(season)
    for recording in (mine, other):
        log.ended(Ended(Job("", recording, "", "ff", (), 1.0, 1.0), Reply("done"), "host", 1, 0.5))
    real = type(season.place).write

    def erased_meanwhile(place: Disk, name: str, contents: bytes) -> None:
        """The erasure ends between the log's look at what is there and its writing."""
        monkeypatch.setattr(type(season.place), "write", real)
        assert gone(season).is_proven
        real(place, name, contents)

    monkeypatch.setattr(type(season.place), "write", erased_meanwhile)
    log.write()
    text = season.place.read(log.name).decode()
    assert other in text
    assert mine not in text


def test_exports_elsewhere_are_named(season: Season, tmp_path: Path) -> None:
    for name in ("moved", "kept"):
        export_athlete(season, GONE, tmp_path / name)
    shutil.rmtree(tmp_path / "moved")
    (tmp_path / "kept" / GONE / "mine.txt").write_text("x")
    assert [words.split(": ", 1)[1] for words in sorted(gone(season).elsewhere)] == [
        "contains files that were not exported; look at them",
        "an export that was moved or removed; if it was moved, remove it there",
    ]
    assert [file.name for file in (tmp_path / "kept" / GONE).rglob("*")] == ["mine.txt"]


def test_the_command(season: Season, tmp_path: Path) -> None:
    names = NamesFile(tmp_path / "names.toml", {"Anna Muster": GONE, "Bert Best": STAYS})
    names.write()
    place = tmp_path / "season"
    assert "Would erase" in run("season", "erase", place, "--athlete", GONE, "--dry-run").stdout
    run("season", "erase", place, "--athlete", GONE, status=2)
    run("season", "erase", place, "--athlete", "NOBODY", "--yes", status=1)
    shown = run("season", "erase", place, "--athlete", GONE, "--names", names.path, "--yes").stdout
    assert f"nothing of {GONE} is left" in shown
    assert f"Removed the name from {names.path}" in " ".join(shown.split())
    assert NamesFile.read(names.path).pseudonyms == {"Bert Best": STAYS}
    assert "Nobody who was erased" in run("season", "erase", place, "--again", "--yes").stdout


def test_an_unfinished_recording_is_erased_too(season: Season, tmp_path: Path) -> None:
    one = of(season, GONE)[0]
    entry = season.entry(one)
    assert isinstance(entry, Entry)
    season.place.remove([f"recordings/{one}/entry.toml"])
    assert gone(season).is_proven
    assert not (tmp_path / "season/recordings" / one).exists()
