"""Some seconds of what devices send, in the bytes of their formats."""

import json
import struct

from oarlock.live.decoders import osc
from oarlock.live.decoders.nmea import sentence

EPOCH = osc.UNIX_EPOCH_S << 32


def json_lines(device, values, rate_hz=100.0, count=200, first=0):
    return [
        json.dumps({"device": device, "t_us": round(1e6 * k / rate_hz), "seq": first + k, **values}).encode()
        for k in range(count)
    ]


def csv_lines(rate_hz=50.0, count=200):
    return [f"{round(1e6 * k / rate_hz)},{k},0.1,0.2,9.8,0.01,0.02,0.03".encode() for k in range(count)]


def ngimu(rate_hz=100.0, count=200):
    sensors = osc.message("/sensors", [1, 2, 3, 0, 0, 1, 20, 0, -40, 1013.25])
    sent = [osc.bundle(EPOCH + int(2**32 * (1.8e9 + k / rate_hz)), [sensors]) for k in range(count)]
    return [osc.bundle(EPOCH + int(2**32 * 1.8e9), [osc.message("/battery", [61.0, 3.9])]), *sent]


def osc_hand(rate_hz=100.0, count=200):
    values = [
        osc.message("/left/hand/gyro_rad_s", [0, 0, 1]),
        osc.message("/left/hand/accel_m_s2", [0, 0, 9.8]),
    ]
    return [osc.bundle(EPOCH + int(2**32 * (1.8e9 + k / rate_hz)), values) for k in range(count)]


def ximu3(rate_hz=200.0, count=200):
    lines = [f"I,{round(1e6 * k / rate_hz)},0.1,0.2,0.3,0,0,1\n".encode() for k in range(count)]
    return [*lines, f"B,{round(1e6 * count / rate_hz)},87.0,4.1,0\n".encode()]


def ximu3_announcement(port, sends=0, name="back", serial="65577B49"):
    told = {"sync": 0, "name": name, "sn": serial, "ip": "127.0.0.1", "port": port}
    told |= {"send": sends, "receive": 9000, "rssi": 64, "battery": 87, "status": 0}
    return json.dumps(told).encode()


def nmea(rate_hz=10.0, count=50):
    return [
        sentence(f"GNRMC,1235{k / rate_hz:05.2f},A,4807.03812,N,01131.00034,E,9.720,084.4,230394,,,A")
        for k in range(count)
    ]


def mvn(rate_hz=60.0, count=120):
    items = b"".join(struct.pack(">I7f", segment, 0.1, 0.2, 0.9, 1, 0, 0, 0) for segment in (1, 10))
    return [
        b"MXTP02"
        + struct.pack(">IBBIBBBBHH", k, 0x80, 2, round(1e3 * k / rate_hz), 0, 23, 0, 0, 0, 64)
        + items
        for k in range(count)
    ]


def vicon(count=100):
    name = b"left_hand".ljust(24, b"\0")
    return [
        struct.pack("<IBBH", k, 1, 0, 72) + name + struct.pack("<6d", 100, 200, 900, 0, 0, 1)
        for k in range(count)
    ]


UNIT = {"gyro_rad_s": [0.0, 0.0, 0.1], "accel_m_s2": [0.0, 0.0, 9.8], "mag_ut": [20.0, 0.0, 40.0]}
