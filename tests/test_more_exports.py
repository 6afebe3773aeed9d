"""RowingData and Concept2 logbook files, the moment at which an export began, and what a season keeps of it.

The files are written by hand after what rowingdata 3.8.2, Open Rowing Monitor and log.concept2.com write.
"""

import datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import fit_bytes
import season_support as support
from oarlock.rowing import Activity, StrokeTable, load_export, load_stroke_export
from oarlock.rowing.exports.starts import epoch_of_text
from oarlock.rowing.strokes.table import running
from oarlock.season import Admission, create_season
from oarlock.season.compute import run_job
from oarlock.season.run import make_plan
from oarlock.season.tables import catalogue, update_tables
from refusals import assert_refused

EXAMPLES = Path(__file__).parents[1] / "examples/strokes"
DEGREE = np.pi / 180
POUND_N = 4.4482216152605
START_S = 1_777_620_600.5
START = "2026-05-01T07:30:00.500000000Z"


def saved(folder: Path, text: str, name: str = "row.csv") -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def strokes_of(file: Path) -> StrokeTable:
    found = load_export(file)
    assert isinstance(found, StrokeTable)
    return found


# --- RowingData ---------------------------------------------------------------------------------------------

ROWSANDALL = (
    "index,TimeStamp (sec), Horizontal (meters), Cadence (stokes/min), HRCur (bpm), Stroke500mPace (sec/500m),"
    " Power (watts), DriveLength (meters), StrokeDistance (meters), DriveTime (ms), StrokeRecoveryTime (ms),"
    " AverageDriveForce (lbs), PeakDriveForce (lbs), lapIdx, latitude, longitude,catch,finish,slip,wash\n"
)


def rowsandall(count: int = 4, step_s: float = 2.5) -> str:
    """Strokes at 24 a minute, of which the last has no number of the oarlock."""
    rows = [
        f"{k},{START_S + step_s * k},{10 * k},24.0,{140 + k},125.0,180,0,10,900,1600,45,120,{k // 2},49.11,17.48,"
        + ("0,0,0,0" if k == count - 1 else f"-55.{k},40,0,12")
        for k in range(count)
    ]
    return ROWSANDALL + "\n".join(rows) + "\n"


def test_rowingdata_strokes_are_read_in_si(tmp_path: Path) -> None:
    found = strokes_of(saved(tmp_path, rowsandall()))
    assert found.epoch == START and found.duration_s == 7.5
    assert found["time_s"].tolist() == [0, 2.5, 5, 7.5] and found["interval"].tolist() == [1, 1, 2, 2]
    np.testing.assert_allclose(found["speed_m_s"], 4.0)
    np.testing.assert_allclose(found["peak_force_n"], 120 * POUND_N)
    np.testing.assert_allclose(found["drive_time_s"], 0.9)
    np.testing.assert_allclose(found["catch_angle_rad"][:3] / DEGREE, [-55.0, -55.1, -55.2])
    np.testing.assert_allclose(found["arc_rad"][0] / DEGREE, 95.0)
    assert found["slip_rad"][:3].tolist() == [0, 0, 0]
    assert np.isnan(found["slip_rad"][3]) and found.reason("slip_rad")[3] == "0 in the file: not measured"
    assert "handle_travel_m" not in found and not any("tude" in name for name in found.columns)


def test_rowingdata_of_open_rowing_monitor(tmp_path: Path) -> None:
    """Blanks before names, an empty first one, forces in newton, NaN."""
    text = (
        ",index, Stroke Number, lapIdx,TimeStamp (sec), ElapsedTime (sec), HRCur (bpm),DistanceMeters,"
        " Cadence (stokes/min), Stroke500mPace (sec/500m), DriveLength (meters), DragFactor, PeakDriveForce (N),"
        " PeakForcePositionNorm, AverageDriveForce (N),Handle_Force_(N)\n"
        + "".join(
            f'{k},{k},{k},0,{START_S + 2.5 * k},{2.5 * k},NaN,{10 * k},24,inf,1.31,110,601.5,0.4,350,"1,2,3"\n'
            for k in (1, 2, 4)
        )
    )
    found = strokes_of(saved(tmp_path, text))
    assert found["peak_force_n"].tolist() == [601.5] * 3 and found["handle_travel_m"].tolist() == [1.31] * 3
    assert "speed_m_s" not in found and "heart_rate_per_min" not in found
    assert any("leaves out 1 stroke, not in the file: line 4" in note for note in found.notes)


def test_rows_every_second_are_points_in_time(tmp_path: Path) -> None:
    found = load_export(saved(tmp_path, rowsandall(30, step_s=1.0)))
    assert isinstance(found, Activity) and len(found) == 30 and found.epoch == START
    np.testing.assert_allclose(found["rate_per_min"], 24)
    assert_refused(lambda: load_stroke_export(tmp_path / "row.csv"), "30 points in time and no strokes")


def test_rows_every_second_with_a_count_of_strokes_are_strokes(tmp_path: Path) -> None:
    head = "TimeStamp (sec), Cadence (stokes/min), Stroke Number, DriveTime (ms)\n"
    rows = "".join(f"{START_S + k},24,{int(k * 0.4)},{900 + k}\n" for k in range(30))
    found = strokes_of(saved(tmp_path, head + rows))
    assert found["stroke_number"].tolist() == list(range(1, 12))
    assert found["time_s"][:3].tolist() == [3, 5, 8] and found["drive_time_s"][:3].tolist() == [
        0.904,
        0.907,
        0.909,
    ]
    assert any("30 rows in time contain 11 strokes" in note for note in found.notes)


def test_a_finish_without_catches_is_the_arc(tmp_path: Path) -> None:
    text = "TimeStamp (sec), Cadence (stokes/min),catch,finish\n"
    found = strokes_of(saved(tmp_path, text + "1,24,0,95\n3.5,24,0,96\n"))
    np.testing.assert_allclose(found["arc_rad"] / DEGREE, [95, 96])
    assert not {"catch_angle_rad", "finish_angle_rad"} & set(found.columns) and found.epoch == ""
    assert found["time_s"].tolist() == [1, 3.5]


def test_rowingdata_refusals_name_line_and_column(tmp_path: Path) -> None:
    text = rowsandall().replace("125.0", "fast", 1)
    assert_refused(
        lambda: load_export(saved(tmp_path, text)), 'row.csv:2, column "Stroke500mPace (sec/500m)": "fast"'
    )
    assert_refused(lambda: load_export(saved(tmp_path, ROWSANDALL)), "contains no strokes")


# --- Concept2 logbook ---------------------------------------------------------------------------------------

LOGBOOK = '"Number","Time (seconds)","Distance (meters)","Pace (seconds)","Watts","Cal/Hr","Stroke Rate","Heart Rate"\n'


def test_strokes_of_the_concept2_logbook(tmp_path: Path) -> None:
    rows = '"1","2.9","11.8","122.9","188","948","0",""\n"2","5.2","21.4","119.8","204","1000","26","121"\n'
    again = '"1","2.5","10.1","123.0","188","948","25","125"\n'
    found = strokes_of(saved(tmp_path, LOGBOOK + rows + again))
    assert "Concept2 logbook" in found.source and found.epoch == ""
    np.testing.assert_allclose(found["speed_m_s"], 500 / np.array([122.9, 119.8, 123.0]))
    assert found["power_w"].tolist() == [188, 204, 188] and np.isnan(found["rate_per_min"][0])
    assert any("the clock begins again" in note for note in found.notes)
    assert found.duration_s == pytest.approx(7.7)


@pytest.mark.parametrize("rate", ["Stroke Rate/Cadence", "Stroke Rate"])
def test_a_season_of_the_concept2_logbook_has_no_strokes(rate: str, tmp_path: Path) -> None:
    text = f'"Log ID","Date","Description","Work Time (Formatted)","Work Distance","{rate}"\n'
    file = saved(tmp_path, text + '"1","2026-05-01 09:30:00","5000m row","21:11.3","5000","24"\n')
    assert_refused(
        lambda: load_export(file), "a row is a workout, not a stroke", "open a workout and export its CSV"
    )


# --- the moment of 0 s --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "epoch"),
    [
        ("nk_logbook.csv", "2021-03-30T11:13:05.000000000Z"),
        ("quiske_oar.csv", "2017-05-21T06:31:32.794780000Z"),
        ("painsled_desktop.csv", "2016-03-29T17:41:27.093000000Z"),
        ("hero.csv", "2021-04-26T13:37:32.000000000Z"),
        ("rp3.csv", ""),
        ("ergstick.csv", ""),
    ],
)
def test_shipped_exports_begin_when_they_say(name: str, epoch: str) -> None:
    found = load_export(EXAMPLES / name)
    assert found.epoch == epoch
    assert found.duration_s is not None and found.duration_s > 0


SPEEDCOACH = (
    "Session Information:,\nStart Time:,09/21/16 06:32am\nInterval,Elapsed Time,Stroke Rate\n"
    "(Interval),(HH:MM:SS.tenths),(SPM)\n1,00:01:21.5,20\n1,00:01:24.5,20\n"
)
BOATCOACH = (
    "workoutType,strokeRate,strokeCount,strokeDriveTime,strokePeakForce,workTime\nTime,20,1,1,9,0:00:02\n"
)
ON_WATER = (
    "DateTime,TOTAL Time Since Start BoatCoach,Elapsed Time,Piece Number,Stroke Rate,Cumulative Stroke Count\n"
    "2017-09-25 17:22:24.1 GMT+02:00,0:00:01,0:00:01,0,20,1\n"
)
ROWPRO = "Time,Distance,Pace,Watts,Cals,SPM,HR,DutyCycle\n878,3,0.29,106,0,20,74,0.3\n"


@pytest.mark.parametrize(
    ("text", "epoch"),
    [
        (
            "Workout data for: x    Club: y    Date: 2016-11-28 08:37\n" + BOATCOACH,
            "2016-11-28T08:37:00.000000000",
        ),
        ("Workout data for: x    Date: 2016-99-28 08:37\n" + BOATCOACH, ""),
        (SPEEDCOACH, "2016-09-21T06:32:00.000000000"),
        (ON_WATER, "2017-09-25T15:22:23.100000000Z"),
        (ON_WATER.replace("2017-09-25", "soon"), ""),
        ("Date,Comment\n2017-01-01T16:49:26-05:00,\n\n" + ROWPRO, "2017-01-01T21:49:26.000000000Z"),
        ("Date,Comment\n6/8/2016 07:00:00,\n\n" + ROWPRO, "2016-06-08T07:00:00.000000000"),
        (ROWPRO, ""),
    ],
)
def test_moments_of_other_logs(text: str, epoch: str, tmp_path: Path) -> None:
    assert load_export(saved(tmp_path, text)).epoch == epoch


def test_dates_put_the_month_first_and_times_may_have_halves_of_the_day() -> None:
    assert epoch_of_text("09/21/16 06:32pm") == "2016-09-21T18:32:00.000000000"
    assert epoch_of_text("10/06/2019 14:02") == "2019-10-06T14:02:00.000000000"
    with pytest.raises(ValueError, match="is no moment"):
        epoch_of_text("---")


def test_a_clock_that_restarts_goes_on_and_one_wrong_time_is_left_out() -> None:
    np.testing.assert_array_equal(running(np.array([1.0, 3.0, 2.0, 5.0])), [1, 3, np.nan, 5])
    np.testing.assert_array_equal(running(np.array([1.0, np.nan, 3.0, 0.5, 2.0])), [1, np.nan, 3, 3.5, 5])
    assert running(np.zeros(0)).shape == (0,)


# --- a season -----------------------------------------------------------------------------------------------


def test_a_season_knows_when_an_export_began_and_keeps_no_position(tmp_path: Path) -> None:
    season = create_season(str(tmp_path / "season"), "club", "Europe/Berlin")
    support.squad(season, "AAAAAA")
    admission = Admission(season, "AAAAAA")
    watch = tmp_path / "anna.fit"
    watch.write_bytes(fit_bytes.fit_file(fit_bytes.watch(90)))
    added = [
        admission.add(watch),
        admission.add(saved(tmp_path, rowsandall())),
        admission.add(saved(tmp_path, SPEEDCOACH, "speedcoach.csv"), {"boat": "1x"}),
        admission.add(EXAMPLES / "rp3.csv", {"date": "2026-05-02"}),
    ]
    entries = [one.entry for one in added]
    utc = datetime.UTC
    assert [entry.start for entry in entries] == [
        datetime.datetime(2026, 5, 1, 7, 30, tzinfo=utc),
        datetime.datetime(2026, 5, 1, 7, 30, 0, 500_000, tzinfo=utc),
        datetime.datetime(2016, 9, 21, 4, 32, tzinfo=utc),  # 06:32 in Berlin
        datetime.datetime(2026, 5, 2, 10, 0, tzinfo=utc),
    ]
    assert [entry.kind for entry in entries] == ["export"] * 4
    assert [round(entry.duration_s or 0.0) for entry in entries] == [89, 8, 84, 732]
    assert list(entries[0].files) == ["export.fit"]
    known = update_tables(season)
    assert 89.0 in [entry.duration_s for entry in known.entries.values()]
    table = pq.read_table(pa.BufferReader(season.place.read(known.of[0].file)))
    assert not [name for name in table.column_names if "lat" in name or "lon" in name]
    assert season.entry("AAAAAA", entries[0].recording) == entries[0]


def test_a_run_over_exports_finds_their_strokes_and_none_in_points_in_time(tmp_path: Path) -> None:
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, "AAAAAA")
    watch = tmp_path / "watch.fit"
    watch.write_bytes(fit_bytes.fit_file(fit_bytes.watch(90)))
    for file in (watch, saved(tmp_path, rowsandall())):
        Admission(season, "AAAAAA").add(file)
    assert [run_job(job).status for job in make_plan(season).jobs] == ["done", "done"]
    records = catalogue(season).current()
    assert sorted(record.strokes for record in records.values()) == [0, 4]
    (with_strokes,) = (record for record in records.values() if record.strokes)
    name = f"athlete=AAAAAA/results/{with_strokes.recording}.{with_strokes.run}/strokes.parquet"
    table = pq.read_table(pa.BufferReader(season.place.read(name)))
    assert table.schema.metadata[b"epoch"].decode() == START
    assert not [column for column in table.column_names if "tude" in column]
    update_tables(season)


def test_a_season_refuses_an_export_that_cannot_be_read(tmp_path: Path) -> None:
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, "AAAAAA")
    cut = tmp_path / "cut.fit"
    cut.write_bytes(fit_bytes.fit_file(fit_bytes.watch(90))[:-100])
    assert_refused(lambda: Admission(season, "AAAAAA").add(cut), "cut.fit", "no whole FIT file")
    assert season.recordings() == {}
