"""What is in the air and on the wires: recognised by content, found in networks, named for rig files."""

import asyncio
import json
import random
import socket

import pytest
from while_listening import datagrams, is_bound, while_listening
from wire_samples import (
    UNIT,
    csv_lines,
    json_lines,
    mvn,
    ngimu,
    nmea,
    osc_hand,
    vicon,
    ximu3,
    ximu3_announcement,
)

from command_line import run
from oarlock.live.decoders import ximu3_announcement as announcements
from oarlock.live.reading import Packet
from oarlock.live.rig import Source
from oarlock.live.scan.finding import DevicePart, Sender, devices_of, received_together
from oarlock.live.scan.network import Network
from oarlock.live.scan.recognition import recognised
from oarlock.live.scan.source_words import source_of, words_of
from oarlock.live.transports.radio import BleAdvertisement, RadioError
from oarlock.live.transports.udp import free_port
from oarlock.storage.errors import DataError

SENT = {
    "lines": (json_lines("back", UNIT), "back", {"gyro_rad_s", "accel_m_s2", "mag_ut"}, 100.0),
    "csv": (csv_lines(), "", {"gyro_rad_s", "accel_m_s2"}, 50.0),
    "ngimu": (ngimu(), "", {"gyro_rad_s", "accel_m_s2", "mag_ut"}, 100.0),
    "osc": (osc_hand(), "left/hand", {"gyro_rad_s", "accel_m_s2"}, 100.0),
    "ximu3": (ximu3(), "", {"gyro_rad_s", "accel_m_s2"}, 200.0),
    "nmea": (nmea(), "", {"speed_m_s", "latitude_deg"}, 10.0),
    "mvn": (mvn(), "pelvis", {"position_m", "quat_wxyz"}, 60.0),
    "vicon": (vicon(), "left_hand", {"position_m"}, 100.0),
}


def packets(data):
    return [Packet("", "10.0.0.7:5000", "", 10_000_000 * k, one) for k, one in enumerate(data)]


@pytest.mark.parametrize("name", SENT)
def test_a_datagram_is_recognised_by_its_content(name):
    data, part, quantities, rate_hz = SENT[name]
    found = recognised(packets(data), Source("", "", "udp"))
    assert found.format == name.replace("csv", "lines") and found.damaged == 0
    own = {one.name: one for one in found.parts}[part]
    assert quantities <= own.rates_hz.keys()
    assert own.rate_hz == pytest.approx(rate_hz, rel=0.01)


@pytest.mark.parametrize("name", ["csv", "ximu3", "nmea", "mvn"])
def test_a_stream_is_recognised_from_its_middle(name):
    """Bytes arrive as the connection cuts them, and the first message is not whole."""
    ends = {"csv": b"\n"}
    stream, rng = b"".join(one + ends.get(name, b"") for one in SENT[name][0])[7:], random.Random(4)
    cut = []
    while stream:
        size = rng.randint(1, 90)
        cut.append(stream[:size])
        stream = stream[size:]
    assert recognised(packets(cut), Source("", "", "tcp")).format == name.replace("csv", "lines")


def test_rubbish_is_nothing():
    rng = random.Random(5)
    assert recognised(packets([rng.randbytes(60) for _ in range(200)]), Source("", "", "udp")) is None


def test_loss_and_battery_are_told():
    lossy = [one for k, one in enumerate(json_lines("back", {**UNIT, "battery_percent": 31})) if k % 10 != 5]
    (part,) = recognised(packets(lossy), Source("", "", "udp")).parts
    assert part.lost_percent == pytest.approx(10.0, abs=0.1) and part.battery_percent == 31.0
    assert part.rate_hz == pytest.approx(100.0, rel=0.01)


def test_devices_have_the_shortest_names_that_tell_them_apart():
    def finding(address, *parts):
        return Sender("", address, Source("", "lines", "udp"), tuple(DevicePart(name, {}) for name in parts))

    several = [
        finding("10.0.0.1:5", "hand", "back"),
        finding("10.0.0.2:5", "hand"),
        finding("10.0.0.3:5", ""),
    ]
    assert [d.name for d in devices_of(several)] == ["10.0.0.1/hand", "back", "10.0.0.2/hand", "10.0.0.3"]
    loopback = [finding("127.0.0.1:5", ""), finding("127.0.0.1:6", "")]
    assert [d.name for d in devices_of(loopback)] == ["127.0.0.1:5", "127.0.0.1:6"]


def test_units_that_are_listed_need_one_source():
    def unit(serial):
        return Sender("", serial, Source("", "ximu3", "tcp", {"units": [serial]}))

    other = Sender("", "10.0.0.1:5", Source("", "lines", "udp", {"port": 9000}))
    (first, both), (second, _) = received_together([unit("AA"), other, unit("BB")])
    assert first.options == {"units": ["AA", "BB"]} and len(both) == 2
    assert second.options == {"port": 9000}


@pytest.mark.parametrize(
    ("text", "transport", "format_", "options"),
    [
        ("udp:9000", "udp", "", {"port": 9000}),
        ("udp:9000:lines", "udp", "lines", {"port": 9000}),
        ("tcp:10.0.0.5:7000:ximu3", "tcp", "ximu3", {"host": "10.0.0.5", "port": 7000}),
        ("tcp:unit.local:7000", "tcp", "", {"host": "unit.local", "port": 7000}),
        (
            "serial:/dev/ttyUSB0@921600:shimmer3",
            "serial",
            "shimmer3",
            {"device": "/dev/ttyUSB0", "baud": 921600},
        ),
        ("serial:COM3", "serial", "", {"device": "COM3"}),
        ("ble:dot:D4:22:CD:00:00:01", "ble", "dot", {"addresses": ["D4:22:CD:00:00:01"]}),
        ("lsl:Back unit", "lsl", "lsl", {"name": "Back unit"}),
    ],
)
def test_sources_in_words(text, transport, format_, options):
    found = source_of(text)
    assert (found.transport, found.format, dict(found.options)) == (transport, format_, options)


@pytest.mark.parametrize(
    "text", ["udp", "udp:x", "udp:9000:line", "tcp:7000", "ble:AA", "usb:1", "", "udp:9:dot"]
)
def test_wrong_words_say_what_is_expected(text):
    with pytest.raises(DataError, match=r"expected udp:PORT|does not carry"):
        source_of(text)


def test_the_words_of_a_rig_file():
    source = Source("", "ximu3", "tcp", {"units": ["AA", "BB"]})
    assert words_of(source) == 'format = "ximu3", transport = "tcp", units = ["AA", "BB"]'


def test_the_verb_lists_what_sends_to_ports(monkeypatch):
    port, other = free_port(), free_port()
    while_listening(
        monkeypatch,
        datagrams(port, [*json_lines("back", UNIT), *json_lines("seat", {"value": 310.0}, 50.0)], ngimu()),
        datagrams(other, [b"\x01\x02hello"] * 5),
    )
    words = ("live", "scan", "--places", "none", "--source", f"udp:{port}", "--source", f"udp:{other}")
    said = run(*words).stdout
    assert f'format = "lines", transport = "udp", port = {port}' in said
    assert f'format = "ngimu", transport = "udp", port = {port}' in said
    assert "gyro, accel, mag" in said and "61.0" in said and "oarlock live init" in said
    assert "no format of Oarlock reads it: 01 02 68 65 6c 6c 6f" in said
    told = json.loads(run(*words, "--json").stdout)
    assert [one["device"] for one in told["devices"] if one["source"] == "lines"] == ["back", "seat"]
    (unit,) = (one for one in told["devices"] if one["source"] == "ngimu")
    assert unit["battery_percent"] == 61.0 and unit["rate_hz"] == pytest.approx(100.0)


def test_nothing_is_said_to_be_nothing(monkeypatch):
    while_listening(monkeypatch)
    assert "Nothing was heard" in run("live", "scan", "--places", "none").stdout
    assert "choose some of" in run("live", "scan", "--places", "radio", status=2).stderr
    assert "expected udp:PORT" in run("live", "scan", "--source", "udp:x", status=2).stderr


def test_a_port_that_is_taken_is_named(monkeypatch):
    while_listening(monkeypatch)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("0.0.0.0", 0))
        port = one.getsockname()[1]
        said = run("live", "scan", "--places", "none", "--source", f"udp:{port}").stdout
    assert f"UDP port {port}" in said and "cannot be opened" in said


@pytest.fixture
def announced_at(monkeypatch):
    port = free_port()
    monkeypatch.setattr(announcements, "PORT", port)
    return port


async def served(sent):
    """A TCP server that sends to each client, and what says that it has sent."""
    done = asyncio.Event()

    async def serve(reader, writer):
        writer.write(b"".join(sent))
        await writer.drain()
        done.set()
        await reader.read()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    return server, server.sockets[0].getsockname()[1], done


def test_a_unit_that_announces_itself_is_found_and_connected_if_asked(monkeypatch, announced_at):
    async def work(connects):
        server, port, done = await served(ximu3())

        async def connected():
            await done.wait()
            await asyncio.sleep(0.01)

        sends = [datagrams(announced_at, [ximu3_announcement(port)])]
        while_listening(monkeypatch, *sends, *([connected] if connects else []))
        async with server:
            return await Network([], connects=connects).scan(0.0)

    (found,), problems = asyncio.run(asyncio.wait_for(work(False), 60))
    assert (
        not problems
        and found.address == "65577B49"
        and found.name == "back"
        and found.battery_percent == 87.0
    )
    assert found.source == Source("", "ximu3", "tcp", {"units": ["65577B49"]}) and not found.parts
    (found,), _ = asyncio.run(asyncio.wait_for(work(True), 60))
    assert found.parts[0].rate_hz == pytest.approx(200.0) and "TCP port" in found.what


def test_the_port_to_which_a_unit_says_that_it_sends_is_opened(monkeypatch, announced_at):
    port = free_port()
    while_listening(
        monkeypatch,
        datagrams(announced_at, [ximu3_announcement(7000, port)]),
        datagrams(port, ximu3()),
    )
    (found,), _ = asyncio.run(asyncio.wait_for(Network([]).scan(0.0), 60))
    assert found.source == Source("", "ximu3", "udp", {"port": port, "units": ["65577B49"]})
    assert found.address == "65577B49" and not is_bound(port)


class Radio:
    def __init__(self, *found):
        self.found = found

    async def scan(self, duration_s):
        if not self.found:
            raise RadioError("no adapter")
        return list(self.found)


def test_bluetooth_devices_are_named_by_their_kind(monkeypatch):
    radio = Radio(
        BleAdvertisement("D4:22:CD:00:00:01", "Movella DOT", (), -60.0),
        BleAdvertisement("F0:00:00:00:00:02", "PM5 430123456", (), -71.0),
        BleAdvertisement("AA:AA:AA:AA:AA:03", "Television", (), -80.0),
    )
    monkeypatch.setattr("oarlock.live.transports.ble.own_radio", lambda: radio)
    while_listening(monkeypatch)
    said = run("live", "scan", "--places", "ble", "--all").stdout
    assert 'addresses = ["D4:22:CD:00:00:01"]' in said and 'format = "pm5"' in said
    assert "-71 dBm" in said and "Television" in said
    monkeypatch.setattr("oarlock.live.transports.ble.own_radio", Radio)
    assert "Bluetooth: no adapter" in run("live", "scan", "--places", "ble").stdout


def test_missing_extras_are_said_with_the_command_that_installs_them(monkeypatch):
    import importlib

    real = importlib.import_module

    def without(name, package=None):
        if name.split(".")[0] in ("bleak", "pylsl", "serial"):
            raise ImportError(name)
        return real(name, package)

    for place in ("transports.bleak_radio", "scan.lsl_streams", "scan.serial_ports"):
        monkeypatch.setattr(f"oarlock.live.{place}.import_module", without)
    while_listening(monkeypatch)
    said = " ".join(run("live", "scan", "--places", "ble,lsl,serial").stdout.split())
    for extra in ("ble", "lsl", "serial"):
        assert f"pip install 'oarlock[{extra}]'" in said


def test_serial_ports_are_listed_and_not_opened(monkeypatch):
    ports = pytest.importorskip("serial.tools.list_ports", reason="needs pyserial, an extra")
    port = type(
        "Port", (), {"device": "/dev/ttyUSB7", "description": "FT232R", "__lt__": lambda a, b: False}
    )()
    monkeypatch.setattr(ports, "comports", lambda: [port])
    while_listening(monkeypatch)
    said = run("live", "scan", "--places", "serial").stdout
    assert "/dev/ttyUSB7" in said and "FT232R" in said
    assert "oarlock live scan --source serial:/dev/ttyUSB7" in " ".join(said.split())


def test_lsl_streams_are_listed_with_what_they_send(monkeypatch):
    pylsl = pytest.importorskip("pylsl", reason="needs pylsl, an extra")
    info = pylsl.StreamInfo("seat", "Encoder", 1, 50.0, "double64", "oarlock-scan-seat")
    info.desc().append_child("channels").append_child("channel").append_child_value("label", "place_mm")
    monkeypatch.setattr(
        pylsl,
        "resolve_streams",
        lambda wait_time: pylsl.resolve_byprop("source_id", "oarlock-scan-seat", 1, 60.0),
    )
    outlet = pylsl.StreamOutlet(info)
    said = run("live", "scan", "--places", "lsl").stdout
    assert 'LSL stream "seat" (Encoder)' in said and "place_mm" in said and " 50" in said
    assert 'source_id = "oarlock-scan-seat"' in said
    del outlet
