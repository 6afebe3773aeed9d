"""Estimates, strokes and events leave by UDP, OSC and LSL; what fails or is slow delays nothing and is tried again."""

import json
import socket
import threading
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from json_schema import SCHEMA, mismatches
from page_session import PageSession
from pythonosc.osc_bundle import OscBundle
from senders import with_test_format

import oarlock
from oarlock.live.frame import frame_of
from oarlock.live.named_angles import LiveAngles
from oarlock.live.outputs import output as output_module
from oarlock.live.outputs.choose import outputs_of
from oarlock.live.outputs.datagrams import Datagrams, json_line, osc_bundle
from oarlock.live.outputs.lsl import LslStreams, channels_of
from oarlock.live.outputs.output import MOST_ESTIMATES, Output, SessionStart
from oarlock.live.outputs.table import Outputs, destination
from oarlock.live.rig import Rig
from oarlock.live.session import Estimate
from oarlock.live.transports.transport import now_ns
from oarlock.storage.errors import DataError
from refusals import assert_refused

START = SessionStart(7_000_000_000, 1_795_424_400.25)
STROKE = {
    "type": "stroke",
    "number": 3,
    "time_s": 7.5,
    "values": {"arc_rad": {"value": 98.25, "std": 0.5}, "rate_per_min": {"value": 24.0, "std": 0.125}},
}
EVENT = {"type": "event", "time_s": 9.25, "text": "back is silent"}
ULP_S = 2.0**-20
"""Of time tags."""


class Belief:
    def __init__(self, names, mean):
        self.state_names, self.mean, self.std = names, np.asarray(mean), np.full(len(mean), 0.02)


def estimates(model, count, step_s=0.01):
    names = list(model.coordinate_names)
    rng = np.random.default_rng(3)
    for number in range(count):
        belief = Belief(names, rng.uniform(-0.5, 0.5, len(names)))
        yield Estimate(1.0 + step_s * number, 1.02 + step_s * number, belief, None)


def receiver():
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    made.settimeout(60)
    return made


def until(is_so):
    begun_s = time.monotonic()
    while not is_so():
        assert time.monotonic() - begun_s < 120
        time.sleep(0.01)


def test_osc_bundles_are_what_an_independent_reader_expects():
    model = oarlock.load_model("upper_body")
    (estimate,) = estimates(model, 1)
    frame = frame_of(estimate, model, named=LiveAngles(model))
    bundle = OscBundle(osc_bundle(frame, START))
    assert bundle.timestamp == pytest.approx(START.epoch_s + estimate.time_s, abs=1e-6)
    found = {message.address: message.params for message in bundle}
    assert found.pop("/oarlock/time") == [pytest.approx(1.0)]
    expected = {f"/oarlock/joint/{name}": pair for name, pair in frame["joints"].items()}
    expected |= {f"/oarlock/angle/{name}": pair for name, pair in frame["angles"].items()}
    assert set(found) == set(expected) and "/oarlock/angle/shoulder_elevation_r" in found
    for address, pair in expected.items():
        np.testing.assert_allclose(found[address], pair, rtol=1e-6)


def test_strokes_and_events_as_osc():
    stroke = {message.address: message.params for message in OscBundle(osc_bundle(STROKE, START))}
    assert stroke == {
        "/oarlock/time": [7.5],
        "/oarlock/stroke/number": [3.0],
        "/oarlock/stroke/arc_rad": [98.25, 0.5],
        "/oarlock/stroke/rate_per_min": [24.0, 0.125],
    }
    event = OscBundle(osc_bundle(EVENT, START))
    assert event.timestamp == pytest.approx(START.epoch_s + 9.25, abs=1e-6)
    assert event.content(1).params == ["back is silent"]


@given(st.floats(0, 1e6), st.floats(0, 4e9))
def test_time_tags_are_the_moment_that_a_message_is_about(time_s, epoch_s):
    packet = osc_bundle({**EVENT, "time_s": time_s}, SessionStart(0, epoch_s))
    tag = int.from_bytes(packet[8:16], "big")
    since_1900_s = (time_s + epoch_s + 2_208_988_800) % 2**32
    assert tag / 2**32 == pytest.approx(since_1900_s, abs=2 * ULP_S)


@pytest.mark.parametrize("name", ["a b", "r#1", "x/y", "{a,b}", "[?*]", "größe", ""])
def test_names_become_parts_of_addresses_that_osc_allows(name):
    stroke = {**STROKE, "values": {name: {"value": 1.0, "std": 1.0}}}
    address = OscBundle(osc_bundle(stroke, START)).content(2).address
    part = address.removeprefix("/oarlock/stroke/")
    assert len(part) == len(name) and not set(part) & set(" #*,/?[]{}") and part.isascii()


def test_json_lines_follow_the_published_schema(sculler):
    with receiver() as got:
        port = got.getsockname()[1]
        (output,) = outputs_of(sculler, 100.0, Outputs(udp=(f"127.0.0.1:{port}",)))
        output.start(START)
        sent = list(estimates(sculler, 5))
        output.tell(STROKE)
        output.tell(EVENT)
        for estimate in sent:
            output.put(estimate)
        lines = [got.recv(65536) for _ in range(7)]
        output.close()
    assert all(line.endswith(b"\n") for line in lines)
    told = [json.loads(line) for line in lines]
    assert told[:2] == [STROKE, EVENT]
    assert [one["time_s"] for one in told[2:]] == [round(one.time_s, 4) for one in sent]
    assert [mismatch for one in told for mismatch in mismatches(one, one["type"])] == []
    assert (output.sent, output.skipped, output.problem) == (7, 0, "")


def test_the_schema_finds_what_is_wrong():
    assert mismatches({**EVENT, "time_s": "9"}, "event")
    assert mismatches({"type": "event", "text": ""}, "event")
    assert mismatches({**EVENT, "more": 1}, "event")
    assert mismatches({**STROKE, "values": {"arc": {"value": 1.0}}}, "stroke")
    assert {one["$ref"] for one in SCHEMA["anyOf"]} <= {f"#/$defs/{name}" for name in SCHEMA["$defs"]}


class Broken:
    """A way that fails as long as it is told to."""

    name = "broken"

    def __init__(self):
        self.is_broken, self.got, self.opened = True, [], 0

    def open(self, start):
        self.opened += 1

    def send(self, message):
        if self.is_broken:
            raise OSError(113, "No route to host")
        self.got.append(message)

    def close(self):
        pass


def test_an_output_that_fails_says_so_and_works_again(sculler, monkeypatch):
    monkeypatch.setattr(output_module, "RETRY_S", 0.02)
    way = Broken()
    output = Output(way, sculler)
    output.start(START)
    output.tell(STROKE)
    for estimate in estimates(sculler, 3):
        output.put(estimate)
    until(lambda: way.opened > 3)
    assert output.problem == "No route to host" and output.sent == 0
    way.is_broken = False
    until(lambda: way.got)
    time.sleep(0.05)
    output.tell(EVENT)
    until(lambda: not output.problem)
    output.close()
    assert [message["type"] for message in way.got] == ["stroke", "event"], (
        "old estimates are of no use, strokes are"
    )
    assert output.skipped == 3


def test_an_output_that_hangs_takes_no_time_of_the_session(sculler, monkeypatch):
    monkeypatch.setattr(output_module, "LONGEST_END_S", 0.05)
    hangs, way = threading.Event(), Broken()
    way.send = lambda message: hangs.wait(600)
    output = Output(way, sculler)
    output.start(START)
    for estimate in estimates(sculler, 3 * MOST_ESTIMATES):
        output.put(estimate)
    assert output.skipped >= 2 * MOST_ESTIMATES - 1
    assert "too slow" in output.problem
    output.close()
    hangs.set()


def test_a_port_at_which_nobody_listens_is_a_problem_until_somebody_does(sculler, monkeypatch):
    monkeypatch.setattr(output_module, "RETRY_S", 0.02)
    with receiver() as taken:
        port = taken.getsockname()[1]
    output = Output(Datagrams("JSON lines", "127.0.0.1", port, json_line), sculler)
    output.start(START)
    several = estimates(sculler, 100_000)

    def refused():
        output.put(next(several))
        return output.problem == "Connection refused"

    until(refused)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", port))
        until(lambda: output.put(next(several)) or not output.problem)
        output.close()
        assert json.loads(listener.recv(65536))["type"] == "frame"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("9000", ("127.0.0.1", 9000)),
        ("lab:1", ("lab", 1)),
        ("[::1]:80", ("::1", 80)),
        (":7", ("127.0.0.1", 7)),
    ],
)
def test_destinations(text, expected):
    assert destination(text, "--udp") == expected


@pytest.mark.parametrize("text", ["", "lab", "lab:", "lab:0", "lab:65536", "lab:-1", "lab:x"])
def test_what_is_no_destination_is_refused(text):
    assert_refused(lambda: Outputs(osc=(text,)), "osc", "HOST:PORT")


RIG = """
format = 1
model = "sculler"
[sources.units]
format = "lines"
transport = "udp"
port = 9000
[streams.back]
source = "units"
{outputs}
"""


def test_the_rig_file_names_outputs(tmp_path):
    from oarlock.live.rig import rig_document
    from oarlock.storage.toml import write_toml

    file = tmp_path / "rig.toml"
    file.write_text(RIG.format(outputs='[outputs]\nudp = "lab:9001"\nosc = ["a:1", "b:2"]\nlsl = "Boat 7"'))
    rig = Rig.load(file)
    assert rig.outputs == Outputs(("lab:9001",), ("a:1", "b:2"), ("Boat 7",))
    write_toml(tmp_path / "again.toml", rig_document(rig))
    assert Rig.load(tmp_path / "again.toml").outputs == rig.outputs


@pytest.mark.parametrize(
    ("line", "words"), [("udp = 3", "text"), ('ocs = "a:1"', "osc"), ('udp = ["lab"]', "HOST:PORT")]
)
def test_a_wrong_output_of_a_rig_file_is_refused(tmp_path, line, words):
    file = tmp_path / "rig.toml"
    file.write_text(RIG.format(outputs=f"[outputs]\n{line}"))
    with pytest.raises(DataError, match=words):
        Rig.load(file)


def own_lsl():
    pylsl = pytest.importorskip("pylsl", reason="needs pylsl, an extra")
    pylsl.set_config_content("[lab]\nSessionID = oarlock-test\n[multicast]\nResolveScope = machine\n")
    return pylsl


def test_channels_of_lsl_have_names_units_and_standard_deviations():
    model = oarlock.load_model("upper_body")
    channels = list(channels_of(model))
    labels = [label for label, _, _ in channels]
    assert len(set(labels)) == len(labels) == 2 * (len(model.coordinate_names) + len(LiveAngles(model).names))
    units = {label: (unit, kind) for label, unit, kind in channels}
    assert units["pelvis.x"] == ("m", "Position") and units["pelvis.x_std"] == ("m", "StandardDeviation")
    assert units["shoulder_elevation_r"] == ("rad", "Angle") and units["pelvis.rx"] == ("rad", "Angle")


def test_lsl_carries_angles_with_the_time_of_the_estimate_and_strokes_as_markers(sculler):
    pylsl = own_lsl()
    output = Output(LslStreams("boat", sculler, 100.0), sculler)
    start = SessionStart(now_ns() - 20_000_000_000, 0.0)
    start_lsl_s = pylsl.local_clock() - 20.0
    output.start(start)
    inlets = {}
    for name in ("boat", "boat events"):
        (found,) = pylsl.resolve_byprop("name", name, 1, 60)
        inlets[name] = pylsl.StreamInlet(found, processing_flags=pylsl.proc_none)
        inlets[name].open_stream(60)
    sent = list(estimates(sculler, 50))
    for estimate in sent:
        output.put(estimate)
    output.tell(STROKE)
    rows, stamps = [], []
    while len(rows) < len(sent):
        row, stamp = inlets["boat"].pull_sample(60)
        rows.append(row)
        stamps.append(stamp)
    marker, marked_s = inlets["boat events"].pull_sample(60)
    info = inlets["boat"].info(60)
    output.close()
    assert (info.type(), info.nominal_srate(), info.channel_count()) == (
        "MoCap",
        100.0,
        2 * len(sculler.coordinate_names),
    )
    assert info.source_id().startswith("oarlock boat")
    assert info.get_channel_labels()[0] == sculler.coordinate_names[0]
    assert set(info.get_channel_units()) == {"rad", "m"}
    np.testing.assert_allclose(np.diff(stamps), np.diff([one.time_s for one in sent]), atol=1e-6)
    # The zeros of both clocks are compared twice, a moment apart.
    assert abs(stamps[0] - start_lsl_s - sent[0].time_s) < 1.0
    mean = [one.belief.mean for one in sent]
    np.testing.assert_allclose(np.array(rows)[:, : len(mean[0])], mean, atol=1.1e-5)
    assert json.loads(marker[0]) == STROKE
    assert marked_s - stamps[0] == pytest.approx(STROKE["time_s"] - round(sent[0].time_s, 4), abs=1e-6)


def test_without_pylsl_the_outlet_says_what_to_install(sculler, monkeypatch):
    def missing(name):
        raise ImportError(f"No module named '{name}'")

    monkeypatch.setattr("oarlock.live.outputs.lsl.import_module", missing)
    assert_refused(lambda: outputs_of(sculler, None, Outputs(lsl=("boat",))), "oarlock[lsl]")


@pytest.fixture
def session(sculler, tmp_path, monkeypatch):
    with_test_format(monkeypatch)
    with PageSession(sculler, tmp_path / "today", 20.0) as running:
        yield running


def test_every_message_of_a_session_follows_the_published_schema(session):
    from websockets.sync.client import connect

    from oarlock.live.client import socket_address

    session.stroke(1, arc=100.0)
    messages, wanted = [], {"hello", "frame", "health", "event", "stroke", "problem"}
    with connect(socket_address(session.url)) as page:
        page.send("rubbish")
        while wanted - {kind for one in messages for kind in (one["type"], *one)}:
            messages.append(json.loads(page.recv()))
            page.send('{"shown": 1}')
    assert [mismatch for one in messages for mismatch in mismatches(one, one["type"])] == []
    assert mismatches({"shown": 1}, "shown") == mismatches({"do": "note", "text": "x"}, "command") == []


def test_a_program_gets_the_strokes_and_events_that_were_and_that_come(session):
    session.stroke(1, arc=100.0)
    found = []
    for told in oarlock.live.events(session.url):
        found.append(told)
        if told["type"] == "stroke" and told["number"] == 1:
            session.stroke(2, arc=101.0)
        if told["type"] == "stroke" and told["number"] == 2:
            threading.Thread(target=session.end).start()
    assert [one["number"] for one in found if one["type"] == "stroke"] == [1, 2]
    assert found[-1]["time_s"] >= 0.0 and all(mismatches(one, one["type"]) == [] for one in found)


def test_a_running_session_sends_to_all_its_outputs(sculler, tmp_path, monkeypatch):
    with_test_format(monkeypatch)
    session = PageSession(sculler, tmp_path / "today", 20.0)
    with receiver() as lines, receiver() as osc:
        wanted = Outputs(
            udp=(f"127.0.0.1:{lines.getsockname()[1]}",), osc=(f"127.0.0.1:{osc.getsockname()[1]}",)
        )
        session.live.outputs = [*outputs_of(sculler, 100.0, wanted), Output(Broken(), sculler)]
        with session:
            session.call(lambda: session.live._announce({**STROKE, "number": 1}))
            told = [json.loads(lines.recv(65536)) for _ in range(60)]
            bundles = [OscBundle(osc.recv(65536)) for _ in range(60)]
            texts = (one["text"] for one in oarlock.live.events(session.url) if one["type"] == "event")
            assert next(text for text in texts if text.startswith("broken")) == "broken: No route to host"
        frames = [one for one in told if one["type"] == "frame"]
        assert len(frames) > 40 and np.all(np.diff([one["time_s"] for one in frames]) > 0)
        assert {"stroke", "event"} <= {one["type"] for one in told}
        assert any(m.address == "/oarlock/joint/trunk" for bundle in bundles for m in bundle)
