"""Messages of WebSockets and of MQTT brokers: each is a packet, and a lost connection is made again."""

import asyncio
import shutil
import socket
import sys
from contextlib import asynccontextmanager, suppress

import pytest
from mqtt_broker import Broker
from websockets.asyncio.server import serve

from oarlock.live.decoders import DECODERS
from oarlock.live.reading import RETAINED
from oarlock.live.rig import Source
from oarlock.live.transports import mqtt, opened, transport, websocket
from oarlock.live.transports.mqtt import Mqtt
from oarlock.live.transports.transport import Options
from oarlock.live.transports.websocket import WebSocket
from oarlock.storage.errors import DataError

MQTT = pytest.importorskip("paho.mqtt.client", reason="needs paho-mqtt, an extra")
TOPIC = "OpenRowingMonitor/+/metrics"
PATIENCE_S = 120.0


@pytest.fixture(autouse=True)
def no_pauses(monkeypatch):
    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    monkeypatch.setattr(transport, "LONGEST_PAUSE_S", 0.02)


def free_tcp_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


async def until(is_so):
    async with asyncio.timeout(PATIENCE_S):
        while not is_so():
            await asyncio.sleep(0.002)


@asynccontextmanager
async def running(made):
    """Packets and states of a transport that runs."""
    packets, states = [], []

    class Watched(type(made)):
        def __setattr__(self, name, value):
            if name == "state":
                states.append(value)
            super().__setattr__(name, value)

    made.__class__ = Watched
    task = asyncio.create_task(made.run(packets.append))
    try:
        yield packets, states
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


def run(work):
    asyncio.run(asyncio.wait_for(work, PATIENCE_S))


# WebSocket


def test_messages_of_a_server_that_closes_and_comes_back():
    async def work():
        port, connected = free_tcp_port(), []

        async def page(socket):
            connected.append(socket.request.path)
            await socket.send(f"text {len(connected)}")
            await socket.send(b"\x00\xff")
            if len(connected) > 1:
                await socket.wait_closed()

        made = WebSocket("erg", Options("erg", {"url": f"ws://127.0.0.1:{port}/websocket"}))
        async with running(made) as (packets, states):
            await until(lambda: any("connects again" in state for state in states))  # nobody is there yet
            async with serve(page, "127.0.0.1", port):
                await until(lambda: len(packets) == 4)
        assert connected == ["/websocket", "/websocket"]
        assert [p.data for p in packets] == [b"text 1", b"\x00\xff", b"text 2", b"\x00\xff"]
        assert {(p.source, p.address, p.channel) for p in packets} == {("erg", f"127.0.0.1:{port}", "")}
        arrivals_ns = [p.arrival_ns for p in packets]
        assert arrivals_ns == sorted(arrivals_ns)
        assert f"connected to ws://127.0.0.1:{port}/websocket" in states

    run(work())


async def state_at_a_server(handler, **settings):
    """What a WebSocket transport says after its first try at a server of TCP connections."""
    server = await asyncio.start_server(handler, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    made = WebSocket("erg", Options("erg", {"url": f"ws://127.0.0.1:{port}/"}))
    async with running(made) as (packets, states):
        await until(lambda: any("connects again" in state for state in states))
    server.close()
    assert packets == []
    return next(state for state in states if "connects again" in state)


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", "status 404"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n", "status 200"),
        (b"SSH-2.0-OpenSSH\r\n\r\n", "no WebSocket"),
    ],
)
def test_what_is_no_websocket_is_named(answer, says):
    async def handler(reader, writer):
        await reader.readuntil(b"\r\n\r\n")
        writer.write(answer)
        writer.close()

    async def work():
        assert says in await state_at_a_server(handler)

    run(work())


def test_a_message_without_end_is_no_packet(monkeypatch):
    monkeypatch.setattr(websocket, "LONGEST", 1000)

    async def page(socket):
        with suppress(Exception):
            await socket.send("x" * 2000)
            await socket.wait_closed()

    async def work():
        async with serve(page, "127.0.0.1", 0) as server:
            port = server.sockets[0].getsockname()[1]
            made = WebSocket("erg", Options("erg", {"url": f"ws://127.0.0.1:{port}"}))
            async with running(made) as (packets, states):
                await until(lambda: any("1009" in state for state in states))
            assert packets == []

    run(work())


@pytest.mark.parametrize(
    "url",
    ["", "192.168.1.20", "http://host/", "ws://", "ws://host:x/", "ws://host:99999/", "ws://host/#part"],
)
def test_a_url_is_checked(url):
    with pytest.raises(DataError, match=r"source 'erg': the option url .* expected ws://HOST:PORT/PATH"):
        WebSocket("erg", Options("erg", {"url": url}))


# MQTT


def publish(client, topic, data, retain=False):
    client.publish(topic, data, retain=retain)


@asynccontextmanager
async def publisher(port, **login):
    """A device that is connected to the broker."""
    client = MQTT.Client(MQTT.CallbackAPIVersion.VERSION2)
    if login:
        client.username_pw_set(**login)
    client.connect("127.0.0.1", port)
    client.loop_start()
    await until(client.is_connected)
    try:
        yield client
    finally:
        client.disconnect()
        client.loop_stop()


def listening(states):
    return [state for state in states if state.startswith("listens")]


def test_messages_of_a_topic_before_and_after_the_broker_was_away():
    async def work():
        broker = Broker()
        async with broker.there(), publisher(broker.port) as device:
            made = Mqtt("erg", Options("erg", {"host": "127.0.0.1", "port": broker.port, "topic": TOPIC}))
            publish(device, "OpenRowingMonitor/one/metrics", b"old", retain=True)
            await until(lambda: broker.retained)
            async with running(made) as (packets, states):
                await until(lambda: packets)
                publish(device, "OpenRowingMonitor/two/metrics", b"\x00\xff")
                publish(device, "other/two/metrics", b"for others")
                publish(device, "OpenRowingMonitor/one/metrics", b"{}")
                await until(lambda: len(packets) == 3)
                before = broker.connections
                broker.drop()
                await until(lambda: broker.connections >= before + 2 and made.state.startswith("listens"))
                await until(lambda: device.is_connected() and len(packets) == 4)
                publish(device, "OpenRowingMonitor/two/metrics", b"again")
                await until(lambda: len(packets) == 5)
        told = [(p.address.split("/")[1], p.channel, p.data) for p in packets]
        assert told == [
            ("one", RETAINED, b"old"),
            ("two", "", b"\x00\xff"),
            ("one", "", b"{}"),
            ("one", RETAINED, b"old"),
            ("two", "", b"again"),
        ]
        assert {p.source for p in packets} == {"erg"}
        assert any("lost" in state for state in states)
        assert f"listens to {TOPIC} at 127.0.0.1:{broker.port}" in states

    run(work())


def test_a_message_from_before_gives_no_reading():
    decoder = DECODERS["open_rowing_monitor"].decoder("mqtt")
    assert decoder.decode(b'{"power": "200"}', RETAINED) == []
    assert decoder.decode(b'{"power": "200"}')[0].values == {"power_w": 200.0}
    assert decoder.damaged == 0


@pytest.mark.parametrize(
    ("password", "says"), [("right", "listens to a/b"), ("wrong", "refuses the connection: Not authorized")]
)
def test_a_broker_that_wants_a_password(tmp_path, password, says):
    file = tmp_path / "password"
    file.write_text(f"{password}\nnot this\n")

    async def work():
        async with Broker(login=("coach", "right")).there() as broker:
            options = {"host": "127.0.0.1", "port": broker.port, "topic": "a/b"}
            login = {"username": "coach", "password_file": str(file)}
            async with running(Mqtt("erg", Options("erg", options | login))) as (_, states):
                await until(lambda: any(says in state for state in states))

    run(work())


def test_a_topic_that_the_broker_refuses_is_named():
    async def work():
        async with Broker(refused_topic="secret").there() as broker:
            options = {"host": "127.0.0.1", "port": broker.port, "topic": "secret"}
            async with running(Mqtt("erg", Options("erg", options))) as (_, states):
                await until(lambda: any("refuses the topic secret" in state for state in states))

    run(work())


def test_a_broker_that_does_not_answer_is_left(monkeypatch):
    monkeypatch.setattr(mqtt, "ANSWERS_S", 5)  # the least that paho takes

    async def silent(reader, writer):
        await reader.read()
        writer.close()

    async def work():
        server = await asyncio.start_server(silent, "127.0.0.1", 0)
        options = {"host": "127.0.0.1", "port": server.sockets[0].getsockname()[1], "topic": "a"}
        async with running(Mqtt("erg", Options("erg", options))) as (_, states):
            await until(lambda: any("connects again" in state for state in states))
        server.close()

    run(work())


def test_nobody_at_the_port_is_said():
    async def work():
        options = {"host": "127.0.0.1", "port": free_tcp_port(), "topic": "a"}
        async with running(Mqtt("erg", Options("erg", options))) as (_, states):
            await until(lambda: any("refused" in state and "connects again" in state for state in states))

    run(work())


@pytest.mark.parametrize("topic", ["", "a/#/b", "a+/b", "a/b#", "#a", "a\0b", "x" * 70000])
def test_a_topic_is_checked(topic):
    with pytest.raises(DataError, match="source 'erg': the option topic"):
        Mqtt("erg", Options("erg", {"host": "localhost", "topic": topic}))


@pytest.mark.parametrize("topic", ["a", "/a/", "a/+/b", "+", "#", "+/#", "a/b c/#"])
def test_wildcards_of_a_topic(topic):
    assert mqtt.is_filter(topic)


def test_a_password_file_that_is_not_there_is_named(tmp_path):
    options = {"host": "localhost", "topic": "a", "password_file": str(tmp_path / "none")}
    with pytest.raises(DataError, match=r"password_file .*none cannot be read"):
        Mqtt("erg", Options("erg", options))


def test_mqtt_without_paho_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "paho.mqtt.client", None)
    source = Source("erg", "open_rowing_monitor", "mqtt", {"host": "localhost", "topic": "a"})
    with pytest.raises(DataError, match=r"pip install 'oarlock\[mqtt\]'"):
        opened(source)


@asynccontextmanager
async def mosquitto(folder, program, port):
    settings = folder / "mosquitto.conf"
    settings.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    process = await asyncio.create_subprocess_exec(
        program, "-c", str(settings), stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL
    )
    try:
        yield
    finally:
        process.terminate()
        await process.wait()


def test_mosquitto_that_is_started_again(tmp_path):
    program = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    if program is None:
        pytest.skip("mosquitto, an MQTT broker, is not installed (apt install mosquitto)")

    async def work():
        port = free_tcp_port()
        made = Mqtt("erg", Options("erg", {"host": "127.0.0.1", "port": port, "topic": TOPIC}))
        async with running(made) as (packets, states):
            for number in range(2):
                heard = len(listening(states))
                async with mosquitto(tmp_path, program, port):
                    await until(lambda heard=heard: len(listening(states)) > heard)
                    async with publisher(port) as device:
                        publish(device, "OpenRowingMonitor/one/metrics", bytes([number]) * 5000)
                        await until(lambda number=number: len(packets) == number + 1)
                await until(lambda: not made.state.startswith("listens"))
        assert [(p.channel, p.data) for p in packets] == [("", bytes([n]) * 5000) for n in range(2)]

    run(work())
