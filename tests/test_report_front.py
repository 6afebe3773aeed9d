"""The front of a report: who and when, belief in one line, findings with sources, earlier pieces, sheet and picture."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from fake_track import noisy_track, true_track
from html_page import Page, assert_references_lead_somewhere
from oarlock.evaluation.suspects.suspect import SUSPECT_NOTE
from oarlock.report import (
    Front,
    Point,
    Sourced,
    belief_markup,
    named_file,
    who_and_when,
    write_page,
    write_summary,
)
from oarlock.report.page import sensors_of
from oarlock.report.trust import trust
from oarlock.rowing.analysis.technique import technique
from oarlock.rowing.report.front import front_of
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.report.write import rowing_front, write_rowing_report
from oarlock.storage.errors import DataError
from rowed_truth import rowed

SESSION = {"athlete": "A07", "date": "2026-05-01", "place": "Rotsee", "boat": "single"}
TIME_S = np.arange(1001) * 0.01
FRONT = Front(
    did="Two strokes.",
    points=[
        Point(
            "Right and left",
            "The right hand is <late>.",
            "+30 ± 6 ms",
            advice=Sourced("Row on the square.", "Coach 2020"),
            why=None,
            meaning="Time between both hands.",
        )
    ]
    * 4,
    compared="<p>As before.</p>",
)


@pytest.fixture
def track():
    return noisy_track(true_track(TIME_S, ("seat", "elbow"), ("m", "rad")), 0.01)


@pytest.fixture(scope="module")
def piece() -> oarlock.Track:
    track = rowed("S-NB", 20.0, 24.0, 5)
    return replace(track, provenance={**track.provenance, "session": SESSION})


def test_who_and_when_make_title_and_file_name():
    assert who_and_when({"session": SESSION}) == ("A07, 2026-05-01", "Rotsee, boat single")
    assert who_and_when({}) == ("", "")
    assert named_file({"session": SESSION}, "card.png") == "A07-2026-05-01-card.png"
    assert named_file({"session": {"athlete": "../Ü b"}}, "report.html") == "Ü-b-report.html"
    assert named_file({}, "report.html") == "report.html"


def test_the_page_answers_in_order_who_what_stands_out_and_compared(track, tmp_path):
    known = replace(track, provenance={**track.provenance, "session": SESSION})
    text = write_page(known, tmp_path / "r.html", front=FRONT).read_text(encoding="utf-8")
    read = Page(text)
    assert read.errors == []
    assert_references_lead_somewhere(read)
    words = ("A07, 1 May 2026", "Rotsee", "Two strokes.", "What stands out", "+30 ± 6 ms", "is <late>")
    words += ("Try: Row on the square. Coach 2020", "1 smaller finding", "As before.", "How it was measured")
    places = [read.text.rindex(one) if one == words[-1] else read.text.index(one) for one in words]
    assert places == sorted(places)
    assert "Why it matters" not in read.text
    targets = [a["popovertarget"] for a in read.all("button")]
    ids = {a["id"] for _, a in read.tags if "id" in a}
    assert targets and set(targets) <= ids


def test_belief_is_the_worst_that_is_known(track):
    sensors = sensors_of(track, None)
    calibrated = replace(track, provenance={}, notes=())
    assert trust(calibrated, None, sensors).level == "good"
    nominal = replace(calibrated, provenance={"nominal_mounts": ("back",)})
    assert trust(nominal, None, sensors).level == "care"
    suspect = replace(nominal, notes=(f"{SUSPECT_NOTE}back: frozen. It stood still.",))
    assert trust(suspect, None, sensors).level == "bad"
    assert trust(suspect, None, sensors).reason == "back: frozen."
    covered = tuple(replace(score, nis=2.0) for score in sensors)
    assert trust(calibrated, None, covered).level == "good"
    loud = tuple(replace(score, nis=9.0) for score in sensors)
    assert "the sensor back is doubtful" in trust(calibrated, None, loud).reason
    closures = tuple(replace(score, count=None) for score in loud)
    assert trust(calibrated, None, closures).level == "good"
    direct = trust(nominal, None, sensors, "oars and seat")
    assert direct.reason.startswith("oars and seat are within their ±; angles of the body")
    note = "r_hand_flexion: beyond its soft limits (-80 to 80 deg) in 72 % of the samples, by up to 124 deg; check"
    contorted = trust(replace(calibrated, notes=(note,)), None, sensors)
    assert contorted.level == "bad"
    assert contorted.reason.startswith(
        "r_hand_flexion: beyond its soft limits (-80 to 80 deg) in 72 % of the samples"
    )
    assert "check" not in contorted.reason
    assert trust(calibrated, None, ()).level == "care"


def test_earlier_pieces_are_compared_on_the_front(piece, tmp_path):
    earlier = rowed("S-NB", 20.0, 28.0, 6)
    files = write_rowing_report(piece, tmp_path, last=("tuesday", earlier), best=("record", piece))
    read = Page(files[0].read_text(encoding="utf-8"))
    assert read.errors == []
    front = read.text[read.text.index("Compared with earlier") : read.text.index("Compare with a boat class")]
    assert "Last time: tuesday. Own best: record." in front
    assert "At like rate: what the stroke rate does is removed." in front
    assert "at like rate" in front and "no clear change (±" in front and "different" not in front
    assert '<table id="compared-earlier-table" class="stacked">' in files[0].read_text(encoding="utf-8")
    assert "A07, 2026-05-01, Rotsee, boat single" in files[1].read_text(encoding="utf-8").splitlines()[0]


def test_report_and_terminal_share_one_analysis(piece, tmp_path, monkeypatch):
    write_rowing_report(piece, tmp_path)
    monkeypatch.setattr("oarlock.rowing.report.called.technique", None)
    assert rowing_front(piece)[1].figures


def test_without_an_earlier_piece_the_page_says_how_to_give_one(piece, tmp_path):
    read = Page(write_rowing_report(piece, tmp_path)[0].read_text(encoding="utf-8"))
    assert "oarlock report TRACK --last EARLIER" in read.text


def test_a_piece_in_which_nothing_stands_out_says_what_would_have():
    long = rowed("S-NB", 60.0, 24.0, 6)
    front = front_of(ReportPiece("", long, technique(long)))
    assert front.points == []
    assert front.quiet == (
        "No clear difference between both oars at the catch. No clear change from start to end."
    )
    assert re.search(
        r"below about \d+ ms between both oars at the catch and changes .* about \d° of arc(,| or) \d° of catch",
        front.limits,
    )
    assert "named from" in front.checked
    assert re.search(r"Row this piece again at 24/min and compare: a change of \d° of", front.next_step)
    short = rowed("S-NB", 14.0, 24.0, 5)
    assert (
        "Too few strokes count to see small changes"
        in front_of(ReportPiece("", short, technique(short))).quiet
    )


def test_a_mean_outside_of_usual_values_is_a_remark_with_its_source_unless_targets_were_chosen(piece):
    for targets, told in (
        (None, "The stroke: 99.5 ± "),
        ("sculling_men", ""),
    ):
        found = technique(piece, targets=targets)
        short = replace(found.summary["arc_rad"], mean=np.radians(99.5))
        remark = front_of(
            ReportPiece("", piece, replace(found, summary={**found.summary, "arc_rad": short}))
        ).remark
        assert told in remark and bool(remark) == bool(told)


@pytest.mark.long
def test_the_course_of_the_rate_is_said():
    ramp, steady = (rowed("S-NB", 30.0, rate, 6) for rate in ((20.0, 32.0), 24.0))
    assert re.search(
        r", the rate rising from 2\d to [23]\d/min\.", front_of(ReportPiece("", ramp, technique(ramp))).did
    )
    assert re.search(
        r", between 2\d\.\d and 2\d\.\d\.", front_of(ReportPiece("", steady, technique(steady))).did
    )


@pytest.mark.long
def test_a_ramp_has_its_numbers_by_rate_and_a_steady_piece_has_not():
    ramp = rowed("S-NB", 60.0, (20.0, 34.0), 6)
    table = front_of(ReportPiece("", ramp, technique(ramp))).by_rate
    ends = [int(text) for text in re.findall(r"(\d\d)/min", table)]
    assert len(ends) == 4 and ends == sorted(ends) and ends[0] < 26 < 30 < ends[-1]
    steady = rowed("S-NB", 30.0, 24.0, 6)
    assert front_of(ReportPiece("", steady, technique(steady))).by_rate == ""


def test_without_calibration_the_first_step_is_to_calibrate_and_lean_is_marked(piece):
    nominal = replace(piece, provenance={**piece.provenance, "nominal_mounts": ("back", "r_wrist")})
    front = front_of(ReportPiece("", nominal, technique(nominal)))
    assert "Calibrate before the next outing" in front.sensors_step
    assert "Calibrate" not in front.next_step
    marked = {figure.name for figure in front.figures if "not calibrated" in figure.detail}
    assert marked == {"trunk lean at the catch", "trunk lean at the finish"}
    assert front.commands[0][1].startswith("oarlock calibrate")
    beside = front_of(
        ReportPiece("", nominal, technique(nominal)), ReportPiece("before", piece, technique(piece))
    ).compared
    assert beside.count("not calibrated") == 2


def test_without_a_finding_the_next_step_is_a_drill_against_what_is_unusual(piece):
    told = front_of(ReportPiece("", piece, technique(piece)))
    assert "style factor" not in told.remark and told.sensors_step == ""
    assert told.next_step.startswith("These numbers ask for no change of technique: what is outside")
    found = technique(piece)
    short = replace(found.summary["arc_rad"], mean=np.radians(94.0))
    changed = replace(found, summary={**found.summary, "arc_rad": short})
    told = front_of(ReportPiece("", piece, changed))
    assert told.remark.startswith("The stroke: 94.0 ± ") and "far shorter than usual" in told.remark
    assert "NK Sports" in told.limits and "NK Sports" not in told.remark
    assert told.next_step.startswith("Tape a drinking straw") and "rowingcoach.app" in told.next_step
    assert "of arc towards usual shows that it worked" in told.next_step


def test_a_doubtful_seat_is_marked_and_to_be_checked(piece, monkeypatch):
    told = front_of(ReportPiece("", piece, technique(piece)))
    seat = next(one for one in told.figures if one.name == "seat travel")
    assert "doubtful" not in seat.detail and "Check how" not in told.sensors_step
    monkeypatch.setattr("oarlock.rowing.report.front.doubtful_sensors", lambda track: ["seat"])
    told = front_of(ReportPiece("", piece, technique(piece)))
    seat = next(one for one in told.figures if one.name == "seat travel")
    assert seat.detail.endswith("; sensor doubtful")
    assert told.sensors_step == "Check how the sensor seat is mounted."


def test_the_front_has_the_first_reason_and_what_was_measured_all(track, tmp_path):
    loud = tuple(replace(score, nis=9.0) for score in sensors_of(track, None))
    nominal = replace(track, provenance={"nominal_mounts": ("back", "r_wrist")}, notes=())
    belief = trust(nominal, None, loud)
    assert "because the 2 units on the body were not calibrated" in belief.reason
    assert "by 3.0 times" in belief.reasons[1]
    assert belief.shown == 2 and "3.0 times" in belief_markup(belief, "measured-in")
    quiet = replace(belief, reasons=(*belief.reasons, "a third."))
    assert "a third" not in quiet.reason and "A third" not in belief_markup(quiet, "measured-in")
    text = write_page(nominal, tmp_path / "r.html", front=Front(direct="oars")).read_text(encoding="utf-8")
    assert text.count("Oars are within their ±") == 1 and text.count("oars are within their ±") == 1
    assert "oars" not in trust(nominal, None, loud, "oars").reason


def test_the_sheet_has_no_link_no_script_and_the_front(piece, tmp_path):
    title, front = rowing_front(piece)
    read = Page(write_summary(piece, tmp_path / "s.html", title, front).read_text(encoding="utf-8"))
    assert read.errors == []
    assert not read.all("a") and not read.all("script")
    assert "A07, 1 May 2026" in read.text and front.did in read.text


def test_the_picture_is_a_square_without_a_link(piece, tmp_path):
    pytest.importorskip("matplotlib")
    from oarlock.report.card import write_card

    title, front = rowing_front(piece)
    png = write_card(piece, tmp_path / "c.png", title, front).read_bytes()
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    assert [int.from_bytes(png[at : at + 4]) for at in (16, 20)] == [1080, 1080]
    assert b"http" not in png


def test_a_track_without_samples_has_neither(track, tmp_path):
    empty = replace(track, time_s=TIME_S[:0])
    with pytest.raises(DataError, match="no samples"):
        write_summary(empty, tmp_path / "s.html", None, FRONT)


def test_the_verb_names_files_by_athlete_and_says_who(piece, tmp_path: Path):
    piece.save(tmp_path / "out")
    (tmp_path / "send").mkdir()
    told = json.loads(
        run("report", tmp_path / "out", "--summary", "--out", tmp_path / "send", "--json").stdout
    )
    assert told["session"] == SESSION
    assert Path(told["report"]).name == "A07-2026-05-01-summary.html"
    assert "A07, 2026-05-01" in run("report", tmp_path / "out", "--out", tmp_path / "x.html").stdout


def test_sheet_and_picture_take_another_piece_and_targets_and_refuse_what_they_cannot_show(piece, tmp_path):
    title, front = rowing_front(
        piece, other=rowed("S-NB", 20.0, 24.0, 6), names=("after", "before"), targets="sculling_men"
    )
    assert title == "after compared with before"
    assert front.figures and any(text.startswith("Against before:") for text in front.changes)
    assert "before" in front.drawings[1]
    read = Page(write_summary(piece, tmp_path / "s.html", title, front).read_text(encoding="utf-8"))
    assert read.errors == [] and not read.all("a") and "Against before:" in read.text
    assert len(re.findall(r'class="name"', (tmp_path / "s.html").read_text(encoding="utf-8"))) <= 4
    piece.save(tmp_path / "out")
    for flag, option in (("--summary", "--truth"), ("--card", "--with")):
        refused = run("report", tmp_path / "out", flag, option, tmp_path / "out", status=2)
        assert f"{flag} has no room for what {option} adds" in " ".join(refused.stderr.split())
