"""The page's files and first message, and a program that follows a session."""

import threading

import numpy as np
import pytest
from json_schema import SCHEMA
from page_session import STROKES, PageSession
from senders import with_test_format

import oarlock
from oarlock.live import frame as live_frame
from oarlock.live.client import socket_address
from oarlock.live.live import Live
from oarlock.live.named_angles import LiveAngles, joints_with_names
from oarlock.live.page import page_files
from oarlock.live.session import LiveSession
from oarlock.storage.errors import DataError

FEW = 20


@pytest.fixture
def session(sculler, tmp_path, monkeypatch):
    with_test_format(monkeypatch)
    with PageSession(sculler, tmp_path / "today", 20.0, token="a b&<c") as running:
        yield running


def test_every_file_that_the_page_names_is_served_with_the_token():
    files = page_files("a b&<c")
    page = files["/"].decode()
    assert 'src="live.js?token=a%20b%26%3Cc"' in page and 'href="live.css?token=a%20b%26%3Cc"' in page
    assert set(files) == {"/", "/live.js", "/live.css"}
    assert (
        "<script>" not in page
        and "style=" not in page
        and "http" not in page.replace("http://www.w3.org", "")
    )
    assert 'src="live.js"' in page_files()["/"].decode()


def test_a_program_gets_the_newest_frames_until_the_session_ends(session):
    found = []
    for frame in oarlock.live.frames(session.url):
        found.append(frame)
        if len(found) == FEW:
            threading.Thread(target=session.end).start()
    assert len(found) >= FEW
    assert all(one["schema"] == live_frame.SCHEMA for one in found)
    assert np.all(np.diff([frame["time_s"] for frame in found]) > 0)
    value, std = found[-1]["joints"]["trunk"]
    assert abs(value) < np.pi and 0.0 < std < 1.0
    assert len(found[-1]["places_mm"]) % 3 == 0


def test_the_schema_says_what_each_key_of_a_message_means():
    messages = {name: each for name, each in SCHEMA["$defs"].items() if name not in ("point", "figure")}
    assert [found for name, each in messages.items() for found in bare(each, name)] == []


def bare(schema, name):
    """Properties without a description, a reference, or the list of their values."""
    for key, inner in schema.items():
        if key == "properties":
            for of, each in inner.items():
                if not {"description", "$ref", "const", "enum"} & set(each):
                    yield f"{name}.{of}"
        if isinstance(inner, dict):
            yield from bare(inner, f"{name}.{key}")


def test_a_program_with_a_wrong_address_is_told_what_to_do(session):
    with pytest.raises(DataError, match="with its token"):
        next(oarlock.live.frames(session.url.partition("?")[0]))
    with pytest.raises(DataError, match="no session answers"):
        next(oarlock.live.frames("http://127.0.0.1:9/"))


def test_addresses_of_pages_become_addresses_of_sockets():
    assert socket_address("http://127.0.0.1:80/?token=t") == "ws://127.0.0.1:80/live?token=t"
    assert socket_address("https://a.example/") == "wss://a.example/live"
    assert socket_address("127.0.0.1:80") == "ws://127.0.0.1:80/live"
    assert socket_address("ws://a:1/live?token=t") == "ws://a:1/live?token=t"


def test_a_viewer_that_comes_late_learns_what_was_announced(session):
    session.stroke(1, arc=100.0)
    found = next(oarlock.live.frames(session.url))
    assert found["type"] == "frame"
    late = session.call(lambda: list(session.server._kept))
    assert any('"stroke"' in text for text in late) and any('"tracking"' in text for text in late)


@pytest.mark.parametrize("name", ["full_body", "sculler"])
def test_the_first_message_names_every_coordinate_with_its_unit(name, tmp_path):
    from oarlock.live.page import hello
    from oarlock.live.rig import Rig

    model = oarlock.load_model(name)
    live = Live(Rig(name, None, {}, ()), model, tmp_path)
    live.session = LiveSession(live.rig, model, 0)
    told = hello(live, more={"strokes": STROKES})
    joints = {joint["name"]: joint for joint in told["joints"]}
    is_rotation = {f"{joint}.r{axis}" for joint in joints_with_names(model) for axis in "xyz"}
    assert set(joints) == {*model.coordinate_names, *LiveAngles(model).names} - is_rotation
    assert len(joints) == len(told["joints"]) == len(model.coordinate_names)
    assert ("shoulder_elevation_r" in joints) == (name == "full_body")
    assert told["strokes"] == STROKES and told["title"] == name and told["figure"] is None
    distances = {joint for joint in joints if joints[joint]["unit"] == "mm"}
    assert distances == ({"seat"} if name == "sculler" else {"pelvis.x", "pelvis.y", "pelvis.z"})
    assert all(joint["scale"] == (1e3 if joint["unit"] == "mm" else 180 / np.pi) for joint in joints.values())
    panels = [joint["panel"] for joint in joints.values() if joint["side"] == "right"]
    assert panels and set(panels) == {joint["panel"] for joint in joints.values() if joint["side"] == "left"}
