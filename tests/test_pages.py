"""The pages show what was measured, with what a user knows of a body, and with fair rules for all software."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import oarlock
from exact_recording import EXCERPT, sculler
from local_data import local_folder
from oarlock_lab.pages import __main__ as pages
from oarlock_lab.pages import record, robustness, sections, status, tables
from oarlock_lab.pages.recordings import read_simulated
from oarlock_lab.pages.sculling import ELEVEN, HANDS, PLACES
from oarlock_lab.pages.validation import best_other
from oarlock_lab.validation import dfjimu, others
from oarlock_lab.validation.estimate import OrientationEstimate

PAGES = [
    (name, page, mark)
    for name, render in pages.SECTIONS.items()
    for page, texts in render(record.load(name)).items()
    for mark in texts
]


@pytest.mark.parametrize(("name", "page", "mark"), PAGES)
def test_a_page_shows_its_record(name, page, mark):
    shown = sections.section((record.ROOT / page).read_text(encoding="utf-8"), mark)
    assert shown == pages.SECTIONS[name](record.load(name))[page][mark].strip()


@pytest.mark.parametrize(("name", "page", "mark"), PAGES)
def test_a_section_has_the_date_and_commit_of_its_figures(name, page, mark):
    found = record.load(name)
    shown = sections.section((record.ROOT / page).read_text(encoding="utf-8"), mark)
    sets = found["sets"] if name == "validation" else {name: found}
    # A section that has the name of a set is of that set alone.
    for one in [sets[mark]] if mark in sets else sets.values():
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", one["made"]["date"])
        assert re.match(r"[0-9a-f]{7,}", one["made"]["commit"])
        assert record.made_text(one) in shown


def test_writing_recorded_figures_changes_no_page(tmp_path):
    for name, page, _ in PAGES:
        for part in (page, f"docs/figures/{name}.json"):
            (tmp_path / part).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / part).write_bytes((record.ROOT / part).read_bytes())
    for name in pages.SECTIONS:
        for file in pages.write(name, tmp_path):
            assert file.read_text("utf-8") == (record.ROOT / file.relative_to(tmp_path)).read_text("utf-8")


def test_tables_of_pages_are_those_of_the_code():
    texts = [file.read_text(encoding="utf-8") for file in sorted((record.ROOT / "docs").rglob("*.md"))]
    assert [text for text in texts if tables.with_tables(text) != text] == [], (
        "run `python -m oarlock_lab.pages tables`"
    )
    assert [
        name for name in tables.TABLES if not any(f"generated: {name} -->" in text for text in texts)
    ] == []


def test_a_page_without_its_marks_is_refused():
    with pytest.raises(ValueError, match="status: begin"):
        sections.into_page("no marks", "text", "status")


def test_a_record_has_plain_numbers():
    figures = record.stamped({"a": float("nan"), "b": [1.23456789, 2], "c": {"d": "text"}})
    assert (figures["a"], figures["b"], figures["c"]) == (None, [1.23457, 2], {"d": "text"})
    json.dumps(figures, allow_nan=False)


def wrong_lengths(folder: Path) -> Path:
    """The excerpt, whose file gives a user a right upper arm that is 3 cm too long."""
    with np.load(EXCERPT) as arrays:
        kept = {key: arrays[key] for key in arrays.files}
    lengths = json.loads(str(kept["nominal_lengths"]))
    lengths["l_ua_R"] += 0.03
    file = folder / "wrong.npz"
    np.savez(file, **kept | {"nominal_lengths": np.array(json.dumps(lengths))})
    return file


def test_figures_are_those_of_the_nominal_lengths(tmp_path):
    """The recording is the same: only what the file gives a user differs."""
    true, wrong = (
        status._run(status.read_trial(file), "filtered") for file in (EXCERPT, wrong_lengths(tmp_path))
    )
    # For the first ten seconds units may sit on skin: 0.29 deg and 2.9 mm. A wrong length moves places, not angles.
    assert true["mean_deg"] < 0.45 and true["places_mm"] < 4.5
    assert wrong["mean_deg"] > true["mean_deg"] and wrong["places_mm"] > 2.5 * true["places_mm"]


def test_a_file_gives_lengths_pins_and_mounts_of_the_model():
    """The excerpt's body is the model's: a name that meant something else would show."""
    nominal = read_simulated(EXCERPT, "B-B", sculler()).nominal
    own = dict(sculler().parameters)
    lengths = {name for name in own if name.startswith("l_") or "_pin_" in name}
    assert set(nominal.parameters) == lengths
    assert {name: own[name] for name in lengths} == pytest.approx(dict(nominal.parameters))
    plain = sculler().predict_measurements(*np.zeros((3, 1, len(sculler().joint_names))))
    given = oarlock.track(
        sculler(), read_simulated(EXCERPT, "B-B", sculler()).recording.slice(end_s=0.2), nominal
    )
    assert given.model is not None
    assert given.model.predict_measurements(*np.zeros((3, 1, len(sculler().joint_names)))) == pytest.approx(
        plain
    )


@pytest.mark.data
@pytest.mark.parametrize("name", ["misfit_0", "wild_0", "wild_7"])
def test_bodies_with_other_lengths_are_tracked_with_what_a_user_knows(name):
    read = status.read_trial(local_folder("recordings") / f"{name}.npz")
    own = sculler().parameters
    differ = [n for n, value in read.nominal.parameters.items() if abs(value - own[n]) > 0.002]
    assert len(differ) >= 8, "the generator's lengths are the model's: a user has others"


@pytest.mark.data
def test_every_recording_of_the_table_has_its_nominal_values():
    rows = {row.key: row for row in status.rows(local_folder("recordings"))}
    assert set(status.README_ROWS) <= set(rows)
    for key in status.README_ROWS:
        for make in rows[key].trials:
            assert make().nominal is not None


def test_hands_and_positions_stand_beside_the_angles():
    assert (len(ELEVEN), len(HANDS), len(PLACES)) == (11, 4, 6)
    for row in record.load("status")["rows"].values():
        for error, share in (
            ("mean_deg", "coverage"),
            ("hands_deg", "hands_coverage"),
            ("places_mm", "places_coverage"),
        ):
            assert len(row[error]) == len(row[share]) > 0
    columns = record.load("robustness")["columns"]
    assert {"hands, deg", "hands in band", "wrists add, mm", "wrists in band"} <= set(columns)
    assert oarlock.studies.load_study("robustness", oarlock.rowing.SIMULATORS).joints == ELEVEN


def test_other_software_is_aligned_as_its_authors_do():
    alignment = {
        name: dfjimu._alignment(OrientationEstimate(name, np.zeros(0), {}))
        for name in (*others.DFJIMU_NAMES, "Oarlock", "VQF 6D")
    }
    assert alignment == dict.fromkeys(others.DFJIMU_NAMES, dfjimu.AUTHORS) | {
        "Oarlock": dfjimu.PLAIN,
        "VQF 6D": dfjimu.PLAIN,
    }


def test_the_best_of_the_others_is_the_smallest_of_its_kind_in_each_column():
    def row(ours: bool, online: bool, a: float, b: float | None) -> dict[str, object]:
        return {"note": "", "ours": ours, "online": online, "a": a, "b": b}

    rows = {
        "Oarlock": row(True, True, 0.1, 0.1),
        "first": row(False, True, 1.0, 4.0),
        "second": row(False, True, 2.0, 2.0),
        "partly": row(False, True, 0.5, None),
        "later": row(False, False, 3.0, 3.0),
        "first, heading given": row(False, True, 0.2, 0.2),
    }
    assert [best_other(rows, c, live=True, helped=False) for c in "ab"] == ["partly", "second"]
    assert best_other(rows, "b", live=False, helped=False) == "later"
    assert best_other(rows, "b", live=True, helped=True) == "first, heading given"
    assert best_other({"Oarlock": rows["Oarlock"]}, "a", live=True, helped=False) is None


def test_robustness_scores_hands_and_wrists_of_the_same_runs():
    study = oarlock.studies.load_study("robustness_quick", oarlock.rowing.SIMULATORS, range(1))
    short = replace(study, faults=study.faults[:1], fixed={**study.fixed, "duration_s": 4.0})
    found = robustness.cells(oarlock.studies.run_study(short, jobs=1))
    assert [row[0] for row in found["rows"]] == ["no fault", short.faults[0].name]
    assert all(len(row) == len(found["columns"]) for row in found["rows"])
