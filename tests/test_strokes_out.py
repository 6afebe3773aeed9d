"""Strokes as FIT and RowingData CSV: what other software reads is what the table says, and nothing is invented."""

import csv
import datetime
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import fitdecode
import numpy as np
import pytest

from command_line import run
from oarlock.rowing import (
    FEATURES,
    StrokeTable,
    load_export,
    load_strokes,
    save_fit,
    save_rowingdata,
    save_strokes,
)
from oarlock.rowing.strokes.fit_fields import (
    KNOWN_OWN,
    NATIVE,
    OWN_ID,
    STANDARD,
    STANDARD_ID,
    UNITS,
    own_field,
)
from oarlock.storage.errors import DataError
from refusals import assert_refused

EXAMPLES = Path(__file__).parents[1] / "examples/strokes"
DEGREE = np.pi / 180
START = "2026-05-01T07:30:00.250000000Z"
# Of the numbers that come as whole ones: half of the last place that FIT's fields have.
STEPS = {
    **{
        "catch_angle_rad": 0.05 * DEGREE,
        "r_catch_angle_rad": 0.05 * DEGREE,
        "finish_angle_rad": 0.05 * DEGREE,
    },
    **{"drive_time_s": 5e-4, "recovery_time_s": 5e-4, "handle_travel_m": 5e-4, "peak_force_n": 0.05},
    **{
        "rate_per_min": 1 / 512,
        "heart_rate_per_min": 0.5,
        "power_w": 0.5,
        "speed_m_s": 5e-4,
        "distance_m": 5e-3,
    },
}
# Of those that come in 32 bits, as a share; of times in 64 bits, s.
FLOAT_SHARE, TIME_S = 1e-6, 1e-6


def rowed(count: int = 6, epoch: str = START) -> StrokeTable:
    """Strokes of 2.5 s; the third has no catch angle, the last no next catch."""
    catch_s = 3.0 + 2.5 * np.arange(count)
    end_s = catch_s + 2.5
    end_s[-1] = np.nan
    angle = -1.0 - 0.001 * np.arange(count)
    angle[2] = np.nan
    columns = {
        "catch_time_s": catch_s,
        "finish_time_s": catch_s + 0.9123,
        "end_time_s": end_s,
        "rate_per_min": np.full(count, 24.3),
        "drive_time_s": np.full(count, 0.9123),
        "rhythm": np.linspace(0.36, 0.37, count),
        "catch_angle_rad": angle,
        "finish_angle_rad": np.full(count, 0.7001),
        "arc_rad": 0.7001 - angle,
        "r_catch_angle_rad": angle - 0.01,
        "catch_lean_rad": np.full(count, -0.3),
        "heart_rate_per_min": np.arange(count) + 140.0,
        "power_w": np.full(count, 211.4),
        "distance_m": 10.0 * np.arange(count),
        "peak_force_n": np.full(count, 512.34),
        "in_averages": np.ones(count),
    }
    stds = {"catch_angle_rad": np.full(count, 0.011), "rhythm": np.full(count, 0.004)}
    return StrokeTable(columns, stds, source="made", epoch=epoch)


def messages_of(file: Path) -> list[Any]:
    """By fitdecode, which shares no code with the writer; it refuses a wrong checksum."""
    with fitdecode.FitReader(
        file, check_crc=fitdecode.CrcCheck.RAISE, error_handling=fitdecode.ErrorHandling.RAISE
    ) as reader:
        return [one for one in reader if isinstance(one, fitdecode.FitDataMessage)]


# --- FIT ----------------------------------------------------------------------------------------------------


def test_every_field_has_a_name_of_its_own_that_leads_back_to_its_column() -> None:
    names = {}
    for column in FEATURES:
        for is_std in (False, True):
            names[own_field(column, is_std).name, is_std] = column
    standard = {one.column: one.name for one in STANDARD}
    assert len(names) == 2 * len(FEATURES) and len({name for name, _ in names}) == len(names)
    for (name, is_std), column in names.items():
        assert (KNOWN_OWN[name].column, KNOWN_OWN[name].is_std) == (column, is_std)
        assert len(name.encode()) < 64
    assert all(own_field(column).name == name for column, name in standard.items() if column in FEATURES)
    assert not NATIVE & set(standard)


def test_every_shown_unit_leads_back_to_si() -> None:
    for column, feature in FEATURES.items():
        unit = own_field(column).unit
        shown = 1.0 if unit == feature.unit else feature.shown_scale
        assert UNITS[unit] * shown == pytest.approx(1.0), column


def test_another_reader_finds_fields_units_and_numbers(tmp_path: Path) -> None:
    assert save_fit(rowed(), tmp_path / "row.fit") == ()
    messages = messages_of(tmp_path / "row.fit")
    assert [message.name for message in messages if message.name != "field_description"] == [
        *("file_id", "developer_data_id", "developer_data_id", "event", *["record"] * 6),
        *("event", "lap", "session", "activity"),
    ]
    applications = [bytes(m.get_value("application_id")) for m in messages if m.name == "developer_data_id"]
    assert applications == [STANDARD_ID, OWN_ID]
    about = {m.get_value("field_name"): m for m in messages if m.name == "field_description"}
    told = {
        name: tuple(
            m.get_value(key, fallback=None)
            for key in (
                "developer_data_index",
                "field_definition_number",
                "fit_base_type_id",
                "scale",
                "units",
            )
        )
        for name, m in about.items()
    }
    assert told["Catch"] == (0, 11, "sint16", 10, "deg")
    assert told["CatchPort"] == (0, 200, "sint16", 10, "deg")
    assert told["StrokeDriveTime"] == (0, 1, "uint16", 1, "ms")
    assert told["RecordingStrategy"] == (0, 10, "uint8", 1, None)
    assert told["Arc"][2:] == ("float32", None, "deg") and told["CatchStd"][4] == "deg"
    assert told["Rhythm"][4] == "%" and told["CatchTime"][2] == "float64"
    record = [message for message in messages if message.name == "record"][1]
    assert record.get_value("timestamp") == datetime.datetime(2026, 5, 1, 7, 30, 8, tzinfo=datetime.UTC)
    shown = {field.name: field.value for field in record.fields}
    assert shown["Catch"] == round(-1.001 / DEGREE * 10) and shown["StrokeDriveTime"] == 912
    assert shown["Arc"] == pytest.approx(1.7011 / DEGREE, rel=FLOAT_SHARE)
    assert shown["CatchStd"] == pytest.approx(0.011 / DEGREE, rel=FLOAT_SHARE)
    assert (shown["cadence"], shown["cadence256"]) == (24, pytest.approx(24.3, abs=1 / 512))
    assert (shown["heart_rate"], shown["power"], shown["total_cycles"]) == (141, 211, 2)
    assert "position_lat" not in shown and "speed" not in shown


def test_what_is_missing_is_left_out(tmp_path: Path) -> None:
    save_fit(rowed(), tmp_path / "row.fit")
    records = [message for message in messages_of(tmp_path / "row.fit") if message.name == "record"]
    assert [record.has_field("Catch") for record in records] == [True, True, False, True, True, True]
    assert [record.has_field("EndTime") for record in records] == [True] * 5 + [False]


def test_session_and_lap_span_the_strokes(tmp_path: Path) -> None:
    interval = np.array([1.0, 1, 1, 2, 2, 2])
    table = rowed()
    save_fit(replace(table, columns={**table.columns, "interval": interval}), tmp_path / "row.fit")
    messages = messages_of(tmp_path / "row.fit")
    session = next(message for message in messages if message.name == "session")
    laps = [message for message in messages if message.name == "lap"]
    assert (session.get_value("sport"), session.get_value("sub_sport")) == ("rowing", "generic")
    assert session.get_value("start_time") == datetime.datetime(2026, 5, 1, 7, 30, tzinfo=datetime.UTC)
    assert session.get_value("RecordingStrategy") == 1 and session.get_value("total_distance") == 50
    assert sum(lap.get_value("total_timer_time") for lap in laps) == session.get_value("total_timer_time")
    assert [(lap.get_value("intensity"), lap.get_value("total_cycles")) for lap in laps] == [
        ("active", 3)
    ] * 2


def test_read_back_it_is_the_same_table(tmp_path: Path) -> None:
    table = rowed()
    save_fit(table, tmp_path / "row.fit")
    back = load_export(tmp_path / "row.fit")
    assert isinstance(back, StrokeTable) and back.epoch == "2026-05-01T07:30:00.000000000Z"
    assert set(back.columns) == set(table.columns) | {"stroke_number"} and set(back.stds) == set(table.stds)
    for name, values in table.columns.items():
        wanted = values + 0.25 if name.endswith("_time_s") and name != "drive_time_s" else values
        most = STEPS.get(name, TIME_S if "time" in name else FLOAT_SHARE * np.nanmax(np.abs(values)))
        np.testing.assert_allclose(back[name], wanted, rtol=0, atol=most * 1.001, err_msg=name)
    np.testing.assert_allclose(back.std("catch_angle_rad"), 0.011, rtol=FLOAT_SHARE)


@pytest.mark.parametrize(
    "name", ["rp3.csv", "nk_logbook.csv", "painsled_desktop.csv", "speedcoach_empower.csv"]
)
def test_strokes_of_devices_go_out_and_come_back(name: str, tmp_path: Path) -> None:
    table = replace(load_export(EXAMPLES / name), epoch=START)
    assert isinstance(table, StrokeTable)
    notes = save_fit(table, tmp_path / "row.fit")
    back = load_export(tmp_path / "row.fit")
    assert isinstance(back, StrokeTable)
    timed = np.isfinite(table.clock_s)
    assert len(back) == timed.sum() and bool(notes) == (not timed.all())
    assert (np.diff(back.clock_s) >= 0).all()
    assert back.duration_s == pytest.approx((table.duration_s or 0.0) + 0.25, abs=TIME_S)


def test_a_machine_is_indoor_rowing(tmp_path: Path) -> None:
    save_fit(replace(load_export(EXAMPLES / "hero.csv"), epoch=START), tmp_path / "row.fit")
    session = next(m for m in messages_of(tmp_path / "row.fit") if m.name == "session")
    assert session.get_value("sub_sport") == "indoor_rowing"


def test_numbers_beyond_a_field_are_left_out_and_fields_beyond_the_file_are_named(tmp_path: Path) -> None:
    table = rowed()
    many = {f"own_{k}_m": np.full(len(table), 1.0 + k) for k in range(260)}
    power = np.where(np.arange(6) == 1, 1e6, 200.0)
    columns = {**table.columns, "power_w": power, "peak_force_n": np.full(6, 1e5)} | many
    (note,) = save_fit(replace(table, columns=columns), tmp_path / "row.fit")
    assert note.startswith("the FIT file has no room for: ")
    records = [message for message in messages_of(tmp_path / "row.fit") if message.name == "record"]
    assert [record.get_value("power", fallback=None) for record in records] == [200, None, 200, 200, 200, 200]
    assert not any(record.has_field("PeakDriveForce") for record in records)


ODD = np.array([np.nan, np.inf, -np.inf, 1e300, -1e300, 1e39, -1.0, 0.0, 6553.5, -3276.8, 3.4e38, 1e-40])


def test_odd_numbers_are_written_or_left_out_and_the_files_are_whole(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    written = 0
    for _ in range(40):
        count = int(rng.integers(1, 6))
        names = ["time_s", *rng.choice(sorted(FEATURES), 12, replace=False)]
        columns = {
            str(name): np.where(rng.random(count) < 0.7, 1.5, rng.choice(ODD, count)) for name in names
        }
        stds = {str(name): rng.choice(ODD, count) for name in names[1:4]}
        table = StrokeTable(columns, stds, epoch=START)
        try:
            save_fit(table, tmp_path / "row.fit")
        except DataError as error:
            assert "no stroke has a time" in str(error)
            continue
        written += 1
        assert [m.name for m in messages_of(tmp_path / "row.fit")].count("record") >= 1
        load_export(tmp_path / "row.fit")
        save_rowingdata(table, tmp_path / "row.csv")
        load_export(tmp_path / "row.csv")
    assert written > 20


def test_fit_refusals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "row.fit"
    for epoch in ("", "2026-05-01T07:30:00", "07:30:00"):
        assert_refused(lambda epoch=epoch: save_fit(rowed(epoch=epoch), file), "--start 2026-05-01T07:30:00Z")
    assert_refused(lambda: save_fit(rowed(epoch="1995-05-01T07:30:00Z"), file), "between 1998 and 2125")
    untimed = StrokeTable({"arc_rad": np.ones(2)}, epoch=START)
    assert_refused(lambda: save_fit(untimed, file), "no stroke has a time")
    assert_refused(lambda: save_rowingdata(untimed, file), "no stroke has a time")
    monkeypatch.setitem(sys.modules, "fit_tool.fit_file_builder", None)
    assert_refused(lambda: save_fit(rowed(), file), "pip install 'oarlock[fit]'")
    assert not file.exists()


# --- RowingData CSV -----------------------------------------------------------------------------------------


def test_rowingdata_has_the_names_and_units_of_the_format(tmp_path: Path) -> None:
    save_rowingdata(rowed(), tmp_path / "row.csv")
    rows = list(csv.DictReader((tmp_path / "row.csv").read_text(encoding="utf-8").splitlines()))
    one = {name: float(cell) for name, cell in rows[1].items() if cell}
    begin_s = datetime.datetime(2026, 5, 1, 7, 30, tzinfo=datetime.UTC).timestamp() + 0.25
    assert one["TimeStamp (sec)"] == begin_s + 8.0 and one[" ElapsedTime (sec)"] == 8
    assert one[" Cadence (stokes/min)"] == 24.3 and one[" DriveTime (ms)"] == 912.3
    assert one["catch"] == pytest.approx(-1.001 / DEGREE, abs=1e-6)
    assert one[" PeakDriveForce (N)"] == pytest.approx(
        4.4482216152605 * one[" PeakDriveForce (lbs)"], rel=1e-6
    )
    assert rows[2]["catch"] == "" and rows[2][" HRCur (bpm)"] == "142" and len(rows) == 6


def test_rowingdata_read_back_is_the_same_table(tmp_path: Path) -> None:
    table = rowed()
    save_rowingdata(table, tmp_path / "row.csv")
    back = load_export(tmp_path / "row.csv")
    assert isinstance(back, StrokeTable) and back.epoch == "2026-05-01T07:30:05.750000000Z"
    for name in (
        "rate_per_min",
        "drive_time_s",
        "catch_angle_rad",
        "finish_angle_rad",
        "peak_force_n",
        "power_w",
    ):
        np.testing.assert_allclose(back[name], table[name], rtol=FLOAT_SHARE, err_msg=name)
    (note,) = save_rowingdata(replace(table, epoch=""), tmp_path / "row.csv")
    assert "count from 0" in note
    assert load_export(tmp_path / "row.csv").epoch == ""


# --- strokes.parquet and the command line -------------------------------------------------------------------


def test_saved_strokes_are_loaded(tmp_path: Path) -> None:
    table = load_export(EXAMPLES / "nk_logbook.csv")
    assert isinstance(table, StrokeTable)
    save_strokes(table, tmp_path / "out")
    back = load_strokes(tmp_path / "out")
    assert (back.epoch, back.notes, back.source) == (table.epoch, table.notes, table.source)
    for name, values in table.columns.items():
        np.testing.assert_array_equal(back[name], values)
        assert back.reason(name) == table.reason(name)
    made = rowed()
    save_strokes(made, tmp_path / "made")
    np.testing.assert_array_equal(load_strokes(tmp_path / "made").std("rhythm"), made.std("rhythm"))
    assert_refused(lambda: load_strokes(EXAMPLES / "rp3.csv"), "cannot be read as Parquet")
    assert_refused(lambda: load_strokes(tmp_path / "absent.parquet"), "cannot be read")


def test_the_command_writes_what_it_is_asked_for(tmp_path: Path) -> None:
    fit, rowingdata = tmp_path / "row.fit", tmp_path / "row.csv"
    shown = run("rowing", "strokes", EXAMPLES / "rp3.csv", "--fit", fit, status=1)
    assert "--start 2026-05-01T07:30:00Z" in shown.output and not fit.exists()
    told = ("--start", "2026-05-01T09:30:00+02:00", "--fit", fit, "--rowingdata", rowingdata)
    document = json.loads(run("rowing", "strokes", EXAMPLES / "rp3.csv", *told, "--json").stdout)
    assert document["files"] == [str(fit), str(rowingdata)]
    assert load_export(fit).epoch == "2026-05-01T07:30:00.000000000Z"
    assert "exists" in run("rowing", "strokes", EXAMPLES / "rp3.csv", *told, status=2).output
    run("rowing", "strokes", EXAMPLES / "rp3.csv", *told, "--force")
    again = run("rowing", "strokes", fit, "--out", tmp_path / "out")
    assert "22 strokes" in again.output
    assert "22 strokes" in run("rowing", "strokes", tmp_path / "out/strokes.parquet").output
    for start in ("today", "2026-05-01T07:30:00"):
        assert "with its zone" in run("rowing", "strokes", fit, "--start", start, status=2).output


def test_the_command_shows_an_activity_without_positions(tmp_path: Path) -> None:
    import fit_bytes

    file = tmp_path / "watch.fit"
    file.write_bytes(fit_bytes.fit_file(fit_bytes.watch(90)))
    shown = run("rowing", "strokes", file).output
    assert (
        "90 points, no strokes" in shown and "89.0 s" in shown and "356" in shown and "stroke rate" in shown
    )
    document = json.loads(run("rowing", "strokes", file, "--json").stdout)
    assert (document["points"], document["duration_s"], document["distance_m"]) == (90, 89.0, 356.0)
    assert "48.2" not in shown + json.dumps(document)
    assert "contains no strokes" in run("rowing", "strokes", file, "--out", tmp_path / "out", status=2).output


def test_a_simulated_recording_goes_out(tmp_path: Path) -> None:
    run("simulate", "--out", tmp_path / "trial", "--duration-s", 8)
    fit = tmp_path / "row.fit"
    run("rowing", "strokes", tmp_path / "trial", "--fit", fit, "--start", "2026-05-01T07:30:00Z")
    names = {field.name for m in messages_of(fit) if m.name == "record" for field in m.fields}
    assert {"Catch", "CatchStd", "Finish", "CatchPort", "Arc", "ArcStd", "Rhythm", "RhythmStd"} <= names
