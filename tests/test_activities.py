"""FIT and TCX files: points in time stay points, strokes are read where a file has them, damage is named."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fit_bytes
from fit_bytes import FLOAT32, SINT16, UINT8, UINT16, UINT32, Message, fit_file, watch
from fuzz_wounds import feed
from oarlock.rowing import Activity, StrokeTable, load_export, load_stroke_export
from oarlock.storage.errors import DataError
from refusals import assert_refused

DEGREE = np.pi / 180
# Of a FIT position: 180 deg in 2^31 steps.
STEP_DEG = 1e-7
MUTANTS = 300


def saved(folder: Path, contents: bytes | str, name: str = "row.fit") -> Path:
    file = folder / name
    file.write_bytes(contents if isinstance(contents, bytes) else contents.encode())
    return file


# --- FIT: points in time ------------------------------------------------------------------------------------


def test_a_watch_gives_points_and_no_strokes_whatever_it_counts(tmp_path: Path) -> None:
    found = load_export(saved(tmp_path, fit_file(watch(90))))
    assert isinstance(found, Activity) and len(found) == 90
    assert found.epoch == "2026-05-01T07:30:00.000000000Z" and found.duration_s == 89
    np.testing.assert_array_equal(found["time_s"], np.arange(90))
    np.testing.assert_allclose(found["distance_m"], 4.0 * np.arange(90))
    np.testing.assert_allclose(found["speed_m_s"], 4.0)
    np.testing.assert_allclose(found["rate_per_min"], 24)
    np.testing.assert_allclose(found["latitude_deg"], 48.25 + 1e-5 * np.arange(90), atol=STEP_DEG)
    assert_refused(lambda: load_stroke_export(tmp_path / "row.fit"), "90 points in time and no strokes")


def test_cadence_of_another_sport_is_no_stroke_rate(tmp_path: Path) -> None:
    found = load_export(saved(tmp_path, fit_file(watch(5, sport=2))))
    assert isinstance(found, Activity) and "rate_per_min" not in found
    assert "the sport is cycling: its cadence is no stroke rate" in found.notes


def test_stamps_since_switching_on_give_no_moment(tmp_path: Path) -> None:
    found = load_export(saved(tmp_path, fit_file(watch(5, start_s=1000))))
    assert found.epoch == "" and found.duration_s == 4


def test_a_number_that_is_marked_invalid_is_missing(tmp_path: Path) -> None:
    messages = watch(3)
    messages[2].fields |= {3: (UINT8, 0xFF), 4: (UINT8, 0)}
    found = load_export(saved(tmp_path, fit_file(messages)))
    assert np.isnan(found["heart_rate_per_min"]).tolist() == [False, True, False]
    assert np.isnan(found["rate_per_min"]).tolist() == [False, True, False]


# --- FIT: strokes -------------------------------------------------------------------------------------------


def rowed(strategy: int | None = None, counted: bool = True, rate: int = 24) -> list[Message]:
    """Two records a stroke, with the developer fields of rowsandall's earlier exports; the last record is cut short."""
    head, *records, session = watch(8)
    application = Message(fit_bytes.DEVELOPER_DATA_ID, {1: (fit_bytes.BYTE, bytes(range(16))), 3: (UINT8, 0)})
    fields = [
        fit_bytes.described(0, UINT16, "DriveLength", "m", 100),
        fit_bytes.described(1, UINT16, "StrokeDriveTime", "ms"),
        fit_bytes.described(4, UINT16, "AverageDriveForceLbs", "lbs", 10),
        fit_bytes.described(11, SINT16, "Catch", "deg", 10),
        fit_bytes.described(77, FLOAT32, "Mood", "smiles"),
        fit_bytes.described(10, UINT8, "RecordingStrategy", ""),
    ]
    for k, record in enumerate(records):
        record.fields |= {19: (UINT32, 1 + k // 2), 4: (UINT8, rate)}
        if not counted:
            del record.fields[19]
        record.developer = {
            0: (UINT16, 140 + k),
            1: (UINT16, 900 + k),
            4: (UINT16, 500),
            11: (SINT16, -553 + k),
            77: (FLOAT32, 1.0),
        }
    records[7].developer = {}
    session.developer = {} if strategy is None else {10: (UINT8, strategy)}
    return [head, application, *fields, *records, session]


def test_records_with_numbers_of_a_stroke_become_strokes(tmp_path: Path) -> None:
    found = load_export(saved(tmp_path, fit_file(rowed())))
    assert isinstance(found, StrokeTable)
    assert found["stroke_number"].tolist() == [1, 2, 3, 4]
    np.testing.assert_allclose(found["handle_travel_m"], [1.41, 1.43, 1.45, np.nan])
    np.testing.assert_allclose(found["drive_time_s"], [0.901, 0.903, 0.905, np.nan])
    np.testing.assert_allclose(found["catch_angle_rad"] / DEGREE, [-55.2, -55.0, -54.8, np.nan])
    np.testing.assert_allclose(found["mean_force_n"][0], 50 * 4.4482216152605)
    np.testing.assert_allclose(found["time_s"], [1, 3, 5, 7])
    assert found.reason("catch_angle_rad") == ("", "", "", "not in the file's record")
    assert "8 records contain 4 strokes: the last of each is taken" in found.notes
    assert "fields that are not known: Mood" in found.notes
    assert not {"latitude_deg", "longitude_deg"} & set(found.columns)


def test_without_a_count_records_are_strokes_only_if_the_file_says_so(tmp_path: Path) -> None:
    unsaid = load_export(saved(tmp_path, fit_file(rowed(counted=False))))
    assert isinstance(unsaid, Activity) and len(unsaid) == 8
    said = load_export(saved(tmp_path, fit_file(rowed(strategy=1, counted=False, rate=60))))
    assert isinstance(said, StrokeTable) and len(said) == 8
    wrong = load_export(saved(tmp_path, fit_file(rowed(strategy=1, counted=False, rate=24))))
    assert isinstance(wrong, Activity)  # a record a second, at 2.5 s a stroke


# --- FIT: damage --------------------------------------------------------------------------------------------


def looked_at(file: Path) -> None:
    found = load_export(file)
    for name, values in found.columns.items():
        assert not np.isinf(values).any(), name
    assert found.duration_s is None or np.isfinite(found.duration_s)


def test_damage_is_named(tmp_path: Path) -> None:
    whole = fit_file(rowed())
    flipped = bytearray(whole)
    flipped[-5] ^= 4  # in the last number
    assert_refused(lambda: load_export(saved(tmp_path, bytes(flipped))), "row.fit", "checksum", "damaged")
    assert_refused(lambda: load_export(saved(tmp_path, whole[:-40])), "row.fit", "after byte", "cut off")
    assert_refused(lambda: load_export(saved(tmp_path, fit_file(watch(0)))), "contains no records")


def test_no_cut_and_no_harm_to_the_bytes_is_a_fault(tmp_path: Path) -> None:
    """With a right checksum, so that the harm reaches the reader."""
    whole = fit_file(rowed(strategy=1))
    for length in range(14, len(whole), 23):
        assert_refused(lambda length=length: load_export(saved(tmp_path, whole[:length])), "row.fit")
    rng = np.random.default_rng(3)
    read = 0
    for _ in range(MUTANTS):
        body = bytearray(whole[14:-2])
        for place in rng.integers(0, len(body), rng.integers(1, 4)):
            body[place] = rng.integers(0, 256)
        try:
            looked_at(saved(tmp_path, fit_bytes.closed(bytes(body))))
            read += 1
        except DataError as error:
            assert "row.fit" in str(error)
    assert 0 < read < MUTANTS


def test_without_fitdecode_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fitdecode", None)
    assert_refused(lambda: load_export(saved(tmp_path, fit_file(watch(3)))), "pip install 'oarlock[fit]'")


# --- TCX ----------------------------------------------------------------------------------------------------

POINT = """<Trackpoint><Time>{time}</Time>
<Position><LatitudeDegrees>48.2362</LatitudeDegrees><LongitudeDegrees>11.5065</LongitudeDegrees></Position>
<DistanceMeters>{distance}</DistanceMeters><HeartRateBpm><Value>{heart}</Value></HeartRateBpm>
<Cadence>{rate}</Cadence>
<Extensions><ns3:TPX><ns3:Speed>4.25</ns3:Speed><ns3:Watts>210</ns3:Watts></ns3:TPX></Extensions></Trackpoint>
"""
TIMES = ("2026-05-01T07:30:00Z", "2026-05-01T07:30:01Z", "2026-05-01T07:30:02.5Z")


def tcx(times: tuple[str, ...] = TIMES, **cells: Any) -> str:
    told = {"distance": "12.5", "heart": "141", "rate": "24"} | cells
    points = "".join(POINT.format(time=time, **told) for time in times)
    return (
        '\n<?xml version="1.0" encoding="UTF-8"?>\n<TrainingCenterDatabase '
        'xmlns="http://www.garmin.com/xmlschemas/TrainingCenterDatabase/v2" '
        'xmlns:ns3="http://www.garmin.com/xmlschemas/ActivityExtension/v2"><Activities><Activity Sport="Other">'
        f'<Id>x</Id><Lap StartTime="{times[0]}"><DistanceMeters>9</DistanceMeters><Cadence>99</Cadence><Track>\n'
        f"{points}</Track></Lap></Activity></Activities></TrainingCenterDatabase>\n"
    )


def test_tcx_gives_points_as_they_stand(tmp_path: Path) -> None:
    found = load_export(saved(tmp_path, tcx(), "row.tcx"))
    assert isinstance(found, Activity)
    assert found.epoch == "2026-05-01T07:30:00.000000000Z" and found.duration_s == 2.5
    wanted = {
        "time_s": [0, 1, 2.5],
        "latitude_deg": [48.2362] * 3,
        "longitude_deg": [11.5065] * 3,
        "distance_m": [12.5] * 3,
        "heart_rate_per_min": [141] * 3,
        "rate_per_min": [24] * 3,
        "speed_m_s": [4.25] * 3,
        "power_w": [210] * 3,
    }
    assert {name: values.tolist() for name, values in found.columns.items()} == wanted


@pytest.mark.parametrize(
    ("times", "epoch"),
    [
        (("2026-05-01T09:30:00.25+02:00",), "2026-05-01T07:30:00.250000000Z"),
        (("2026-05-01T09:30:00",), "2026-05-01T09:30:00.000000000"),
    ],
)
def test_tcx_zones(tmp_path: Path, times: tuple[str, ...], epoch: str) -> None:
    assert load_export(saved(tmp_path, tcx(times), "row.tcx")).epoch == epoch


def test_tcx_zero_heart_rate_and_rate_are_missing_and_a_clock_that_goes_back_is_noted(tmp_path: Path) -> None:
    found = load_export(saved(tmp_path, tcx((TIMES[1], TIMES[0]), heart="0", rate="0"), "row.tcx"))
    assert "heart_rate_per_min" not in found.columns and "rate_per_min" not in found.columns
    assert "the clock goes back 1 times; the points are as in the file" in found.notes


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (tcx(heart="x"), ('row.tcx:6: Value: "x" is not a number',)),
        (tcx(heart="inf"), ("is not a number",)),
        (tcx(("soon",)), ('row.tcx:4: Time: "soon" is not a moment',)),
        (tcx((TIMES[0], "2026-05-01T09:30:00")), ("row.tcx:9", "some times have a zone")),
        (tcx()[:600], ("row.tcx:", "no whole XML", "cut off")),
        (tcx(("x",)).replace("<Time>x</Time>", ""), ("a point ends without a Time",)),
        (tcx().replace("<Activities>", "<Activities><Activity/>"), ("begins a second activity",)),
        ("<TrainingCenterDatabase></TrainingCenterDatabase>", ("contains no points",)),
        (
            '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><TrainingCenterDatabase>&b;'
            "</TrainingCenterDatabase>",
            ("row.tcx:1", "declares an entity"),
        ),
        ("<TrainingCenterDatabase>" + "<a>" * 40, ("nested more than 32 deep",)),
    ],
)
def test_tcx_refusals_name_the_line(tmp_path: Path, text: str, says: tuple[str, ...]) -> None:
    assert_refused(lambda: load_export(saved(tmp_path, text, "row.tcx")), *says)


def test_wounded_tcx(tmp_path: Path) -> None:
    feed(tmp_path / "row.tcx", tcx(), looked_at)


# --- the activity itself ------------------------------------------------------------------------------------


def test_an_activity_of_wrong_columns_is_refused() -> None:
    time_s = np.arange(3.0)
    assert_refused(lambda: Activity({"time_s": time_s, "lean_rad": time_s}), "it has time_s, lean_rad")
    assert_refused(lambda: Activity({"distance_m": time_s}), "needs time_s")
    assert_refused(lambda: Activity({"time_s": time_s, "power_w": time_s[:2]}), "differ in length")
    made = replace(Activity({"time_s": time_s}), epoch="2026-05-01T07:30:00Z")
    assert made.epoch and made.duration_s == 2
