"""Exports of rowing devices: numbers unchanged in SI, curves that agree with them, no stroke lost, clear refusals."""

import csv
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from command_line import run
from oarlock.rowing import (
    EXPORT_FORMATS,
    FEATURES,
    StrokeTable,
    load_stroke_export,
    save_strokes,
    summarise_strokes,
)
from oarlock.storage.errors import DataError
from refusals import assert_refused

EXAMPLES = Path(__file__).parents[1] / "examples/strokes"
# file, format, strokes counted by hand
SHIPPED = (
    ("quiske_oar.csv", "quiske", 5),
    ("quiske_cut_off.csv", "quiske", 2),
    ("quiske_seat.csv", "quiske", 4),
    ("rp3.csv", "rp3", 22),
    ("speedcoach_empower.csv", "nk-speedcoach", 30),
    ("speedcoach_link_1_26.csv", "nk-speedcoach", 8),
    ("nk_logbook.csv", "nk-logbook", 14),
    ("ergstick.csv", "ergstick", 3),
    ("hero.csv", "hero", 5),
    ("painsled_desktop.csv", "painsled-desktop", 5),
)
# Of Quiske's own stroke angle; asked for.
ARC_SHARE = 0.05
# Of a made curve, 200 points of which are summed: their spacing costs 1e-4.
SUMMED_SHARE = 1e-3
# m; sums of 0.022 in binary.
EXACT_M = 1e-9
# s; RP3 rounds its stamp and both times to 0.01 s, and its stamps run 0.02 s short of them.
RP3_CLOCK_S = 0.06
DEGREE = np.pi / 180


def example(name):
    return load_stroke_export(EXAMPLES / name)


def written(tmp_path, text, name="export.csv", encoding="utf-8"):
    file = tmp_path / name
    file.write_text(text, encoding=encoding)
    return file


def cells_below(file, mark, skipped=0):
    """Rows of a file as dicts, read without any code of the package."""
    rows = list(csv.reader(file.read_text(encoding="utf-8").splitlines()))
    head = next(k for k, row in enumerate(rows) if mark in row)
    return [dict(zip(rows[head], row, strict=False)) for row in rows[head + 1 + skipped :] if any(row)]


def degrees_of(rows, name):
    return np.array([float("nan") if row[name] == "---" else float(row[name]) for row in rows])


# --- recognised, whole ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "format", "strokes"), SHIPPED)
def test_a_shipped_file_is_recognised_whole_explained_and_holds_no_position(name, format, strokes):
    table = example(name)
    assert len(table) == strokes
    assert EXPORT_FORMATS[format].title in table.source
    assert list(load_stroke_export(EXAMPLES / name, format).columns) == list(table.columns)
    for column, values in table.columns.items():
        assert column in FEATURES
        assert [bool(reason) for reason in table.reason(column)] == np.isnan(values).tolist(), column
        assert not {"lat", "lon"} & set(column.split("_"))


def test_no_feature_is_explained_twice():
    folder = Path(__file__).parents[1] / "python/oarlock/rowing/analysis"
    import tomllib

    own, loggers = (
        set(tomllib.loads((folder / name).read_text(encoding="utf-8")))
        for name in ("features.toml", "logger_features.toml")
    )
    assert not own & loggers


# --- Quiske -----------------------------------------------------------------------------------------------


def test_quiske_arc_from_its_curve_agrees_with_its_own():
    table = example("quiske_oar.csv")
    assert np.abs(table["curve_arc_rad"] / table["arc_rad"] - 1).max() < ARC_SHARE
    assert table["arc_rad"][1] == pytest.approx(93.43 * DEGREE)


def quiske(arc_deg, period_s, drive_share, rate, points=200, raw=True):
    """A stroke of a known arc: two half sines of angular velocity, of the drive and of the recovery."""
    phase = (np.arange(points) + 0.5) / points
    drive = np.sin(np.pi * phase / drive_share) * (np.pi / 2) * arc_deg / (drive_share * period_s)
    back = np.sin(np.pi * (phase - drive_share) / (1 - drive_share)) * (np.pi / 2) * arc_deg
    speed = np.where(phase < drive_share, drive, -back / ((1 - drive_share) * period_s))
    accel = ",".join(["0.1"] * round(100 * period_s)) if raw else ""
    curve = ",".join(f"{v:.5f}" for v in speed)
    return f'0,0,{rate},4,,,{arc_deg},150,,,"{accel}","{curve}",\n'


HEADER = (
    "Quiske\ntimestamp(s),distance(m),SPM (strokes per minute),speed (m/s),latitude,longitude,stroke angle (deg),"
    "max drive speed (deg/s),max seat speed (m/s),max seat recovery speed (m/s),boat accelerator curve,"
    "oar angle velocity curve,seat curve\n"
)


@pytest.mark.parametrize("arc_deg", [40, 97.5])
@pytest.mark.parametrize(("period_s", "rate"), [(2.93, 20), (1.52, 39)])
def test_quiske_arc_of_a_known_stroke(tmp_path, arc_deg, period_s, rate):
    table = load_stroke_export(written(tmp_path, HEADER + quiske(arc_deg, period_s, 0.4, rate)))
    assert table["duration_s"][0] == pytest.approx(period_s)
    assert table["curve_arc_rad"][0] / DEGREE == pytest.approx(arc_deg, rel=SUMMED_SHARE)


def test_quiske_duration_comes_from_the_rate_where_nothing_better_is_there(tmp_path):
    table = load_stroke_export(written(tmp_path, HEADER + quiske(100, 3.0, 0.4, 20, raw=False)))
    assert table["duration_s"][0] == pytest.approx(3.0)
    assert table["curve_arc_rad"][0] / DEGREE == pytest.approx(100, rel=SUMMED_SHARE)


def test_quiske_curve_that_a_spreadsheet_cut_gives_no_arc():
    table = example("quiske_cut_off.csv")
    assert np.isnan(table["curve_arc_rad"][0]) and "255 characters" in table.reason("curve_arc_rad")[0]
    assert np.isfinite(table["curve_arc_rad"][1]) and np.isfinite(table["arc_rad"]).all()
    assert "boat_acceleration_m_s2" not in table.curves
    assert any("cut off after 255 characters in 1 of 2 rows" in note for note in table.notes)


def test_quiske_seat_curve_in_its_newer_layout():
    table = example("quiske_seat.csv")
    times, speed = table.curves["seat_drive_speed_m_s"][0].T
    assert len(times) == 200 and times[0] == 0 and times[-1] < table["duration_s"][0]
    # the drive comes first and toward the bow is positive
    assert speed[10:60].mean() > 0.3 > -0.3 > speed[150:195].mean()
    assert 0.3 < table["seat_travel_m"][0] < 0.8
    assert table["time_s"][0] == 0


# --- RP3 --------------------------------------------------------------------------------------------------


def test_rp3_curves_agree_with_its_own_numbers():
    table = example("rp3.csv")
    has = np.array([len(curve) > 0 for curve in table.curves["handle_force_n"]])
    assert has.sum() == 20
    for own in ("handle_travel_m", "peak_force_n", "peak_force_position_m"):
        assert np.abs(table[f"curve_{own}"] - table[own])[has].max() < EXACT_M, own


def test_rp3_row_that_closes_an_interval_stays_with_its_reason():
    table = example("rp3.csv")
    closing = np.flatnonzero(np.isnan(table["handle_travel_m"]))
    assert closing.tolist() == [9, 16]
    assert "closes an interval" in table.reason("peak_force_n")[9]
    assert np.isfinite(table["time_s"]).all()
    assert any("clock begins again with each interval" in note for note in table.notes)


def test_rp3_recovery_follows_the_drive():
    table, rows = example("rp3.csv"), cells_below(EXAMPLES / "rp3.csv", "curve_data")
    assert table["recovery_time_s"][0] == float(rows[1]["recover_time"])
    assert table["recovery_before_s"][1] == float(rows[1]["recover_time"])
    stroke_s = table["end_time_s"] - table["catch_time_s"]
    off_s = stroke_s - table["drive_time_s"] - table["recovery_time_s"]
    # while rowed evenly; the first strokes from a stand have no recovery of their own
    assert np.nanmax(np.abs(off_s[:8])) < RP3_CLOCK_S
    assert np.isnan(table["recovery_time_s"][-1]) and table.reason("recovery_time_s")[-1]


RP3_HEADER = (
    "workout_interval_id,stroke_number,time,stroke_rate,stroke_length,peak_force,peak_force_pos,drive_time,"
    "recover_time,curve_data\n"
)


def test_rp3_point_missing_inside_a_curve_is_not_closed_up(tmp_path):
    curve = "1,2,-32768,5,2,-32768,-32768"
    text = RP3_HEADER + f'7,1,2.0,25,11,5,8.8,0.8,1.6,"{curve}"\n7,2,4.4,25,4.4,5,2.2,0.8,1.6,"5,2"\n'
    table = load_stroke_export(written(tmp_path, text))
    assert np.isnan(table.curves["handle_force_n"][0][2, 1]) and len(table.curves["handle_force_n"][0]) == 5
    assert np.isnan(table["curve_peak_force_n"][0]) and table.reason("curve_peak_force_n")[0]
    assert table["curve_handle_travel_m"][1] == pytest.approx(0.044)


def test_strokes_that_a_file_leaves_out_are_told(tmp_path):
    rows = "".join(f'7,{n},{2.4 * n},25,11,5,8.8,0.8,1.6,"1,2"\n' for n in (1, 2, 5, 6, 6))
    notes = load_stroke_export(written(tmp_path, RP3_HEADER + rows)).notes
    assert any("leaves out 2 strokes, not in the file: line 4" in note for note in notes)
    assert any("the same time as the stroke before: line 6" in note for note in notes)


# --- NK ---------------------------------------------------------------------------------------------------

IN_DEGREES = {
    "Catch": "catch_angle_rad",
    "Finish": "finish_angle_rad",
    "Slip": "slip_rad",
    "Wash": "wash_rad",
    "Max Force Angle": "peak_force_angle_rad",
}
PLAIN = {"Force Max": "peak_force_n", "Force Avg": "mean_force_n", "Work": "work_j", "Power": "power_w"}


def assert_empower_is_unchanged(table, file, shown):
    """Columns as they stand in the file, by the file's names."""
    rows = cells_below(file, "Stroke Rate", skipped=1)
    for theirs in shown:
        ours = table[PLAIN[theirs]] if theirs in PLAIN else np.round(table[IN_DEGREES[theirs]] / DEGREE, 9)
        np.testing.assert_array_equal(ours, degrees_of(rows, theirs), err_msg=theirs)
    assert np.nanmedian(table["catch_angle_rad"]) < 0 < np.nanmedian(table["finish_angle_rad"])


def test_empower_values_are_unchanged():
    name = "speedcoach_empower.csv"
    assert_empower_is_unchanged(example(name), EXAMPLES / name, (*IN_DEGREES, *PLAIN))


def test_empower_strokes_that_the_speedcoach_did_not_count_stay():
    table = example("speedcoach_empower.csv")
    alone = np.isnan(table["time_s"])
    assert alone.sum() == 3 and np.isfinite(table["catch_angle_rad"][alone]).all()
    assert all("did not count" in table.reason("rate_per_min")[row] for row in np.flatnonzero(alone))


def test_empower_effective_arc():
    table = example("speedcoach_empower.csv")
    rest = table["arc_rad"] - table["slip_rad"] - table["wash_rad"]
    np.testing.assert_allclose(table["effective_arc_rad"], rest)


def test_columns_are_found_in_any_order_and_unit(tmp_path):
    rows = list(csv.reader((EXAMPLES / "speedcoach_empower.csv").read_text(encoding="utf-8").splitlines()))
    head = next(k for k, row in enumerate(rows) if "Stroke Rate" in row)
    names = rows[head]
    order = [0, *np.random.default_rng(5).permutation(np.arange(1, len(names))).tolist()]
    speed = names.index("Speed (GPS)")
    rows[head + 1][speed] = "(KPH)"
    moved = [[row[k] for k in order] for row in rows[head:]]
    file = tmp_path / "moved.csv"
    with file.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream, delimiter=";").writerows(moved)
    table, plain = load_stroke_export(file), example("speedcoach_empower.csv")
    assert set(table.columns) == set(plain.columns)
    for name in plain.columns:
        factor = 1 / 3.6 if name == "speed_m_s" else 1.0
        np.testing.assert_allclose(table[name], plain[name] * factor, err_msg=name)


def test_angle_of_peak_force_beyond_the_finish_is_no_oar_angle():
    table = example("speedcoach_link_1_26.csv")
    assert "peak_force_angle_rad" not in table
    assert (table["peak_force_travel_rad"] > table["finish_angle_rad"]).all()
    assert any("no oar angle" in note for note in table.notes)


def test_logbook_takes_strokes_in_order_and_leaves_marks_out():
    table = example("nk_logbook.csv")
    assert (np.diff(table["time_s"]) > 0).all()
    assert any("1 row of other types than 0" in note for note in table.notes)
    assert any("not in order of time" in note for note in table.notes)
    assert np.isnan(table["catch_angle_rad"]).sum() == 1
    np.testing.assert_allclose(table["rhythm"], table["drive_time_s"] / table["duration_s"])


# --- ergometers -------------------------------------------------------------------------------------------


def test_rows_in_time_become_strokes():
    table = example("ergstick.csv")
    assert table["stroke_number"].tolist() == [1, 2, 3]
    assert table["time_s"][:2].tolist() == [1.11, 3.88]
    assert table["recovery_time_s"][0] == 1.75
    assert table["peak_force_n"][0] == pytest.approx(228.4 * 4.4482216, rel=1e-7)


def test_clock_times_and_paces():
    table = example("hero.csv")
    assert table["time_s"][1] == pytest.approx(4.7)
    assert table["speed_m_s"][1] == pytest.approx(500 / 212.0)
    assert table["handle_travel_m"][1] == pytest.approx(1.36)


def test_forces_of_a_concept2_in_newton():
    table = example("painsled_desktop.csv")
    curve = table.curves["handle_force_n"][0]
    assert curve.max() == table["curve_peak_force_n"][0] > 400


# --- refused ----------------------------------------------------------------------------------------------

ERGDATA = "Stroke Number,Time (seconds),Distance (meters),Pace (seconds per 500m,Stroke Rate\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<?xml?>\n<TrainingCenterDatabase>", "is no whole XML"),
        ("=====\tCrew Info\na\tb\n", "Peach PowerLine"),
        (
            "Interval,Type,Distance(m),Time,Stroke,Rate,Split(sec)\n1,D,20,1,3,12,4\n",
            "a row every few metres",
        ),
        ("a,b\n1,2\n", "not a known stroke export"),
        ("", "not a known stroke export"),
        ("\x00\x01,;", "zero bytes"),
        (ERGDATA, "contains no strokes"),
        (ERGDATA + "1,3.9,12,172,20\n2,x,12,172,20\n", 'csv:3, column "Time (seconds)": "x" is not a number'),
        (ERGDATA + "1,1e99,12,172,20\n", "is not a number"),
        (ERGDATA + "1,3.9,12\n", "csv:2: has 3 cells, the header has 5"),
        (ERGDATA.replace(",", ";") + "1;3,9;12;172;20\n", "Is it a decimal comma?"),
        ("Interval,Elapsed Time,Stroke Rate\n1,00:01,20\n", "not followed by a row of units"),
        (
            "Interval,Speed (GPS),Elapsed Time,Stroke Rate\n(Interval),(Knots),(s),(SPM)\n",
            '"(knots)" is not known',
        ),
        ("Interval,Elapsed Time,Stroke Rate\n(Interval),(HH),(SPM)\n1,soon,20\n", "not a time such as"),
    ],
)
def test_refusal_says_what_the_file_is(tmp_path, text, says):
    with pytest.raises(DataError, match=r"export\.csv") as refusal:
        load_stroke_export(written(tmp_path, text))
    assert says in str(refusal.value)


def test_format_that_is_not_known_or_not_that_of_the_file(tmp_path):
    assert_refused(lambda: load_stroke_export(EXAMPLES / "rp3.csv", "rp4"), "known are quiske, rp3")
    assert_refused(lambda: load_stroke_export(EXAMPLES / "rp3.csv", "quiske"), "not a file of Quiske")
    assert_refused(lambda: load_stroke_export(tmp_path / "absent.csv"), "cannot be read")


def test_utf_16_and_western_european_text(tmp_path):
    text = ERGDATA + "1,3.9,12,172,20\n"
    assert len(load_stroke_export(written(tmp_path, text, encoding="utf-16"))) == 1
    assert len(load_stroke_export(written(tmp_path, "Ruderer: Jürgen,\n" + text, encoding="cp1252"))) == 1


# --- files and command line -------------------------------------------------------------------------------


def test_saved_strokes_read_back(tmp_path):
    table = example("quiske_cut_off.csv")
    csv_file, parquet_file = save_strokes(table, tmp_path / "out")
    back = pq.read_table(parquet_file)
    arcs = back["curve_arc_rad"].to_pylist()
    assert arcs[0] is None and arcs[1] == table["curve_arc_rad"][1]
    assert "255" in back["curve_arc_rad_reason"].to_pylist()[0]
    assert [len(curve) for curve in back["oar_rate_rad_s_curve"].to_pylist()] == [0, 200]
    assert len(back["oar_rate_rad_s_curve_at"].to_pylist()[1]) == 200
    assert json.loads(back.schema.metadata[b"notes"]) == list(table.notes)
    assert b"Finish angle minus catch angle" in back.schema.field("arc_rad").metadata[b"meaning"]
    lines = [line for line in csv_file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    assert len(lines) == 1 + len(table) and lines[0].startswith("time_s,")


def test_summary_is_in_degrees_and_counts_what_is_there():
    rows = {row.name: row for row in summarise_strokes(example("speedcoach_empower.csv"))}
    catch = rows["catch_angle_rad"]
    assert (catch.unit, catch.strokes, catch.median) == ("deg", 29, pytest.approx(-59.0))
    assert "time_s" not in rows
    left_out = StrokeTable({"arc_rad": np.array([1.0, 9.0]), "in_averages": np.array([1.0, 0.0])})
    assert summarise_strokes(left_out)[0].strokes == 1


def test_command_shows_and_writes(tmp_path):
    shown = run("rowing", "strokes", EXAMPLES / "speedcoach_empower.csv", "--each", "--out", tmp_path / "out")
    assert "30 strokes" in shown.output and "catch angle" in shown.output and "-59.0" in shown.output
    written = {file.name for file in (tmp_path / "out").iterdir()}
    assert written == {"oarlock-manifest.toml", "strokes.csv", "strokes.parquet"}
    document = json.loads(run("rowing", "strokes", EXAMPLES / "rp3.csv", "--json").stdout)
    assert document["strokes"] == len(document["rows"]) == 22
    assert document["rows"][9]["peak_force_n"] is None


def test_page_shows_what_the_command_prints():
    page = (Path(__file__).parents[1] / "docs/stroke-exports.md").read_text(encoding="utf-8")
    shown = run("rowing", "strokes", EXAMPLES / "speedcoach_empower.csv").stdout
    assert shown.startswith("speedcoach_empower.csv") and shown in page


def test_command_refuses(tmp_path):
    for arguments, status, words in (
        ((tmp_path / "absent.csv",), 1, "cannot be read"),
        ((EXAMPLES / "rp3.csv", "--format", "rp4"), 2, "--format rp4: is not known"),
        ((tmp_path, "--format", "rp3"), 2, "--format needs a file"),
        ((tmp_path,), 1, "contains neither"),
    ):
        assert words in " ".join(run("rowing", "strokes", *arguments, status=status).stderr.split())


def test_command_takes_a_track_or_a_recording(tmp_path):
    run("simulate", "--out", tmp_path / "trial", "--duration-s", 8)
    for folder in (tmp_path / "trial", tmp_path / "trial/truth"):
        shown = run("rowing", "strokes", folder, "--json")
        assert json.loads(shown.stdout)["strokes"] >= 2
