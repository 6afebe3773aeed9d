"""The pose of a model: what stands where, in words and in SVG."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from oarlock import load_model
from oarlock.model.layout import blocks, quantities, rows_of
from oarlock.report.pose_picture.skeleton import StickFigure, skeleton, views
from oarlock.report.pose_picture.svg import draw_svg

SHIPPED = ("sculler", "pendulum3")


@pytest.fixture(params=SHIPPED)
def body(request: pytest.FixtureRequest) -> StickFigure:
    model = load_model(request.param)
    return skeleton(model, np.zeros(len(model.joint_names)))


def test_every_line_has_an_extent_and_joins_the_body(body: StickFigure) -> None:
    assert body.links
    for link in body.links:
        assert np.linalg.norm(link.end - link.start) > 0


def test_front_view_shows_the_left_on_the_right() -> None:
    model = load_model("sculler")
    body = skeleton(model, np.zeros(len(model.joint_names)))
    _, front = views(body)
    across = {spot.name: front.project(spot.point)[0] for spot in body.spots}
    assert across["l_shoulder"] > 0 > across["r_shoulder"]


def test_frames_with_a_sensor_are_marked() -> None:
    model = load_model("sculler")
    body = skeleton(model, np.zeros(len(model.joint_names)))
    assert {spot.name for spot in body.spots if spot.has_sensor} == {
        "r_shoulder", "r_elbow", "r_wrist", "l_elbow", "l_wrist"
    }  # fmt: skip


def test_svg_is_xml_that_names_the_frames(body: StickFigure) -> None:
    root = ElementTree.fromstring(draw_svg(body, 'a <body> & "more"'))
    texts = {element.text for element in root.iter("{http://www.w3.org/2000/svg}text")}
    assert 'a <body> & "more"' in texts
    assert body.spots[0].name in texts


def test_a_body_without_extent_is_a_point() -> None:
    model = load_model("pendulum3")
    whole = skeleton(model, np.zeros(len(model.joint_names)))
    point = StickFigure((), whole.spots[:1], (), whole.up, whole.forward)
    assert "root" in draw_svg(point, "point")


def test_layout_of_rows() -> None:
    rows = ("a", "b", "a.velocity", "s.gyro_x", "s.gyro_y", "s.gyro_z", "a.gyro_bias_x", "wind")
    assert rows_of("b", rows) == "1"
    assert rows_of("a", rows) == "0, 2, 6"
    assert quantities(["gyro_x", "gyro_y", "gyro_z", "mag_y"]) == "gyro xyz, mag y"
    found = [(b.kind, b.rows) for b in blocks(rows, {"a": "joints", "b": "joints"})]
    assert found == [
        ("joints", "0-1"),
        ("velocity of joints", "2"),
        ("gyro", "3-5"),
        ("sensor biases", "6"),
        ("wind", "7"),
    ]
