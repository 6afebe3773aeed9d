"""The report is one well-formed, self-contained page that holds every joint and says what is wrong."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fake_track import FakeInfo, noisy_track, true_track, with_beliefs
from html_page import (
    Page,
    assert_loads_nothing,
    assert_references_lead_somewhere,
    assert_speaks_to_screen_readers,
)
from oarlock.evaluation.suspects.suspect import SUSPECT_NOTE
from oarlock.report import Section, plot, write_page
from oarlock.report.health import smoothed_nis
from oarlock.report.text import fixed, number
from oarlock.storage.errors import DataError
from refusals import assert_refused

LARGEST_BYTES = 3_000_000
"""A page that is mailed and opened on a telephone."""

NAMES, UNITS = ("seat", "elbow", "theta"), ("m", "rad", "rad")
TIME_S = np.arange(1001) * 0.01


@pytest.fixture
def truth():
    return true_track(TIME_S, NAMES, UNITS)


@pytest.fixture
def track(truth):
    observed = truth.observed.copy()
    observed[:, 2] = False
    return replace(noisy_track(truth, 0.01), observed=observed)


def page(tmp_path, track, **options) -> Page:
    return Page(write_page(track, tmp_path / "report.html", **options).read_text(encoding="utf-8"))


def test_page_is_well_formed_and_loads_nothing(tmp_path, track, truth):
    read = page(tmp_path, track, truth=truth)
    assert_loads_nothing(read)
    assert not read.all("script")
    style = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "@import" not in style
    assert not re.search(r"url\((?!#)", style)


def test_ids_are_unique_and_references_lead_somewhere(tmp_path, track, truth):
    assert_references_lead_somewhere(page(tmp_path, track, truth=truth))


def test_every_joint_sensor_and_slow_state_is_there(tmp_path, track, truth):
    text = page(tmp_path, track, truth=truth).text
    for name in (*NAMES, *track.info.sensor_names, "surge", "back.gyro_bias", "r_shoulder"):
        assert name in text
    assert "theta: not observed (no stream)" in text
    assert "assumed (not calibrated): back" in text


def test_drawings_and_tables_speak_to_screen_readers(tmp_path, track, truth):
    read = page(tmp_path, track, truth=truth)
    assert len(assert_speaks_to_screen_readers(read)) >= len(NAMES) + len(track.info.sensor_names)
    assert len(read.all("table")) == 3


def test_without_truth_it_says_so(tmp_path, track):
    read = page(tmp_path, track)
    assert "Without a reference we can show the expected error" in read.text
    assert "RMSE" not in read.text
    assert "half-width of the 95 % band" in read.text
    assert not any("truth" in (a.get("class") or "").split() for a in read.all("path"))


def test_honest_and_dishonest_bands_get_different_words(tmp_path, truth):
    honest = page(tmp_path, noisy_track(truth, 0.01), truth=truth).text
    proud = page(tmp_path, noisy_track(truth, 0.01, claimed=0.003), truth=truth).text
    shy = page(tmp_path, noisy_track(truth, 0.01, claimed=0.05), truth=truth).text
    assert "The 95 % bands are correct" in honest
    assert "The 95 % bands are far too narrow" in proud
    assert "The 95 % bands are wider than needed" in shy


def test_a_sensor_that_scatters_too_much_is_named(tmp_path, track, truth):
    nis = track.info.nis.copy()
    nis[:, 0] *= 4
    read = page(tmp_path, replace(track, info=replace(track.info, nis=nis)), truth=truth)
    assert re.search(
        r"Innovations are larger than the filter expects .* for back \((3\.9|4\.0|4\.1)\)", read.text
    )


def test_nees_per_state_is_told_where_beliefs_are_kept(tmp_path, track, truth):
    covariance = np.diag(np.tile([1e-4, 1e-2, 1.0], 3))
    kept = with_beliefs(track, truth, covariance, every=50)
    assert re.search(
        r"NEES per state, .*: (0\.[89]|1\.[012])\d over \d+ beliefs", page(tmp_path, kept, truth=truth).text
    )
    assert "NEES per state" not in page(tmp_path, track, truth=truth).text


def test_hostile_names_stay_text(tmp_path, track):
    notes = ("<script>alert(1)</script>",)
    renamed = replace(track, joint_names=('"><b>', "a&b", "theta"), notes=notes)
    read = page(tmp_path, renamed, title="<i>x</i> & y")
    assert read.errors == []
    assert not read.all("script")
    assert "<script>alert(1)</script>" in read.text
    assert "<i>x</i> & y" in read.text


def test_sparse_tracks_are_drawn(tmp_path, track, truth):
    bare = replace(
        truth, time_s=TIME_S[:1], q=truth.q[:1], q_std=truth.q_std[:1], observed=truth.observed[:1]
    )
    silent = FakeInfo(
        ("back",),
        np.full((1001, 1), np.nan),
        *(np.zeros((1001, 1), dtype=int) for _ in range(3)),
        inertial_nis=np.full(1001, np.nan),
        inertial_used=np.zeros(1001, dtype=int),
        field=np.zeros((1001, 1), dtype=int),
        fault=np.zeros((1001, 1), dtype=int),
    )
    empty = replace(track, q=np.full(track.q.shape, np.nan), info=silent, slow={}, provenance={}, notes=())
    assert page(tmp_path, bare).errors == []
    assert page(tmp_path, empty).errors == []
    with pytest.raises(DataError, match="no samples"):
        write_page(replace(track, time_s=TIME_S[:0]), tmp_path / "none.html")


def test_folders_get_a_file_and_missing_parents_are_made(tmp_path, track):
    assert write_page(track, tmp_path) == tmp_path / "report.html"
    assert write_page(track, tmp_path / "a" / "b.html").exists()


def test_forty_seconds_of_a_whole_body_stay_small(tmp_path):
    units = ("rad",) * 22
    truth = true_track(np.arange(5001) / 125, tuple(f"joint_{k}" for k in range(22)), units)
    path = write_page(noisy_track(truth, 0.01), tmp_path, truth=truth)
    assert path.stat().st_size < LARGEST_BYTES


def test_decimation_keeps_extremes_and_gaps():
    rng = np.random.default_rng(0)
    x, y = np.arange(20_000.0), rng.standard_normal(20_000)
    y[5_000:6_000] = np.nan
    y[12_345], y[777] = 50.0, -60.0
    xs, ys = plot.decimate(x, y)
    assert len(xs) <= 2 * plot.BUCKETS
    assert np.all(np.diff(xs) > 0)
    assert (np.nanmax(ys), np.nanmin(ys)) == (50.0, -60.0)
    assert np.isnan(ys).any()


def test_decimated_band_is_never_narrower():
    x = np.arange(20_000.0)
    half = np.where(x == 4_321, 9.0, 1.0)
    xs, low, high = plot.envelope(x, -half, half)
    assert len(xs) <= plot.BUCKETS
    assert (low.min(), high.max()) == (-9.0, 9.0)
    assert np.all(high >= 1.0)


@pytest.mark.parametrize(
    ("low", "high"), [(0, 40), (-61.2, 41.7), (1.7e9, 1.7e9 + 3), (-2e-5, 3e-5), (0.99, 1.01)]
)
def test_ticks_are_round_inside_and_told_apart(low, high):
    values = plot.ticks(low, high)
    labels = plot.tick_labels(values)
    assert 2 <= len(values) <= 9
    assert all(low <= v <= high for v in values)
    assert len(set(labels)) == len(labels)
    for value, name in zip(values, labels, strict=True):
        assert float(name.replace("\N{MINUS SIGN}", "-")) == pytest.approx(value, abs=1e-9)


def test_smoothed_nis_is_one_for_a_consistent_sensor():
    time_s = np.arange(0, 10, 0.01)
    nis, used = np.full(1000, 9.0), np.full(1000, 9.0)
    nis[400:500], used[400:500] = np.nan, 0
    smooth, degrees = smoothed_nis(time_s, nis, used)
    np.testing.assert_allclose(smooth[np.isfinite(smooth)], 1.0, atol=1e-9)
    assert np.isnan(smooth[400:500]).all()
    assert 51 * 9 - 9 <= degrees[200] <= 51 * 9


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.02034, "0.0203"),
        (12.345, "12.3"),
        (-0.5, "\N{MINUS SIGN}0.500"),
        (5001.0, "5,001"),
        (np.nan, "–"),
    ],
)
def test_numbers_read_well(value, text):
    assert number(value) == text


def test_a_rounded_zero_has_no_sign():
    assert (fixed(-1e-7, 4), fixed(-0.5, 1)) == ("0.0000", "\N{MINUS SIGN}0.5")


def test_sections_of_a_field_come_first_and_bring_their_words_style_and_script(tmp_path, track):
    own = Section(
        "teeth",
        "Teeth",
        "<p>12 % of gums</p>",
        ("<b>Two</b> teeth.",),
        ".teeth { color: red; }",
        "window.teeth = 5 % 3;",
    )
    read = page(tmp_path, replace(track, notes=(f"{SUSPECT_NOTE}the back is frozen",)), sections=[own])
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert read.errors == []
    places = [
        read.text.index(words)
        for words in ("Suspect: the back is frozen", "Two teeth.", "3 joints of the model")
    ]
    assert places == sorted(places)
    assert ".teeth { color: red; }" in text
    assert "<script>window.teeth = 5 % 3;</script>" in text
    assert "script-src 'unsafe-inline'" in text
    assert [a["href"] for a in read.all("a")][:2] == ["#measured-in", "#teeth"]


def test_a_page_without_sections_runs_no_script(tmp_path, track):
    page(tmp_path, track)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "script-src" not in text


@pytest.mark.parametrize("key", ["Teeth", "2nd", "a b", ""])
def test_a_key_that_is_no_anchor_is_refused(key):
    assert_refused(lambda: Section(key, "Teeth", ""), "small letters")


def test_two_sections_with_one_key_are_refused(tmp_path, track):
    with pytest.raises(DataError, match="already has a section 'joints'"):
        page(tmp_path, track, sections=[Section("joints", "Joints", "")])


def test_a_script_that_would_end_itself_is_refused():
    assert_refused(lambda: Section("teeth", "Teeth", "", script="'</script>'"), "would end it")
