"""`oarlock live init`: from what is heard to a rig file that loads."""

import asyncio
import json
import math

import pytest
from while_listening import datagrams, while_listening
from wire_samples import UNIT, json_lines, mvn, ximu3, ximu3_announcement

import oarlock
from command_line import run
from oarlock.live.decoders import ximu3_announcement as announcements
from oarlock.live.rig import Rig, streams_of
from oarlock.live.scan.matching import Sources, matched
from oarlock.live.scan.network import Network
from oarlock.live.scan.rig_text import RigDraft
from oarlock.live.scan.source_words import source_of
from oarlock.live.transports.udp import free_port
from oarlock.storage.errors import DataError

SENSORS = [
    *json_lines("back", UNIT),
    *json_lines("Right forearm", UNIT),
    *json_lines("seat", {"place_mm": 310.0}, rate_hz=49.0),
    *json_lines("R_OAR_PHI", {"value": 12.5}, rate_hz=50.0),
    *json_lines("stranger", UNIT),
]


@pytest.fixture
def port(monkeypatch):
    """Sensors send to this port while a scan listens."""
    found = free_port()
    while_listening(monkeypatch, datagrams(found, SENSORS))
    return found


def init(port, out, *more, status=0):
    words = ("--model", "sculler", "--places", "none", "--source", f"udp:{port}")
    return run("live", "init", *words, "--out", out, *more, status=status)


def test_devices_with_names_of_streams_feed_them(port, tmp_path):
    out = tmp_path / "rig.toml"
    said = init(port, out).stdout
    assert f"oarlock live doctor {out}" in said and "unused devices  stranger" in said
    rig = Rig.load(out)
    feeds = {feed.stream: feed for feed in rig.feeds}
    assert {stream: feed.device for stream, feed in feeds.items()} == {
        "back": "back",
        "r_forearm": "Right forearm",
        "seat": "seat",
        "r_oar_phi": "R_OAR_PHI",
    }
    assert (feeds["seat"].values, feeds["seat"].scale, feeds["seat"].rate_hz) == (("place_mm",), 0.001, 50.0)
    assert feeds["back"].rate_hz == 100.0
    (source,) = rig.sources.values()
    assert (source.format, source.transport, dict(source.options)) == ("lines", "udp", {"port": port})
    text = out.read_text()
    assert "# [streams.l_forearm]" in text and "stranger" in text
    assert "must be rad; it sent 12.5" in text


def test_a_commented_stream_works_when_the_comment_is_taken_away(port, tmp_path):
    out = tmp_path / "rig.toml"
    init(port, out)
    lines = out.read_text().splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith("# [streams.l_forearm]"))
    for k in range(at, at + 3):
        lines[k] = lines[k].removeprefix("# ").replace('"..."', '"stranger"')
    out.write_text("\n".join(lines))
    (feed,) = (feed for feed in Rig.load(out).feeds if feed.stream == "l_forearm")
    assert (feed.source, feed.device) == ("lines", "stranger")


def test_a_stream_is_fed_by_hand(port, tmp_path):
    out = tmp_path / "rig.toml"
    told = json.loads(init(port, out, "--feed", "l_upperarm=stranger", "--json").stdout)
    assert told["streams"]["l_upperarm"] == {"source": "lines", "device": "stranger", "rate_hz": 100.0}
    assert told["unused_devices"] == [] and "r_upperarm" in told["free_streams"]
    again = init(port, out, "--feed", "l_upperarm=lines/back", "--force")
    assert "l_upperarm" in again.stdout


@pytest.mark.parametrize(
    ("feed", "expected", "status"),
    [
        ("l_upperarm", "expected NAME=VALUE, for example --feed back=65577B49", 2),
        ("upper=stranger", "the model has none", 1),
        ("l_upperarm=strangr", 'Did you mean "stranger"?', 1),
        ("seat=stranger", "no such device was heard that could feed it", 1),
    ],
)
def test_a_wrong_feed_is_explained_and_nothing_is_written(port, tmp_path, feed, expected, status):
    out = tmp_path / "rig.toml"
    assert expected in " ".join(init(port, out, "--feed", feed, status=status).stderr.split())
    assert not out.exists()


def test_a_file_is_not_overwritten_unasked(port, tmp_path):
    out = tmp_path / "rig.toml"
    out.write_text("mine")
    init(port, out, status=2)
    assert out.read_text() == "mine"
    init(port, out, "--force")
    assert Rig.load(out).feeds


def test_paths_are_relative_to_the_file(port, tmp_path, monkeypatch):
    (tmp_path / "rigs").mkdir()
    run("model", "copy", "sculler", tmp_path / "own.toml")
    oarlock.Calibration().save(tmp_path / "cal.toml")
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "rigs" / "rig.toml"
    run(
        *("live", "init", "--model", "own.toml", "--calibration", "cal.toml", "--places", "none"),
        *("--source", f"udp:{port}", "--out", "rigs/rig.toml"),
    )
    assert 'model = "../own.toml"' in out.read_text() and 'calibration = "../cal.toml"' in out.read_text()
    rig = Rig.load(out)
    assert rig.feeds and rig.calibration.resolve() == tmp_path / "cal.toml"


def test_nothing_heard_gives_a_file_that_says_what_to_write(monkeypatch, tmp_path):
    while_listening(monkeypatch)
    out = tmp_path / "rig.toml"
    told = json.loads(
        run("live", "init", "--model", "sculler", "--places", "none", "--out", out, "--json").stdout
    )
    assert told["streams"] == {} and len(told["free_streams"]) == 12 and told["next"][0].startswith("edit")
    assert not Rig.load(out).feeds
    plain = out.read_text().replace("# [sources.units]", "[sources.units]")
    for key in ("format", "transport", "port"):
        plain = plain.replace(f"# {key} =", f"{key} =")
    out.write_text(plain)
    assert Rig.load(out).sources["units"].options == {"port": 9000}


def test_on_a_terminal_it_asks_for_the_others(port, tmp_path, monkeypatch):
    monkeypatch.setattr("oarlock.cli.live_scan.asks_questions", lambda no, json_output: True)
    answers = iter(["x", "1", *[""] * 20])
    asked = []

    def answer(text, **keys):
        asked.append(text)
        return next(answers)

    monkeypatch.setattr("typer.prompt", answer)
    out = tmp_path / "rig.toml"
    said = init(port, out).stdout
    assert "Which device feeds r_upperarm?" in said and '"x" is none of 1 to 1' in said
    assert {f.stream: f.device for f in Rig.load(out).feeds}["r_upperarm"] == "stranger"
    assert len(asked) == 2  # nothing else is free


def scanned(monkeypatch, sends, *words):
    while_listening(monkeypatch, *sends)
    network = Network([source_of(text) for text in words], announcements=False)
    return asyncio.run(asyncio.wait_for(network.scan(0.0), 60))[0]


def test_devices_of_several_senders_are_told_apart(sculler, monkeypatch):
    port = free_port()
    sends = datagrams(port, json_lines("", UNIT), json_lines("", UNIT), json_lines("hand", UNIT))
    sources = Sources.of(scanned(monkeypatch, [sends], f"udp:{port}"))
    names = [one.device.name for one in sources.feeding("imu")]
    assert len(set(names)) == 3 and "hand" in names
    assert sum(name.startswith("127.0.0.1:") for name in names) == 2


def test_a_name_that_several_devices_have_feeds_nothing_unasked(sculler, monkeypatch):
    port, other = free_port(), free_port()
    sends = [datagrams(p, json_lines("back", UNIT)) for p in (port, other)]
    sources = Sources.of(scanned(monkeypatch, sends, f"udp:{port}", f"udp:{other}"))
    assert matched({"back": "imu"}, sources, {}) == {}
    with pytest.raises(DataError, match="--feed back=lines/back or --feed back=lines_2/back"):
        matched({"back": "imu"}, sources, {"back": "back"})
    assert matched({"back": "imu"}, sources, {"back": "lines_2/back"})["back"].source == "lines_2"


def test_the_unit_of_a_quantity_gives_its_scale(sculler, monkeypatch, tmp_path):
    port = free_port()
    sent = [*json_lines("seat", {"seat_cm": 31.0}), *json_lines("gate", {"r_oar_phi_deg": 30.0})]
    sources = Sources.of(scanned(monkeypatch, [datagrams(port, sent)], f"udp:{port}"))
    kinds = {stream: kind for stream, (kind, _) in streams_of(sculler).items()}
    draft = RigDraft(sculler, "sculler", "", sources, matched(kinds, sources, {}))
    (tmp_path / "rig.toml").write_text(draft.text())
    feeds = {feed.stream: feed for feed in Rig.load(tmp_path / "rig.toml").feeds}
    assert feeds["seat"].scale == 0.01
    assert (feeds["r_oar_phi"].device, feeds["r_oar_phi"].scale) == ("gate", math.pi / 180.0)


def test_positions_and_segments_feed_what_takes_them(monkeypatch):
    port = free_port()
    sources = Sources.of(scanned(monkeypatch, [datagrams(port, mvn())], f"udp:{port}"))
    found = matched({"pelvis": "orientation", "t8": "vector", "back": "imu"}, sources, {})
    assert {stream: one.device.name for stream, one in found.items()} == {"pelvis": "pelvis"}
    assert found["pelvis"].rate_hz == 60.0


def test_announced_units_are_written_with_their_serial_numbers(monkeypatch, tmp_path):
    at, port = free_port(), free_port()
    monkeypatch.setattr(announcements, "PORT", at)
    monkeypatch.setattr("oarlock.live.scan.scan.USUAL_PORTS", ())
    while_listening(
        monkeypatch,
        datagrams(at, [ximu3_announcement(1, port, name="Left forearm")]),
        datagrams(port, ximu3()),
    )
    out = tmp_path / "rig.toml"
    run("live", "init", "--model", "sculler", "--places", "network", "--out", out)
    rig = Rig.load(out)
    (source,), (feed,) = rig.sources.values(), rig.feeds
    assert source.options == {"port": port, "units": ["65577B49"]}
    assert (feed.stream, feed.device, feed.rate_hz) == ("l_forearm", "65577B49", 200.0)
