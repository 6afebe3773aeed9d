"""Whole messages of each wire format of worn units, for tests that cut them, damage them, or put rubbish between."""

import json
import math
import struct
from dataclasses import dataclass

from decoded import decoder_of
from oarlock.live.decoders.nmea import sentence
from oarlock.live.decoders.osc import bundle, message


@dataclass(frozen=True)
class Wire:
    """A format as one unit sends it.

    Args:
        name: of the format.
        transport: that carries it.
        messages: that follow each other, each with one reading.
        end: what ends a message and is in none; b"" if nothing does.
        first: what the decoder must know before.
        waiting: how many of the last messages are decoded when others follow.
        options: of the decoder.
    """

    name: str
    transport: str
    messages: tuple[bytes, ...]
    end: bytes = b""
    first: bytes = b""
    waiting: int = 0
    options: tuple[tuple[str, object], ...] = ()

    def decoder(self):
        return decoder_of(self.name, self.transport, **dict(self.options))


def slip(packet):
    return packet.replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc") + b"\xc0"


def ximu3(letter, time_us, *values):
    plain = bytes([ord(letter) + 0x80]) + struct.pack(f"<Q{len(values)}f", time_us, *values)
    return plain.replace(b"\xdb", b"\xdb\xdd").replace(b"\n", b"\xdb\xdc") + b"\n"


def osc(address, count):
    return tuple(
        bundle(k << 27, [message(address, [k + 0.1 * j for j in range(count)])]) for k in range(1, 9)
    )


def pose(sample):
    item = struct.pack(">I7f", 1 + sample % 23, 0.1, 0.2, 0.9, 0.5, -0.5, 0.5, 0.5)
    return b"MXTP02" + struct.pack(">IBBIBBBB2xH", sample, 0x80, 1, 4 * sample, 0, 23, 0, 0, len(item)) + item


def inertial(k):
    return (
        b"\0"
        + (640 * (k + 26_000) % 2**24).to_bytes(3, "little")
        + struct.pack(">3h", 37 * k, -k, 500 - 9 * k)
    )


LINES = tuple(b"%d,%d,0.1,%d,9.8,0,0,0.02\n" % (2500 * k, k, k) for k in range(8))
JSON = tuple(
    json.dumps({"t_us": 9 * k, "seq": k, "gyro_rad_s": [k, 0, 1]}).encode() + b"\n" for k in range(8)
)
FIXES = tuple(sentence(f"GPRMC,1000{k:02},A,4807.0,N,01131.0,E,{k}.5,84,230326,,,A") for k in range(8))
TURNS = tuple(ximu3("I", 0x0A0A0A + 2500 * k, k, 2, 3, 0.1, 0.2, 0.9) for k in range(8))
GYRO_INQUIRY = b"\xff\x02" + struct.pack("<HIBB", 640, 0, 3, 1) + b"\x0a\x0b\x0c"

STREAMS = (
    Wire("lines", "serial", LINES, b"\n"),
    Wire("lines", "tcp", JSON, b"\n"),
    Wire("nmea", "serial", FIXES, b"\n"),
    Wire("ximu3", "tcp", TURNS, b"\n"),
    Wire("ximu3", "serial", tuple(b"Q,%d,1,0,0,0\n" % k for k in range(8)), b"\n"),
    Wire("ngimu", "serial", tuple(map(slip, osc("/sensors", 10))), b"\xc0"),
    Wire("osc", "serial", tuple(map(slip, osc("/hand/gyro_rad_s", 3))), b"\xc0"),
    Wire("mvn", "tcp", tuple(map(pose, range(8)))),
    Wire("shimmer3", "serial", tuple(map(inertial, range(8))), b"", GYRO_INQUIRY, 2),
)
DATAGRAMS = (
    Wire("lines", "udp", LINES),
    Wire("nmea", "udp", FIXES),
    Wire("ximu3", "udp", TURNS),
    Wire("ngimu", "udp", osc("/sensors", 10)),
    Wire("osc", "udp", osc("/hand/gyro_rad_s", 3)),
    Wire("mvn", "udp", tuple(map(pose, range(8)))),
    Wire(
        "dot",
        "ble",
        tuple(struct.pack("<I6f", 9 * k, k, 0, 9.8, 0, k, 0) for k in range(8)),
        options=(("mode", 21),),
    ),
    Wire(
        "vicon",
        "udp",
        tuple(struct.pack("<IBBH24s6d", k, 1, 0, 72, b"seat", 1, 2, 3, 0, 0, k) for k in range(8)),
    ),
)


def label(wire):
    """For names of tests."""
    return f"{wire.name}-{wire.transport}-{len(wire.messages[0])}"


def assert_sound(readings):
    """Readings are finite, whatever the bytes were."""
    for reading in readings:
        assert reading.clock_s is None or math.isfinite(reading.clock_s)
        for value in reading.values.values():
            numbers = value if isinstance(value, tuple) else () if isinstance(value, str) else (value,)
            assert all(map(math.isfinite, numbers))
