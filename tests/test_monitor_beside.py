"""Force curves of a PM5 that a live session recorded, beside the motion: planted strokes, clocks and delays."""

from dataclasses import replace

import numpy as np
import pytest

import oarlock
from command_line import run
from html_page import Page, assert_loads_nothing
from oarlock.live.folder import LiveFolder
from oarlock.live.reading import Packet
from oarlock.live.recorder import Recorder
from oarlock.live.rig import Rig
from oarlock.rowing.alongside.align import align_strokes
from oarlock.rowing.alongside.force_curves import forces_on_strokes
from oarlock.rowing.alongside.monitor import is_one_clock, monitor_strokes, place_by_clock, session_near
from oarlock.rowing.analysis.technique import technique
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.errors import DataError
from oarlock_lab.emulators.pm5 import MESSAGES, force_curve
from oarlock_lab.emulators.rower import Rowing
from rowed_truth import rowed

START_NS = 5_000_000_000_000
LEAST_DELAY_S = 0.010
JITTER_S = 0.015
"""Mean of what Bluetooth adds, exponential; docs/live.md: messages are 10 to 50 ms late."""
WITHIN_S = 0.020
"""A force curve belongs within this of its stroke."""
UUID = "ce0600{:02x}"
RIG = """
format = 1
model = "sculler"
streams = {}
[sources.erg]
format = "pm5"
transport = "ble"
address = "F0:12:34:56:78:9A"
"""


def piece(count: int = 40) -> StrokeTable:
    """Strokes of a track at a rate that rises."""
    catch_s = 20.0 + np.cumsum(60.0 / np.linspace(18.0, 32.0, count + 1))
    return StrokeTable({"catch_time_s": catch_s[:-1], "end_time_s": catch_s[1:]})


def session(
    folder,
    strokes: StrokeTable,
    seed: int = 0,
    shift_s: float = 0.0,
    restart: int = 0,
    lost: tuple[int, ...] = (),
):
    """The folder of a live session in which a PM5 sent these strokes.

    Args:
        shift_s: the catches are so much later by the clock of the session.
        restart: the monitor's time begins again with this stroke.
        lost: strokes whose first message, and whose curve, did not arrive.
    """
    rng = np.random.default_rng(seed)
    rig = folder.parent / "rig.toml"
    rig.write_text(RIG)
    live = LiveFolder.create(folder, Rig.load(rig), None, START_NS)
    catch_s = strokes["catch_time_s"] + shift_s
    sent = []
    for number, at_s in enumerate(catch_s):
        zero_s = catch_s[restart if number >= restart else 0]
        rowing = Rowing(drive_s=round(0.3 * (strokes["end_time_s"] - strokes["catch_time_s"])[number], 2))
        end_s, next_s = at_s + rowing.drive_s, strokes["end_time_s"][number] + shift_s - 0.01
        messages = [] if number in lost else [(end_s, 0x35), (end_s, 0x36), (end_s, 0x3D)]
        messages += [(next_s, 0x35), *((s, 0x32) for s in np.arange(at_s, next_s, 0.25))]
        for time_s, kind in messages:
            shown = {**rowing.values(time_s - catch_s[0]), "elapsed_s": (time_s - zero_s) * (1.0 + 30e-6)}
            shown |= {"stroke_number": number + 1.0, "heart_rate_per_min": 140.0 + number}
            parts = force_curve(rowing.force_n()) if kind == 0x3D else [MESSAGES[kind](shown, False)]
            sent += [(time_s, UUID.format(kind), data) for data in parts]
    arrived_s = 0.0
    recorder = Recorder(live.disk)
    for time_s, uuid, data in sorted(sent, key=lambda one: one[0]):
        arrived_s = max(arrived_s, time_s + LEAST_DELAY_S + rng.exponential(JITTER_S))
        recorder.write(Packet("erg", "F0", uuid, START_NS + round(1e9 * arrived_s), data))
    recorder.close()
    live.finish(oarlock.load_model("sculler"))
    return live


def worst_s(export: StrokeTable, track: StrokeTable, found) -> float:
    """How far the centre of a curve is from that of its stroke's planted force, in the middle of the drive, at most."""
    [stack] = forces_on_strokes(export, track, found)
    lasted_s = (track["end_time_s"] - track["catch_time_s"])[found.stroke]
    at_s = lasted_s * (stack.force_n @ stack.at) / stack.force_n.sum(axis=1) / 100.0
    return float(np.abs(at_s - 0.5 * np.round(0.3 * lasted_s, 2)).max())


@pytest.mark.parametrize("seed", range(3))
def test_curves_of_the_same_session_lie_within_20_ms_of_their_stroke(tmp_path, seed):
    track = piece()
    live = session(tmp_path / "today", track, seed, restart=10 * seed)
    export = monitor_strokes(tmp_path / "today")
    track = replace(track, epoch=live.epoch)
    assert is_one_clock(export, track)
    found = place_by_clock(export, track)
    assert found.stroke.tolist() == list(range(40))
    assert worst_s(export, track, found) < WITHIN_S
    assert "40 of 40 strokes" in found.notes[0] and "ms after the catch" in found.notes[0]
    assert export["heart_rate_per_min"] == pytest.approx(140.0 + np.arange(40.0), abs=1.0)
    assert np.isfinite(export["speed_m_s"]).all() and (np.diff(export["distance_m"]) > 0.0).all()


def test_curves_of_another_computer_are_aligned_by_onsets(tmp_path):
    track = piece()
    session(tmp_path / "erg", track, shift_s=300.0)
    export = monitor_strokes(tmp_path / "erg")
    assert not is_one_clock(export, track)
    found = align_strokes(export, track)
    assert found.count == 40 and worst_s(export, track, found) < WITHIN_S


def test_strokes_whose_messages_were_lost_are_missing_and_move_no_other(tmp_path):
    track, lost = piece(), (7, 8, 20)
    live = session(tmp_path / "today", track, lost=lost)
    export = monitor_strokes(tmp_path / "today")
    found = place_by_clock(export, replace(track, epoch=live.epoch))
    assert found.stroke.tolist() == [k for k in range(40) if k not in lost]


def test_the_report_finds_the_monitor_of_its_own_session(tmp_path):
    track = rowed("B-NB", 30.0, 24.0, 0)
    found = technique(track).strokes
    whole = np.isfinite(found["end_time_s"])
    rowed_s = {name: found[name][whole] for name in ("catch_time_s", "end_time_s")}
    live = session(tmp_path / "today", StrokeTable(rowed_s))
    replace(track, provenance={**track.provenance, "epoch": live.epoch}).save(tmp_path / "out")
    run("report", str(tmp_path / "out"), "--out", str(tmp_path / "piece.html"))
    page = Page((tmp_path / "piece.html").read_text("utf-8"))
    assert_loads_nothing(page)
    assert "Force beside the motion" in page.text and "Force of erg in the live session today" in page.text
    assert "recorded by one computer in one session" in page.text and "Heart rate" in page.text
    track.save(tmp_path / "other")
    run("report", str(tmp_path / "other"), "--out", str(tmp_path / "other.html"))
    assert "Force beside" not in Page((tmp_path / "other.html").read_text("utf-8")).text
    words = ("--with", str(tmp_path / "today"), "--offset-s", "0.0")
    run("report", str(tmp_path / "other"), *words, "--out", str(tmp_path / "with.html"))
    assert "placed at the catch on average" in Page((tmp_path / "with.html").read_text("utf-8")).text


def test_a_folder_without_strokes_says_so(tmp_path):
    with pytest.raises(DataError, match=r"live\.toml"):
        monitor_strokes(tmp_path)
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG)
    LiveFolder.create(tmp_path / "today", Rig.load(rig), None, START_NS)
    with pytest.raises(DataError, match="no device sent strokes"):
        monitor_strokes(tmp_path / "today")
    assert session_near(tmp_path / "today", None) is None
