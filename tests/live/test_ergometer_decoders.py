"""Decoders of ergometers, belts and power meters, on published messages of real devices."""

import json

import pytest

from oarlock.live.decoders import DECODERS
from oarlock.live.decoders.csafe import framed

POUND_FORCE_N = 4.4482216152605
PM5 = "CE06{:04X}-43E5-11E4-916C-0800200C9A66"


def decoded(name, *messages, channel=""):
    """The readings of messages in hexadecimal digits; none of them may be damaged."""
    decoder = DECODERS[name].decoder()
    readings = [reading for text in messages for reading in decoder.decode(bytes.fromhex(text), channel)]
    assert decoder.damaged == 0
    assert all(reading.count is None for reading in readings)
    return readings


def values(name, *messages, channel=""):
    [reading] = decoded(name, *messages, channel=channel)
    assert reading.clock_s is None
    return reading.values


def test_pm5_pace_and_split_of_one_workout():
    assert values("pm5", "8b2f00a40828ff7b588467000000000000", channel=PM5.format(0x32)) == {
        "elapsed_s": 121.71,
        "speed_m_s": 2.212,
        "rate_per_min": 40.0,
        "pace_s_per_500_m": 226.51,
        "average_pace_s_per_500_m": 265.0,
        "rest_distance_m": 0.0,
        "rest_time_s": 0.0,
        "machine_type": 0.0,
    }
    assert values("pm5", "f52e000013000c00846713000c00000000b30000", channel=PM5.format(0x33)) == {
        "elapsed_s": 120.21,
        "interval": 0.0,
        "average_power_w": 19.0,
        "energy_kcal": 12.0,
        "split_pace_s_per_500_m": 265.0,
        "split_power_w": 19.0,
        "split_energy_rate_kcal_per_h": 12.0,
        "last_split_time_s": 0.0,
        "last_split_distance_m": 179.0,
    }


def test_pm5_force_curve_is_complete_with_its_last_part():
    decoder = DECODERS["pm5"].decoder()
    first = bytes.fromhex("79001800290029003B003B004000450045005300")
    pounds = [24, 41, 41, 59, 59, 64, 69, 69, 83]
    assert decoder.decode(first, "CE06003D") == []
    for index in range(1, 6):
        assert decoder.decode(bytes([0x79, index]) + first[2:], "CE06003D") == []
    [reading] = decoder.decode(bytes([0x71, 6, 24, 0]), "CE06003D")
    assert reading.device == "drive"
    assert reading.values["handle_force_n"] == tuple(POUND_FORCE_N * p for p in [*(6 * pounds), 24])
    assert decoder.damaged == 0


def test_pm5_force_curve_with_a_lost_part_is_left_out():
    decoder = DECODERS["pm5"].decoder()
    assert decoder.decode(bytes([0x31, 0, 1, 0]), "003D") == []
    assert decoder.decode(bytes([0x31, 2, 3, 0]), "003D") == []
    assert decoder.damaged == 1
    assert decoder.decode(bytes([0x21, 0, 5, 0]), "003D") == []
    assert decoder.decode(bytes([0x21, 0, 7, 0]), "003D") == []
    assert decoder.damaged == 2
    [reading] = decoder.decode(bytes([0x21, 1, 8, 0]), "003D")
    assert reading.values["handle_force_n"] == (7 * POUND_FORCE_N, 8 * POUND_FORCE_N)


def stroke(elapsed, recovery, number, drive=(142, 83, 2214, 1302)):
    """0x0035: 1.42 m of handle, drive of 0.83 s, 221.4 and 130.2 pounds of force."""
    travel, time, peak, mean = drive
    widths = (
        (elapsed, 3),
        (1234, 3),
        (travel, 1),
        (time, 1),
        (recovery, 2),
        (987, 2),
        (peak, 2),
        (mean, 2),
        (5678, 2),
    )
    return b"".join(value.to_bytes(width, "little") for value, width in (*widths, (number, 2))).hex()


@pytest.mark.parametrize("number_after", [17, 18])
def test_pm5_stroke_is_complete_at_the_second_message(number_after):
    drive, complete = decoded("pm5", stroke(5000, 140, 17), stroke(5150, 152, number_after), channel="0035")
    assert drive.device == "drive"
    assert complete.device == "stroke"
    assert complete.values == {
        "elapsed_s": 51.5,
        "distance_m": 123.4,
        "handle_travel_m": 1.42,
        "drive_time_s": 0.83,
        "recovery_time_s": 1.52,
        "distance_per_stroke_m": 9.87,
        "peak_force_n": pytest.approx(221.4 * POUND_FORCE_N, rel=1e-15),
        "mean_force_n": pytest.approx(130.2 * POUND_FORCE_N, rel=1e-15),
        "work_j": 567.8,
        "stroke_number": float(number_after),
    }


def test_pm5_stroke_with_a_lost_message_stays_a_drive():
    other = (150, 90, 2000, 1200)
    messages = stroke(5000, 140, 17), stroke(5250, 152, 18, other), stroke(5400, 160, 18, other)
    assert [r.device for r in decoded("pm5", *messages, channel="0035")] == ["drive", "drive", "stroke"]


def test_pm5_stroke_of_zeros_after_a_rest_completes_none():
    zeros = "00" * 20
    assert [r.device for r in decoded("pm5", zeros, zeros, channel="0035")] == ["drive", "drive"]


def test_pm5_status_names_the_workout_by_its_unit():
    status = "393000" + "7b0000" + "0503010102" + "f40100" + "{}" + "{}" + "78"
    time = values("pm5", status.format("60ea00", "00"), channel="0031")
    assert time["elapsed_s"] == 123.45
    assert time["workout_duration_s"] == 600.0
    assert time["drag_factor"] == 120.0
    assert time["stroke_state"] == 2.0
    assert values("pm5", status.format("d00700", "80"), channel="0031")["workout_distance_m"] == 2000.0
    assert "workout_duration" not in values("pm5", status.format("d00700", "c0"), channel="0031")


def test_pm5_stroke_power_and_state():
    assert values("pm5", "e803005e01b004120058020088130000"[:30], channel="0036") == {
        "elapsed_s": 10.0,
        "power_w": 350.0,
        "energy_rate_kcal_per_h": 1200.0,
        "stroke_number": 18.0,
        "projected_time_s": 600.0,
        "projected_distance_m": 5000.0,
    }
    state = values("pm5", "0201" + "0300" + "0400" + "050607" + "08" + "0900", channel="003E")
    assert list(state.values()) == [float(n) for n in (2, 1, 3, 4, 5, 6, 7, 8, 9)]


@pytest.mark.parametrize(
    ("number", "alone", "multiplexed", "only"),
    [
        (0x31, "01" * 19, "01" * 19, set()),
        (0x32, "01" * 17, "01" * 16 + "0201" + "01", {"average_power_w"}),
        (0x33, "01" * 4 + "0201" + "01" * 14, "01" * 18, {"average_power_w"}),
        (0x35, "01" * 16 + "0201" + "01" * 2, "01" * 18, {"work_j"}),
        (0x36, "01" * 15, "01" * 15 + "0201", {"work_j"}),
        (
            0x3D,
            "19000100020003000400050006000700080009" + "00",
            "18000100020003000400050006000700" + "0800",
            {"handle_force_n"},
        ),
        (0x3E, "01" * 12, "01" * 12, set()),
    ],
)
def test_pm5_multiplexed_values_are_those_of_the_characteristics(number, alone, multiplexed, only):
    [own] = decoded("pm5", alone, channel=PM5.format(number))
    [shared] = decoded("pm5", f"{number:02x}{multiplexed}", channel=PM5.format(0x80))
    assert own.device == shared.device
    both = own.values.keys() & shared.values.keys() - only
    assert {name: own.values[name] for name in both} == {name: shared.values[name] for name in both}
    assert own.values.keys() ^ shared.values.keys() <= only


@pytest.mark.parametrize(
    "frame",
    ["F17E0185FAF2", "F17F035701002AF2", "F17603A38581D2F2", "F1760701010113020101" + "61F2"],
)
def test_csafe_frames(frame):
    content = bytes.fromhex(frame)[1:-2]
    assert values("csafe", frame)["content"] == tuple(content)
    assert framed(content) == bytes.fromhex(frame)
    assert len(decoded("csafe", *(frame[at : at + 2] for at in range(0, len(frame), 2)))) == 1


def test_csafe_stuffs_its_marks():
    content = bytes(range(0xEE, 0xF6))
    assert framed(content).hex() == "f1eeeff300f301f302f303f4f5" + "00" + "f2"
    assert values("csafe", framed(content).hex())["content"] == tuple(content)
    assert values("csafe", "f00102" + framed(content).hex()[2:])["content"] == tuple(content)


PM5_PARTS = (
    (
        ("FF0A34CB0000C000CF00320027008C0000540000", "00013E24000900D701FF"),
        (26, 203, 192, 207, 50, 39, 140, 0, 84, 31, 36, 9, 471),
    ),
    (
        ("FF0A30520100AD00C10043003000760000830000", "000132340010001402FF"),
        (24, 338, 173, 193, 67, 48, 118, 0, 131, 25, 52, 16, 532),
    ),
)


@pytest.mark.parametrize(("parts", "expected"), PM5_PARTS)
def test_ftms_of_a_pm5_in_two_parts(parts, expected):
    names = [
        *("average_rate_per_min", "distance_m", "pace_s_per_500_m", "average_pace_s_per_500_m", "power_w"),
        *("average_power_w", "resistance_level", "heart_rate_per_min", "elapsed_s", "rate_per_min"),
        *("stroke_number", "energy_kcal", "energy_rate_kcal_per_h"),
    ]
    assert values("ftms", *parts, channel="2AD1") == dict(zip(names, map(float, expected), strict=True))


def test_ftms_of_a_kayakpro():
    assert values("ftms", "2C094F210032000056010C00FFFF5901FF3E00") == {
        "rate_per_min": 39.5,
        "stroke_number": 33.0,
        "distance_m": 50.0,
        "pace_s_per_500_m": 342.0,
        "power_w": 12.0,
        "energy_rate_kcal_per_h": 345.0,
        "elapsed_s": 62.0,
    }
    later = values("ftms", "2C09B1B80030010000011E00FFFF8501FF5B01")
    assert list(later.values()) == [88.5, 184.0, 304.0, 256.0, 30.0, 389.0, 347.0]


def test_ftms_resistance_of_one_byte():
    record = "8008" + "3C0A00" + "07" + "3E00"
    assert values("ftms", record)["elapsed_s"] == 62.0
    padded = bytes.fromhex(record + "00")
    [reading] = DECODERS["ftms"].decoder(resistance_bytes=1).decode(padded)
    assert (reading.values["resistance_level"], reading.values["elapsed_s"]) == (7.0, 62.0)


def test_ftms_parts_of_two_records_are_not_mixed():
    decoder = DECODERS["ftms"].decoder()
    (first, _), _ = PM5_PARTS[0]
    (later, end), expected = PM5_PARTS[1]
    assert decoder.decode(bytes.fromhex(first)) == decoder.decode(bytes.fromhex(later)) == []
    [reading] = decoder.decode(bytes.fromhex(end))
    assert tuple(reading.values.values()) == tuple(map(float, expected))
    assert decoder.damaged == 1


def test_heart_rate():
    assert values("heart_rate", "0454") == {"heart_rate_per_min": 84.0, "skin_contact": 0.0}
    assert values("heart_rate", "1659A202", channel="2A37") == {
        "heart_rate_per_min": 89.0,
        "skin_contact": 1.0,
        "rr_s": (674 / 1024,),
    }
    assert values("heart_rate", "167310020D02")["rr_s"] == (528 / 1024, 525 / 1024)
    assert values("heart_rate", "09FA000A00") == {"heart_rate_per_min": 250.0, "energy_j": 10_000.0}


def test_cycling_power():
    assert values("cycling_power", "0000D204") == {"power_w": 1234.0}
    assert values("cycling_power", "3000D204FFFFFFFF033FFF07E70F", channel="2A63") == {
        "power_w": 1234.0,
        "wheel_turns": 4294967295.0,
        "wheel_time_s": 16131 / 2048,
        "crank_turns": 2047.0,
        "crank_time_s": 4071 / 1024,
    }


def test_cycling_power_unwraps_turns_and_times():
    before, after = decoded(
        "cycling_power",
        "300000" + "00" + "FFFFFFFF" + "00FF" + "FFFF" + "00FF",
        "300000" + "00" + "01000000" + "0001" + "0000" + "0001",
    )
    assert after.values["wheel_turns"] - before.values["wheel_turns"] == 2.0
    assert after.values["wheel_time_s"] - before.values["wheel_time_s"] == 512 / 2048
    assert after.values["crank_turns"] - before.values["crank_turns"] == 1.0
    assert after.values["crank_time_s"] - before.values["crank_time_s"] == 512 / 1024


def test_open_rowing_monitor_by_mqtt():
    message = {
        "timestamp": "1732300000.125",
        "strokeState": "Drive",
        "totalMovingTime": "61.50000",
        "totalNumberOfStrokes": "24",
        "heartrate": "NaN",
        "driveDuration": "812",
        "recoveryDuration": "1488",
        "strokeDuration": None,
        "driveLength": "1.42",
        "strokeRate": "26.1",
        "peakHandleForce": "612.4",
        "forceCurve": [10.5, 612.4],
        "dragfactor": "118.2",
        "isMoving": True,
    }
    [reading] = decoded("open_rowing_monitor", json.dumps(message).encode().hex())
    assert reading.clock_s == 1732300000.125
    assert reading.values == {
        "elapsed_s": 61.5,
        "stroke_number": 24.0,
        "handle_travel_m": 1.42,
        "drive_time_s": pytest.approx(0.812, rel=1e-15),
        "recovery_time_s": pytest.approx(1.488, rel=1e-15),
        "rate_per_min": 26.1,
        "peak_force_n": 612.4,
        "handle_force_n": (10.5, 612.4),
        "drag_factor": 118.2,
        "stroke_state": "Drive",
    }


def test_open_rowing_monitor_by_websocket():
    metrics = {
        "timestamp": "2024-11-22T18:26:40.125Z",
        "driveDuration": 0.812,
        "driveHandleForceCurve": [10.5, 612.4],
    }
    [reading] = decoded(
        "open_rowing_monitor", json.dumps({"type": "metrics", "data": metrics}).encode().hex()
    )
    assert reading.clock_s == 1732300000.125
    assert reading.values == {"drive_time_s": 0.812, "handle_force_n": (10.5, 612.4)}
    assert decoded("open_rowing_monitor", b'{"type": "config", "data": {}}'.hex()) == []
