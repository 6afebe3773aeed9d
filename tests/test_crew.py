"""Timing between the seats of a boat: planted delays, clocks, missing strokes, false alarms, page and verb."""

import json

import numpy as np
import pytest

from command_line import run
from crew_pieces import crew_recordings, hull_units, on_other_clock
from html_page import Page, assert_loads_nothing, assert_references_lead_somewhere
from oarlock import DataError, Recording
from oarlock.rowing import crew_findings, crew_seats, crew_timing, write_crew_report
from oarlock.rowing.crew.matching import aligning_shift, delays, matched
from oarlock.rowing.crew.scatter import mean_of
from oarlock.rowing.crew.seats import seat_place

NAMES = ["bow", "2", "3", "stroke"]
LATE_S = (0.040, -0.015, 0.015, 0.0)


def planted(recordings, names=NAMES, **options):
    """The timing of a crew whose loggers are one."""
    return crew_timing(crew_seats(recordings, names), clock_std_s=0.0, **options)


@pytest.fixture(scope="module")
def four():
    """Four seats with planted delays; seat 2 has no readings from 30 to 45 s."""
    return planted(crew_recordings(LATE_S, 28.0, jitter_s=0.004, gap=(1, 30.0, 45.0)))


def test_planted_delays_are_reported_within_5_ms(four):
    for name, late_s in zip(NAMES[:-1], LATE_S, strict=False):
        for event in ("catch", "finish"):
            found = four.delay(name, event)
            assert abs(found.mean_s - late_s) < 0.005
            # three standard errors rather than two: this test has six such bands
            assert abs(found.mean_s - late_s) < 1.5 * found.half_width_s
    assert four.delay("stroke", "catch") is None
    assert four.left_out > 0


@pytest.mark.parametrize("rate", [18.0, 36.0])
def test_without_scatter_a_delay_is_known_to_a_ms(rate):
    timing = planted(crew_recordings((0.015, 0.0), rate, 60.0), ["bow", "stroke"])
    # 0.001 rad of noise at 18 strokes a minute move a reversal by up to 5 ms, a mean of 15 by about 1
    assert timing.delay("bow", "catch").mean_s == pytest.approx(0.015, abs=0.003)
    assert timing.delay("bow", "finish").mean_s == pytest.approx(0.015, abs=0.003)


def test_what_was_planted_is_named_and_nothing_else(four):
    found = crew_findings(four)
    assert [one.seats for one in found] == [("bow",), *[(name,) for name in found_order(found)]]
    assert {one.seats[0] for one in found} == {"bow", "2", "3"}
    assert all(one.low_s < one.size_s < one.high_s and one.finish_too for one in found)
    even = planted(crew_recordings((0.0,) * 4, 28.0, 60.0, jitter_s=0.006, seed=3))
    assert crew_findings(even) == []


def found_order(found):
    """Seats after the first, as they are."""
    return [one.seats[0] for one in found[1:]]


def test_all_late_is_one_finding():
    timing = planted(crew_recordings((0.02, 0.02, 0.0), 30.0, 60.0, jitter_s=0.002), ["bow", "2", "stroke"])
    (one,) = crew_findings(timing)
    assert (one.kind, set(one.seats)) == ("catch", {"bow", "2"})


def test_against_the_mean_and_another_seat(four):
    mean = crew_timing(four.seats, "mean", 0.0)
    total = sum(mean.delay(name, "catch").mean_s for name in NAMES)
    assert abs(total) < 0.003  # weights differ a little from seat to seat
    assert mean.delay("stroke", "catch").mean_s == pytest.approx(-0.010, abs=0.005)
    other = crew_timing(four.seats, "2", 0.0)
    assert other.delay("stroke", "catch").mean_s == pytest.approx(0.015, abs=0.005)
    with pytest.raises(DataError, match="is no seat of this crew; there are bow, 2, 3, stroke"):
        crew_timing(four.seats, "7", 0.0)


def test_unknown_clocks_say_so_and_keep_scatter_and_drive(four):
    pieces = [seat.data for seat in four.seats]
    pieces[0] = on_other_clock(pieces[0], 21.7, 40e-6)
    timing = crew_timing(crew_seats(pieces, NAMES))
    assert not timing.clocks.known
    bow, known = timing.delay("bow", "catch"), four.delay("bow", "catch")
    assert np.isnan(bow.mean_s)
    assert bow.strokes.sd == pytest.approx(known.strokes.sd, rel=0.1)
    assert timing.delay("bow", "drive").mean_s == pytest.approx(four.delay("bow", "drive").mean_s, abs=1e-3)
    assert "cannot be told" in timing.clocks.sentence
    assert crew_findings(timing) == []


def test_the_hulls_unit_aligns_two_loggers():
    first, second = crew_recordings((0.015, 0.0), 26.0, 120.0)
    own, theirs = hull_units(120.0, 3.217, 30e-6)
    pair = [on_other_clock(first, 3.217, 30e-6, [theirs]), Recording([*second.streams, own])]
    timing = crew_timing(crew_seats(pair, ["bow", "stroke"]))
    assert timing.clocks.kind == "hull"
    assert 0.0 < timing.clocks.worst_std_s < 0.003
    assert timing.delay("bow", "catch").mean_s == pytest.approx(0.015, abs=0.005)


def test_a_stated_clock_widens_the_band(four):
    known = four.delay("bow", "catch").half_width_s
    stated = crew_timing(four.seats, clock_std_s=0.010).delay("bow", "catch").half_width_s
    # 95 % of a normal distribution with 10 ms
    assert stated == pytest.approx(np.hypot(known, 0.0196), rel=1e-3)
    with pytest.raises(DataError, match="a standard deviation of -1 s"):
        crew_timing(four.seats, clock_std_s=-1.0)


def test_one_logger_is_recognised():
    plain = crew_recordings((0.0, 0.0), 26.0, 30.0)
    same = [
        Recording(one.streams, {"session": {"seat": name, "logger": "L1"}})
        for one, name in zip(plain, ("bow", "stroke"), strict=True)
    ]
    assert crew_timing(crew_seats(same)).clocks.kind == "one"


def test_strokes_match_only_their_partner():
    leader = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
    own = np.array([1.02, 4.9, 7.03, 8.0, 9.01])
    theirs, ours = matched(leader, own)
    assert theirs.tolist() == [0, 2, 3, 4]
    assert ours.tolist() == [0, 1, 2, 4]
    assert np.isnan(delays(leader, own)[3])
    assert matched(leader, np.empty(0))[0].size == 0
    uneven = np.cumsum([2.0, 2.1, 1.9, 2.05, 2.2, 1.95, 2.0, 2.15])
    assert aligning_shift(uneven, uneven[2:] - 30.0) == pytest.approx(30.0, abs=1e-9)


def test_a_band_covers_strokes_that_resemble_their_neighbours():
    rng = np.random.default_rng(5)
    inside, tried = 0, 400
    for _ in range(tried):
        steps = rng.normal(size=75)
        for k in range(1, 75):
            steps[k] = 0.4 * steps[k - 1] + np.sqrt(1.0 - 0.16) * steps[k]
        found = mean_of(0.01 * steps[25:], np.full(50, 0.001))
        inside += abs(found.mean) <= found.half_width(0.95, 0.0)
    # 95 % less three standard deviations of 400 draws, and less what a short series cannot show
    assert inside / tried > 0.90


def test_seats_are_named_and_checked(four):
    assert [seat_place(name) for name in ("bow", "Seat 3", "7", "stroke")] == [1.0, 3.0, 7.0, 1000.0]
    pieces = [seat.data for seat in four.seats]
    with pytest.raises(DataError, match=r"its session\.toml names no seat"):
        crew_seats(pieces)
    with pytest.raises(DataError, match="given twice"):
        crew_seats(pieces, ["bow", "1", "3", "stroke"])
    with pytest.raises(DataError, match=r"is no seat\. Name it bow"):
        crew_seats(pieces, ["bow", "cox", "3", "stroke"])
    with pytest.raises(DataError, match="at least two seats"):
        crew_seats(pieces[:1], ["bow"])
    boats = [Recording(one.streams, {"session": {"boat": str(k)}}) for k, one in enumerate(pieces)]
    with pytest.raises(DataError, match="different boats"):
        crew_seats(boats, NAMES)
    with pytest.raises(DataError, match="no movement that all seats have"):
        crew_seats(pieces, NAMES, source="handle")


def test_the_page_is_offline_and_says_who_leads(four, tmp_path):
    page, beside = write_crew_report(four, tmp_path)
    text = page.read_text(encoding="utf-8")
    read = Page(text)
    assert_loads_nothing(read)
    assert_references_lead_somewhere(read)
    assert "Bow catches" in read.text
    assert "after stroke" in read.text
    assert "One logger recorded all seats, as stated" in read.text
    lines = beside.read_text().splitlines()
    assert len(lines) == 1 + len(four.catch_s)
    assert lines[0].startswith("stroke,catch_time_s,bow_catch_late_s")


def test_the_verb_writes_the_page_and_json(four, tmp_path, monkeypatch):
    for seat in four.seats:
        seat.data.save(tmp_path / seat.name)
    folders = [tmp_path / name for name in NAMES]
    given = ("--seats", "bow,2,3,stroke", "--clock-ms", 0, "--movement", "oars", "--against", "stroke")
    out = tmp_path / "boat.html"
    found = json.loads(run("rowing", "crew", *folders, *given, "--out", out, "--json").stdout)
    late = {(one["seat"], one["event"]): one["mean_s"] for one in found["delays"]}
    assert late["bow", "catch"] == pytest.approx(0.040, abs=0.005)
    assert "exists" in run("rowing", "crew", *folders, *given, "--out", out, status=2).stderr
    behind = [word for folder in folders for word in ("--recording", folder)]
    told = run("rowing", "crew", *folders, *given, *behind, "--out", out, "--force").stdout
    assert "What stands out" in told
    assert (
        "give one a seat"
        in run(
            "rowing", "crew", *folders, "--recording", folders[0], "--out", tmp_path / "x.html", status=2
        ).stderr
    )
