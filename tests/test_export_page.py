"""The page of an export: starts stand apart, limits tell something, speeds are paces, definitions fit the device."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command_line import run
from html_page import Page
from oarlock.rowing import StrokeTable, load_export
from oarlock.rowing.alongside.course import course_of, pieces_of, splits_of, starts_of
from oarlock.rowing.alongside.paces import clock_text, pace_text
from oarlock.rowing.report.export_front import beyond_usual, findings_of_export
from oarlock.rowing.report.export_page import strokes_page
from oarlock.rowing.report.export_piece import ExportPiece, boat_kind

EXAMPLE = Path(__file__).parents[1] / "examples" / "strokes" / "speedcoach_empower.csv"


def rowed(
    shares: list[float], then: int = 40, at_m_s: float = 4.0, columns: dict | None = None
) -> StrokeTable:
    """A piece at 30/min with a first part at these shares of its speed; a stroke is stamped at its end."""
    speed = at_m_s * np.array([*shares, *[1.0] * then])
    found = {
        "time_s": 2.0 * np.arange(1, len(speed) + 1),
        "distance_m": np.cumsum(2.0 * speed),
        "speed_m_s": speed,
        "rate_per_min": np.full(len(speed), 30.0),
    }
    return StrokeTable({**found, **(columns or {})}, source="a.csv: Made")


@pytest.mark.parametrize(
    ("shares", "strokes", "name"),
    [
        ([0.1, 0.4, 0.7, 0.85], 4, "standing start"),
        ([0.7, 0.85, 0.95], 2, "rolling start"),
        ([1.0, 0.4, 0.7], 3, "standing start"),
        ([19.0, 0.4, 0.7], 3, "standing start"),
        ([], 0, ""),
        ([0.85, 0.95], 0, ""),
        ([0.5 + 0.02 * k for k in range(25)], 0, ""),
    ],
    ids=[
        "at rest",
        "moving",
        "stale first speed",
        "misread first speed",
        "at speed",
        "about at speed",
        "warm-up",
    ],
)
def test_a_start_is_what_comes_before_the_speed_that_follows(shares, strokes, name):
    found = starts_of(course_of(rowed(shares)))
    assert [(one.name, one.strokes) for one in found] == ([(name, strokes)] if strokes else [])


def test_a_device_whose_speed_lags_has_no_start():
    steady = rowed([])
    speed = steady["speed_m_s"].copy()
    speed[:3] = (1.0, 2.0, 3.0)
    assert not starts_of(course_of(replace(steady, columns={**steady.columns, "speed_m_s": speed})))


def test_without_speed_and_distance_the_power_decides():
    power = 200.0 * np.array([0.1, 0.3, 0.5, *[1.0] * 40])
    table = StrokeTable(
        {"time_s": 2.0 * np.arange(1, 44), "power_w": power, "rate_per_min": np.full(43, 30.0)}
    )
    assert [one.strokes for one in starts_of(course_of(table))] == [3]


def test_each_of_several_pieces_has_its_start_and_everything_adds_up():
    one, other = rowed([0.2, 0.5, 0.8]), rowed([0.4, 0.8], 30)
    shifted = {
        "time_s": other["time_s"] + one["time_s"][-1] + 60.0,
        "distance_m": other["distance_m"] + one["distance_m"][-1],
    }
    both = {name: np.concatenate([one[name], shifted.get(name, other[name])]) for name in one.columns}
    course = course_of(StrokeTable(both, source="a.csv: Made"))
    parts = [*starts_of(course), *pieces_of(course)]
    # The second piece begins with its first stroke's end.
    assert [part.strokes for part in parts] == [3, 2, 40, 30]
    assert sum(part.duration_s for part in parts) == pytest.approx(course.duration_s)
    assert sum(part.distance_m for part in parts) == pytest.approx(course.distance_m)
    assert course.steady_m / course.steady_s == pytest.approx(4.0)
    assert int(course.counted.sum()) == 75 and int(course.steady.sum()) == 70


def test_marks_of_500_m_count_from_the_begin_of_the_piece():
    splits = splits_of(course_of(rowed([0.2, 0.5, 0.8], 250)))
    assert [part.name for part in splits[:3]] == ["standing start", "to 500 m", "to 1000 m"]
    assert splits[0].distance_m + splits[1].distance_m == pytest.approx(500.0)
    assert [part.speed_m_s for part in splits[1:3]] == pytest.approx([4.0, 4.0])


def test_the_page_keeps_the_start_visible_and_out_of_pace_and_scatter():
    text = Page(strokes_page(load_export(EXAMPLE))).text
    assert "137 m. Standing start: 5 strokes, 9.4 s, 24 m; then 1:48.0 for 500 m at 29.5/min." in text
    assert "5 of them the start; 13 of 30 lines left out" in text
    assert "SD 1.8° from stroke to stroke" in text
    assert "standing start3:17.5" in text and "after the start1:48.0" in text and "together2:03.5" in text


def test_scatter_is_an_sd_with_one_value_and_intervals_alone_have_plus_minus():
    page = strokes_page(load_export(EXAMPLE))
    text = Page(page).text
    assert "SD 19 N from stroke to stroke" in text and "<td>574</td><td>19</td>" in re.sub(
        r" class=\"[^\"]*\"| data-[a-z-]+=\"[^\"]*\"", "", page
    )
    assert "±" not in text.partition("How it was measured")[0] and "± mean" not in text
    assert "first quarter" not in text and "12 strokes count, and 24 are needed" in text


def test_a_limit_that_tells_nothing_is_not_given():
    rng = np.random.default_rng(0)
    power = 200.0 + rng.normal(0.0, 60.0, 12)
    steady = rowed([], 12, columns={"power_w": power})
    told = Page(strokes_page(steady)).text.partition("have to be larger than about")[2].partition("Next")[0]
    assert "s per 500 m" in told and "power" not in told
    few = StrokeTable(
        {"rate_per_min": 30.0 + rng.normal(0.0, 1.0, 12), "power_w": power}, source="a.csv: Made"
    )
    text = Page(strokes_page(few)).text
    assert "Not assessed: the 12 strokes are too few, or differ too much" in text
    assert "Record at least 60 strokes at one rate" in text


def test_differences_of_speed_are_given_as_pace():
    rng = np.random.default_rng(1)
    slower = np.where(np.arange(90) < 60, 4.0, 3.7) + rng.normal(0.0, 0.02, 90)
    table = StrokeTable(
        {"rate_per_min": 28.0 + rng.normal(0.0, 0.3, 90), "speed_m_s": slower}, source="a.csv: Made"
    )
    found = findings_of_export(ExportPiece(table))[0]
    assert found.unit == "s per 500 m" and found.size == pytest.approx(500 / 3.7 - 125.0, abs=0.5)
    assert re.search(
        r"the boat is 10\.\d s per 500 m slower than before: 2:1\d\.\d instead of 2:0\d\.\d", found.sentence
    )
    text = Page(strokes_page(table, table)).text
    assert "as pace, s per 500 m" in text
    assert not re.search(r"m/s (lower|higher|faster|slower)", text)


def test_definitions_fit_an_oarlock_on_one_oar():
    text = Page(strokes_page(load_export(EXAMPLE))).text
    assert "two oars" not in text and "force on the handle" not in text.lower()
    assert "measures one oar, at the gate" in text and "In sculling it stands for both oars" in text
    assert "without slip (before" not in text


def test_what_the_file_does_not_say_is_asked_for(tmp_path):
    page = tmp_path / "a.html"
    run("rowing", "strokes", str(EXAMPLE), "--report", str(page), "--athlete", "A07")
    text = Page(page.read_text("utf-8")).text
    assert "Date and place not in the file." in text and "--date DATE" in text
    run(
        *("rowing", "strokes"),
        str(EXAMPLE),
        "--report",
        str(page),
        "--force",
        "--date",
        "2026-05-03",
        "--athlete",
        "A07",
        "--place",
        "Lake",
    )
    text = Page(page.read_text("utf-8")).text
    assert "A07, 3 May 2026: 17 strokes" in text and "not in the file" not in text
    assert (
        "--date needs --report"
        in run("rowing", "strokes", str(EXAMPLE), "--date", "2026-05-03", status=2).output
    )


def test_trust_is_one_short_sentence_and_the_rest_is_below():
    text = Page(strokes_page(load_export(EXAMPLE))).text
    front, _, measured = text.rpartition("How it was measured")
    assert "these are the numbers of the NK SpeedCoach, not checked here." in front
    assert "23 % less wash" not in front and "23 % less wash" in measured


def test_wash_beyond_usual_is_the_thing_to_look_at():
    found = load_export(EXAMPLE)
    more = replace(found, columns={**found.columns, "wash_rad": found["wash_rad"] + np.radians(5.0)})
    assert "Look at the finish wash first: 17" in beyond_usual(ExportPiece(more, "1x"))
    assert "12°" in beyond_usual(ExportPiece(more)) and "nksports.com" in beyond_usual(ExportPiece(more))
    assert beyond_usual(ExportPiece(found, "1x")) == ""
    assert "These strokes are too few to show what to change in the boat" in strokes_page(found)


@pytest.mark.parametrize(
    ("boat", "kind"),
    [("single scull", "sculling"), ("2x", "sculling"), ("8+", "sweep"), ("pair", "sweep"), ("", "")],
)
def test_the_kind_of_boat_follows_from_its_name(boat, kind):
    assert boat_kind(StrokeTable({"arc_rad": np.ones(3)}), boat) == kind
    assert boat_kind(StrokeTable({"handle_travel_m": np.ones(3)}), boat) == "ergometer"


def test_the_length_of_the_oar_tells_sculling_from_sweep():
    assert boat_kind(load_export(EXAMPLE), "") == "sculling"


def test_pace_and_durations_as_text():
    assert (pace_text(4.0), clock_text(424.84, tenths=True)) == ("2:05.0", "7:04.8")
