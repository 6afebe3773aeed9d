"""What the doctor says of brokers and WebSockets, and how a command line names them."""

import asyncio
import importlib

import pytest
from mqtt_broker import Broker

import oarlock
from oarlock.live.doctor.check import PROBLEM
from oarlock.live.doctor.rig_checks import rig_checks
from oarlock.live.rig import Rig, Source
from oarlock.live.scan.listening import hear
from oarlock.live.scan.source_words import source_of, words_of
from oarlock.live.transports.udp import free_port
from oarlock.storage.errors import DataError

LISTENS_S = 3.0
TOPIC = "OpenRowingMonitor/+/metrics"


def told(source):
    """What the doctor says of a source from which nothing comes."""
    rig = Rig("arm", None, {source.name: source}, ())
    hearings = asyncio.run(hear([source], LISTENS_S))
    [check] = [
        one for one in rig_checks(rig, oarlock.load_model("arm"), hearings, LISTENS_S) if "erg" in one.about
    ]
    assert check.state == PROBLEM
    return " ".join((check.text, *check.tries))


def by_mqtt(port):
    options = {"host": "127.0.0.1", "port": port, "topic": TOPIC}
    return Source("erg", "open_rowing_monitor", "mqtt", options)


def test_a_broker_that_is_not_there():
    pytest.importorskip("paho.mqtt.client", reason="needs paho-mqtt, an extra")
    said = told(by_mqtt(free_port()))
    assert "Connection refused" in said and "Does the broker run" in said and "mosquitto" in said


def test_a_topic_without_messages():
    pytest.importorskip("paho.mqtt.client", reason="needs paho-mqtt, an extra")

    async def listened():
        async with Broker().there() as broker:
            source = by_mqtt(broker.port)
            return source, await hear([source], LISTENS_S)

    source, hearings = asyncio.run(listened())
    rig = Rig("arm", None, {"erg": source}, ())
    found = rig_checks(rig, oarlock.load_model("arm"), hearings, LISTENS_S)
    said = " ".join(text for one in found for text in (one.text, *one.tries))
    assert f"listens to {TOPIC}" in said and 'topic = "#"' in said and "Does the broker run" not in said


def test_a_library_that_is_missing(monkeypatch):
    real = importlib.import_module

    def without(name, *more):
        if name.startswith("paho"):
            raise ModuleNotFoundError(name)
        return real(name, *more)

    monkeypatch.setattr("oarlock.live.transports.mqtt.import_module", without)
    assert "pip install 'oarlock[mqtt]'" in told(by_mqtt(1883))


def test_a_server_that_is_not_there():
    url = f"ws://127.0.0.1:{free_port()}/websocket"
    said = told(Source("erg", "open_rowing_monitor", "websocket", {"url": url}))
    assert url in said and "in a browser" in said


@pytest.mark.parametrize(
    ("text", "transport", "options"),
    [
        ("ws://10.0.0.7/websocket", "websocket", {"url": "ws://10.0.0.7/websocket"}),
        ("wss://erg.local:8443/live", "websocket", {"url": "wss://erg.local:8443/live"}),
        ("mqtt://10.0.0.2/" + TOPIC, "mqtt", {"host": "10.0.0.2", "topic": TOPIC}),
        ("mqtts://10.0.0.2:8884/#", "mqtt", {"host": "10.0.0.2", "topic": "#", "port": 8884, "tls": True}),
    ],
)
def test_sources_in_words(text, transport, options):
    found = source_of(text)
    assert (found.transport, dict(found.options)) == (transport, options)
    assert all(str(value) in words_of(found) for value in options.values() if value is not True)


@pytest.mark.parametrize("text", ["mqtt://10.0.0.2", "mqtt:10.0.0.2/a", "ws:10.0.0.7"])
def test_other_words_are_refused(text):
    with pytest.raises(DataError, match="mqtt://HOST"):
        source_of(text)
