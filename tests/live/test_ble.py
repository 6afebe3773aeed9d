"""The Bluetooth transport: order of operations, one connection after the other, connections that end and come back."""

import asyncio
import sys
from contextlib import suppress

import pytest
from enough import EnoughError, Sent

from oarlock import DataError
from oarlock.live.rig import Source
from oarlock.live.transports import opened
from oarlock.live.transports.ble import Ble
from oarlock.live.transports.ble_profiles import kind_of
from oarlock.live.transports.bleak_radio import BleakRadio
from oarlock.live.transports.radio import RadioError, short, standard
from oarlock.live.transports.transport import Options
from oarlock_lab.emulators import heart_rate
from oarlock_lab.emulators.bluetooth import Air, VirtualRadio

DOT = "1517{:04x}-4947-11e9-8646-d663bd873d93"
PM5 = "ce06{:04x}-43e5-11e4-916c-0800200c9a66"


class FakeRadio:
    """Writes down what is asked; `refuses` are UUIDs or addresses that fail."""

    def __init__(self, refuses=()):
        self.asked, self.refuses = [], set(refuses)
        self.lost, self.receivers = {}, {}

    async def scan(self, duration_s):
        return []

    async def connect(self, address, lost):
        self.lost[address] = lost
        await self._take("connect", address, address)

    async def subscribe(self, address, characteristic, receive):
        self.receivers[address, characteristic] = receive
        await self._take("subscribe", address, characteristic)

    async def write(self, address, characteristic, data):
        await self._take("write", address, characteristic, data.hex())

    async def disconnect(self, address):
        await self._take("disconnect", address)

    async def _take(self, verb, address, uuid="", *more):
        self.asked.append((verb, address, *((short(uuid),) if uuid and uuid != address else ()), *more))
        await asyncio.sleep(0)
        if uuid in self.refuses:
            raise RadioError(f"no {uuid}")


def transport(radio, **options):
    return Ble("units", Options("units", options), radio)


async def running(ble, until, deliver=lambda packet: None):
    """Runs a transport until a condition, and cancels it."""
    task = asyncio.create_task(ble.run(deliver))
    while not until():
        await asyncio.sleep(0.005)
        if task.done():
            task.result()
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task


def test_dot_is_heard_before_it_is_started_and_stopped_before_it_is_left():
    radio = FakeRadio()
    ble = transport(radio, profile="dot", address="A", mode=26, rate_hz=30)
    asyncio.run(running(ble, lambda: ble.state == "receives from A"))
    assert radio.asked == [
        ("connect", "A"),
        ("write", "A", "15171002", "10" + "00" * 23 + "1e00" + "00" * 6),
        ("subscribe", "A", "15172002"),
        ("subscribe", "A", "15173001"),
        ("write", "A", "15172001", "01011a"),
        ("write", "A", "15172001", "01001a"),
        ("disconnect", "A"),
    ]


def test_devices_are_connected_one_after_the_other():
    radio = FakeRadio()
    ble = transport(radio, profile="dot", addresses=["A", "B", "C"])
    asyncio.run(running(ble, lambda: ble.state.count("receives") == 3))
    begun = [address for verb, address, *_ in radio.asked if verb != "disconnect"][:15]
    assert begun == ["A"] * 5 + ["B"] * 5 + ["C"] * 5
    assert {one[1] for one in radio.asked if one[0] == "disconnect"} == {"A", "B", "C"}


def test_notifications_are_packets_with_source_address_and_channel():
    radio, packets = FakeRadio(), []
    ble = transport(radio, profile="heart_rate", address="A")

    def has_received():
        if ble.state == "receives from A":
            radio.receivers["A", standard(0x2A37)](b"\x04\x54")
        return bool(packets)

    asyncio.run(running(ble, has_received, packets.append))
    assert [(p.source, p.address, p.channel, p.data) for p in packets] == [
        ("units", "A", "2A37", b"\x04\x54")
    ]
    assert packets[0].arrival_ns > 0


def test_pm5_without_a_force_curve_is_heard_and_one_without_strokes_is_not():
    ble = transport(FakeRadio([PM5.format(0x3D)]), profile="pm5", address="A")
    asyncio.run(running(ble, lambda: ble.state == "receives from A"))
    radio = FakeRadio([PM5.format(0x35)])
    lame = transport(radio, profile="pm5", address="A", period_ms=100)
    asyncio.run(running(lame, lambda: lame.state.startswith("lost")))
    assert lame.state == f"lost A (no {PM5.format(0x35)}); connects again in 0.5 s"
    assert radio.asked[1] == ("write", "A", "CE060034", "03")
    assert radio.asked[-1] == ("disconnect", "A")


def test_a_device_that_is_away_does_not_keep_others_from_sending():
    radio = FakeRadio(["A"])
    ble = transport(radio, profile="heart_rate", addresses=["A", "B"])
    asyncio.run(running(ble, lambda: ble.state == "lost A (no A); connects again in 0.5 s; receives from B"))
    first, second = ble.links
    assert (first.address, second.state) == ("A", "receives from B")


def test_a_lost_device_is_asked_again():
    radio = FakeRadio()
    ble = transport(radio, profile="heart_rate", address="A")
    states = []

    def is_back():
        if ble.state not in states[-1:]:
            states.append(ble.state)
            if states.count("receives from A") == 1 and ble.state == "receives from A":
                radio.lost["A"]()
        return states.count("receives from A") == 2

    asyncio.run(running(ble, is_back))
    assert (
        radio.asked[:3]
        == radio.asked[3:6]
        == [("connect", "A"), ("subscribe", "A", "2A37"), ("disconnect", "A")]
    )


def test_a_virtual_belt_that_is_switched_off_and_on():
    address, packets = "F0:00:00:00:00:AA", []

    async def session():
        air = Air()
        ble = transport(VirtualRadio(air.device()), profile="heart_rate", address=address)
        task = asyncio.create_task(ble.run(packets.append))
        counts = []
        for _ in range(2):
            before = len(packets)
            with pytest.raises(EnoughError):
                await heart_rate.run(air.device(address), speed=50.0, sent=Sent(lambda sent: len(sent) == 5))
            while not ble.state.startswith("lost"):
                await asyncio.sleep(0.005)
            counts.append(len(packets) - before)
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        return counts

    assert asyncio.run(session()) == [5, 5]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"profile": "dott", "address": "A"}, 'Did you mean "dot"'),
        ({"profile": "dot"}, "address is missing"),
        ({"profile": "dot", "addresses": "A"}, "a list of texts"),
        ({"profile": "dot", "address": "A", "mode": 1}, "mode is 1; expected 2, 3, 4"),
        ({"profile": "dot", "address": "A", "rate_hz": 50}, "rate_hz is 50; expected 1, 4, 10"),
        ({"profile": "pm5", "address": "A", "period_ms": 200}, "period_ms is 200; expected 1000, 500"),
        ({"profile": "pm5", "address": "A", "mode": 20}, "mode is unknown"),
    ],
)
def test_options_are_checked(options, says):
    with pytest.raises(DataError, match=says):
        transport(FakeRadio(), **options)


def test_a_source_of_a_rig_asks_for_what_its_decoder_reads(monkeypatch):
    radio = FakeRadio()
    monkeypatch.setattr("oarlock.live.transports.ble.own_radio", lambda: radio)
    ble = opened(Source("units", "dot", "ble", {"address": "A"}, {"mode": 21}))
    asyncio.run(running(ble, lambda: ble.state == "receives from A"))
    assert ("write", "A", "15172001", "010115") in radio.asked
    with pytest.raises(DataError, match=r"below \[sources.units.decoder\]"):
        opened(Source("units", "dot", "ble", {"address": "A", "mode": 21}))
    with pytest.raises(DataError, match="Valid: cycling_power, dot"):
        opened(Source("units", "nmea", "ble", {"address": "A"}))


def test_kinds_are_recognised():
    assert kind_of("PM5 430000000", ()) == "pm5"
    assert kind_of("Xsens DOT", ()) == "dot"
    assert kind_of("Belt", (standard(0x180D),)) == "heart_rate"
    assert kind_of("PM5 430000000", (standard(0x1826),)) == "pm5"
    assert kind_of("Lamp", ()) is None


def test_bluetooth_without_bleak_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "bleak", None)
    with pytest.raises(DataError, match=r"pip install 'oarlock\[ble\]'"):
        Ble("units", Options("units", {"profile": "dot", "address": "A"}))


class FakeClient:
    """What the radio uses of bleak's client."""

    def __init__(self, device, disconnected_callback):
        self.device, self.lost, self.asked = device, disconnected_callback, []
        FakeClient.last = self

    async def connect(self):
        if self.device == "away":
            raise TimeoutError
        if self.device == "no service":
            raise FileNotFoundError(2, "No such file or directory")

    async def start_notify(self, characteristic, receive):
        receive(None, bytearray(b"\x01"))

    async def write_gatt_char(self, characteristic, data, response):
        import bleak

        raise bleak.exc.BleakError(f"{characteristic} {data.hex()} {response}")

    async def disconnect(self):
        self.lost(self)


def test_radio_of_bleak(monkeypatch):
    monkeypatch.setattr("bleak.BleakClient", FakeClient)
    radio, received, lost = BleakRadio(), [], []

    async def ask():
        with pytest.raises(RadioError, match="A is not connected"):
            await radio.write("A", "2A37", b"")
        await radio.connect("A", lambda: lost.append("A"))
        await radio.subscribe("A", "2A37", received.append)
        with pytest.raises(RadioError, match="2A37 07 True"):
            await radio.write("A", "2A37", b"\x07")
        await radio.disconnect("A")
        await radio.disconnect("A")
        with pytest.raises(RadioError, match="no answer"):
            await radio.connect("away", lambda: None)
        with pytest.raises(RadioError, match="systemctl start bluetooth"):
            await radio.connect("no service", lambda: None)

    asyncio.run(ask())
    assert received == [b"\x01"]
    assert lost == ["A"]
