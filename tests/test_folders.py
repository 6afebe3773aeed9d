"""Folders cannot lie: what is read is what was written as a whole, and nothing of others is replaced."""

from __future__ import annotations

import fcntl
import os
import resource
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import oarlock
from oarlock import DataError, ModelError
from oarlock.cli import app
from oarlock.evaluation.study.rows import write_rows
from oarlock.formats.csv import read_csv
from oarlock.formats.datasets.broad import read_broad
from oarlock.formats.devices.apdm import read_apdm
from oarlock.formats.devices.dot import read_dot
from oarlock.formats.devices.mtmanager import read_mtmanager
from oarlock.formats.devices.mvnx import read_mvnx
from oarlock.formats.devices.shimmer import read_shimmer
from oarlock.formats.devices.sto import read_sto
from oarlock.model.load import load_model
from oarlock.model.shipped_files import model_path
from oarlock.recording.streams import ImuStream, ScalarStream
from oarlock.rowing import SIMULATORS, load_stroke_export
from oarlock.storage import folder_writer
from oarlock.storage.folder_writer import MANIFEST, read_manifest, replaced_folder
from oarlock.storage.names import LONGEST_NAME, file_names
from oarlock.storage.write_file import sync

TIME_S = np.arange(5) / 100.0


def run(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="oarlock")
    return done.exit_code, done.output


def recording(*values: float, name: str = "seat") -> oarlock.Recording:
    return oarlock.Recording(
        [ScalarStream(name if k == 0 else f"{name}{k}", TIME_S, v + TIME_S) for k, v in enumerate(values)]
    )


def load_study(file: Path) -> object:
    return oarlock.studies.load_study(file, SIMULATORS)


def value_of(folder: Path, name: str = "seat") -> float:
    return float(oarlock.load_recording(folder)[name].value[0])


@pytest.fixture(scope="module")
def swung() -> tuple[oarlock.Recording, oarlock.Track]:
    model = oarlock.load_model("pendulum3")
    time_s = np.linspace(0.0, 2.0, 201)
    motion = oarlock.simulation.Motion(
        tuple(model.joint_names), time_s, 0.5 * np.sin(np.outer(time_s, [2.0, 3.0, 4.0]))
    )
    measured = oarlock.simulate(model, motion, seed=1)[1]
    return measured, oarlock.track(model, measured)


@pytest.fixture
def tracked(swung: tuple[oarlock.Recording, oarlock.Track], tmp_path: Path) -> Path:
    swung[0].save(tmp_path / "rec")
    swung[1].save(tmp_path / "out")
    return tmp_path / "out"


# --- names --------------------------------------------------------------------------------------------


def test_streams_with_similar_names_have_files_of_their_own(tmp_path: Path) -> None:
    names = [
        "a_b_3",
        "a b",
        "a/b",
        "a%20b",
        "A B",
        "Rücken",
        "Ru\u0308cken",
        "..",
        ".x",
        "con",
        "x" * 80,
        "é" * 80,
    ]
    given = oarlock.Recording([ScalarStream(n, TIME_S, TIME_S + k) for k, n in enumerate(names)])
    given.save(tmp_path / "rec")
    found = oarlock.load_recording(tmp_path / "rec")
    assert [(s.name, s.value[0]) for s in found] == [(n, float(k)) for k, n in enumerate(names)]
    files = [file.name for file in (tmp_path / "rec").iterdir()]
    assert len({name.casefold() for name in files}) == len(names) + 2
    assert all(name.isascii() and len(name) < 200 for name in files)


def test_capitals_get_a_number_that_no_name_has() -> None:
    assert file_names(["Back", "back", "back~2", "BACK"], "csv") == [
        "Back.csv",
        "back~2.csv",
        "back%7E2.csv",
        "BACK~3.csv",
    ]


def test_names_have_a_length(tmp_path: Path) -> None:
    assert oarlock.Recording([ScalarStream("x" * LONGEST_NAME, TIME_S, TIME_S)]).names
    with pytest.raises(DataError, match=r'stream "x{24}\.\.\.": the name has 10000 characters; at most 80'):
        ScalarStream("x" * 10_000, TIME_S, TIME_S)
    text = Path(model_path("pendulum3")).read_text(encoding="utf-8")
    (tmp_path / "long.toml").write_text(text.replace('"upper"', f'"{"u" * 10_000}"'), encoding="utf-8")
    with pytest.raises(ModelError, match=r"the name has 10000 characters; at most 80") as caught:
        oarlock.load_model(tmp_path / "long.toml")
    assert len(str(caught.value)) < 3000
    with pytest.raises(DataError, match=r"study, scenario .* at most 80"):
        oarlock.studies.Study(
            oarlock.load_model("sculler"), SIMULATORS["sculling"], scenarios={"s" * 300: {}}
        )


def test_half_a_character_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="half of a character"):
        ScalarStream("\ud800", TIME_S, TIME_S)
    recording(1.0).save(tmp_path)
    with pytest.raises(DataError, match="half of a character"):
        oarlock.Recording(recording(2.0), {"athlete": "\udfff"}).save(tmp_path)
    assert value_of(tmp_path) == 1.0


# --- as a whole -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "meta", [{"rig": None}, {"rig": {"pins": [1.0, None]}}, {"note": "\ud83d"}, {"f": print}]
)
def test_a_save_that_fails_leaves_the_old_recording(tmp_path: Path, meta: dict[str, object]) -> None:
    recording(1.0).save(tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(DataError):
        oarlock.Recording(recording(2.0), meta).save(tmp_path)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_what_the_old_recording_had_alone_is_gone(tmp_path: Path) -> None:
    recording(1.0, 2.0).save(tmp_path)
    recording(3.0).save(tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {"recording.toml", "seat.parquet", MANIFEST}
    assert value_of(tmp_path) == 3.0


def test_a_new_folder_that_failed_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="rig"):
        oarlock.Recording(recording(2.0), {"rig": None}).save(tmp_path / "rec")
    with pytest.raises(RuntimeError), replaced_folder(tmp_path / "other", "track") as stage:
        (stage / "half").write_text("x")
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_changed_file_is_named(tmp_path: Path, tracked: Path) -> None:
    recording(1.0, 2.0).save(tmp_path / "a")
    recording(5.0, 6.0).save(tmp_path / "b")
    (tmp_path / "a/seat1.parquet").write_bytes((tmp_path / "b/seat1.parquet").read_bytes())
    with pytest.raises(DataError, match=r"a/seat1\.parquet: is not the file that was written here") as caught:
        oarlock.load_recording(tmp_path / "a")
    assert "remove its line" in str(caught.value)
    manifest = tmp_path / "a" / MANIFEST
    lines = manifest.read_text(encoding="utf-8").splitlines(keepends=True)
    manifest.write_text("".join(line for line in lines if "seat1" not in line), encoding="utf-8")
    assert value_of(tmp_path / "a", "seat1") == 6.0
    run_file = tracked / "run.toml"
    run_file.write_text(run_file.read_text(encoding="utf-8").replace("smoothed = false", "smoothed = true"))
    with pytest.raises(DataError, match=r"run\.toml: is not the file"):
        oarlock.load_track(tracked)


def test_tables_of_two_tracks_are_refused(
    tmp_path: Path, swung: tuple[oarlock.Recording, oarlock.Track]
) -> None:
    measured, track = swung
    track.save(tmp_path / "one")
    oarlock.track(oarlock.load_model("pendulum3"), measured.slice(end_s=1.0)).save(tmp_path / "two")
    (tmp_path / "one/sensors.parquet").write_bytes((tmp_path / "two/sensors.parquet").read_bytes())
    with pytest.raises(DataError, match=r"sensors\.parquet: is not the file"):
        oarlock.load_track(tmp_path / "one")


def test_folders_without_a_manifest_are_read_and_not_replaced(tmp_path: Path) -> None:
    recording(1.0).save(tmp_path)
    (tmp_path / MANIFEST).unlink()
    assert value_of(tmp_path) == 1.0
    with pytest.raises(DataError, match=r"(?s)no manifest says.*force"):
        recording(2.0).save(tmp_path)
    assert value_of(tmp_path) == 1.0
    recording(2.0).save(tmp_path, force=True)
    assert value_of(tmp_path) == 2.0


KILLED = """
import itertools, os, shutil, signal, sys
from pathlib import Path
import oarlock
load = getattr(oarlock, sys.argv[1])
os.fsync = lambda number: None  # a kill takes nothing from the system's cache
old, new, folder = map(Path, sys.argv[2:])

def contents(place):
    return {file.relative_to(place).as_posix(): file.read_bytes() for file in place.rglob("*") if file.is_file()}

def kill_at(number):
    def counted(plain):
        def call(*values, **keys):
            if next(calls) == number:
                os.kill(os.getpid(), signal.SIGKILL)
            return plain(*values, **keys)
        return call
    calls = itertools.count()
    for name in ("mkdir", "rename", "replace", "unlink", "rmdir", "fsync"):
        setattr(os, name, counted(getattr(os, name)))

mine = {name: (old / name).read_bytes() for name in ("notes.txt", "data/notes.txt")}
states = [contents(old), contents(new) | mine]
saved, seen = load(new), []
for number in itertools.count():
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(old, folder)
    child = os.fork()
    if child == 0:
        kill_at(number)
        saved.save(folder)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    load(folder)
    there = {name: text for name, text in contents(folder).items() if not name.startswith(".oarlock/")}
    seen.append(states.index(there))
    load(folder).save(folder)
    assert not (folder / ".oarlock").exists(), number
    if status == 0:
        break
assert seen == sorted(seen), seen
print(seen.count(0), seen.count(1))
"""


@pytest.mark.parametrize("load", ["load_recording", "load_track"])
def test_killed_at_each_call_it_is_the_old_or_the_new_one(
    tmp_path: Path, load: str, swung: tuple[oarlock.Recording, oarlock.Track]
) -> None:
    if load == "load_recording":
        recording(1.0, 2.0).save(tmp_path / "old")
        recording(3.0, 4.0, 5.0).save(tmp_path / "new")
    else:
        swung[1].save(tmp_path / "old")
        truth = replace(swung[1], info=None, beliefs=None)
        truth.save(tmp_path / "new")
    (tmp_path / "old/data").mkdir()
    for name in ("notes.txt", "data/notes.txt"):
        (tmp_path / "old" / name).write_text("mine")
    done = subprocess.run(
        [
            sys.executable,
            "-W",
            "ignore",
            "-c",
            KILLED,
            load,
            *(tmp_path / name for name in ("old", "new", "rec")),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    before, after = map(int, done.stdout.split())
    assert before > 10 and after > 10


def failing(monkeypatch: pytest.MonkeyPatch, name: str, is_it: Callable[[object], bool]) -> None:
    """Lets the next call of a function of `os` that is it fail."""
    whole, failures = getattr(os, name), [1]

    def called(what: object, *given: object, **keys: object) -> object:
        if failures and is_it(what):
            failures.pop()
            raise OSError(5, "made to fail")
        return whole(what, *given, **keys)

    monkeypatch.setattr(os, name, called)


def test_a_removal_that_fails_leaves_the_new_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing(monkeypatch, "rmdir", lambda what: what == "tree")
    recording(1.0).save(tmp_path / "rec")
    assert value_of(tmp_path / "rec") == 1.0
    recording(2.0).save(tmp_path / "rec")
    assert value_of(tmp_path / "rec") == 2.0 and not (tmp_path / "rec" / ".oarlock").exists()


def test_files_that_cannot_be_moved_wait_for_the_next_reader(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording(1.0).save(tmp_path)
    failing(monkeypatch, "replace", lambda what: True)
    with pytest.raises(DataError, match=r"the new files are complete in .* \(made to fail\)"):
        recording(2.0).save(tmp_path)
    assert value_of(tmp_path) == 2.0 and not (tmp_path / ".oarlock").exists()


def test_a_lock_that_fails_is_free_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    failing(monkeypatch, "fstat", lambda what: True)
    with pytest.raises(DataError, match="made to fail"):
        recording(1.0).save(tmp_path / "rec")
    recording(2.0).save(tmp_path / "rec")
    assert value_of(tmp_path / "rec") == 2.0


def test_where_an_open_file_cannot_be_removed_the_lock_is_closed_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = Path.unlink

    def unlink(file: Path, missing_ok: bool = False) -> None:
        if file.name == "lock":  # an OSError if it is still locked, as Windows has it of a file that is open
            with file.open() as other:
                fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        plain(file, missing_ok)

    monkeypatch.setattr(Path, "unlink", unlink)
    monkeypatch.setattr(folder_writer, "OPEN_FILES_STAY", True)
    with replaced_folder(tmp_path / "rec", "recording"):
        pass
    assert {file.name for file in (tmp_path / "rec").iterdir()} == {MANIFEST}


def test_files_are_flushed_to_the_disk_itself_where_that_is_another_call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, int]] = []
    monkeypatch.setattr(fcntl, "F_FULLFSYNC", 51, raising=False)
    monkeypatch.setattr(fcntl, "fcntl", lambda number, what: calls.append(("full", what)))
    monkeypatch.setattr(os, "fsync", lambda number: calls.append(("fsync", 0)))
    with (tmp_path / "file").open("wb") as file:
        sync(file.fileno())
        assert calls == [("full", 51)]
        monkeypatch.delattr(fcntl, "F_FULLFSYNC")
        sync(file.fileno())
    assert calls == [("full", 51), ("fsync", 0)]


def test_a_limit_on_file_size_leaves_the_old_recording(tmp_path: Path) -> None:
    recording(1.0).save(tmp_path / "rec")
    script = "import oarlock, sys\ntry:\n    oarlock.load_recording(sys.argv[1]).save(sys.argv[2])\n"
    script += "except oarlock.DataError as error:\n    sys.exit(str(error))"
    time_s = np.arange(20_000) / 100.0
    noise = np.random.default_rng(0).normal(size=(20_000, 3))
    oarlock.Recording([ImuStream("back", time_s, noise)]).save(tmp_path / "large")
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))  # noqa: E731
    done = subprocess.run(
        [sys.executable, "-c", script, tmp_path / "large", tmp_path / "rec"],
        capture_output=True,
        text=True,
        preexec_fn=limit,
        check=False,
    )
    assert done.returncode == 1 and "rec: cannot be written" in done.stderr, done.stderr
    assert value_of(tmp_path / "rec") == 1.0
    assert not (tmp_path / "rec/.oarlock").exists()


# --- one writer at a time -------------------------------------------------------------------------------


def test_the_second_writer_is_refused_by_name(tmp_path: Path) -> None:
    with replaced_folder(tmp_path / "rec", "recording") as stage:
        recording(1.0).save(stage)
        with pytest.raises(DataError, match="rec: another run is writing"):
            recording(2.0).save(tmp_path / "rec")
    assert value_of(tmp_path / "rec") == 1.0


def test_two_tracks_into_one_folder(tracked: Path) -> None:
    with suppress(RuntimeError), replaced_folder(tracked, "track"):
        status, said = run(
            "track", tracked.parent / "rec", "--model", "pendulum3", "--out", tracked, "--force"
        )
        raise RuntimeError
    assert status == 1 and "another run" in said and "Wait for its end" in said
    assert run("track", tracked.parent / "rec", "--model", "pendulum3", "--out", tracked, "--force")[0] == 0


def test_writers_that_end_at_the_same_time_leave_one_whole_recording(tmp_path: Path) -> None:
    refused = []

    def save(value: float) -> None:
        for _ in range(10):
            try:
                recording(value, value).save(tmp_path / "rec")
            except DataError as error:
                refused.append(str(error))

    threads = [threading.Thread(target=save, args=(float(k),)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert value_of(tmp_path / "rec") == value_of(tmp_path / "rec", "seat1")
    assert all("another run" in text for text in refused)
    assert not (tmp_path / "rec/.oarlock").exists()


# --- what is not ours -----------------------------------------------------------------------------------


def test_a_track_replaces_no_model_of_a_user(tmp_path: Path, tracked: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    (own / "run.toml").write_text("# my notes\n")
    (own / "model.toml").write_text("# my model\n")
    status, said = run("track", tmp_path / "rec", "--model", "pendulum3", "--out", own)
    assert status == 2 and "contains files" in said
    with pytest.raises(DataError, match=r"own/(model|run)\.toml exists, and no manifest says"):
        oarlock.load_track(tracked).save(own)
    assert (own / "model.toml").read_text() == "# my model\n"


def test_a_track_is_replaced_only_with_force(tracked: Path) -> None:
    (tracked / "model.toml").write_text("# mine now\n")
    status, said = run("track", tracked.parent / "rec", "--model", "pendulum3", "--out", tracked)
    assert status == 2 and "contains files" in said and "--force" in said
    assert (tracked / "model.toml").read_text() == "# mine now\n"


def test_files_beside_the_track_stay(tracked: Path) -> None:
    (tracked / "notes.txt").write_text("mine")
    assert run("view", tracked, "--no-open")[0] == 0
    assert run("track", tracked.parent / "rec", "--model", "pendulum3", "--out", tracked, "--force")[0] == 0
    assert (tracked / "notes.txt").read_text() == "mine"
    assert not (tracked / "view.html").exists(), "a page of the old track would lie about the new one"


@pytest.mark.parametrize("verb", [("report",), ("view", "--no-open")])
def test_pages_replace_nothing_unasked(tracked: Path, tmp_path: Path, verb: tuple[str, ...]) -> None:
    thesis, link, dangling = tmp_path / "thesis.html", tmp_path / "link.html", tmp_path / "dangling.html"
    thesis.write_text("mine")
    link.symlink_to(thesis)
    dangling.symlink_to(tmp_path / "later.html")
    for page in (thesis, link, dangling):
        status, said = run(*verb, tracked, "--out", page)
        assert status == 2 and f"{page.name} exists" in " ".join(said.split()), said
    assert run(*verb, tracked, "--out", link, "--force")[0] == 0
    assert thesis.read_text() == "mine" and not link.is_symlink() and not (tmp_path / "later.html").exists()
    assert run(*verb, tracked, "--out", "/dev/null", "--force")[0] == 2
    assert not Path("/dev/null").is_file()


def test_the_page_of_a_track_is_replaced_until_the_user_changes_it(tracked: Path) -> None:
    for _ in range(2):
        assert run("report", tracked)[0] == 0
    page = tracked / "report.html"
    page.write_text(page.read_text(encoding="utf-8") + "<!-- mine -->", encoding="utf-8")
    assert run("report", tracked)[0] == 2
    assert page.read_text(encoding="utf-8").endswith("<!-- mine -->")
    assert run("report", tracked, "--force")[0] == 0


def test_strokes_beside_a_page_replace_nothing(tmp_path: Path) -> None:
    assert run("simulate", "--out", tmp_path / "trial", "--duration-s", 8)[0] == 0
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages/strokes.csv").write_text("mine")
    status, said = run("report", tmp_path / "trial/truth", "--out", tmp_path / "pages/report.html")
    assert status == 1 and "strokes.csv exists" in " ".join(said.split()), said
    assert (tmp_path / "pages/strokes.csv").read_text() == "mine"
    assert not (tmp_path / "pages/report.html").exists()


def test_links_inside_a_folder_lead_nowhere(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "rec").mkdir()
    (tmp_path / "rec/truth").symlink_to(tmp_path / "mine")
    (tmp_path / "rec/recording.toml").symlink_to(tmp_path / "mine/later")
    status, said = run("simulate", "--out", tmp_path / "rec", "--duration-s", 3, "--force")
    assert status == 1 and "truth: is a link" in said, said
    assert list((tmp_path / "mine").iterdir()) == []


def test_new_files_do_not_follow_a_link_that_was_prepared(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "rec/.oarlock").mkdir(parents=True)
    (tmp_path / "mine/notes.txt").write_text("mine")
    (tmp_path / "rec/.oarlock/new").symlink_to(tmp_path / "mine")
    with pytest.raises(DataError, match=r"\.oarlock/new: is a link; remove it"):
        recording(1.0).save(tmp_path / "rec")
    assert [file.name for file in (tmp_path / "mine").iterdir()] == ["notes.txt"]
    (tmp_path / "rec/.oarlock/new").unlink()
    recording(1.0).save(tmp_path / "rec")
    assert value_of(tmp_path / "rec") == 1.0


def test_a_folder_that_was_prepared_moves_nothing_out_of_itself(tmp_path: Path) -> None:
    recording(1.0).save(tmp_path / "rec")
    (tmp_path / "mine.txt").write_text("mine")
    commit = tmp_path / "rec/.oarlock/commit"
    (commit / "tree").mkdir(parents=True)
    (commit / MANIFEST).write_text('format = 1\n[sha256.gone]\n"../mine.txt" = ""\n')
    with pytest.raises(DataError, match="is damaged"):
        oarlock.load_recording(tmp_path / "rec")
    assert (tmp_path / "mine.txt").read_text() == "mine"


# --- what is read ---------------------------------------------------------------------------------------


def test_a_small_file_of_equal_rows_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    recording(1.0).save(tmp_path)
    many = 200_000_000
    ones = pa.DictionaryArray.from_arrays(pa.array(np.zeros(1_000_000, np.int32)), pa.array([1.0]))
    schema = pa.schema([(name, ones.type) for name in ("time_s", "value")])
    with pq.ParquetWriter(tmp_path / "seat.parquet", schema) as writer:
        for _ in range(many // 1_000_000):
            writer.write_table(pa.table([ones, ones], schema=schema))
    assert (tmp_path / "seat.parquet").stat().st_size < 5e6
    # far less than the numbers need: Arrow would end with an error of another kind
    script = "import oarlock, resource, sys\nresource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))\n"
    script += "try:\n    oarlock.load_recording(sys.argv[1])\n"
    script += "except oarlock.DataError as error:\n    sys.exit(str(error))"
    done = subprocess.run(
        [sys.executable, "-c", script, tmp_path], capture_output=True, text=True, check=False
    )
    assert "unpacks to more than 268.4 MB" in done.stderr, done.stderr


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    readers: dict[str, list[Callable[[Path], object]]] = {
        "toml": [
            load_model,
            oarlock.load_calibration,
            oarlock.calibration.load_session_plan,
            read_csv,
            load_study,
        ],
        "csv": [
            read_apdm,
            read_dot,
            read_mtmanager,
            read_shimmer,
            load_stroke_export,
            oarlock.markers.load_markers,
        ],
        "trc": [oarlock.markers.load_markers],
        "c3d": [oarlock.markers.load_markers],
        "mat": [read_broad],
        "mvnx": [read_mvnx],
        "sto": [read_sto],
    }
    for kind, named in readers.items():
        os.mkfifo(tmp_path / f"pipe.{kind}")
        (tmp_path / f"endless.{kind}").symlink_to("/dev/zero")
        for file, what in ((tmp_path / f"pipe.{kind}", "a pipe"), (tmp_path / f"endless.{kind}", "a device")):
            for reader in named:
                with pytest.raises(
                    (DataError, ModelError),
                    match=rf"{file.name}: (is {what}, not a regular|there is no such) file",
                ):
                    reader(file)
    for name in ("pipe.toml", "endless.toml"):
        status, said = run("model", "check", tmp_path / name)
        assert status == 1 and "not a regular file" in said, said


def test_toml_has_a_size(tmp_path: Path) -> None:
    file = tmp_path / "huge.toml"
    with file.open("wb") as stream:
        stream.truncate(10**12)
    for reader in (load_model, oarlock.load_calibration):
        with pytest.raises((DataError, ModelError), match=r"has 1,000\.0 GB, more than the 8\.4 MB"):
            reader(file)


def test_a_simulation_that_cannot_fit_is_refused_with_its_size(tmp_path: Path) -> None:
    status, said = run("simulate", "--out", tmp_path / "trial", "--duration-s", "1e9")
    assert status == 1 and "would need about 1,250,000.0 GB of memory" in said, said
    assert not (tmp_path / "trial").exists()


def test_stamps_have_a_least_distance() -> None:
    with pytest.raises(DataError, match=r"\[1\] is only 1e-09 s after .* \(4 of 4 intervals .*another unit"):
        ScalarStream("seat", np.arange(5) * 1e-9, TIME_S)
    with pytest.raises(DataError, match=r"\[3\] is only 1e-07 s after .* \(1 of 4 .*keep one of them"):
        ScalarStream("seat", [0.0, 0.01, 0.02, 0.0200001, 0.03], TIME_S)
    epoch = 1.7e9 + np.arange(5) * 1e-6
    assert len(ScalarStream("seat", epoch, TIME_S)) == 5


# --- spreadsheets ---------------------------------------------------------------------------------------


def test_cells_of_a_study_run_nothing(tmp_path: Path) -> None:
    names = ["=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", "\t=1", "-2.5e-3", "+7", "plain"]
    write_rows([{"name": name, "=key": 1.5} for name in names], tmp_path / "runs")
    lines = (tmp_path / "runs.csv").read_text(encoding="utf-8").splitlines()
    first = [line.rpartition(",")[0].strip('"') for line in lines[1:]]
    assert first == [*(f"'{name}" for name in names[:5]), *names[5:]]
    assert lines[0] == '''"name","'=key"'''


def test_every_listed_file_of_a_simulation_is_checked(tmp_path: Path) -> None:
    assert run("simulate", "--out", tmp_path / "trial", "--duration-s", 3)[0] == 0
    manifest = read_manifest(tmp_path / "trial")
    assert all(manifest.is_unchanged(name) for name in manifest.sha256)
    assert {"recording.toml", "truth/track.parquet", "truth/run.toml"} <= set(manifest.sha256)
    (tmp_path / "trial/truth/track.parquet").write_bytes(b"PAR1")
    status, said = run("simulate", "--out", tmp_path / "trial", "--duration-s", 3)
    assert status == 2 and "--force" in said
    assert run("simulate", "--out", tmp_path / "trial", "--duration-s", 4, "--force")[0] == 0
    oarlock.load_track(tmp_path / "trial/truth")


def test_a_page_of_the_old_truth_goes_with_it(tmp_path: Path) -> None:
    trial = tmp_path / "trial"
    assert run("simulate", "--out", trial, "--duration-s", 3)[0] == 0
    assert run("report", trial / "truth")[0] == 0 and run("report", trial / "truth")[0] == 0
    (trial / "truth/notes.txt").write_text("mine")
    assert run("simulate", "--out", trial, "--duration-s", 4, "--force")[0] == 0
    assert not (trial / "truth/report.html").exists()
    assert (trial / "truth/notes.txt").read_text() == "mine"
