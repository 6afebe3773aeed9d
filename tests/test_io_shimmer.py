"""Exports of Shimmer Consensys, made by hand in the form that public code and samples of these exports have."""

import math

import numpy as np
import pytest

from oarlock.formats.devices.shimmer import find_shimmer, read_shimmer
from oarlock.formats.listing import listed
from refusals import assert_refused

NAMES = (
    "{0}_Timestamp_Unix_CAL;{0}_Accel_LN_X_CAL;{0}_Accel_LN_Y_CAL;{0}_Accel_LN_Z_CAL;{0}_Accel_WR_X_CAL;"
    "{0}_Accel_WR_Y_CAL;{0}_Accel_WR_Z_CAL;{0}_Battery_CAL;{0}_Gyro_X_CAL;{0}_Gyro_Y_CAL;{0}_Gyro_Z_CAL;"
    "{0}_Mag_X_CAL;{0}_Mag_Y_CAL;{0}_Mag_Z_CAL;"
)
UNITS = "ms;m/(s^2)*;m/(s^2)*;m/(s^2)*;m/(s^2);m/(s^2);m/(s^2);mV;deg/s;deg/s;deg/s;local_flux;local_flux;local_flux;"
ROWS = """1.600000000034E12;-1.4347826086956521;10.0;0.55;-3.93;8.421;-1.62;4139;0.1374;1.8778;-0.1832;-0.1;-0.9;-0.05;
1.600000000057E12;-1.4021739130434783;10.0;0.55;-3.92;8.442;-1.59;4137.72;0.1832;1.3282;-0.4122;-0.1;-0.9;-0.05;
1.6000000000745E12;-1.4347826086956521;NaN;0.55;-3.89;8.428;-1.60;4111.35;0.2748;1.2824;-0.1984;-0.1;-0.9;-0.05;
"""
SESSION = f'"sep=;"\n{NAMES.format("Shimmer_40AC")}\n{UNITS}\n{ROWS}'
TWO = """"sep=\t"
Left_Timestamp_CAL\tLeft_Gyro_X_CAL\tLeft_Gyro_Y_CAL\tLeft_Gyro_Z_CAL\tRight_Timestamp_CAL\tRight_Gyro_X_CAL\tRight_Gyro_Y_CAL\tRight_Gyro_Z_CAL\t
ms\tdeg/s\tdeg/s\tdeg/s\tms\tdeg/s\tdeg/s\tdeg/s\t
1000.5\t1.0\t2.0\t3.0\t1000.25\t4.0\t5.0\t6.0\t
1020.03125\t1.0\t2.0\t3.0\t1019.5\t4.0\t5.0\t6.0\t
"""


def written(folder, text=SESSION, name="Day_Session1_Shimmer_40AC_Calibrated_SD.csv"):
    (folder / name).write_bytes(text.encode("utf-8"))
    return folder / name


def refused(file, *words, **options):
    assert_refused(lambda: read_shimmer(file, **options), *words)


def test_low_noise_or_wide_range(tmp_path):
    recording = read_shimmer(written(tmp_path))
    stream = recording["shimmer_40ac"]
    assert stream.time_s.tolist() == [0.0, 0.023, 0.0405]
    assert stream.accel_m_s2[0].tolist() == [-1.4347826086956521, 10.0, 0.55]
    assert np.isnan(stream.accel_m_s2[2, 1])
    assert stream.gyro_rad_s[1].tolist() == [v * math.pi / 180.0 for v in (0.1832, 1.3282, -0.4122)]
    factor = recording.meta["mag_scale"]["shimmer_40ac"]
    assert stream.mag_ut[0].tolist() == [-0.1 * factor, -0.9 * factor, -0.05 * factor]
    assert recording.epoch == "2020-09-13T12:26:40.034000000Z"
    source = recording.meta["source"]
    assert source["left_out"][:2] == ["Shimmer_40AC_Accel_WR_X_CAL", "Shimmer_40AC_Accel_WR_Y_CAL"]
    assert any("default calibration" in note for note in source["notes"])
    wide = read_shimmer(tmp_path, accel="WR")["shimmer_40ac"]
    assert wide.accel_m_s2[0].tolist() == [-3.93, 8.421, -1.62]


def test_several_units_in_a_file(tmp_path):
    recording = read_shimmer(written(tmp_path, TWO, "both.txt"))
    assert recording.names == ("left", "right")
    assert recording["left"].time_s.tolist() == [1.0005, 1.02003125]
    assert recording["right"].time_s.tolist() == [1.00025, 1.0195]
    assert recording["right"].gyro_rad_s[0].tolist() == [v * math.pi / 180.0 for v in (4.0, 5.0, 6.0)]


def test_files_of_a_session_are_one_trial(tmp_path):
    written(tmp_path)
    other = SESSION.replace("Shimmer_40AC", "S_Seat").replace("1.60000000005", "1.60000000004")
    written(tmp_path, other, "Day_Session1_S_Seat_Calibrated_SD.csv")
    written(tmp_path, SESSION, "Day_Session2_Shimmer_40AC_Calibrated_SD.csv")
    written(tmp_path, TWO, "both.txt")
    found = find_shimmer(listed(tmp_path))
    assert [(one.name, len(one.files), one.about[-7:]) for one in found] == [
        ("Day_Session1_Calibrated_SD", 2, "2 units"),
        ("Day_Session2_Calibrated_SD", 1, " 1 unit"),
        ("both", 1, "2 units"),
    ]
    recording = read_shimmer(found[0].path, **found[0].options)
    assert recording.names == ("s_seat", "shimmer_40ac")
    assert recording["s_seat"].time_s.tolist() == [0.0, 0.013, 0.0405]


def test_formatted_dates(tmp_path):
    text = SESSION.replace("Timestamp_Unix", "TimestampSync_FormattedUnix").replace(
        "\nms;", "\nyyyy/mm/dd hh:mm:ss.000;"
    )
    for k, stamp in enumerate(("1.600000000034E12", "1.600000000057E12", "1.6000000000745E12")):
        text = text.replace(stamp, f"2020/09/13 12:26:40.{34 + 20 * k:03d}")
    recording = read_shimmer(written(tmp_path, text))
    assert recording["shimmer_40ac"].time_s.tolist() == [0.0, 0.02, 0.04]
    assert recording.meta["clock"] == {"kind": "local", "zero": "2020-09-13T12:26:40.034000000"}


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\ufeff" + text,
        lambda text: text.replace(";\n", "\n"),
        lambda text: text.replace(";", "\t"),
        lambda text: text.replace(";", ","),
        lambda text: text.replace('"sep=;"\n', ""),
        lambda text: text.replace(".", ","),
    ],
)
def test_forms_of_one_file(tmp_path, change):
    plain = read_shimmer(written(tmp_path))["shimmer_40ac"]
    again = read_shimmer(written(tmp_path, change(SESSION), "again.csv"))["shimmer_40ac"]
    np.testing.assert_array_equal(again.accel_m_s2, plain.accel_m_s2)
    np.testing.assert_array_equal(again.time_s, plain.time_s)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("_CAL", "_RAW", [":2", "only raw columns", "CAL"]),
        ("\nms;", "\ns;", [":3", "Timestamp_Unix_CAL", '"s"', "ms"]),
        ("deg/s;deg/s;", "deg/s;rad/s;", [":3", "Gyro_X_CAL", '"deg/s"']),
        ("deg/s", "Degrees", [":3", "Gyro_X_CAL", '"Degrees"']),
        ("Gyro_Y", "Other", ['"Shimmer_40AC" has no column Shimmer_40AC_Gyro_Y_CAL']),
        ("_Timestamp_Unix", "_Clock", ["no calibrated time column"]),
        ("1.600000000057E12", "1.600000000034E12", [":5", "Timestamp_Unix_CAL", "repeats", "own"]),
        ("1.600000000057E12", "12x", [":5", "Timestamp_Unix_CAL", "12x"]),
        ("0.1832;", "0.1x32;", [":5", '"Shimmer_40AC_Gyro_X_CAL"', "0.1x32"]),
        ("4137.72;", "", [":5", "14 fields", "15"]),
    ],
)
def test_mistakes(tmp_path, old, new, words):
    assert old in SESSION
    refused(written(tmp_path, SESSION.replace(old, new)), "Calibrated_SD.csv", *words)


def test_what_is_not_there(tmp_path):
    refused(
        written(tmp_path, SESSION.replace("Accel_WR", "Other").replace("Gyro", "G").replace("Mag", "M")),
        "no accelerometer WR",
        accel="WR",
    )
    refused(written(tmp_path), "expected LN or WR", accel="HG")
    refused(written(tmp_path, "a;b\n1;2\n"), "not an export of Shimmer Consensys")
    refused(written(tmp_path, SESSION.split("1.6000")[0]), "no rows of data")
