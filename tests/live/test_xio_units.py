"""x-IMU3 and NGIMU: the vectors of the maker's manual, vectors made with python-osc, and what units send besides."""

import json
import math
import struct

import pytest
from pythonosc.osc_bundle_builder import OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder
from scipy.spatial.transform import Rotation

import test_ximu3
from decoded import G, as_bytes, damaged, near, one, readings
from oarlock.formats.devices.ximu3_messages import file_units
from oarlock.live.decoders import DECODERS
from oarlock.live.decoders.osc import bundle, message, messages
from oarlock.live.decoders.ximu3_announcement import Announcement, announcement

STAMP = "40420F0000000000"
SENSORS = as_bytes(
    "2362756e646c6500 eef4508020000000 00000040 2f73656e736f727300000000 2c6666666666666666666600 3f800000 40000000"
    "40400000 00000000 00000000 3f800000 41a00000 00000000 c2200000 447d5000"
)


@pytest.mark.parametrize(
    ("sent", "values"),
    [
        (f"C9 {STAMP} {'00000000' * 5} 0000803F 0A", {"gyro_rad_s": (0, 0, 0), "accel_m_s2": (0, 0, G)}),
        (f"D1 {STAMP} 0000803F {'00000000' * 3} 0A", {"quat_wxyz": (1, 0, 0, 0)}),
        (f"C8 {STAMP} 0000000000000000 0000803F 0A", {"high_g_accel_m_s2": (0, 0, G)}),
        (
            f"C2 {STAMP} 0000C842 66668640 00000040 0A",
            {"battery_percent": 100, "battery_v": near(4.2), "charging": 2},
        ),
        (f"CE {STAMP} {b'Button pressed.'.hex()} 0A", {"notification": "Button pressed."}),
        (f"C6 {STAMP} {b'Low battery.'.hex()} 0A", {"error": "Low battery."}),
        # The manual prints the temperature of this example with its bytes in the other order.
        (f"D4 {STAMP} 0000C841 0A", {"temperature_deg_c": 25}),
        (f"D9 {STAMP} 0000803F 0A", {"sync_edge": 1}),
        (f"CF {STAMP} 0A", {"button": 1}),
        (f"CD {STAMP} 0000803F 00000000 000000BF 0A", {"mag_arbitrary": (1, 0, -0.5)}),
        (f"D7 {STAMP} 0000C842 000048C2 0A", {"rssi_percent": 100, "rssi_dbm": -50}),
    ],
)
def test_messages_of_the_manual(sent, values):
    found = one("ximu3", sent)
    assert (found.device, found.clock_s, found.count) == ("", 1.0, None)
    assert found.values == values


def test_stuffed_bytes():
    found = one("ximu3", "C9 DBDC DBDC 000000000000 00002041 000020C0 00000000 00000000 000000BF D7B35D3F 0A")
    assert found.clock_s == pytest.approx(2570e-6, abs=1e-12)
    assert found.values["gyro_rad_s"] == near((math.radians(10), math.radians(-2.5), 0))
    assert found.values["accel_m_s2"] == near((0, -0.5 * G, 0.8660254 * G), rel=1e-7)
    stamp = as_bytes(STAMP)
    for stuffed, plain in (
        ("45 DB DC 41 4D 50 4C 45", "E\nAMPLE"),
        ("45 58 41 4D 50 DB DD DB DC", "EXAMP\ufffd\n"),
    ):
        assert one("ximu3", b"\xce" + stamp + as_bytes(stuffed) + b"\n").values == {"notification": plain}


def test_text_messages():
    found = readings(
        "ximu3",
        b"I,1000000,90.0000,0.0000,0.0000,0.0000,0.0000,1.0000\r\n",
        b"Q,1000001,0.7071,0.7071,0.0000,0.0000\n",
        b"N,1000002,Hello, world\n",
        b"B,1000003,99.5,4.1,0\n",
    )
    assert [round(1e6 * r.clock_s) for r in found] == [1000000, 1000001, 1000002, 1000003]
    assert found[0].values["gyro_rad_s"] == pytest.approx((math.pi / 2, 0, 0))
    assert found[1].values["quat_wxyz"] == (0.7071, 0.7071, 0, 0)
    assert found[2].values == {"notification": "Hello, world"}
    assert found[3].values["battery_percent"] == 99.5


def test_angles_are_the_quaternion_of_yaw_pitch_roll():
    turn = Rotation.from_euler("ZYX", [50, -20, 110], degrees=True).as_quat()[[3, 0, 1, 2]]
    found = one("ximu3", b"A,0,110,-20,50\n")
    assert found.values["quat_wxyz"] == pytest.approx(tuple(turn) if turn[0] > 0 else tuple(-turn))


@pytest.mark.parametrize(("letter", "name"), [("L", "linear_accel_m_s2"), ("E", "earth_accel_m_s2")])
def test_accelerations_with_and_without_quaternion(letter, name):
    assert one("ximu3", test_ximu3.message(letter, 0, 0, 0, 1)).values == {name: (0, 0, G)}
    found = one("ximu3", test_ximu3.message(letter, 0, 1, 0, 0, 0, 0, 0, 1))
    assert found.values == {"quat_wxyz": (1, 0, 0, 0), name: (0, 0, G)}


def test_channels_of_a_multiplexed_stream_are_devices():
    told = test_ximu3.message("Q", 5, 1, 0, 0, 0)
    assert [r.device for r in readings("ximu3", b"^A" + told, b"^B" + told, b"^C^D" + told)] == [
        "A",
        "B",
        "CD",
    ]
    assert damaged("ximu3", b"^A^B^C" + told) == 1


def test_a_mean_has_the_time_of_its_middle():
    sent = test_ximu3.message("I", 1_000_000, 0, 0, 0, 0, 0, 1)
    assert one("ximu3", sent, inertial_divisor=4).clock_s == pytest.approx(1.0 - 1.5 / 400, abs=1e-12)
    assert one("ximu3", test_ximu3.message("Q", 1_000_000, 1, 0, 0, 0), inertial_divisor=4).clock_s == 1.0


def test_answers_to_commands_are_text():
    assert one("ximu3", test_ximu3.PING).values == {"command": test_ximu3.PING.strip().decode()}
    assert damaged("ximu3", b'{"ping":\n') == 1


@pytest.mark.parametrize(
    "sent",
    [
        b"\xc9\x00\n",
        b"\xd1" + bytes(24) + b"\n",
        b"\xd1" + bytes(23) + b"\xdb\n",
        b"\xd1" + bytes(7) + b"\xff" + struct.pack("<4f", 1, 0, 0, 0) + b"\n",
        b"\xd1" + bytes(8) + struct.pack("<4f", math.nan, 0, 0, 0) + b"\n",
        b"\xd1" + bytes(8) + struct.pack("<4f", 2, 0, 0, 0) + b"\n",
        b"Q,1,1,0,0\n",
        b"Q,x,1,0,0,0\n",
        b"Q,-1,1,0,0,0\n",
        b"Z,1,1\n",
        b"N,,x\n",
        b"^\n",
        b"\xff" * 5000 + b"\n",
    ],
)
def test_damaged_messages_are_counted(sent):
    assert damaged("ximu3", sent) == 1


def test_a_stream_says_what_the_reader_of_its_file_says(tmp_path):
    content = b"".join(
        [
            test_ximu3.PING,
            *(test_ximu3.message("I", 2500 * k, k, 2.0, 3.0, 0.1, 0.2, 0.9) for k in range(1, 30)),
            b"I,75000,1,2,3,4,5,6\n",
        ]
    )
    file = tmp_path / "log.ximu3"
    file.write_bytes(content)
    stream = file_units(file)[0].stream("unit")
    found = [r for r in readings("ximu3", content) if "gyro_rad_s" in r.values]
    assert [r.clock_s for r in found] == stream.time_s.tolist()
    assert [list(r.values["gyro_rad_s"]) for r in found] == stream.gyro_rad_s.tolist()
    assert [list(r.values["accel_m_s2"]) for r in found] == stream.accel_m_s2.tolist()


def test_announcements():
    told = {"sync": 0, "name": "Hand", "sn": "0123ABCD", "ip": "192.168.1.2", "port": 7000}
    told |= {"send": 8000, "receive": 9000, "rssi": 76, "battery": 100, "status": 2}
    found = announcement(json.dumps(told).encode())
    assert found == Announcement("Hand", "0123ABCD", "192.168.1.2", 7000, 9000, 8000, 76.0, 100.0)
    for damage in (b"", b"[]", b"{}", b"\xff", json.dumps(told | {"port": None}).encode(), b"[" * 50_000):
        assert announcement(damage) is None


def test_ngimu_sensors():
    assert len(SENSORS) == 84
    found = one("ngimu", SENSORS, transport="udp")
    assert found.clock_s == 1_800_000_000.125
    assert found.values == {
        "gyro_rad_s": pytest.approx((math.radians(1), math.radians(2), math.radians(3))),
        "accel_m_s2": (0, 0, G),
        "mag_ut": (20, 0, -40),
        "pressure_hpa": 1013.25,
    }


def test_ngimu_on_a_serial_port():
    sent = bundle(12 << 32, [message("/quaternion", [0.5, 0.5, -0.5, 0.5])])
    frame = sent.replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc") + b"\xc0"
    first, second = readings("ngimu", frame[:7], frame[7:] + b"\xc0" + frame)
    assert first == second
    assert first.clock_s == 12.0  # without a synchronisation master, since the unit's start
    assert first.values == {"quat_wxyz": (0.5, -0.5, 0.5, -0.5)}


def test_what_else_an_ngimu_sends():
    def told(address, *arguments):
        return one("ngimu", message(address, arguments), transport="udp").values

    assert told("/battery", 85.5, 120.0, 4.0, 0.1, "Discharging") == {"battery_percent": 85.5}
    assert told("/temperature", 31.5, 30.0) == {"temperature": (31.5, 30.0)}
    assert told("/earth", 0.0, 0.0, 1.0) == {"earth_accel_m_s2": (0, 0, G)}
    assert told("/error", "full") == {"error": "full"}
    assert readings("ngimu", message("/button", []), transport="udp") == []
    assert damaged("ngimu", message("/sensors", [1.0] * 9), transport="udp") == 1


def test_osc_of_anybody():
    sent = bundle(
        1_800_000_000 << 32,
        [
            message("/left/hand/gyro_rad_s", [1, 2, 3]),
            message("/left/hand/accel_m_s2", [0, 0, 9]),
            message("/x", [7]),
        ],
    )
    hand, x = readings("osc", sent, transport="udp")
    assert (hand.device, hand.values) == ("left/hand", {"gyro_rad_s": (1, 2, 3), "accel_m_s2": (0, 0, 9)})
    assert (x.device, x.values) == ("", {"x": 7.0})
    assert damaged("osc", message("/hand/gyro_rad_s", [1, 2]), transport="udp") == 1


@pytest.mark.parametrize("kind", ["i", "f", "d", "h", "T", "F"])
def test_numbers_of_all_types_written_by_python_osc(kind):
    builder = OscMessageBuilder("/x")
    value = {"f": 0.5, "d": -2.5, "T": True, "F": False}.get(kind, 77)
    builder.add_arg(value, kind)
    assert one("osc", builder.build().dgram, transport="udp").values == {"x": float(value)}


def test_a_time_tag_may_be_an_argument():
    assert one("osc", b"/x\0\0,t\0\0" + (77).to_bytes(8, "big"), transport="udp").values == {"x": 77.0}


def test_texts_and_blobs_written_by_python_osc():
    builder = OscMessageBuilder("/a/b")
    for value, kind in (("four", "s"), (b"12345", "b"), ("", "s"), (3, "i")):
        builder.add_arg(value, kind)
    (found,) = messages(builder.build().dgram)
    assert found.arguments == ("four", b"12345", "", 3)


def test_what_is_written_is_what_python_osc_writes():
    one_message = OscMessageBuilder("/sensors")
    for value in (1.5, "four", -2.0):
        one_message.add_arg(value)
    assert message("/sensors", [1.5, "four", -2.0]) == one_message.build().dgram
    whole = OscBundleBuilder(1_800_000_000.125)
    whole.add_content(one_message.build())
    assert bundle(0xEEF4508020000000, [message("/sensors", [1.5, "four", -2.0])]) == whole.build().dgram


def test_immediately_is_no_time():
    assert one("osc", bundle(1, [message("/x", [1])]), transport="udp").clock_s is None


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        b"#bundle\0",
        SENSORS[:-1],
        SENSORS + b"\0",
        SENSORS[:16] + b"\xff" * 4 + SENSORS[20:],
        b"/x\0\0",
        b"/x\0\0,q\0\0",
        b"/x\0\0,f\0\0",
        b"x\0\0\0,f\0\0\0\0\0\0",
        b"/x\0\0,b\0\0\xff\xff\xff\xff",
        bundle(5, [bundle(5, [bundle(5, [b"/"])])]),
    ],
)
def test_malformed_packets_are_counted(packet):
    assert damaged("osc", packet, transport="udp") == 1


def test_bundles_in_bundles_have_an_end():
    deep = message("/x", [1])
    for _ in range(12):
        deep = bundle(5, [deep])
    assert damaged("osc", deep, transport="udp") == 1
    assert DECODERS["osc"].decoder().decode(b"\xc0") == []


def test_a_stuffed_first_byte_that_begins_no_message_is_damage():
    decoder = DECODERS["ximu3"].decoder("tcp")
    assert decoder.decode(b"\xdb\xdc" * 3 + bytes(26) + b"\n") == []
    assert decoder.damaged == 1
