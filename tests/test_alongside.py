"""Exports beside the motion: clocks related by stroke onsets, force placed on its stroke, and the page of an export."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import made_exports as made
from command_line import run
from html_page import Page, assert_loads_nothing, assert_references_lead_somewhere
from local_data import local_folder
from oarlock.rowing import StrokeTable, load_export
from oarlock.rowing.alongside.align import NO_ONSET, align_strokes
from oarlock.rowing.alongside.clock_match import match_clocks
from oarlock.rowing.alongside.course import course_of, pieces_of, splits_of, starts_of
from oarlock.rowing.alongside.force_curves import FORCES, force_stacks, forces_on_strokes
from oarlock.rowing.alongside.paces import clock_text, pace_text
from oarlock.rowing.analysis.technique import technique
from oarlock.rowing.report.export_front import findings_of_export
from oarlock.rowing.report.export_page import strokes_page, write_strokes_report
from oarlock.rowing.report.export_piece import ExportPiece, resolution, where_lost
from oarlock.storage.errors import DataError
from rowed_truth import rowed

EXAMPLES = Path(__file__).parents[1] / "examples" / "strokes"
WITHIN_S = 0.020
"""A force curve belongs within this of its stroke."""
TRACK_STD_S = 0.004
"""Of a catch found in an oar angle with 0.1 deg of noise."""


def catches(kind: str, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    period_s = {
        "ramp": 60.0 / np.linspace(18.0, 34.0, count) + rng.normal(0.0, 0.02, count),
        "steady": 2.7 + rng.normal(0.0, 0.03, count),
        "regular": np.full(count, 2.7),
    }[kind]
    return 20.0 + np.cumsum(period_s)


def track_of(catch_s: np.ndarray, seed: int = 0) -> StrokeTable:
    """The strokes of a track, with the noise of their times, and the speed of the handle that `made` has."""
    noisy_s = catch_s + np.random.default_rng(seed).normal(0.0, TRACK_STD_S, len(catch_s))
    percent = np.linspace(0.0, 1.0, 101)
    share = np.clip(percent / made.DRIVE_SHARE, 0.0, 1.0)
    speed = np.where(percent <= made.DRIVE_SHARE, 1.0 - np.cos(2.0 * np.pi * share), 0.0)
    return StrokeTable(
        {"catch_time_s": noisy_s[:-1], "end_time_s": noisy_s[1:]},
        curves={"handle_speed_m_s": (speed,) * (len(catch_s) - 1)},
    )


# --- clocks -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["ramp", "steady"])
@pytest.mark.parametrize("seed", range(5))
def test_offset_and_drift_are_found_though_strokes_are_missing(kind, seed):
    rng = np.random.default_rng(seed)
    true_s = catches(kind, 120, seed)
    offset_s, drift = rng.uniform(-3000.0, 3000.0), rng.normal(0.0, 40e-6)
    device_s = np.round(true_s * (1.0 + drift) + offset_s + rng.normal(0.0, 0.006, 120), 2)
    device_s = device_s[5:][rng.random(115) > 0.05]
    track_s = np.sort(np.append(np.delete(true_s, [30, 31, 80]), true_s[60] + 1.2))
    match = match_clocks(device_s, track_s)
    assert match is not None and not match.rivals_s
    wrong_s = match.on_track(device_s) - (device_s - offset_s) / (1.0 + drift)
    assert np.abs(wrong_s).max() < 0.010
    assert np.abs(wrong_s).max() < 4.0 * match.std_s(device_s).max()


def test_regular_strokes_are_ambiguous_unless_the_moments_decide():
    true_s = catches("regular", 60, 0)
    device_s = true_s[3:50] - 100.0
    match = match_clocks(device_s, true_s)
    assert match is not None and match.rivals_s
    told = match_clocks(device_s, true_s, near_s=100.4)
    assert told is not None and not told.rivals_s
    assert told.offset_s == pytest.approx(100.0, abs=0.01)


def test_few_strokes_are_not_matched():
    assert match_clocks(np.arange(5.0), np.arange(50.0)) is None


def test_strokes_that_are_too_regular_are_reported_and_not_aligned():
    true_s = catches("regular", 40, 0)
    found = align_strokes(StrokeTable({"catch_time_s": true_s[2:30] - 50.0}), track_of(true_s))
    assert found.count == 0 and "too regular" in found.notes[0]
    given = align_strokes(StrokeTable({"catch_time_s": true_s[2:30] - 50.0}), track_of(true_s), offset_s=50.3)
    assert given.stroke[0] == 2


def test_each_run_of_a_clock_that_restarts_has_its_own_offset():
    true_s = catches("ramp", 60, 1)
    device_s = np.concatenate([true_s[:25] - true_s[0], true_s[30:] - true_s[30]])
    found = align_strokes(StrokeTable({"catch_time_s": device_s}), track_of(true_s))
    assert len(found.matches) == 2
    assert found.stroke[:25].tolist() == list(range(25))
    assert found.stroke[25] == 30


def test_stamps_without_a_definition_place_no_curve():
    true_s = catches("ramp", 60, 2)
    export = StrokeTable({"time_s": true_s - 7.0}, curves={"handle_force_n": (np.ones(9),) * 60})
    found = align_strokes(export, track_of(true_s))
    assert found.count > 50 and NO_ONSET in found.notes
    assert forces_on_strokes(export, track_of(true_s), found) == []


def test_exports_without_times_are_refused():
    with pytest.raises(DataError, match="has no times"):
        align_strokes(StrokeTable({"power_w": np.ones(9)}), track_of(catches("ramp", 20, 0)))


# --- force ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("write", [made.rp3, made.painsled_desktop, made.peach])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_force_curves_lie_within_20_ms_of_their_stroke(tmp_path, write, seed):
    true_s = catches(("ramp", "steady")[seed % 2], 70, seed)
    device_s = (true_s - true_s[0]) * (1.0 + 30e-6) + 12.0
    export = load_export(write(tmp_path / "export.txt", device_s))
    track = track_of(true_s, seed)
    found = align_strokes(export, track)
    assert found.count >= 60
    for stack in forces_on_strokes(export, track, found):
        for row, stroke in enumerate(found.stroke):
            known = stack.force_n[row] > 0.0
            if stroke < 0 or not known.any():
                continue
            lasted_s = track["end_time_s"][stroke] - track["catch_time_s"][stroke]
            at_s = track["catch_time_s"][stroke] + stack.at / 100.0 * lasted_s
            share = (at_s - true_s[stroke]) / (made.DRIVE_SHARE * (true_s[stroke + 1] - true_s[stroke]))
            planted = np.where((share > 0.0) & (share < 1.0), made.force_n(share), 0.0)
            got = np.nan_to_num(stack.force_n[row])
            inside = share < 1.3  # a gate's curve goes on to the next drive
            apart_s = (at_s @ (got * inside)) / (got * inside).sum() - (at_s @ planted) / planted.sum()
            assert abs(apart_s) < WITHIN_S


@pytest.mark.parametrize("name", ["rp3_curve", "rp3intervals", "painsled_desktop_example"])
def test_a_real_export_is_placed_on_the_strokes_of_a_track(name):
    """The real onsets of a device, seen by a track with another clock that has its own noise and lacks strokes."""
    export = load_export(local_folder("data/rowingdata_samples/testdata") / f"{name}.csv")
    onset_s = export["catch_time_s"]
    known = np.flatnonzero(np.isfinite(onset_s))
    run = max(np.split(known, np.flatnonzero(np.diff(onset_s[known]) < 0.0) + 1), key=len)
    true_s = onset_s[run] * (1.0 - 20e-6) + 4321.0
    found = align_strokes(export, track_of(np.delete(true_s, [7, 20, 21])))
    aligned = run[found.stroke[run] >= 0]
    assert len(run) > 100 and len(aligned) >= 0.9 * len(run)
    assert np.abs(found.onset_s - onset_s * (1.0 - 20e-6) - 4321.0)[aligned].max() < WITHIN_S


def test_force_has_its_axis():
    rp3, painsled = (
        force_stacks(load_export(EXAMPLES / f"{name}.csv"))[0] for name in ("rp3", "painsled_desktop")
    )
    assert (rp3.unit, painsled.unit) == ("m", "%")
    assert rp3.at[-1] == pytest.approx(1.23, abs=0.1)
    assert "spread evenly" in painsled.how and not rp3.how


# --- Peach ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_peach_file_gives_strokes_with_angle_and_force(tmp_path, encoding):
    catch_s = catches("steady", 20, 3)
    found = load_export(made.peach(tmp_path / "p.txt", catch_s, encoding=encoding))
    apart_s = np.abs(found["catch_time_s"][:, None] - catch_s[None, :]).min(axis=1)
    assert len(found) >= 17 and apart_s.max() < 0.015  # a sample is 20 ms; the curvature jumps at the turn
    assert np.degrees(found["catch_angle_rad"][5]) == pytest.approx(-60.0, abs=0.3)
    assert found["r_peak_gate_force_n"][5] == pytest.approx(made.PEAK_N, rel=0.01)
    assert found["speed_m_s"][5] == pytest.approx(4.2)
    assert set(found.curves) & set(FORCES) == {"r_gate_force_n", "l_gate_force_n"}


def test_a_peach_file_of_a_crew_needs_a_seat(tmp_path):
    file = made.peach(tmp_path / "p.txt", catches("steady", 12, 4), seats=(1, 2))
    with pytest.raises(DataError, match=r"seats 1, 2\. Choose one with --seat"):
        load_export(file)
    assert len(load_export(file, seat=2)) >= 10


def test_a_peach_file_without_periodic_data_is_refused(tmp_path):
    file = tmp_path / "p.txt"
    file.write_text("=====\tCrew Info\na\tb\n", encoding="utf-8")
    with pytest.raises(DataError, match="0 sections Periodic"):
        load_export(file)


# --- changes and pace -------------------------------------------------------------------------------------


def fading(seed: int, lost_m: float) -> StrokeTable:
    rng = np.random.default_rng(seed)
    rate = 20.0 + rng.normal(0.0, 1.0, 90)
    travel = 1.40 - 0.004 * (rate - 20.0) + rng.normal(0.0, 0.015, 90)
    travel[60:] -= lost_m
    force = 600.0 + 8.0 * (rate - 20.0) + rng.normal(0.0, 20.0, 90)
    return StrokeTable({"rate_per_min": rate, "handle_travel_m": travel, "peak_force_n": force})


def test_a_planted_change_is_named_first_and_nothing_where_nothing_changed():
    named = [findings_of_export(ExportPiece(fading(seed, 0.06))) for seed in range(10)]
    assert sum(bool(found) and found[0].name == "handle_travel_m" for found in named) >= 9
    assert sum(not findings_of_export(ExportPiece(fading(seed, 0.0))) for seed in range(20)) >= 19


def test_last_time_is_compared_only_with_the_same_device():
    earlier, now = (
        replace(fading(seed, lost_m), source=f"{seed}.csv: RP3") for seed, lost_m in ((1, 0.0), (2, 0.0))
    )
    shorter = replace(now, columns={**now.columns, "handle_travel_m": now["handle_travel_m"] - 0.08})
    pieces = ExportPiece(shorter), ExportPiece(earlier)
    assert [one.kind for one in findings_of_export(*pieces)] == ["against last"]
    other = replace(earlier, source="1.csv: Concept2")
    assert findings_of_export(pieces[0], ExportPiece(other)) == []
    assert "not assessed, because the devices differ (RP3, Concept2)" in strokes_page(shorter, other)


def test_the_effect_of_the_rate_is_no_change():
    rate = np.linspace(18.0, 34.0, 90)
    scatter = np.random.default_rng(0).normal(0.0, 0.01, 90)
    travel = 1.5 - 0.01 * (rate - 18.0) + scatter
    assert not findings_of_export(ExportPiece(StrokeTable({"rate_per_min": rate, "handle_travel_m": travel})))


def test_splits_are_at_marks_of_500_m():
    distance_m = np.arange(0.0, 2005.0, 9.0)
    table = StrokeTable({"time_s": distance_m / 4.0, "distance_m": distance_m})
    parts = splits_of(course_of(table))
    assert [part.name for part in parts[:4]] == ["to 500 m", "to 1000 m", "to 1500 m", "to 1998 m"]
    assert [part.duration_s for part in parts[:3]] == pytest.approx([125.0] * 3)
    assert pace_text(4.0) == "2:05.0" and pace_text(0.0) == pace_text(np.nan) == "–"


def outing() -> StrokeTable:
    """Standing, a start, 2000 m at 4 m/s and 30/min with a misread stroke, 60 s of pause, 600 m, and paddling."""
    waited = [(5.0, 0.2, 20.0, 0.2), (9.0, 0.4, 31.0, 0.1)]
    rows, time_s, way_m = list(waited), 40.0, 0.4
    parts = [(1, speed, 33.0) for speed in (0.8, 1.6, 2.6)]
    parts += [(250, 4.0, 30.0), (0, 0.0, 0.0), (75, 4.0, 30.0), (6, 1.2, 10.0)]
    for count, speed, rate in parts:
        if not count:
            time_s, way_m = time_s + 60.0, way_m + 30.0
        for _ in range(count):
            time_s, way_m = time_s + 60.0 / rate, way_m + speed * 60.0 / rate
            rows.append((time_s, way_m, rate, speed))
    rows[100] = (*rows[100][:2], 80.0, rows[100][3])
    columns = np.array(rows).T
    names = ("time_s", "distance_m", "rate_per_min", "speed_m_s")
    return StrokeTable(dict(zip(names, columns, strict=True)), source="out.csv: Made")


def test_only_rowing_counts_and_every_row_has_its_place():
    course = course_of(outing())
    assert [one.strokes for one in pieces_of(course)] == [249, 75]  # one misread
    assert [(one.name, one.strokes) for one in starts_of(course)] == [("standing start", 3)]
    assert [round(one.pause_s) for one in pieces_of(course)] == [0, 62]
    assert int(course.counted.sum()) + sum(course.left_out.values()) == len(outing())
    assert sum(one.strokes for one in splits_of(course)) == 252
    assert course.duration_s < course.total_s - 60.0


def test_pace_is_rowed_distance_over_rowed_time_and_splits_add_up():
    course = course_of(outing())
    splits, piece = splits_of(course), course.longest
    assert piece is not None
    assert sum(one.duration_s for one in splits) == pytest.approx(piece.duration_s)
    assert sum(one.distance_m for one in splits) == pytest.approx(piece.distance_m)
    parts = [*starts_of(course), *pieces_of(course)]
    assert sum(one.duration_s for one in parts) == pytest.approx(course.duration_s)
    assert sum(one.distance_m for one in parts) == pytest.approx(course.distance_m)
    assert splits[1].speed_m_s == pytest.approx(4.0, abs=0.001)
    page = strokes_page(outing())
    pace = pace_text(course.steady_m / course.steady_s)
    assert f"{clock_text(course.duration_s, tenths=True)}" in page and f"<b>{pace}</b>" in page
    assert "327 strokes rowed in 2 pieces" in Page(page).text


def test_intervals_of_a_clock_that_restarts_keep_their_whole_distance():
    step = np.arange(1.0, 101.0)
    table = StrokeTable(
        {
            "time_s": np.tile(2.5 * step, 2),
            "distance_m": np.tile(10.0 * step, 2),
            "interval": np.repeat([1.0, 2.0], 100),
        }
    )
    pieces = pieces_of(course_of(table))
    assert [one.distance_m for one in pieces] == pytest.approx([1000.0, 1000.0])
    assert [one.duration_s for one in pieces] == pytest.approx([250.0, 250.0])
    assert np.isnan(pieces[1].pause_s)


@pytest.mark.parametrize("write", [made.rp3, made.painsled_desktop, made.peach])
def test_distance_and_time_of_a_piece_are_those_of_the_same_moments(tmp_path, write):
    course = course_of(load_export(write(tmp_path / "export.txt", catches("steady", 70, 0))))
    for part in (*pieces_of(course), *splits_of(course)):
        assert part.speed_m_s == pytest.approx(made.SPEED_M_S, rel=0.001)


def test_the_pace_of_an_rp3_is_that_of_the_machine():
    course = course_of(load_export(EXAMPLES / "rp3.csv"))
    assert (round(course.distance_m, 1), round(course.duration_s, 2)) == (77.9, 23.42)
    own_s = 151.0  # its estimated_500m_time; its stamps run 0.02 s a stroke short of its other times
    for part in (*pieces_of(course), *splits_of(course)):
        assert 500.0 / part.speed_m_s == pytest.approx(own_s, rel=0.01)


def test_a_gap_in_which_the_boat_went_on_is_no_pause():
    step = np.delete(np.arange(1.0, 101.0), slice(40, 46))
    assert len(course_of(StrokeTable({"time_s": 2.5 * step, "distance_m": 10.0 * step})).stretches) == 1


def test_what_fell_first_is_named_and_nothing_where_nothing_fell():
    rng = np.random.default_rng(0)
    rate, fell = 28.0 + rng.normal(0.0, 0.3, 200), np.linspace(0.0, 1.0, 200)
    noise = rng.normal(0.0, 0.01, (2, 200))
    force = 300.0 * (1.0 - 0.12 * fell + noise[0])
    arc = np.radians(110.0) * (1.0 - 0.01 * fell + noise[1])
    table = StrokeTable(
        {
            "time_s": np.cumsum(60.0 / rate),
            "rate_per_min": rate,
            "mean_force_n": force,
            "arc_rad": arc,
            "power_w": 0.75 * force * arc * rate / 60.0,
        }
    )
    piece = ExportPiece(table)
    assert "Look at the force first" in where_lost(piece.faded, piece.course)
    steady = ExportPiece(
        replace(table, columns={**table.columns, "power_w": 200.0 + rng.normal(0.0, 2.0, 200)})
    )
    assert where_lost(steady.faded, steady.course) == ""


def test_a_device_that_rounds_to_coarse_steps_is_not_certain():
    values = np.tile([100.0, 100.0, 105.0], 5)
    assert resolution(values) == 5.0 and resolution(np.ones(4)) == 0.0


# --- the page ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rp3", "painsled_desktop", "speedcoach_empower", "nk_logbook", "hero"])
def test_every_export_has_a_page_that_loads_nothing(tmp_path, name):
    shares: list[float] = []
    file = write_strokes_report(load_export(EXAMPLES / f"{name}.csv"), tmp_path, progress=shares.append)
    assert shares == [1.0]
    page = Page(file.read_text("utf-8"))
    assert not page.errors
    assert_loads_nothing(page)
    assert_references_lead_somewhere(page)


def test_the_page_begins_with_who_and_what():
    found = load_export(EXAMPLES / "speedcoach_empower.csv")
    whole = strokes_page(found, found, {"athlete": "A07", "place": "Lake"})
    assert_references_lead_somewhere(Page(whole))
    text = whole.partition("<body")[2]
    order = [
        "<h1>A07: ",
        " strokes, ",
        "Lake",
        "What stands out",
        "Compared with earlier",
        "How it was measured</h2",
    ]
    places = [text.index(word) for word in order]
    assert places == sorted(places)


# --- the verbs --------------------------------------------------------------------------------------------


def test_the_verb_writes_a_page_and_compares(tmp_path):
    page = tmp_path / "piece.html"
    file = str(EXAMPLES / "speedcoach_empower.csv")
    run("rowing", "strokes", file, "--report", str(page), "--last", file)
    assert "last time" in page.read_text("utf-8")
    assert "exists" in run("rowing", "strokes", file, "--report", str(page), status=2).output


def test_the_page_names_who_rowed_as_given_or_as_session_toml_says(tmp_path):
    file = tmp_path / "rp3.csv"
    file.write_bytes((EXAMPLES / "rp3.csv").read_bytes())
    (tmp_path / "session.toml").write_text('athlete = "B12"\nplace = "Lake"\n', encoding="utf-8")
    run("rowing", "strokes", str(file), "--report", str(tmp_path / "a.html"))
    run(
        "rowing",
        "strokes",
        str(file),
        "--report",
        str(tmp_path / "b.html"),
        "--athlete",
        "A07",
        "--boat",
        "1x",
    )
    texts = [Page((tmp_path / name).read_text("utf-8")).text for name in ("a.html", "b.html")]
    assert "B12: " in texts[0] and "Lake" in texts[0]
    assert "A07: " in texts[1] and "boat 1x" in texts[1] and "Lake" in texts[1]
    assert (
        "--athlete needs --report" in run("rowing", "strokes", str(file), "--athlete", "A07", status=2).output
    )
    assert "Athlete, date and place not in the file." in strokes_page(load_export(file))


def test_the_report_of_a_track_shows_force_beside_the_motion(tmp_path):
    track = rowed("B-NB", 40.0, 24.0, 0)
    catch_s = technique(track).strokes["catch_time_s"]
    track.save(tmp_path / "out")
    export = made.rp3(tmp_path / "rp3.csv", catch_s + 200.0)
    # Strokes of a steady simulation are too regular to be related by their intervals.
    run(
        "report",
        str(tmp_path / "out"),
        "--with",
        str(export),
        "--offset-s",
        "-200",
        "--out",
        str(tmp_path / "piece.html"),
    )
    page = Page((tmp_path / "piece.html").read_text("utf-8"))
    assert not page.errors
    assert_loads_nothing(page)
    assert_references_lead_somewhere(page)
    assert "Force beside the motion" in page.text and "Force of rp3.csv: RP3" in page.text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["rowing", "strokes", str(EXAMPLES / "rp3.csv"), "--last", "other.csv"], "--last needs --report"),
        (["rowing", "strokes", str(EXAMPLES), "--report", "piece.html"], "is a folder"),
        (["report", str(EXAMPLES), "--offset-s", "3"], "--offset-s needs --with"),
    ],
)
def test_the_verbs_say_what_is_missing(words, says):
    assert says in run(*words, status=2).output


def test_the_verb_reads_a_seat_of_a_crew(tmp_path):
    file = made.peach(tmp_path / "p.txt", catches("steady", 12, 4), seats=(1, 2))
    assert "seat 2" in run("rowing", "strokes", str(file), "--seat", "2").output
