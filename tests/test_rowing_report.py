"""The report of a rower: strokes in words and tables, every number explained, two pieces beside each other."""

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import oarlock
from html_page import (
    Page,
    assert_loads_nothing,
    assert_references_lead_somewhere,
    assert_speaks_to_screen_readers,
)
from oarlock.cli.report import report
from oarlock.evaluation.suspects.suspect import SUSPECT_NOTE
from oarlock.rowing import FEATURES, TARGET_CLASSES
from oarlock.rowing.analysis.stroke_means import FeatureMean
from oarlock.rowing.analysis.technique import Technique, technique
from oarlock.rowing.findings.find import findings
from oarlock.rowing.report.averages import Average, beyond, difference, feature_of
from oarlock.rowing.report.called import called, piece_of
from oarlock.rowing.report.compared import counts, differences, first_sentence, largest_first
from oarlock.rowing.report.front import front_of
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.report.sections import sections_of
from oarlock.rowing.report.write import is_of_rower, write_rowing_report
from oarlock.rowing.simulation.experiment import simulate_sweep
from oarlock.storage.errors import DataError
from rowed_truth import rowed

LARGEST_BYTES = 3_000_000
"""A page that is mailed and opened on a telephone."""
DURATION_S, RATES = 40.0, (24.0, 24.0)
FEWEST_STROKES = 15
"""In 40 s at 24 a minute: 16, of which the first or last may be cut."""


@pytest.fixture(scope="module")
def track() -> oarlock.Track:
    return rowed("B-NB", DURATION_S, 24.0, 0)


@pytest.fixture(scope="module")
def found(track: oarlock.Track) -> Technique:
    return technique(track)


@pytest.fixture(scope="module")
def other() -> oarlock.Track:
    return rowed("B-NB", 20.0, 30.0, 5)


@pytest.fixture(scope="module")
def written(track: oarlock.Track, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_rowing_report(track, tmp_path_factory.mktemp("report"), targets="sculling_men")


@pytest.fixture(scope="module")
def text(written: list[Path]) -> str:
    return written[0].read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(text: str) -> Page:
    return Page(text)


@pytest.fixture(scope="module")
def compared(
    track: oarlock.Track, other: oarlock.Track, tmp_path_factory: pytest.TempPathFactory
) -> list[Path]:
    file = tmp_path_factory.mktemp("two") / "both.html"
    shares: list[float] = []
    files = write_rowing_report(track, file, other=other, names=("after", "before"), progress=shares.append)
    assert shares == sorted(shares) and len(shares) > 2 and shares[-1] == 1.0
    return files


def test_page_is_well_formed_small_and_loads_nothing(page, text):
    assert_loads_nothing(page)
    assert_references_lead_somewhere(page)
    assert_speaks_to_screen_readers(page)
    assert "default-src 'none'" in text
    assert len(text.encode()) < LARGEST_BYTES


def test_summary_says_strokes_rate_and_length_first(page):
    lead = page.text[: page.text.index("joints of the model")]
    assert re.search(r"1[567] strokes in 40 s at 2[34]\.\d/min", lead)
    told = lead.replace("\N{NO-BREAK SPACE}", " ")
    for usual in ("usual 102 to 110°", r"slightly shorter than usual \(−62 to −66°\)", "usual 40 to 44°"):
        assert re.search(rf"\d\.\d°± \d\.\d°; {usual}", told)
    assert re.search(r"1[567] strokes of sculling", lead)
    assert "What stands out" in lead


def test_faults_of_sensors_come_before_the_strokes_and_without_a_class_there_is_no_target(other, tmp_path):
    suspect = other.with_notes(f"{SUSPECT_NOTE}back: it stood still")
    text = write_rowing_report(suspect, tmp_path)[0].read_text(encoding="utf-8")
    shown = Page(text).text
    assert shown.index("Suspect: back: it stood still") < shown.index("strokes in 20 s")
    assert 'class="zone"' not in text


def test_strokes_csv_lies_beside_with_a_line_a_stroke(written, found):
    assert [path.name for path in written] == ["report.html", "strokes.csv"]
    lines = [line for line in written[1].read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    table = found.strokes
    assert len(rows) == len(table) >= FEWEST_STROKES
    assert [float(row["catch_time_s"]) for row in rows] == pytest.approx(list(table["catch_time_s"]))


def test_every_number_in_the_page_is_explained_in_the_page(page, found):
    names = found.strokes.columns
    ids = {a["id"] for _, a in page.tags if "id" in a}
    for name in names:
        assert f"def-{name.replace('_', '-')}" in ids
        assert FEATURES[name].definition.split(".")[0] in page.text
        assert FEATURES[name].source in page.text
    terms = [a["href"] for a in page.all("a") if a.get("class") == "term" and "data-stroke" not in a]
    assert len(terms) > 50
    assert all(link.startswith("#def-") for link in terms)


def test_tables_are_sortable_with_heads_that_say_what_they_hold(page):
    heads = [a for a in page.all("th") if a.get("scope") == "col"]
    assert any("handle reverses" in (a.get("title") or "") for a in heads)
    assert sum("sortable" in (a.get("class") or "") for a in page.all("table")) >= 3


def test_strokes_that_count_in_no_average_are_grey_and_say_why(page, found):
    left_out = [reason for reason in found.found.left_out if reason]
    assert left_out
    for reason in left_out:
        assert reason in page.text


def test_all_sections_are_there(page):
    ids = {a["id"] for a in page.all("section")}
    wanted = {"moving", "strokes", "trends", "courses", "speeds", "paths", "arms", "sides"}
    assert wanted | {"numbers", "meanings", "joints", "curves", "provenance"} <= ids


def test_targets_that_have_no_number_in_the_piece_are_named(page):
    assert "Targets without a number in this piece: catch slip, finish wash." in page.text


def test_targets_are_drawn_with_their_source_and_never_called_right(page, text):
    assert "RtcNoord (KNRB)" in page.text
    assert 'class="zone"' in text
    assert "No target is right for everyone" in page.text
    assert "correct" not in page.text.lower()


def test_help_names_every_target_class():
    assert all(name in str(report.__doc__) for name in TARGET_CLASSES)


def test_a_target_class_that_is_not_there_is_refused(other, tmp_path):
    with pytest.raises(DataError, match="sculling_men"):
        write_rowing_report(other, tmp_path, targets="canoes")
    assert not list(tmp_path.iterdir())


def test_two_pieces_stand_beside_each_other(compared):
    assert [path.name for path in compared] == ["both.html", "both-strokes.csv", "both-strokes-2.csv"]
    text = compared[0].read_text(encoding="utf-8")
    read = Page(text)
    assert read.errors == []
    assert "after compared with before" in read.text
    assert "Only the stroke rate and what goes with it changed; no change of technique is clear." in read.text
    assert re.search(r"stroke rate2\d\.\d/min(29|30)\.\d/min\d\.\d ± \d\.\d/min less", read.text)
    assert read.text.index("Both pieces") < read.text.index("What stands out")
    assert '"ghost":{' in text
    row = re.search(
        r">stroke rate</a></th>(.*?)</tr>", text[text.index('<table id="compared-pieces-table') :]
    )
    assert row
    assert row[1].endswith('<td data-head="verdict"><b>clear</b></td>')


def test_the_numbers_that_differ_are_named_with_chance_and_those_that_follow_the_rate(compared):
    read = Page(compared[0].read_text(encoding="utf-8"))
    assert re.search(r"after: \d+ strokes in .*before: \d+ strokes in ", read.text)
    assert re.search(
        r"\d+ of \d+ numbers differ.*by chance about \d+ would if they were independent\.", read.text
    )
    assert read.text.index("numbers differ") > read.text.index("What stands out")
    assert re.search(r"Explained by the stroke rate [^.]*recovery time", read.text)
    assert "To compare technique, row both pieces at the same rate." in read.text


def test_the_largest_differences_come_first(track, found, other):
    held = differences(ReportPiece("a", track, found), ReportPiece("b", other, technique(other)))
    sure = [bool(held[name][2].beyond) for name in largest_first(held)]
    assert sure == sorted(sure, reverse=True) and any(sure)


def test_rates_too_far_apart_are_said_with_what_can_still_be_read(track, found, other):
    theirs = technique(other)
    faster = changed(other, theirs, rate_per_min=theirs.strokes["rate_per_min"] + 10.0)
    first = ReportPiece("a", track, found)
    told = " ".join([first_sentence(first, faster), *counts(first, faster)])
    assert "over more than 6/min its effect is not known well enough" in told
    assert "still that of its own piece" in told and "Explained by the stroke rate" not in told


def test_a_piece_beside_itself_differs_in_nothing_but_its_name(other):
    names = ("out", "out")
    sections = sections_of(called([piece_of(other, name) for name in names], names), ("a.csv", "b.csv"))
    same = next(section for section in sections if section.key == "compared-pieces")
    assert "<b>clear</b>" not in same.markup
    told = sections[0].sentences[0]
    assert "No change of technique is clear." in told
    assert "out (first)" in same.markup and "out (second)" in same.markup


def test_a_track_without_strokes_says_so_and_is_reported(track, tmp_path):
    still = replace(track, q=np.broadcast_to(track.q[:1], track.q.shape).copy(), qd=np.zeros_like(track.qd))
    files = write_rowing_report(still, tmp_path)
    read = Page(files[0].read_text(encoding="utf-8"))
    assert read.errors == []
    assert "No stroke" in read.text
    assert len(files) == 1


def test_who_is_a_rower(track):
    assert is_of_rower(track)
    assert not is_of_rower(replace(track, joint_names=("upper", "lower")))


def average(mean: float, sd: float, std: float, count: int = 16) -> Average:
    return Average(
        feature_of("catch_angle_rad"),
        FeatureMean("catch_angle_rad", count, mean, sd, mean, mean, std, np.nan),
    )


def test_a_difference_is_beyond_both_uncertainties_or_not_or_nobody_knows():
    shared = difference(average(-1.0, 0.0, 0.01), average(-1.02, 0.0, 0.01))
    assert shared.value == pytest.approx(0.02)
    assert shared.uncertainty == pytest.approx(0.01 * np.sqrt(2.0))
    assert shared.beyond is False
    assert difference(average(-1.0, 0.0, 0.01), average(-1.03, 0.0, 0.01)).beyond is True
    assert difference(average(-1.0, 0.0, np.nan), average(-2.0, 0.0, 0.01)).beyond is None
    assert beyond(np.nan, 1.0) is None


def test_scatter_of_strokes_shrinks_with_their_number_and_bands_do_not():
    assert average(-1.0, 0.04, 0.0).uncertainty == pytest.approx(0.01)
    assert average(-1.0, 0.0, 0.01, 100).uncertainty == pytest.approx(0.01)
    assert average(-1.0, np.nan, 0.01, 1).uncertainty == pytest.approx(0.01)


def changed(track: oarlock.Track, found: Technique, **columns: np.ndarray) -> ReportPiece:
    """A piece whose table holds other numbers; its averages follow from the summary as before."""
    table = replace(found.strokes, columns={**found.strokes.columns, **columns})
    return ReportPiece("", track, replace(found, strokes=table))


def test_hands_on_one_oar_are_not_set_against_each_other():
    model = oarlock.load_model("sweep")
    swept = simulate_sweep(model, duration_s=20.0, seed=3)[0]
    piece = ReportPiece("", swept, technique(swept))
    assert piece.sides
    assert not {finding.name for finding in findings(piece)} & set(piece.sides)
    front = front_of(piece)
    assert "one oar" not in front.quiet and "Right and left" not in front.checked


def test_an_odd_stroke_and_a_drift_are_found(track, found):
    arc = found.strokes["arc_rad"]
    odd = arc.copy()
    odd[7] -= np.radians(15.0)
    told = [finding.sentence for finding in findings(changed(track, found, arc_rad=odd))]
    assert any(text.startswith("Stroke 8 ") and "arc" in text for text in told)
    tired = arc - np.radians(9.0) * (np.arange(len(arc)) > 0.6 * len(arc))
    told = [finding.sentence for finding in findings(changed(track, found, arc_rad=tired))]
    assert any(text.startswith("In the last third the stroke is ") for text in told)
    assert findings(changed(track, found)) == []
