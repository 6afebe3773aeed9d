"""Time stamps as people have them: units that are recognised, epochs that are kept, moments that are shown."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from command_line import run
from oarlock import (
    DataError,
    Recording,
    Track,
    evaluate,
    load_model,
    load_recording,
    load_track,
    simulate,
    track,
)
from oarlock.formats.csv import read_csv
from oarlock.recording import ScalarStream
from oarlock.report import write_page
from oarlock.report.viewer.scene import scene
from oarlock.simulation import Motion
from oarlock.storage.epoch import apart_s, epoch_text, moment_of, moment_text
from refusals import assert_refused

SEAT = """format = 1
[[file]]
path = "a.csv"
{skip}time = {{ column = "{header}"{more} }}
[[file.sensor]]
name = "seat"
value = {{ column = "x", unit = "m" }}
"""
EPOCH_S = 1_700_000_000
ROUNDING_S = 2**-27
"""Spacing of float64 at 2**32 samples of 0.01 s."""
STAMP_S = 2**-22
"""Spacing of float64 at seconds since 1970."""


@pytest.fixture
def mapping(tmp_path):
    def write(cells, header="t", more="", above=()):
        """A mapping file beside a file with these time stamps."""
        lines = [*above, f"{header},x", *(f"{cell},1" for cell in cells)]
        (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
        skip = f"skip_rows = {len(above)}\n" if above else ""
        (tmp_path / "mapping.toml").write_text(SEAT.format(header=header, more=more, skip=skip))
        return tmp_path / "mapping.toml"

    return write


# --- units that are recognised ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "cells", "read_as", "step_s"),
    [
        ("t", ["1700000000.00", "1700000000.01", "1700000000.02"], '"epoch_s"', 0.01),
        ("t", ["1700000000000", "1700000000010", "1700000000020"], '"epoch_ms"', 0.01),
        ("t", ["1700000000000000", "1700000000010000", "1700000000020000"], '"epoch_us"', 0.01),
        ("t", ["1700000000000000000", "1700000000010000000", "1700000000020000000"], '"epoch_ns"', 0.01),
        ("t", ["2024-05-01T10:00:00Z", "2024-05-01T10:00:00.01Z"], '"iso"', 0.01),
        ("t", ["2024-05-01 10:00:00", "2024-05-01 10:00:00.01"], '"iso"', 0.01),
        ("t", ["23:59:59.99", "00:00:00.00"], '"HH:MM:SS"', 0.01),
        ("t", ["0", "0.01", "0.02"], '"s"', 0.01),
        ("t", ["0", "16.625", "33.25"], '"ms"', 0.016625),
        ("Time [ms]", ["0", "10", "20"], '"ms"', 0.01),
        ("timestamp_us", ["0", "10000", "20000"], '"us"', 0.01),
        ("elapsed (ns)", ["0", "10000000", "20000000"], '"ns"', 0.01),
        ("unix_ms", ["1700000000000", "1700000000010"], '"epoch_ms"', 0.01),
        ("t", ["4000000000", "4000010000", "4000020000"], '"us"', 0.01),
    ],
)
def test_a_unit_that_header_or_values_leave_no_doubt_of_is_read_and_said(
    mapping, header, cells, read_as, step_s
):
    recording = read_csv(mapping(cells, header))
    assert np.diff(recording["seat"].time_s)[0] == pytest.approx(step_s, abs=1e-6)
    (sentence,) = recording.meta["clock"]["found"]
    assert sentence.startswith(f'a.csv, column "{header}": read as unit = {read_as}')


@pytest.mark.parametrize(
    ("header", "cells", "choices"),
    [
        ("t", ["0", "10", "20"], ['unit = "ms" (100 Hz)', 'unit = "ticks", tick_s = 0.0001 (1000 Hz)']),
        ("SampleTimeFine", ["0", "100", "200"], ['"ms" (10 Hz)', "tick_s = 0.0001 (100 Hz)"]),
        ("n", ["0", "1", "2"], ['"ms" (1000 Hz)', '"s" (1 Hz)', '"samples", rate_hz = ...']),
        ("t", ["0", "0.5", "1"], ['"s" (2 Hz)', '"ms" (2000 Hz)']),
        ("t [s]", ["0", "100", "200"], ["No unit gives", 'header says "s"', "epoch_ms"]),
        ("t", ["5"], ["No unit gives"]),
        ("t", ["soon", "later"], ['"soon" is not a number']),
    ],
)
def test_a_unit_that_is_not_clear_is_refused_with_the_choices(mapping, header, cells, choices):
    assert_refused(
        lambda: read_csv(mapping(cells, header)), "a.csv", "the unit of time is not clear", *choices
    )


def test_an_epoch_in_another_unit_than_said_names_the_right_one(mapping):
    file = mapping([EPOCH_S * 1000], more=', unit = "epoch_s"')
    assert_refused(lambda: read_csv(file), 'with unit = "epoch_ms" it is 2023-11-14 22:13:20.00 UTC')


# --- counts of samples ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("bits", "first"), [(8, 250), (16, 65_530), (32, 2**32 - 5)])
def test_a_count_of_samples_starts_at_0_and_goes_on_where_it_wraps(mapping, bits, first):
    cells = [(first + k) % 2**bits for k in range(600) if k not in (100, 101)]
    recording = read_csv(mapping(cells, more=', unit = "samples", rate_hz = 100'))
    time_s = recording["seat"].time_s
    np.testing.assert_allclose(time_s, np.delete(np.arange(600), [100, 101]) / 100, atol=ROUNDING_S)
    assert str(2**bits) in recording.meta["clock"]["found"][0]


def test_a_restart_that_is_no_register_is_refused(mapping):
    file = mapping([997, 998, 999, 0, 1], more=", rate_hz = 100")
    assert_refused(lambda: read_csv(file), "time.wraps_at")
    told = mapping([997, 998, 999, 0, 1], more=", rate_hz = 100, wraps_at = 1000")
    np.testing.assert_allclose(read_csv(told)["seat"].time_s, np.arange(5) / 100)


def test_the_rate_of_a_count_is_found_above_the_header(mapping):
    recording = read_csv(mapping([7, 8, 9], more=', unit = "samples"', above=["made by X", "Rate: 59,5 Hz"]))
    np.testing.assert_allclose(recording["seat"].time_s, np.arange(3) / 59.5)
    assert "59.5 Hz" in recording.meta["clock"]["found"][0]


@pytest.mark.parametrize("above", [(), ("50 Hz", "100 Hz")])
def test_a_count_without_one_rate_is_refused(mapping, above):
    file = mapping([7, 8, 9], more=', unit = "samples"', above=above)
    assert_refused(lambda: read_csv(file), "Give time.rate_hz")


def test_a_rate_needs_a_count(mapping):
    assert_refused(lambda: read_csv(mapping([1], more=', unit = "s", rate_hz = 100')), "rate_hz", "samples")


# --- the epoch --------------------------------------------------------------------------------------------


def recording_of(time_s, **meta):
    return Recording([ScalarStream("seat", time_s, np.zeros(len(time_s)), "m")], meta)


def test_seconds_since_1970_start_at_0_and_keep_the_moment(tmp_path):
    stamps = EPOCH_S + np.arange(100) / 64
    packets = {"seat": {"after_s": [EPOCH_S + 0.5], "packets": [1.0], "step_s": [1 / 64]}}
    recording = recording_of(stamps, packets=packets, athlete="A07")
    assert (recording["seat"].time_s == np.arange(100) / 64).all()
    assert recording.epoch == "2023-11-14T22:13:20.000000000Z"
    assert recording.meta["packets"]["seat"]["after_s"] == [0.5]
    recording.save(tmp_path / "rec")
    again = load_recording(tmp_path / "rec")
    assert (again.epoch, dict(again.meta)) == (recording.epoch, dict(recording.meta))
    written = tomllib.loads((tmp_path / "rec/recording.toml").read_text())
    assert written["meta"]["clock"]["zero"] == recording.epoch
    assert again.slice(0.5).epoch == recording.epoch


def test_an_older_folder_with_such_stamps_loads_from_0(tmp_path):
    recording_of(np.arange(3) / 64).save(tmp_path / "rec", "csv")
    (tmp_path / "rec/oarlock-manifest.toml").unlink()
    (tmp_path / "rec/seat.csv").write_text(f"time_s,value\n{EPOCH_S}.25,0\n{EPOCH_S}.5,0\n{EPOCH_S}.75,0\n")
    old = load_recording(tmp_path / "rec")
    assert old["seat"].time_s.tolist() == [0.0, 0.25, 0.5]
    assert old.epoch == "2023-11-14T22:13:20.250000000Z"


@pytest.mark.parametrize("start", [0.0, 12.008, 5e8, 1e12])
def test_other_stamps_stay_as_they_are(start):
    recording = recording_of(start + np.arange(3.0))
    assert recording.start_s == start
    assert recording.epoch is None
    assert "clock" not in recording.meta


def test_moments_as_text():
    zero = epoch_text(1_714_582_798_020_000_001, "utc")
    assert zero == "2024-05-01T16:59:58.020000001Z"
    assert moment_text(zero, 2.5) == "2024-05-01 17:00:00.52 UTC"
    assert moment_text("2024-05-01T16:59:58.02", -0.02) == "2024-05-01 16:59:58.00 local time"
    assert moment_text("23:59:59.500000000", 1.0) == "00:00:00.50 time of day"
    assert [moment_text(odd) for odd in (None, 7, "soon", "2024-13-01T00:00:00Z", "<b>T")] == [""] * 5
    assert moment_of("9999-12-31T23:59:59Z", 1e12) is None


# --- where it is shown ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pair():
    """The same recording with and without an epoch, and their tracks."""
    model = load_model("pendulum3")
    time_s = np.linspace(0.0, 2.0, 21)
    motion = Motion(model.joint_names, time_s, 0.3 * np.sin(np.outer(time_s, [1.0, 2.0, 3.0])))
    made = simulate(model, motion, seed=1, rate_hz=64.0)[1]
    plain = Recording([s.at_rows(slice(None), np.arange(len(s)) / 64) for s in made.streams])
    dated = Recording([s.at_rows(slice(None), s.time_s + EPOCH_S) for s in plain.streams])
    return {one.epoch: (one, track(model, one)) for one in (plain, dated)}


def test_a_track_keeps_the_epoch_and_its_numbers(pair, tmp_path):
    (_, plain), (recording, dated) = pair.values()
    assert plain.epoch is None
    assert dated.epoch == recording.epoch == "2023-11-14T22:13:20.000000000Z"
    assert dated.provenance["recording_sha256"] == plain.provenance["recording_sha256"]
    assert (dated.q == plain.q).all()
    assert any("they now start at 0 s, which is 2023-11-14 22:13:20.00 UTC" in note for note in dated.notes)
    dated.save(tmp_path / "track")
    assert load_track(tmp_path / "track").epoch == dated.epoch
    assert scene(dated)["epoch"] == {"ms": 1e3 * EPOCH_S, "dated": True, "zone": "UTC"}
    assert scene(plain)["epoch"] is None


def test_terminal_and_report_show_the_start(pair, tmp_path):
    *_, (recording, _) = pair.values()
    recording.save(tmp_path / "rec")
    shown = run(
        "track",
        tmp_path / "rec",
        "--model",
        "pendulum3",
        "--out",
        tmp_path / "track",
        "--no-suspects",
        "--verbose",
    )
    assert "2023-11-14 22:13:20.00 UTC" in shown.stdout
    report = (tmp_path / "track/report.html").read_text(encoding="utf-8")
    assert "from 2023-11-14 22:13:20.00 UTC" in report


def test_import_shows_start_and_what_it_recognised(mapping, tmp_path):
    file = mapping([f"{EPOCH_S}{k:03}" for k in (0, 10, 20)])
    shown = run("import", "csv", file, "--out", tmp_path / "rec")
    assert "2023-11-14 22:13:20.00 UTC" in shown.stdout
    assert 'read as unit = "epoch_ms"' in shown.stdout
    told = json.loads(run("import", "csv", file, "--out", tmp_path / "rec2", "--json").stdout)
    assert told["epoch"] == "2023-11-14T22:13:20.000000000Z"
    assert told["start"] == "2023-11-14 22:13:20.00 UTC"


@pytest.mark.parametrize(
    ("epoch", "other", "apart"),
    [
        ("2024-05-01T17:00:00.000000001Z", "2024-05-01T16:59:58.020000000Z", 1.980000001),
        ("2024-05-01T17:00:00Z", "2024-05-02T17:00:00.5Z", -86400.5),
        ("17:00:00.250000000", "16:00:00.000000000", 3600.25),
        ("2024-05-01T17:00:00.000000000", "2024-05-01T17:00:00.000000000Z", None),
        ("2024-05-01T17:00:00.000000000Z", "17:00:00.000000000", None),
        (None, "17:00:00.000000000", None),
        ("tomorrow", "17:00:00.000000000", None),
    ],
)
def test_epochs_of_one_kind_have_a_distance(epoch, other, apart):
    assert apart_s(epoch, other) == apart
    assert apart_s(other, epoch) == (None if apart is None else -apart)


def later(track: Track, seconds: float, epoch: str | None) -> Track:
    """The same movement by a clock whose zero is that many seconds earlier."""
    known = {} if epoch is None else {"epoch": epoch}
    return replace(track, time_s=track.time_s + seconds, provenance=known)


def test_tracks_with_epochs_are_compared_as_moments(pair, tmp_path):
    *_, (_, dated) = pair.values()
    same = evaluate(dated, dated, 0.2)
    by_another_clock = later(dated, 100.25, "2023-11-14T22:11:39.750000000Z")
    moved = evaluate(dated, by_another_clock, 0.2)
    assert moved.samples == same.samples
    assert [score.rmse for score in moved.joints] == pytest.approx([0.0] * 3, abs=1e-12)
    write_page(dated, tmp_path / "report.html", truth=by_another_clock)
    for epoch in (None, "2023-11-14T22:11:39.750000000"):
        with pytest.raises(DataError, match="do not overlap"):
            evaluate(dated, later(dated, 100.25, epoch), 0.2)
    apart = later(dated, 0.0, "2023-11-14T23:13:20.000000000Z")
    with pytest.raises(DataError, match=r"truth 3600\.000 to .* time 0 is 2023-11-14 22:13:20\.00 UTC"):
        evaluate(dated, apart, 0.2)
