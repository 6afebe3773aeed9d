"""A stream of the Lab Streaming Layer from outlet to readings, on this machine."""

import asyncio
import struct

import numpy as np
import pytest

from oarlock.live.decoders import DECODERS
from oarlock.live.decoders.lsl import HEADER, SAMPLES
from oarlock.live.transports.lsl import Lsl
from oarlock.live.transports.transport import Options
from oarlock.storage.errors import DataError

LABELS = [
    ("AccX", "g"),
    ("AccY", "g"),
    ("AccZ", "g"),
    ("GyrX", "deg/s"),
    ("GyrY", "deg/s"),
    ("GyrZ", "deg/s"),
    ("Force", "N"),
]
XML = (
    "<info><name>unit</name><channel_count>7</channel_count><desc><channels>"
    + "".join(f"<channel><label>{label}</label><unit>{unit}</unit></channel>" for label, unit in LABELS)
    + "</channels></desc></info>"
).encode()
ROW = [0.0, 0.0, 1.0, 90.0, 0.0, -180.0, 321.0]


def assert_is_row(reading, stamp_s):
    assert reading.clock_s == stamp_s
    assert reading.values["accel_m_s2"] == (0.0, 0.0, 9.80665)
    np.testing.assert_allclose(reading.values["gyro_rad_s"], [np.pi / 2, 0, -np.pi])
    assert reading.values["Force"] == 321.0


def test_samples_are_units_by_their_labels():
    decoder = DECODERS["lsl"].decoder()
    assert decoder.decode(struct.pack("<8d", 1.5, *ROW), SAMPLES) == []  # no header yet
    assert decoder.decode(XML, HEADER) == []
    first, second = decoder.decode(struct.pack("<16d", 1.5, *ROW, 1.51, *ROW), SAMPLES)
    assert_is_row(first, 1.5)
    assert_is_row(second, 1.51)
    assert decoder.damaged == 1


@pytest.mark.parametrize("data", [b"", b"1234567", struct.pack("<8d", np.nan, *ROW)])
def test_what_is_no_sample_is_counted(data):
    decoder = DECODERS["lsl"].decoder()
    decoder.decode(XML, HEADER)
    assert decoder.decode(data, SAMPLES) == []
    assert decoder.damaged == 1


@pytest.mark.parametrize("xml", [b"", b"<info>", XML.replace(b">7<", b">-1<"), XML.replace(b">7<", b">x<")])
def test_a_header_that_is_none_is_counted(xml):
    decoder = DECODERS["lsl"].decoder()
    decoder.decode(xml, HEADER)
    assert decoder.damaged == 1


def test_the_rig_names_one_stream():
    pytest.importorskip("pylsl", reason="needs pylsl, an extra")
    with pytest.raises(DataError, match="one of the options name, type, source_id"):
        Lsl("radio", Options("radio", {}))


def test_from_outlet_to_readings_and_again_after_a_restart():
    pylsl = pytest.importorskip("pylsl", reason="needs pylsl, an extra")
    pylsl.set_config_content("[lab]\nSessionID = oarlock-test\n[multicast]\nResolveScope = machine\n")

    def outlet():
        info = pylsl.StreamInfo("unit", "IMU", 7, 100.0, "double64", "oarlock-unit")
        channels = info.desc().append_child("channels")
        for label, unit in LABELS:
            channels.append_child("channel").append_child_value("label", label).append_child_value(
                "unit", unit
            )
        return pylsl.StreamOutlet(info)

    async def work():
        decoder, got = DECODERS["lsl"].decoder(), []
        transport = Lsl("unit", Options("unit", {"source_id": "oarlock-unit"}))
        running = asyncio.create_task(
            transport.run(lambda packet: got.extend(decoder.decode(packet.data, packet.channel)))
        )
        for start_s in (100.0, 5.0):
            sender = outlet()
            while not sender.have_consumers():
                await asyncio.sleep(0.05)
            before = len(got)
            for number in range(50):
                sender.push_sample(ROW, start_s + number / 100)
                await asyncio.sleep(0.002)
            while len(got) < before + 50:
                await asyncio.sleep(0.05)
            for number, reading in enumerate(got[before:]):
                assert_is_row(reading, start_s + number / 100)
            del sender
        running.cancel()
        return decoder.damaged

    assert asyncio.run(asyncio.wait_for(work(), 120)) == 0
