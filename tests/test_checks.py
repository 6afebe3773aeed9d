"""The checks of the project's text find what is planted, so that silence means something."""

import re
from pathlib import Path

import pytest
from checks import (
    arrows,
    budgets,
    engine_arrows,
    file_gate,
    inventory,
    links,
    names,
    portability,
    project_files,
    registered,
    rowing_words,
)


def test_arrow_reader_reads_every_way_to_write_an_arrow():
    read = engine_arrows.named_from_root
    code = "use crate::{error::Error, model::{Joint, Body}};\nuse super::sensor::Imu;\ncrate::kernels::f()"
    assert read(code, ("track",)) == {"error", "model", "sensor", "kernels"}
    assert read("use super::gate;", ("estimate", "filter")) == set()
    assert read("use super::super::model::Model;", ("estimate", "filter")) == {"model"}


def planted(folder: Path, **texts: str) -> Path:
    """A package `oarlock` whose modules have these texts; two underscores in a name stand for a folder."""
    package = folder / "oarlock"
    for name, text in texts.items():
        file = package.joinpath(*name.split("__")).with_suffix(".py")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return package


@pytest.mark.parametrize(
    "back",
    [
        "from oarlock.model import a",
        "def f():\n    from oarlock.model.a import g\n",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .a import A\n",
    ],
)
def test_a_circle_of_imports_is_found_wherever_it_is_written(back, tmp_path):
    package = planted(tmp_path, model__a="from oarlock.model.b import h", model__b=back)
    found = arrows.circles(arrows.imports_of(package))
    assert len(found) == 1 and "oarlock.model.a" in found[0] and "oarlock.model.b" in found[0]
    assert not arrows.circles(arrows.imports_of(planted(tmp_path, model__b="import numpy")))


def test_an_import_of_a_room_above_and_a_room_without_a_layer_are_found(tmp_path):
    package = planted(
        tmp_path, model__a="", storage__b="def f():\n    from oarlock.model.a import g\n", attic__c=""
    )
    found = arrows.upward(arrows.imports_of(package))
    assert len(found) == 2 and "'attic'" in found[0] and "oarlock.storage.b must not import" in found[1]
    assert arrows.layer_of("oarlock.model.description") == "model.description"
    package = planted(tmp_path, model__description="from oarlock.storage.b import f")
    assert any("oarlock.model.description must not" in f for f in arrows.upward(arrows.imports_of(package)))


def test_an_arrow_that_runs_upwards_is_found():
    upwards = "use crate::{error::Error, track::Tracker};"
    assert engine_arrows.forbidden(upwards, ("model",)) == {"track"}
    assert engine_arrows.forbidden(upwards, ("unheard_of",))


def test_the_engine_was_found():
    found = {engine_arrows.module_path(path)[0] for path in engine_arrows.engine_files()}
    assert {"model", "estimate", "rotation"} <= found


def test_lines_of_code_are_neither_text_nor_imports(tmp_path):
    file = tmp_path / "a.py"
    file.write_text(
        '"""One."""\n\nimport os\n\n\nclass A:\n    """Two\n    lines."""\n\n'
        "    def f(self):\n        # why\n        return 1\n"
    )
    assert budgets.size_of([file]) == {
        "lines": 12,
        "code": 3,
        "files": 1,
        "functions": 1,
        "classes": 1,
        "refused": 0,
    }


def test_rooms_beyond_their_budget_and_loose_budgets_are_found(monkeypatch, tmp_path):
    table = tmp_path / "budgets.toml"
    table.write_text(
        '"a" = { lines = 100 }\n"b" = { lines = 100 }\n# why\n"c" = { lines = 100 }\n"gone" = { lines = 1 }\n'
    )
    monkeypatch.setattr(budgets, "TABLE", table)
    monkeypatch.setattr(budgets, "name_of", str)
    lines_of = {"a": 101, "b": 99, "c": 90, "d": 1}
    monkeypatch.setattr(budgets, "sizes", lambda: {room: {"lines": n} for room, n in lines_of.items()})
    lines = [line.partition(";")[0] for line in budgets.findings()]
    assert lines == [
        "a: 101 lines, budget 100",
        "c: 90 lines, budget 100",
        "d: has no budget",
        "gone: has a budget and no file",
    ]
    lowered = budgets.lowered(table.read_text(), budgets.sizes())
    assert lowered == '"a" = { lines = 100 }\n"b" = { lines = 99 }\n# why\n"c" = { lines = 90 }\n'


def test_a_class_name_that_stands_for_two_classes_is_found(monkeypatch, tmp_path):
    planted(tmp_path, model__a="class A: ...\nclass B: ...", storage__b="def f():\n    class A: ...\n")
    monkeypatch.setattr(names, "PACKAGE", tmp_path)
    monkeypatch.setattr(names, "name_of", lambda path: path.name)
    assert names.classes_with_the_same_name() == ["A: a.py:1, b.py:2; a class name stands once"]


@pytest.mark.parametrize("folder", ["home", "opt"])
def test_paths_of_one_machine_are_found(folder):
    assert portability.MACHINE_PATH.search(f"cd /{folder}/tools")
    assert not portability.MACHINE_PATH.search(f"https://example.org/{folder}/page")


def test_paths_of_one_windows_machine_are_found():
    assert portability.MACHINE_PATH.search("C:" + r"\Users\ann")


def test_loose_pins_are_found():
    files = f" \\\n    --hash=sha256:{'0' * 64} \\\n    --hash=sha256:{'1' * 64}\n    # via d\n"
    good = f"a==4!1.0{files}c==3 ; python_version < '3.12'{files}"
    assert portability.loose(good) == []
    assert portability.loose(f"{good}b>=2 \\\n    --hash=sha256:2\ne==5\n") == [
        "b>=2 --hash=sha256:2",
        "e==5",
    ]


def test_links_that_lead_nowhere_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# One title\n[a](#one-title) [b](#two) [c](page.md#one-title) [d](gone.md) [e](https://x.org)\n"
    )
    assert links.broken_links(page) == ["no title for #two in page.md", "gone.md does not exist"]


def test_engine_tests_that_nothing_names_are_found(tmp_path):
    (tmp_path / "one").mkdir()
    for name, text in {"main": "mod named;", "named": "", "forgotten": ""}.items():
        (tmp_path / "one" / f"{name}.rs").write_text(text)
    found = registered.findings(tmp_path)
    assert len(found) == 1 and "mod forgotten;" in found[0]


def test_words_of_rowing_are_found_and_names_are_not(tmp_path):
    file = tmp_path / "part.py"
    file.write_text('load_model("sculler")\nthrow = arrow\nthe_boat = 1\n# an oar\n')
    assert rowing_words.words_of_rowing(file) == [(3, "boat"), (4, "oar")]


@pytest.mark.parametrize(
    "call",
    [
        *("open(file)", "io.open(file)", "os.open(file, 0)", "Path(file).open()", "file.open('rb')"),
        *("file.read_text()", "(folder / name).read_bytes()", "np.load(file)", "numpy.genfromtxt(file)"),
        *("pd.read_csv(file)", "pl.scan_parquet(file)", "parquet.read_table(file)", "pq.ParquetFile(file)"),
        *("h5py.File(file)", "zipfile.ZipFile(file)", "gzip.open(file)", "mmap.mmap(number, 0)"),
        *(
            "sqlite3.connect(file)",
            "loadmat(file)",
            "av.open(file)",
            "ElementTree.parse(file)",
            "csv.open_csv(file)",
        ),
    ],
)
def test_files_that_are_opened_beside_the_gate_are_found(call, tmp_path):
    package = planted(tmp_path, model__a=f"def f():\n    return {call}\n", storage__regular_file="open(file)")
    assert [hit.split(": ")[0] for hit in file_gate.findings(package, {})] == ["model/a.py:2"]
    assert file_gate.findings(package, {"model/a.py": (1, "a reason")}) == []
    assert "opens 1 files now" in file_gate.findings(package, {"model/a.py": (2, "a reason")})[0]


def test_what_opens_no_file_of_a_user_passes_the_gate():
    calls = "webbrowser.open(page)\nway.open(start)\narchive.open(entry)\nread_text(file)\nread_table(file)\n"
    calls += "files('oarlock').joinpath('a').read_text()\nopen_regular(file)\ncsv.reader(lines)\n"
    assert list(file_gate.openings(calls)) == []


def test_lines_are_named(monkeypatch, tmp_path):
    monkeypatch.setattr(project_files, "ROOT", tmp_path)
    file = Path(tmp_path, "a.txt")
    file.write_text("well\nsee me\n")
    assert project_files.hits(re.compile("see"), file) == ["a.txt:2: see me"]


REASON = "Nobody measured with it, so it went."
VERBS = {"verbs": {"track", "run"}, "options": {"track --model", "run --model"}, "settings": {"gate"}}


def inventory_lines(verbs: dict[str, object], options: dict[str, object]) -> list[str]:
    """Differences of an inventory from three verbs, options and settings."""
    tables = {"verbs": verbs, "options": options, "settings": {"gate": "same"}}
    return inventory.differences(tables, VERBS, "")


def test_an_inventory_that_is_true_has_no_findings():
    options = {"track": ["--model"], "run": {"new": ["--model"]}, "run --set": {"now": "settings: gate"}}
    assert inventory_lines({"track": "same", "run": "new", "smooth": {"gone": REASON}}, options) == []
    options = {"estimate": ["--model"], "run": ["--model"], "smooth": ["--all"]}
    assert (
        inventory_lines({"estimate": {"now": "track"}, "run": "same", "smooth": {"gone": REASON}}, options)
        == []
    )


def test_entries_of_the_inventory_that_are_missing_are_found():
    options = {
        "track": ["--model", "--smooth"],
        "run": ["--model"],
        "run --set": {"now": "settings: consider"},
    }
    found = inventory_lines({"track": "same", "run": "same", "smooth": "same"}, options)
    assert [line.partition(" is not there")[0] for line in found] == [
        'verbs: "smooth"',
        'options: "track --smooth"',
        'options: "run --set", now settings: "consider",',
    ]


@pytest.mark.parametrize("reason", ["", " ", "obsolete", "no longer used by anybody"])
def test_a_reason_that_is_no_sentence_is_found(reason):
    verbs = {"track": "same", "run": "same", "smooth": {"gone": reason}}
    found = inventory_lines(verbs, {"track": ["--model"], "run": ["--model"]})
    assert len(found) == 1 and '"smooth" is gone without a reason' in found[0]


def test_what_is_said_to_be_gone_what_has_no_line_and_no_answer_are_found():
    verbs = {"track": "same", "run": {"gone": REASON}, "smooth": {"since": "1.0"}}
    found = inventory_lines(verbs, {"track": ["--model"]})
    assert len(found) == 4
    assert "said to be gone and is there" in found[0] and '"smooth" has no answer' in found[1]
    assert found[2].startswith('verbs: "run" has no line') and found[3].startswith(
        'options: "run --model" has'
    )


def test_pieces_of_text_are_sought_in_the_sources():
    tables = {"notes": {"no stream for": "same", "was increased": {"gone": REASON}, "no field": "same"}}
    found = inventory.differences(tables, {}, "push('no stream for: seat')")
    assert len(found) == 1 and 'notes: "no field" is not there' in found[0]


def test_a_package_that_cannot_be_imported_is_said(monkeypatch):
    def unbuilt() -> dict[str, set[str]]:
        raise ImportError("no module named oarlock._core")

    monkeypatch.setattr(inventory, "surface", unbuilt)
    assert "oarlock._core" in inventory.findings()[0] and "make" in inventory.findings()[0]


def test_names_with_refused_words_are_listed(monkeypatch, tmp_path):
    monkeypatch.setattr(names, "ROOT", tmp_path)
    monkeypatch.setattr(names, "PACKAGE", tmp_path / "python/oarlock")
    folder = tmp_path / "python/oarlock"
    folder.mkdir(parents=True)
    (folder / "told.py").write_text(
        "def found_mount(kept, mount):\n    FileNotFoundError\n    least_squares = 1\n    mount.asked = kept\n"
    )
    (folder / "keys.toml").write_text("[usual]\nshown_unit = 'deg'\nunit = 'found'\n")
    (folder / "engine.rs").write_text(
        'fn take_in(turned: f64) { mem::take(x.found(), "a \\\n most"); } // one\n'
    )
    assert names.refused_names(folder / "told.py") == {"told": 1, "found_mount": 1, "kept": 1, "asked": 4}
    assert names.refused_names(folder / "keys.toml") == {"usual": 1, "shown_unit": 2}
    assert names.refused_names(folder / "engine.rs") == {"take_in": 1, "turned": 1}
    assert names.refused_names(tmp_path / "told.py") == {}
