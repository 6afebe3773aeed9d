"""Decoders of ergometers, belts and power meters survive any bytes and decode the next message."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from oarlock.live.decoders import DECODERS

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


@pytest.mark.parametrize(("name", "channel", "message", "value", "expected"), NEXT)
@given(data=st.data())
def test_any_bytes_and_then_a_message(name, channel, message, value, expected, data):
    decoder = DECODERS[name].decoder()
    channels = st.sampled_from(CHANNELS.get(name, [""]))
    for garbage, at in data.draw(st.lists(st.tuples(NEAR, channels), max_size=6)):
        for reading in decoder.decode(garbage, at):
            assert all(isinstance(v, float | str | tuple) for v in reading.values.values())
    assert decoder.decode(bytes.fromhex(message), channel)[-1].values[value] == expected
