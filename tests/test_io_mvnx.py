"""MVNX exports, made by hand as the MVN user manual (MV0319P, section 14.4) describes them."""

import numpy as np
import pytest

from oarlock.formats.devices.mvnx import FULL_BODY, find_mvnx, read_mvnx
from oarlock.formats.listing import listed
from oarlock.recording.packets import missing_packets
from oarlock.recording.streams import ImuStream, OrientationStream
from refusals import assert_refused

FRAME = """<frame time="{time}" index="{index}" tc="04:17:11:50" ms="{ms}" type="normal">
<orientation>1.000000 0.000000 0.000000 0.000000 0.500000 -0.500000 0.500000 0.{digits}</orientation>
<position>0.0 0.0 0.97 0.1 0.2 1.5</position>
<sensorFreeAcceleration>-0.027436 0.163358 -0.087386</sensorFreeAcceleration>
<sensorMagneticField>-0.005615 0.150635 -0.514160</sensorMagneticField>
<sensorOrientation>0.796989 -0.034920 -0.600623 -0.053302</sensorOrientation>
</frame>
"""
HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<!-- Uncomment this part to use the DTD.
<!DOCTYPE mvnx SYSTEM "http://www.xsens.com/mvn/mvnx/schema.dtd">
-->
<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">
<mvn version="2019.0.0" build="290"/>
<comment></comment>
<subject label="A07" frameRate="60" segmentCount="2" recDate="Tue Nov 13 2018" configuration="UpperBody">
<segments>
<segment label="T8" id="1"><points><point label="jT9T8"><pos_b>0 0 0</pos_b></point></points></segment>
<segment label="RightForeArm" id="2"/>
</segments>
<sensors><sensor label="RightForeArm"/></sensors>
<frames segmentCount="2" sensorCount="1" jointCount="1">
<frame time="0" tc="00:00:00:00" ms="0" type="identity"><orientation>1 0 0 0 1 0 0 0</orientation></frame>
<frame time="0" tc="00:00:00:00" ms="0" type="tpose"><orientation>1 0 0 0 1 0 0 0</orientation></frame>
"""
TAIL = '</frames></subject><securityCode code="0"/></mvnx>\n'
TRIAL = (
    HEAD
    + FRAME.format(time=0, index=0, ms=1542082631842, digits="500001")
    + FRAME.format(time=17, index=1, ms=1542082631859, digits="500002")
    + FRAME.format(time=67, index=4, ms=1542082631909, digits="500003")
    + FRAME.format(time=83, index=5, ms=1542082631925, digits="500004")
    + TAIL
)


def written(folder, text=TRIAL, name="trial.mvnx", encoding="utf-8"):
    (folder / name).write_bytes(text.encode(encoding))
    return folder / name


def refused(file, *words):
    assert_refused(lambda: read_mvnx(file), "trial.mvnx", *words)


def test_orientations_and_magnetic_field(tmp_path):
    recording = read_mvnx(written(tmp_path))
    assert recording.names == (
        *("t8", "right_fore_arm"),
        *("right_fore_arm_sensor", "right_fore_arm_sensor_orientation"),
    )
    arm = recording["right_fore_arm"]
    assert isinstance(arm, OrientationStream)
    assert arm.time_s.tolist() == [0.0, 1 / 60, 4 / 60, 5 / 60]
    assert recording.meta["clock"]["from"] == "index"
    assert arm.quat_wxyz[:2].tolist() == [[0.5, -0.5, 0.5, 0.500001], [0.5, -0.5, 0.5, 0.500002]]
    sensor = recording["right_fore_arm_sensor"]
    factor = recording.meta["mag_scale"]["right_fore_arm_sensor"]
    assert isinstance(sensor, ImuStream) and sensor.gyro_rad_s is None
    assert sensor.mag_ut[0].tolist() == [v * factor for v in (-0.005615, 0.150635, -0.514160)]
    turn = recording["right_fore_arm_sensor_orientation"].quat_wxyz[3]
    assert turn.tolist() == [0.796989, -0.034920, -0.600623, -0.053302]


def test_what_a_recording_says(tmp_path):
    recording = read_mvnx(written(tmp_path))
    assert recording.epoch == "2018-11-13T04:17:11.842000000Z"
    assert missing_packets(recording, recording["t8"]) == 2
    source = recording.meta["source"]
    assert (source["software"], source["rate_hz"], source["configuration"]) == ("2019.0.0", "60", "UpperBody")
    assert source["left_out"] == ["position"]
    assert any("computed from sensorFreeAcceleration and sensorOrientation" in n for n in source["notes"])
    assert "A07" not in str(dict(recording.meta)), "the subject's label may be a name"


def test_specific_force_from_free_acceleration(tmp_path):
    """A unit that lies still reads gravity in its own axes; the global ones have Z up."""
    on_its_side = "0.707106781187 0.707106781187 0 0"  # turned about X: the unit's Y points up
    text = TRIAL.replace("0.796989 -0.034920 -0.600623 -0.053302", on_its_side)
    still = text.replace("-0.027436 0.163358 -0.087386", "0 0 0")
    accel = read_mvnx(written(tmp_path, still))["right_fore_arm_sensor"].accel_m_s2
    np.testing.assert_allclose(accel, np.tile([0.0, 9.80665, 0.0], (4, 1)), atol=1e-9)
    lifted = text.replace("-0.027436 0.163358 -0.087386", "1 2 3")
    accel = read_mvnx(written(tmp_path, lifted))["right_fore_arm_sensor"].accel_m_s2
    np.testing.assert_allclose(accel, np.tile([1.0, 12.80665, -2.0], (4, 1)), atol=1e-9)


def test_free_acceleration_without_orientation_is_left_out(tmp_path):
    text = "\n".join(line for line in TRIAL.splitlines() if "sensorOrientation" not in line)
    recording = read_mvnx(written(tmp_path, text))
    assert recording["right_fore_arm_sensor"].accel_m_s2 is None
    assert any("sensorFreeAcceleration was left out" in n for n in recording.meta["source"]["notes"])


@pytest.mark.parametrize(
    ("old", "new"), [('time="67"', 'time="70"'), ('index="4" ', ""), ('frameRate="60"', "")]
)
def test_milliseconds_where_the_index_gives_no_times(old, new, tmp_path):
    recording = read_mvnx(written(tmp_path, TRIAL.replace(old, new)))
    expected = [0.0, 0.017, 0.07 if "70" in new else 0.067, 0.083]
    assert recording["t8"].time_s.tolist() == expected
    assert recording.meta["clock"]["from"] == "time"


def test_recognised_by_content(tmp_path):
    written(tmp_path)
    written(tmp_path, "<html></html>", "page.xml")
    written(tmp_path, "<html></html>", "page.mvnx")
    (one,) = find_mvnx(listed(tmp_path))
    assert one.path.name == "trial.mvnx" and one.format == "mvnx"


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(' xmlns="http://www.xsens.com/mvn/mvnx"', ""),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\ufeff" + text,
        lambda text: text.replace("<frame ", "<frame   ").replace(" 0.5", "\n\t0.5"),
        lambda text: text[: text.index("<mvnx")] + text[text.index("<subject") : text.index("<securityCode")],
        lambda text: text.replace("UTF-8", "ISO-8859-1").replace("A07", "Größe"),
    ],
)
def test_forms_of_one_file(tmp_path, change):
    text = change(TRIAL)
    again = read_mvnx(written(tmp_path, text, encoding="latin-1" if "8859" in text else "utf-8"))
    plain = read_mvnx(written(tmp_path))
    np.testing.assert_array_equal(again["right_fore_arm"].quat_wxyz, plain["right_fore_arm"].quat_wxyz)


def test_segments_without_labels(tmp_path):
    first, last = TRIAL.index("<segments>"), TRIAL.index("<frames")
    text = TRIAL[:first] + TRIAL[last:]
    recording = read_mvnx(written(tmp_path, text))
    assert recording.names[:3] == ("segment_1", "segment_2", "sensor_1_sensor")
    whole = text.replace("0.500001", "0.5" + " 1 0 0 0" * 21)
    for digits in ("500002", "500003", "500004"):
        whole = whole.replace(f"0.{digits}", "0.5" + " 1 0 0 0" * 21)
    recording = read_mvnx(written(tmp_path, whole))
    assert recording.names[:23] == tuple(
        "".join(f"_{c.lower()}" if c.isupper() and k else c.lower() for k, c in enumerate(label))
        for label in FULL_BODY
    )


ENTITIES = """<?xml version="1.0"?>
<!DOCTYPE mvnx [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>
<mvnx><subject>&b;</subject></mvnx>
"""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ENTITIES, [":2", "entity"]),
        (ENTITIES.replace('a "aaaaaaaaaa"', 'a SYSTEM "file:///etc/passwd"'), [":2", "entity"]),
        ("<a>" * 40, [":1", "nested"]),
        (TRIAL[: len(TRIAL) // 2], ["no whole XML", "cut off"]),
        ("", ["no whole XML"]),
        ("PacketCounter\tAcc_X\n", [":1", "no whole XML"]),
        (TRIAL.replace("normal", "npose"), ['no frames of type "normal"']),
        (TRIAL.replace("</subject>", "</subject><subject label='B'/>"), ["second subject"]),
        (TRIAL.replace("0.500002", "0.5x"), [":25", "<orientation>", "not a number"]),
        (TRIAL.replace(" 0.500002", ""), [":25", "<orientation> has 7 numbers, expected 8"]),
        (TRIAL.replace("0.500001", "0.5 1"), [":18", "9 numbers", "multiple of 4"]),
        (TRIAL.replace('time="17"', 'time="x"'), [":24", '"x"', "milliseconds"]),
        (TRIAL.replace('time="17"', 'time="0"'), [":24", "repeats"]),
        (TRIAL.replace('index="1"', 'index="0"'), [":24", "0 after 0"]),
        (TRIAL.replace("0.500002", "1.5"), [":24", "norm"]),
        (
            TRIAL.replace('<segment label="T8" id="1">', "<other>").replace(
                "</points></segment>", "</points></other>"
            ),
            ["names 1 segments", "have 2"],
        ),
        (
            TRIAL.replace("<sensorOrientation>0.7", "<x>0.7", 1).replace("</sensorOrientation>", "</x>", 1),
            [":30", "only one of them", "sensorOrientation"],
        ),
        (
            TRIAL.replace("orientation>", "turns>")
            .replace("Orientation>", "Turns>")
            .replace("MagneticField>", "Field>"),
            ["no orientation"],
        ),
    ],
)
def test_mistakes(tmp_path, text, words):
    refused(written(tmp_path, text), *words)
