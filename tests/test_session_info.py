"""session.toml: who was recorded and when, beside recordings and tracks, and outside of their contents."""

import json

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.recording.session_info import checked_session, session_info, session_text
from oarlock.report.viewer import scene
from oarlock.report.write import write_page

WHO = {"athlete": "A07", "date": "2026-05-01", "place": "Bled", "boat": "2x", "seat": "2", "note": "windy"}


def recording(session=None):
    model = oarlock.load_model("pendulum3")
    time_s = np.arange(60) / 50.0
    up = np.tile([0.1, 9.8, 0.0], (60, 1))
    streams = [
        oarlock.recording.ImuStream(n, time_s, gyro_rad_s=0.0 * up, accel_m_s2=up) for n in model.sensor_names
    ]
    return model, oarlock.Recording(streams, {"session": session} if session else {})


def test_it_stands_beside_the_recording_and_may_be_edited(tmp_path):
    _, measured = recording(WHO)
    measured.save(tmp_path / "rec")
    file = tmp_path / "rec/session.toml"
    assert file.is_file() and "session" not in (tmp_path / "rec/recording.toml").read_text()
    assert "session.toml" not in (tmp_path / "rec/oarlock-manifest.toml").read_text()
    assert oarlock.load_recording(tmp_path / "rec").meta["session"] == WHO
    file.write_text('athlete = "B12"\ndate = 2026-05-02\ncoach = "C"\n')
    again = oarlock.load_recording(tmp_path / "rec")
    assert again.meta["session"] == {"athlete": "B12", "date": "2026-05-02", "coach": "C"}
    again.save(tmp_path / "rec")
    assert oarlock.load_recording(tmp_path / "rec").meta["session"]["coach"] == "C"
    measured.without([]).save(tmp_path / "rec")
    recording()[1].save(tmp_path / "rec")
    assert not file.exists()


def test_tracks_carry_it_and_their_hash_does_not(tmp_path):
    model, measured = recording(WHO)
    track = oarlock.track(model, measured)
    plain = oarlock.track(model, recording()[1])
    assert track.provenance["recording_sha256"] == plain.provenance["recording_sha256"]
    track.save(tmp_path / "out")
    assert "A07" not in (tmp_path / "out/run.toml").read_text()
    again = oarlock.load_track(tmp_path / "out")
    assert dict(session_info(again.provenance)) == WHO
    page = write_page(again, tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("A07, 1 May 2026") >= 2  # title and heading
    assert "Bled, boat 2x, seat 2, windy" in page
    assert scene(again)["title"].startswith("A07") and scene(again, title="x")["title"] == "x"
    assert scene(plain)["title"] == ""


def test_terminal_and_json(tmp_path):
    recording(WHO)[1].save(tmp_path / "rec")
    said = run(
        "track", tmp_path / "rec", "--model", "pendulum3", "--out", tmp_path / "out", "--verbose"
    ).stdout
    assert "A07, 2026-05-01" in said
    assert (tmp_path / "out/session.toml").is_file()


def test_options_questions_and_what_is_kept(tmp_path):
    from test_table import HEADER, columns_of, table

    (tmp_path / "a.csv").write_text(table(HEADER, columns_of()))
    run("import", tmp_path / "a.csv", "--out", tmp_path / "rec", "--athlete", "A07", "--date", "2026-05-01")
    again = ("import", tmp_path / "a.csv", "--out", tmp_path / "rec", "--force", "--boat", "1x", "--json")
    kept = {"athlete": "A07", "date": "2026-05-01", "boat": "1x"}
    assert json.loads(run(*again).stdout)["session"] == kept
    refused = run(
        "import", tmp_path / "a.csv", "--out", tmp_path / "b", "--date", "yesterday", status=2
    ).stderr
    assert '"yesterday" is no date' in refused
    done = run("import", "table", tmp_path / "a.csv", "--out", tmp_path / "c", "--athlete", "B")
    assert "B" in done.stdout and oarlock.load_recording(tmp_path / "c").meta["session"] == {"athlete": "B"}


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"athlete": 1.5}, "expected a text"),
        ({"date": "32.5.26"}, "is no date"),
        ({"note": "a" * 501}, "one line"),
        ({"note": "\x07"}, "one line"),
        ({"x" * 81: "a"}, "80"),
    ],
)
def test_refusals(given, reason):
    with pytest.raises(oarlock.DataError, match=reason):
        checked_session(given, "session.toml")


def test_the_order_and_an_athlete_of_a_mapping():
    assert list(checked_session({"note": "n", "rig": "r", "athlete": "a"}, "x")) == ["athlete", "rig", "note"]
    assert session_text(session_info({"athlete": "A07"})) == "A07"
    assert session_text(session_info({"session": "morning"})) == ""
