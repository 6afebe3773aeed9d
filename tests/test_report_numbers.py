"""Numbers of a rower's report agree: ± has one meaning, a change one size and verdict, pieces one name."""

import re
from dataclasses import replace

import numpy as np
import pytest

import oarlock
from html_page import Page
from oarlock.report import day_text
from oarlock.rowing.analysis.stroke_means import FeatureMean, feature_means
from oarlock.rowing.analysis.technique import technique
from oarlock.rowing.findings.candidate import MetricComparison
from oarlock.rowing.findings.watched import WATCHED
from oarlock.rowing.report.averages import Average, Difference, difference, feature_of
from oarlock.rowing.report.by_rate import range_over_rate
from oarlock.rowing.report.called import Folder, called
from oarlock.rowing.report.compared import counts, differences, first_sentence
from oarlock.rowing.report.earlier import change, in_words, matters
from oarlock.rowing.report.front import front_of
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.report.player import player
from oarlock.rowing.report.shown import apart, shown
from oarlock.rowing.report.tables import averages_table, sides_table, verdict, which_left_out
from oarlock.rowing.report.write import write_rowing_report
from oarlock.storage.statistics import NORMAL_95
from rowed_truth import rowed

ARC = feature_of("arc_rad")
DEG = np.pi / 180.0


def of_day(track: oarlock.Track, day: str, **more: str) -> oarlock.Track:
    session = {"date": day, **more} if day else more
    return replace(track, provenance={**track.provenance, "session": session})


def piece_of(track: oarlock.Track, folder: str = "") -> ReportPiece:
    return ReportPiece("", track, technique(track), folder)


@pytest.fixture(scope="module")
def piece() -> ReportPiece:
    return piece_of(of_day(rowed("S-NB", 40.0, 24.0, 5), "2026-05-20"), "tw2")


@pytest.fixture(scope="module")
def alike() -> ReportPiece:
    return piece_of(of_day(rowed("S-NB", 40.0, 24.0, 6), "2026-05-15"), "tw1")


@pytest.fixture(scope="module")
def ramp() -> ReportPiece:
    return piece_of(of_day(rowed("S-NB", 60.0, (20.0, 32.0), 7), "2026-05-20"), "tramp")


def average(mean_deg: float, sd_deg: float = 0.0, std_deg: float = 0.1, name: str = "arc_rad") -> Average:
    mean, sd, std = mean_deg * DEG, sd_deg * DEG, std_deg * DEG
    return Average(feature_of(name), FeatureMean(name, 16, mean, sd, mean, mean, std, np.nan))


def robust(size_deg: float, sd_deg: float) -> MetricComparison:
    return MetricComparison(WATCHED["arc_rad"], "against other", size_deg, sd_deg, 0.5, 100.0)


def test_the_difference_of_two_shown_numbers_adds_up_for_a_reader():
    assert shown(ARC, apart(ARC, 102.94 * DEG, 102.36 * DEG)) == "0.5"
    found = difference(average(102.94), average(102.36))
    assert np.degrees(found.value) == pytest.approx(0.58)
    assert in_words(found) == "0.5 ± 0.3° longer"
    for now, then in np.random.default_rng(1).uniform(-120.0, 120.0, (200, 2)):
        told = round(float(f"{now:.1f}") - float(f"{then:.1f}"), 1)
        assert shown(ARC, apart(ARC, now * DEG, then * DEG)).replace("−", "-") == f"{told + 0.0:.1f}"


def test_what_is_not_clear_has_no_direction():
    assert in_words(difference(average(102.9), average(102.9))) == "no clear change (±\N{NO-BREAK SPACE}0.3°)"
    # As shown, a change is not larger than its interval, though before rounding it is.
    edge = Difference(ARC, 0.54 * DEG, 0.53 / NORMAL_95 * DEG, 0.5 * DEG)
    assert edge.beyond is False and not matters(edge)
    unknown = replace(edge, uncertainty=float("nan"))
    assert in_words(unknown) == "0.5° longer, uncertainty not known"


def test_where_the_means_and_the_robust_comparison_disagree_the_change_is_uncertain():
    now, then = average(105.0), average(102.0)
    assert np.degrees(change(now, then, robust(3.0, 0.2)).uncertainty) == pytest.approx(0.2)
    assert np.degrees(change(now, then, robust(0.0, 0.2)).uncertainty) == pytest.approx(np.hypot(0.2, 3.0))


def test_one_change_has_one_size_interval_and_verdict_on_the_whole_page(piece, alike):
    front = front_of(piece, alike)
    between = differences(piece, alike)
    for name in ("arc_rad", "catch_angle_rad", "finish_angle_rad", "rhythm"):
        found = between[name][2]
        feature = found.feature
        text = f"{shown(feature, found.told, signed=True)} ± {shown(feature, found.half)}"
        table = Page(front.checked).text
        assert re.search(rf"Against last time{re.escape(feature.label)}{re.escape(text)}", table), name
        row = Page(front.compared).text.partition(feature.label)[2]
        assert in_words(found).replace("\N{NO-BREAK SPACE}", " ") in row[:80].replace(
            "\N{NO-BREAK SPACE}", " "
        )
        assert ("no clear change" in row[:80]) is not bool(found.beyond)


def test_plus_minus_is_half_of_a_95_percent_interval_in_every_table(piece, alike):
    one = piece.averages["arc_rad"]
    half = shown(ARC, one.half)
    tile = next(figure for figure in front_of(piece).figures if figure.name == "arc")
    assert f"±\N{NO-BREAK SPACE}{half}°" in tile.detail
    text = averages_table("numbers-0", "", piece, [one], {})
    assert f'<td data-head="±">{half}</td>' in text
    page = Page(sides_table("sides-0", piece)).text
    assert "half of the 95 % interval" in page and "standard deviation of the" not in page


def test_a_size_with_a_large_interval_and_an_uncalibrated_angle_are_marked(piece):
    weak = averages_table("numbers-0", "", piece, [average(10.0, std_deg=4.0)], {})
    assert weak.count("not clear") == 1
    lean = average(-10.0, std_deg=4.0, name="catch_lean_rad")
    assert "not clear" not in averages_table("numbers-0", "", piece, [lean], {})
    nominal = replace(piece, track=replace(piece.track, provenance={"nominal_mounts": ("back",)}))
    found = [nominal.averages[name] for name in ("catch_lean_rad", "lean_swing_rad")]
    assert averages_table("numbers-0", "", nominal, found, {}).count("not calibrated") == 1
    assert differences(nominal, piece)["catch_lean_rad"][2].beyond is None
    assert "not calibrated" in front_of(nominal, piece).checked


def test_a_clear_difference_below_the_smallest_size_is_small():
    assert verdict(difference(average(103.0), average(102.0))) == "clear, but small"
    assert verdict(difference(average(106.0), average(102.0))) == "<b>clear</b>"
    assert verdict(difference(average(102.1), average(102.0))) == "not clear"


def test_the_rate_explains_only_what_is_smaller_at_like_rate(piece, ramp):
    told = " ".join(counts(ramp, piece))
    assert re.search(r"Explained by the stroke rate [^.]*recovery time", told)
    assert "arc" not in re.findall(r"Explained by the stroke rate [^.]*", told)[0].split("; ")
    assert first_sentence(ramp, piece).startswith("Only the stroke rate and what goes with it changed")
    assert "numbers differ" not in first_sentence(ramp, piece)


def test_a_shorter_stroke_leads_with_its_day(piece, alike):
    table = alike.table
    longer = {
        name: table[name] - 5.0 * DEG
        for name in ("catch_angle_rad", "r_catch_angle_rad", "l_catch_angle_rad")
    }
    before = replace(table, columns={**table.columns, **longer, "arc_rad": table["arc_rad"] + 5.0 * DEG})
    held = replace(alike.technique, strokes=before, summary=feature_means(before, alike.counted))
    first, second = called([piece, replace(alike, technique=held)], ["", ""])
    assert re.fullmatch(
        r"The (catch|stroke) is \d\.\d° shorter and the (catch|stroke) is \d\.\d° shorter than on 15 May 2026\.",
        first_sentence(first, second),
    )


def test_pieces_are_called_by_day_and_rate_else_by_folder_and_given_names_win(piece, alike, ramp):
    def names(pieces, given):
        return [one.name for one in called(pieces, given)]

    folders = [Folder("tramp"), Folder("tw1")]
    assert names([piece, alike], folders) == ["20 May 2026, 24/min", "15 May 2026, 24/min"]
    assert re.fullmatch(r"20 May 2026, 2\d to 3\d/min", names([ramp], folders[:1])[0])
    assert names([piece, alike], ["after", "before"]) == ["after", "before"]
    undated = replace(alike, track=of_day(alike.track, ""))
    assert names([piece, undated], folders) == ["20 May 2026, 24/min", "tw1"]
    other = replace(piece, track=of_day(piece.track, "2026-05-20", athlete="B"))
    mine = replace(piece, track=of_day(piece.track, "2026-05-20", athlete="A"))
    assert names([mine, other], ["", ""]) == ["A, 20 May 2026, 24/min", "B, 20 May 2026, 24/min"]


def test_two_pieces_of_one_day_and_rate_are_told_apart_by_time_of_day_else_by_folder(piece):
    def at(epoch: str, folder: str) -> ReportPiece:
        provenance = {**piece.track.provenance, "epoch": epoch} if epoch else piece.track.provenance
        return replace(piece, track=replace(piece.track, provenance=provenance), folder=folder)

    timed = called([at("2026-05-20T16:59:58.02", "a"), at("2026-05-20T18:10:00", "b")], ["", ""])
    assert [one.name for one in timed] == ["20 May 2026, 24/min, 16:59", "20 May 2026, 24/min, 18:10"]
    plain = called([at("", "a"), at("", "b")], ["", ""])
    assert [one.name for one in plain] == ["20 May 2026, 24/min (a)", "20 May 2026, 24/min (b)"]
    same = called([at("", "a"), at("", "a")], ["", ""])
    assert same[0].name != same[1].name


def test_days_are_written_as_people_do():
    assert day_text("2026-05-20") == "20 May 2026"
    assert day_text("spring") == "spring" and day_text("") == ""


def test_the_second_piece_has_its_own_line_of_trust(piece, ramp, tmp_path):
    nominal = replace(piece.track, provenance={**piece.track.provenance, "nominal_mounts": ("back",)})
    files = write_rowing_report(ramp.track, tmp_path / "both.html", other=nominal)
    read = Page(files[0].read_text(encoding="utf-8"))
    assert read.errors == []
    assert re.search(r"20 May 2026, 24/min: . Read with care\.", read.text)
    assert re.search(r"20 May 2026: 2\d to 3\d/min compared with 20 May 2026, 24/min", read.text)


def test_sizes_that_would_be_named_are_the_same_on_both_pages_and_in_the_table(piece, alike, ramp):
    alone, beside = (front_of(ramp, other=other) for other in (None, piece))
    assert alone.limits == beside.limits
    size = re.search(r"below about (\d+ ms) between both oars", alone.limits)
    assert size and re.search(rf"catch, right minus left.{{0,30}}{size[1]}", Page(alone.checked).text)


def test_a_number_that_follows_the_rate_has_its_range(piece, ramp):
    assert re.fullmatch(r"3\d\.\d to 4\d\.\d %", range_over_rate(ramp, "rhythm"))
    assert range_over_rate(ramp, "catch_angle_rad") == "" and range_over_rate(piece, "rhythm") == ""
    assert "scatter alone" in front_of(ramp).by_rate


def test_strokes_left_out_are_numbered(piece):
    row = int(np.flatnonzero(~piece.counted)[0])
    assert which_left_out(piece).startswith(f"stroke {row + 1} (")


def test_the_player_shows_three_minutes_and_never_minus_zero():
    long = rowed("S-NB", 12.0, 24.0, 5)
    early = replace(long, time_s=20.0 * long.time_s - 0.4)
    shown_text = player([ReportPiece("", early, technique(long))])
    hint = re.search(r"It shows (\S+) to (\d+) s of the piece; the last (\d+) s are left out", shown_text)
    assert hint and hint[1] == "0" and int(hint[2]) in (180, 181)
    whole = replace(long, time_s=10.0 * long.time_s)
    assert "It shows" not in player([ReportPiece("", whole, technique(long))])
