"""Disturbed magnetometers: told in the track, its notes, the report and on disk, and not used."""

from pathlib import Path

import numpy as np
import pytest

import oarlock
from oarlock import Config, Recording
from oarlock.evaluation.consistency import sensor_scores
from oarlock.evaluation.interval import Interval
from oarlock.recording import ImuStream
from oarlock.report import write_page
from oarlock.simulation import Motion
from oarlock.storage.errors import DataError
from oarlock.tracking.records import DISTURBED, FIELD

HEAD = """
format = 1
name = "head"
structure = "tree"
description = "one body on a ball"
joint = [{ name = "neck", kind = "ball" }]
frame = [{ name = "head", parent = "root", joint = "neck", transform = {} }]
[world]
up = [0, 0, 1]
forward = [1, 0, 0]
magnetic_norm_ut = 48.0
magnetic_dip_rad = "65*pi/180"
magnetic_azimuth_rad = 0.0
azimuth_fixed = true
[[sensor]]
name = "head"
kind = "imu"
frame = "head"
gyro_std_rad_s = 0.005
accel_std_m_s2 = 0.05
mag_std_ut = 0.5
"""
RATE_HZ = 100.0
DISTURBED_S = (10.0, 15.0)
TURNED_RAD = 0.52  # 30 deg
KINDS = {"norm": (1.25, 65), "dip": (1.0, 45), "innovation": (1.0, 65)}
"""By the test that has to catch it: how many times stronger the field is, and its dip in deg."""


def model(dip_deg: int = 65) -> oarlock.Model:
    return oarlock.Model.from_toml(HEAD.replace("65*pi", f"{dip_deg}*pi"), "head.toml", {})


def simulated(dip_deg: int = 65, azimuth_rad: float = 0.0) -> tuple[oarlock.Track, Recording]:
    time_s = np.linspace(-1.0, 19.0, 401)
    turns = [0.4 * np.sin(1.3 * time_s), 0.3 * np.sin(1.7 * time_s + 1.0), 0.5 * np.sin(0.9 * time_s + 2.0)]
    motion = Motion(("neck.rx", "neck.ry", "neck.rz"), time_s, np.column_stack(turns))
    return oarlock.simulate(model(dip_deg), motion, seed=5, rate_hz=RATE_HZ, azimuth_rad=azimuth_rad)


def disturbed(kind: str) -> tuple[oarlock.Track, Recording]:
    stronger, dip_deg = KINDS[kind]
    truth, recording = simulated()
    plain, beside = recording["head"], simulated(dip_deg, TURNED_RAD)[1]["head"]
    within = (plain.time_s >= DISTURBED_S[0]) & (plain.time_s < DISTURBED_S[1])
    mag_ut = np.where(within[:, None], stronger * beside.mag_ut, plain.mag_ut)
    stream = ImuStream(
        "head", plain.time_s, gyro_rad_s=plain.gyro_rad_s, accel_m_s2=plain.accel_m_s2, mag_ut=mag_ut
    )
    return truth, Recording([stream])


def error_rad(track: oarlock.Track, truth: oarlock.Track) -> float:
    """Largest error of the head's orientation during the disturbance."""
    dot = np.abs(np.sum(track.frame_quat_wxyz("head") * truth.frame_quat_wxyz("head"), axis=1))
    within = (track.time_s >= DISTURBED_S[0]) & (track.time_s < DISTURBED_S[1])
    return float(2.0 * np.arccos(np.clip(dot[within], 0.0, 1.0)).max())


@pytest.mark.parametrize("kind", DISTURBED)
def test_a_disturbance_is_named_everywhere_and_does_no_harm(kind: str, tmp_path: Path) -> None:
    truth, recording = disturbed(kind)
    track = oarlock.track(model(), recording)
    within = (track.time_s >= DISTURBED_S[0]) & (track.time_s < DISTURBED_S[1])
    assert np.array_equal(track.info.disturbed(kind)[:, 0], within)
    assert np.array_equal(track.info.disturbed()[:, 0], within)
    (note,) = (n for n in track.notes if "magnetic field disturbed" in n)
    assert note.startswith(f"head: magnetic field disturbed in 25.0 % of the readings ({kind} 25.0 %)")
    (score,) = (s for s in sensor_scores(track, Interval(-np.inf, np.inf)) if s.name == "head")
    assert score.count is not None and score.count.disturbed == {kind: pytest.approx(within.mean())}
    page = write_page(track, tmp_path / "report.html").read_text(encoding="utf-8").replace("\xa0", " ")
    assert f"<td>{kind} 25.0 %</td>" in page
    track.save(tmp_path / "track")
    loaded = oarlock.load_track(tmp_path / "track")
    assert np.array_equal(loaded.info.field, track.info.field) and loaded.notes == track.notes
    harmed = error_rad(oarlock.track(model(), recording, config=Config(magnetometer="on")), truth)
    spared = error_rad(track, truth)
    # Five seconds on a gyroscope whose bias is known: a quarter of a degree; beside the iron half of the turn.
    assert spared < 0.005
    assert harmed > 0.5 * TURNED_RAD


def test_a_step_names_it_too() -> None:
    tracker = oarlock.Tracker(model())
    samples = tracker.samples(disturbed("dip")[1])
    steps = [tracker.step(sample)[1] for sample in samples]
    assert steps[0].sensors["head"]["field"] == "missing" and steps[0].status == "starting"
    assert steps[900].sensors["head"]["field"] == "undisturbed"
    inside = next(i for i in steps if i.time_s >= 12.0)
    assert inside.sensors["head"]["field"] == "dip" and inside.sensors["head"]["rejected"] == 3


def test_a_clean_field_is_used() -> None:
    track = oarlock.track(model(), simulated()[1])
    assert (track.info.field == FIELD.index("undisturbed")).all()
    assert not any("disturbed" in note for note in track.notes)
    for structure in ("tree", "strapdown"):
        config = Config(structure=structure, magnetometer="off")
        off = oarlock.track(model(), simulated()[1], config=config)
        assert (off.info.field == FIELD.index("missing")).all()


def test_an_unknown_test_is_refused() -> None:
    info = oarlock.track(model(), simulated()[1].slice(end_s=1.0)).info
    with pytest.raises(DataError, match=r"no test 'tilt'.*norm"):
        info.disturbed("tilt")
