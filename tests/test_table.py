"""Tables of text without a mapping file: columns, units, time, layouts, and the mapping that was used."""

import tomllib

import numpy as np
import pytest

import oarlock
from local_data import local_folder
from oarlock.formats.choices import UnclearError
from oarlock.formats.csv import read_csv
from oarlock.formats.table.header import InertialColumn, channel_of
from oarlock.formats.table.table import read_table, read_table_orientations
from oarlock.storage.units import STANDARD_GRAVITY_M_S2

G = STANDARD_GRAVITY_M_S2


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("Acc_X [g]", InertialColumn("", "accel", "x", "g", False)),
        ("gyro_x_dps", InertialColumn("", "gyro", "x", "deg/s", False)),
        ("thorax_gx", InertialColumn("thorax", "gyro", "x", None, False)),
        ("thorax_q1", InertialColumn("thorax", "quat", "1", None, False)),
        ("Shank ACC X (G)", InertialColumn("shank", "accel", "x", "g", False)),
        ("LeftForeArm-Sensor-Gyro-z", InertialColumn("left_fore_arm", "gyro", "z", None, True)),
        ("Foot Accel Sensor X LT (mG)", InertialColumn("foot_lt", "accel", "x", "mg", True)),
        (
            "Noraxon MyoMotion-Segments-Foot LT-Gyroscope-x (deg/s)",
            InertialColumn("foot_lt", "gyro", "x", "deg/s", False),
        ),
        ("Sensor 1: ACC.X (g)", InertialColumn("sensor_1", "accel", "x", "g", True)),
        ("AccX(m/s^2)", InertialColumn("", "accel", "x", "m/s2", False)),
        ("upper_arm_acc_z_m_s2", InertialColumn("upper_arm", "accel", "z", "m/s2", False)),
        ("Mag_X(a.u.)", InertialColumn("", "mag", "x", "a.u.", False)),
        ("Angular Velocity Y", InertialColumn("", "gyro", "y", None, False)),
        ("64F61C2E_gyr_x", InertialColumn("64f61c2e", "gyro", "x", None, False)),
        ("acc_g_x", InertialColumn("", "accel", "x", "g", False)),
        ("magGauss", None),
        ("thorax_linAcc_x", None),
        ("FreeAcc_X", None),
        ("Hips-Joint-Acce-x", None),
        ("GYRO X Time Series (s)", None),
        ("Roll (deg)", None),
        ("magnitude", None),
        ("Mat[1][1]", None),
        ("X[s]", None),
    ],
)
def test_names_of_columns(name, channel):
    assert channel_of(name) == channel


def moving(rows=400, rate_hz=100.0):
    """A unit that swings by 60 deg about x at half a hertz: time, gyro in rad/s, accel in m/s2, mag in uT."""
    time_s = np.arange(rows) / rate_hz
    angle = np.pi / 3 * np.sin(np.pi * time_s)
    rate = np.pi / 3 * np.pi * np.cos(np.pi * time_s)
    zero = np.zeros(rows)
    gyro = np.column_stack([rate, zero, zero])
    up = np.column_stack([zero, np.sin(angle), np.cos(angle)])
    return time_s, gyro, G * up, 48.0 * np.column_stack([zero + 0.4, up[:, 2], -up[:, 1]])


def table(columns, rows, delimiter=",", decimal=".", above="", units=None):
    lines = [delimiter.join(columns), *([delimiter.join(units)] if units else [])]
    lines += [delimiter.join(f"{x:.9g}".replace(".", decimal) for x in row) for row in rows]
    return above + "\n".join(lines) + "\n"


def names(quantity):
    return [f"{quantity}_{axis}" for axis in "xyz"]


def columns_of(scale_gyro=1.0, scale_accel=1.0, scale_mag=1.0):
    time_s, gyro, accel, mag = moving()
    return np.column_stack([time_s, gyro * scale_gyro, accel * scale_accel, mag * scale_mag])


HEADER = ["time", *names("gyro"), *names("acc"), *names("mag")]


@pytest.mark.parametrize(
    ("gyro", "accel", "mag"),
    [(1.0, 1.0, 1.0), (180 / np.pi, 1 / G, 1.0), (1.0, 1000 / G, 10.0), (180 / np.pi, 1000.0, 1000.0)],
)
def test_units_of_measurement_follow_from_gravity(tmp_path, gyro, accel, mag):
    (tmp_path / "a.csv").write_text(table(HEADER, columns_of(gyro, accel, mag)))
    unit = read_table(tmp_path / "a.csv")["imu"]
    _, gyro_rad_s, accel_m_s2, mag_ut = moving()
    np.testing.assert_allclose(unit.gyro_rad_s, gyro_rad_s, atol=1e-6)
    np.testing.assert_allclose(unit.accel_m_s2, accel_m_s2, atol=1e-6)
    np.testing.assert_allclose(unit.mag_ut, mag_ut, atol=1e-4)


def test_a_magnetometer_near_one_is_arbitrary_and_scaled(tmp_path):
    (tmp_path / "a.csv").write_text(table(HEADER, columns_of(scale_mag=1 / 48.0)))
    recording = read_table(tmp_path / "a.csv")
    assert np.median(np.linalg.norm(recording["imu"].mag_ut, axis=1)) == pytest.approx(50.0)
    assert recording.meta["mag_scale"]["imu"] == pytest.approx(50.0 / np.linalg.norm([0.4, 1.0]), rel=1e-3)
    assert any("arbitrary" in note for note in recording.meta["source"]["notes"])


@pytest.mark.parametrize(
    ("delimiter", "decimal", "encoding", "end", "above"),
    [
        (",", ".", "utf-8", "\n", ""),
        (";", ",", "cp1252", "\r\n", "Gerät;7\r\n\r\n"),
        ("\t", ",", "utf-16", "\n", ""),
        ("\t", ".", "utf-8-sig", "\r", "// Start Time: now\n// Update Rate: 100.0Hz\n"),
        ("|", ".", "utf-8", "\n", "DataType=double\nendheader\n"),
    ],
)
def test_layouts_are_found(tmp_path, delimiter, decimal, encoding, end, above):
    text = table(HEADER, columns_of(), delimiter, decimal, above.replace("\r\n", "\n"))
    (tmp_path / "a.csv").write_bytes(text.replace("\n", end).encode(encoding))
    recording = read_table(tmp_path / "a.csv")
    assert recording["imu"].rate_hz == pytest.approx(100.0)
    np.testing.assert_allclose(recording["imu"].accel_m_s2, moving()[2], atol=1e-6)


def test_a_line_of_units_below_the_names_is_used(tmp_path):
    units = ["s", *["deg/s"] * 3, *["g"] * 3, *["uT"] * 3]
    still = columns_of(0.0, 1 / G)
    (tmp_path / "a.csv").write_text(table(HEADER, still, ";", units=units))
    assert "notes" not in read_table(tmp_path / "a.csv").meta["source"] or not any(
        "gyroscope read" in note for note in read_table(tmp_path / "a.csv").meta["source"]["notes"]
    )


def test_what_is_not_clear_is_asked_with_the_choices(tmp_path):
    still = columns_of(0.0)
    still[:, 4:7] = [0.0, 0.0, G]
    (tmp_path / "a.csv").write_text(table(HEADER, still))
    with pytest.raises(UnclearError, match=r"Give --gyro-unit rad/s\|deg/s") as unclear:
        read_table(tmp_path / "a.csv")
    assert (unclear.value.option, set(unclear.value.choices)) == ("gyro_unit", {"rad/s", "deg/s"})
    assert len(read_table(tmp_path / "a.csv", gyro_unit="deg/s")["imu"]) == 400
    (tmp_path / "b.csv").write_text(table(HEADER, columns_of(scale_accel=0.3)))
    with pytest.raises(UnclearError, match="--accel-unit"):
        read_table(tmp_path / "b.csv")
    with pytest.raises(oarlock.DataError, match='--accel-unit "stone"'):
        read_table(tmp_path / "b.csv", accel_unit="stone")


def test_a_file_without_time_stamps_needs_its_rate(tmp_path):
    rows = columns_of()
    (tmp_path / "a.csv").write_text(table(HEADER[1:], rows[:, 1:]))
    with pytest.raises(UnclearError, match="--rate-hz") as unclear:
        read_table(tmp_path / "a.csv")
    assert unclear.value.option == "rate_hz"
    recording = read_table(tmp_path / "a.csv", rate_hz=100.0)
    np.testing.assert_allclose(recording["imu"].time_s, rows[:, 0], atol=1e-12)
    (tmp_path / "b.csv").write_text("Sampling rate: 100 Hz\n" + table(HEADER[1:], rows[:, 1:]))
    assert read_table(tmp_path / "b.csv")["imu"].rate_hz == pytest.approx(100.0)


def test_a_count_of_samples_shows_missing_rows(tmp_path):
    rows = np.delete(np.column_stack([np.arange(1, 401), columns_of()[:, 1:]]), [5, 6], axis=0)
    (tmp_path / "a.csv").write_text(table(["Frame", *HEADER[1:]], rows))
    with pytest.raises(UnclearError, match="--rate-hz"):
        read_table(tmp_path / "a.csv")
    recording = read_table(tmp_path / "a.csv", rate_hz=100.0)
    assert np.diff(recording["imu"].time_s).max() == pytest.approx(0.03)
    assert '"Frame" counts samples at 100 Hz' in recording.meta["source"]["notes"][0]
    with pytest.raises(oarlock.DataError, match='--time-unit "weeks"'):
        read_table(tmp_path / "a.csv", time_unit="weeks")


def test_columns_of_several_units_and_their_orientations(tmp_path):
    time_s, gyro, accel, _ = moving()
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (len(time_s), 1))
    header = ["Timestamp (ms)"]
    header += [f"Hips-Sensor-{q}-{a}" for q in ("Acce", "Gyro") for a in "xyz"]
    header += [f"Hips-Sensor-Quat-{a}" for a in "wxyz"]
    header += [f"RightLeg-Sensor-{q}-{a}" for q in ("Acce", "Gyro") for a in "xyz"]
    rows = np.column_stack([1000 * time_s, accel / G, gyro, quat, accel / G, 2 * gyro])
    rows[:, 14:] /= 2  # both units turn equally
    (tmp_path / "a.csv").write_text(table(header, rows))
    recording = read_table(tmp_path / "a.csv")
    assert recording.names == ("hips", "right_leg")
    np.testing.assert_array_equal(read_table_orientations(tmp_path / "a.csv")["hips"], quat)


def test_equal_columns_of_several_sensors_are_numbered(tmp_path):
    time_s, gyro, accel, _ = moving()
    one = [f"ACC {a} (G)" for a in "XYZ"] + [f"GYRO {a} (deg/s)" for a in "XYZ"]
    rows = np.column_stack([time_s, accel / G, np.degrees(gyro), accel / G, np.degrees(gyro)])
    (tmp_path / "a.csv").write_text(table(["time (s)", *one, *one], rows))
    assert read_table(tmp_path / "a.csv").names == ("imu_1", "imu_2")


def test_each_signal_with_a_time_column_of_its_own(tmp_path):
    """As programs for electromyography export: a slower sensor's columns end earlier."""
    time_s, gyro, accel, _ = moving()
    lines = ["X[s],Sensor 1: ACC.X (g),Sensor 1: ACC.Y (g),Sensor 1: ACC.Z (g),X[s],"
             "Sensor 1: GYRO.X (deg/s),Sensor 1: GYRO.Y (deg/s),Sensor 1: GYRO.Z (deg/s)"]  # fmt: skip
    for k in range(len(time_s)):
        slow = [time_s[2 * k], *np.degrees(gyro[2 * k])] if k < len(time_s) // 2 else []
        cells = [f"{x:.9g}" for x in (time_s[k], *(accel[k] / G), *slow)] + [""] * (4 - len(slow))
        lines.append(",".join(cells))
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    recording = read_table(tmp_path / "a.csv")
    unit = recording["sensor_1"]
    assert len(unit) == 400 and np.isfinite(unit.gyro_rad_s).all(axis=1).sum() == 200
    assert oarlock.recording.packets.missing_share(recording, unit) == pytest.approx(0.0, abs=0.01)


def test_names_of_sensors_above_and_rates_below_the_names(tmp_path):
    """As a program for electromyography exports: a time column before each signal, rates and periods below."""
    time_s, gyro, accel, _ = moving()
    signals = [*(f"ACC {a} (G)" for a in "XYZ"), *(f"GYRO {a} (deg/s)" for a in "XYZ")]
    names = [text for s in signals for text in (f"{s.split(' (')[0]} Time Series (s)", s)]
    head = [
        ["Application:", " Trigno Discover"],
        ["Femur Anterior (75657)", *[" "] * 11, "Tibia Lateral (75812)", *[" "] * 11],
        [*["sensor mode: 609", *[" "] * 11] * 2],
        names * 2,
        [" ", " 100.0 Hz"] * 12,
        [" ", " 0.01 s"] * 12,
    ]
    values = np.column_stack([accel / G, np.degrees(gyro)])
    rows = [[x for v in row for x in (t, v)] * 2 for t, row in zip(time_s, values, strict=True)]
    lines = [",".join(line) for line in head] + [",".join(f"{x:.9g}" for x in row) for row in rows]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    recording = read_table(tmp_path / "a.csv")
    assert recording.names == ("femur_anterior", "tibia_lateral")
    np.testing.assert_allclose(recording["tibia_lateral"].gyro_rad_s, gyro, atol=1e-6)
    np.testing.assert_allclose(recording["tibia_lateral"].accel_m_s2, accel, atol=1e-6)


def test_the_raw_accelerometer_is_taken_where_a_segment_has_the_same_name(tmp_path):
    time_s, gyro, accel, _ = moving()
    header = ["time", *(f"Noraxon MyoMotion-Segments-Pelvis-Acceleration-{a} (mG)" for a in "xyz")]
    header += [f"Pelvis Accel Sensor {a} (mG)" for a in "XYZ"]
    header += [f"Noraxon MyoMotion-Segments-Pelvis-Gyroscope-{a} (deg/s)" for a in "xyz"]
    rows = np.column_stack([time_s, 0 * accel, 1000 * accel / G, np.degrees(gyro)])
    (tmp_path / "a.csv").write_text(table(header, rows))
    np.testing.assert_allclose(read_table(tmp_path / "a.csv")["pelvis"].accel_m_s2, accel, atol=1e-6)


def test_a_quantity_without_an_axis_is_left_out_and_named(tmp_path):
    rows = columns_of()
    (tmp_path / "a.csv").write_text(table(HEADER[:-1], rows[:, :-1]))
    recording = read_table(tmp_path / "a.csv")
    assert recording["imu"].mag_ut is None
    assert any("imu has no mag along z" in note for note in recording.meta["source"]["notes"])


def test_the_mapping_that_was_used_reads_the_same(tmp_path):
    (tmp_path / "data").mkdir()
    file = tmp_path / "data/a.csv"
    header = ["Packet Counter", "time_ms", *HEADER[1:]]
    rows = columns_of(180 / np.pi, 1 / G, 1 / 48)
    rows = np.column_stack([np.arange(400) % 256, 1000 * rows[:, 0], rows[:, 1:]])
    file.write_text(table(header, np.delete(rows, [7, 8], axis=0), ";", ","))
    recording = read_table(file, save_mapping=tmp_path / "used.toml")
    again = read_csv(tmp_path / "used.toml")
    assert recording["imu"].values.keys() == again["imu"].values.keys()
    for name, values in recording["imu"].values.items():
        np.testing.assert_array_equal(values, again["imu"].values[name])
    np.testing.assert_array_equal(recording["imu"].time_s, again["imu"].time_s)
    assert recording.meta["packets"]["imu"]["packets"] == [2.0]
    entry = tomllib.loads((tmp_path / "used.toml").read_text())["file"][0]
    assert entry["path"] == "data/a.csv" and entry["counter"]["wraps_at"] == 256


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "is empty"),
        ("hello\n", "is no table"),
        ("a,b,c\n1,2,3\n4,5,6\n", "no three columns"),
        ("time,ax,ay,az\n", "is no table"),
        ("time,ax,ay,az\n0,0,0,9.8\n0.01,0,0,9.8\n0.02,0,0\n0.03,0,0,9.8\n", "has 3 fields"),
        ("time,ax,ay,az\n0,0,0,9.8\n0.01,0,x,9.8\n0.02,0,0,9.8\n", "is not a number"),
        ("time,ax,ay,az\n0,0,0,9.8\n0.02,0,0,9.8\n0.01,0,0,9.8\n", "time_s"),
    ],
)
def test_refusals_name_the_file(tmp_path, text, reason):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(oarlock.DataError, match=reason) as refusal:
        read_table(tmp_path / "a.csv")
    assert "a.csv" in str(refusal.value)


def test_units_on_an_arm_without_a_mapping():
    file = local_folder("data/opensimrt_upper_limb_ngimu") / "ngimu_data.csv"
    recording = read_table(file)
    raw = np.genfromtxt(file, delimiter=",", skip_header=4, names=True)
    assert recording.names == ("thorax", "humerus", "radius")
    for unit in recording:
        columns = {q: np.column_stack([raw[f"{unit.name}_{q}{a}"] for a in "xyz"]) for q in "agm"}
        np.testing.assert_array_equal(unit.accel_m_s2, columns["a"] * G)
        np.testing.assert_array_equal(unit.gyro_rad_s, columns["g"] * np.pi / 180.0)
        np.testing.assert_array_equal(unit.mag_ut, columns["m"])
    np.testing.assert_allclose(recording["radius"].time_s, raw["time"] - raw["time"][0], atol=1e-6)
    assert recording.epoch == "2021-02-19T10:58:53.403044000Z"
    quat = read_table_orientations(file)["radius"]
    np.testing.assert_array_equal(quat, np.column_stack([raw[f"radius_q{k}"] for k in "1234"]))
