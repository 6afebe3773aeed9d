"""Decoders of ergometers, belts, power meters, LSL streams and announcements: any bytes, then the next message."""

import json
import math
import struct

import pytest
from hypothesis import strategies as st

from fuzz_campaign import campaign
from fuzz_wounds import byte_wounds, wounded_bytes
from oarlock.live.decoders import DECODERS
from oarlock.live.decoders.lsl import HEADER, SAMPLES
from oarlock.live.decoders.ximu3_announcement import announcement
from wire_streams import assert_sound

PM5 = [
    "0031",
    "0032",
    "0033",
    "0035",
    "0036",
    "003D",
    "003E",
    "0080",
    "",
    "CE060031-43E5-11E4-916C-0800200C9A66",
    "x",
]
CHANNELS = {"pm5": PM5, "ftms": ["2AD1", ""], "heart_rate": ["2A37", ""], "cycling_power": ["2A63", ""]}
# A message of each format, with its channel and a value in it.
NEXT = [
    ("pm5", "0032", "8b2f00a40828ff7b588467000000000000", "elapsed_s", 121.71),
    ("pm5", "003D", "1100" + "0000", "handle_force_n", (0.0,)),
    ("pm5", "0080", "32" + "8b2f00a40828ff7b588467000000000000" + "0100", "average_power_w", 256.0),
    ("ftms", "2AD1", "2C094F210032000056010C00FFFF5901FF3E00", "pace_s_per_500_m", 342.0),
    ("heart_rate", "2A37", "1659A202", "heart_rate_per_min", 89.0),
    ("cycling_power", "2A63", "0000D204", "power_w", 1234.0),
    ("csafe", "", "F17F035701002AF2", "content", (0x7F, 3, 0x57, 1, 0)),
    ("open_rowing_monitor", "", b'{"driveDuration": "1000"}'.hex(), "drive_time_s", 1.0),
    (
        "open_rowing_monitor",
        "",
        b'{"type": "metrics", "data": {"heartrate": 90}}'.hex(),
        "heart_rate_per_min",
        90.0,
    ),
]

# Beside any bytes, such that come near to messages: of usual lengths, of marks, with small first bytes.
NEAR = st.one_of(
    st.binary(max_size=24),
    st.lists(st.sampled_from([0, 1, 3, 0xF0, 0xF1, 0xF2, 0xF3, 0xFF]), max_size=24).map(bytes),
    st.tuples(st.integers(0x30, 0x3F), st.binary(min_size=12, max_size=20)).map(
        lambda p: bytes([p[0]]) + p[1]
    ),
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["type", "data", "timestamp", "forceCurve", "heartrate"]), inner, max_size=4
            )
        ),
        max_leaves=8,
    ).map(lambda value: str(value).replace("'", '"').replace("None", "null").encode("utf-8", "replace")),
)


LABELS = ("gyro_x", "gyro_y", "gyro_z", "power")
LSL_XML = (
    "<info><name>back</name><type>IMU</type><channel_count>4</channel_count><nominal_srate>100</nominal_srate>"
    "<channel_format>float32</channel_format><desc><channels>"
    + "".join(f"<channel><label>{label}</label><unit>deg/s</unit></channel>" for label in LABELS)
    + "</channels></desc></info>"
).encode()
LSL_ROW = struct.pack("<5d", 12.5, 1.0, 2.0, 3.0, 250.0)
ANNOUNCED = {"name": "back", "sn": "65577B49", "ip": "10.0.0.7", "port": 7000, "send": 8000, "receive": 9000}
ANNOUNCEMENT = json.dumps({**ANNOUNCED, "rssi": 64, "battery": 87, "status": 0}).encode()


@pytest.mark.parametrize(("name", "channel", "message", "value", "expected"), NEXT)
def test_any_bytes_and_then_a_message(name, channel, message, value, expected):
    channels = st.sampled_from(CHANNELS.get(name, [""]))

    def check(garbage, harms):
        decoder = DECODERS[name].decoder()
        for data, at in garbage:
            assert_sound(decoder.decode(data, at))
        for harm in harms:
            assert_sound(decoder.decode(wounded_bytes(bytes.fromhex(message), harm), channel))
        assert decoder.decode(bytes.fromhex(message), channel)[-1].values[value] == expected

    campaign(check, st.lists(st.tuples(NEAR, channels), max_size=6), st.lists(byte_wounds, max_size=6))


def test_lsl():
    def check(harms, garbage):
        decoder = DECODERS["lsl"].decoder()
        for harm in harms:
            assert_sound(decoder.decode(wounded_bytes(LSL_XML, harm), HEADER))
            assert_sound(decoder.decode(wounded_bytes(3 * LSL_ROW, harm), SAMPLES))
            assert_sound(decoder.decode(garbage, SAMPLES))
        assert decoder.decode(LSL_XML, HEADER) == []
        found = {name: value for r in decoder.decode(LSL_ROW, SAMPLES) for name, value in r.values.items()}
        assert found["power"] == 250.0 and found["gyro_rad_s"] == pytest.approx(
            tuple(math.radians(k) for k in (1, 2, 3))
        )

    campaign(check, st.lists(byte_wounds, min_size=1, max_size=4), st.binary(max_size=100))


def test_announcements():
    def check(harm, garbage):
        for data in (wounded_bytes(ANNOUNCEMENT, harm), garbage):
            found = announcement(data)
            assert found is None or math.isfinite(found.rssi_percent + found.battery_percent)

    campaign(check, byte_wounds, NEAR)
