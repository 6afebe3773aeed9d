"""What leaves a season: exports of one athlete, consent, positions near somebody's home."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

import season_support as support
from command_line import run
from oarlock import DataError, load_recording
from oarlock.season import Season, changed_athlete, create_season
from oarlock.season.exports import export_athlete, may_share
from oarlock.season.gps import EARTH_RADIUS_M, GpsCut, far_from_ends
from oarlock.season.upkeep import check

ONE, OTHER = "K7QMVA", "R9TWXB"
METRE_DEG = 180.0 / (np.pi * EARTH_RADIUS_M)


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def season(tmp_path: Path) -> Season:
    season = create_season(str(tmp_path / "season"), "club")
    support.squad(season, ONE, OTHER)
    return season


def test_an_export_has_everything_of_one_athlete_and_nothing_of_others(
    season: Season, tmp_path: Path
) -> None:
    mine, other = support.add_noise(season, ONE, 1), support.add_noise(season, OTHER, 2)
    run_name = support.add_strokes(season, mine, tmp_path, 1)
    support.add_strokes(season, other, tmp_path, 2)
    out = tmp_path / "out"
    shown = run("season", "export", tmp_path / "season", "--athlete", ONE, "--out", out, "--json").stdout
    assert json.loads(shown)["exported"][0]["athlete"] == ONE
    folder = out / ONE
    strokes = list(csv.DictReader((folder / "csv/strokes.csv").read_text().splitlines()))
    assert [float(row["catch_angle_rad"]) for row in strokes] == pytest.approx(
        [-1.01 - k / 1000.0 for k in range(5)], abs=1e-6
    )
    stored = load_recording(folder / "stored/recordings" / mine)
    np.testing.assert_array_equal(stored["trunk"].gyro_rad_s, support.noise(1)["trunk"].gyro_rad_s)
    table = list(csv.DictReader((folder / f"csv/recordings/{mine}/trunk.csv").read_text().splitlines()))
    assert float(table[3]["gyro_x_rad_s"]) == support.noise(1)["trunk"].gyro_rad_s[3, 0]
    assert (folder / f"stored/results/{mine}.{run_name}/strokes.parquet").exists()
    texts = [file.read_bytes() for file in folder.rglob("*") if file.is_file()]
    assert not any(OTHER.encode() in text or other.encode() in text for text in texts)
    notes = [season.place.read(name) for name, _ in season.place.files(f"athlete={ONE}/exports")]
    assert len(notes) == 1
    assert str(folder).encode() in notes[0]
    assert check(season) == []
    with pytest.raises(DataError, match="is there already"):
        export_athlete(season, ONE, out)
    with pytest.raises(DataError, match="lies inside the season"):
        export_athlete(season, ONE, tmp_path / "season/out")
    with pytest.raises(DataError, match="has no athlete"):
        export_athlete(season, "NOBODY", out)


def test_who_does_not_consent_or_withdrew_is_left_out(season: Season, tmp_path: Path) -> None:
    for athlete in (ONE, OTHER):
        support.add_noise(season, athlete, len(athlete) + ord(athlete[0]))
        changed_athlete(season, athlete, {}, ["sharing"])
    assert may_share(season, "sharing") == ([ONE, OTHER], [])
    changed_athlete(season, OTHER, {}, withdrawn=True)
    place, out = tmp_path / "season", tmp_path / "shared"
    shown = run("season", "export", place, "--scope", "sharing", "--out", out, "--json").stdout
    assert json.loads(shown)["left_out_without_consent"] == [OTHER]
    assert [folder.name for folder in out.iterdir()] == [ONE]
    run("season", "export", place, "--scope", "sharing", "--athlete", OTHER, "--out", out, status=2)
    run("season", "export", place, "--out", out, status=2)
    run("season", "export", place, "--scope", "selling", "--out", out, status=1)
    assert not (out / OTHER).exists()
    export_athlete(season, OTHER, tmp_path / "own")  # the right of access needs no consent


def track(out_m: float = 1000.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Degrees of latitude and longitude, and metres from the start: north and back again, 10 m apart."""
    north_m = np.concatenate([np.arange(0.0, out_m, 10.0), np.arange(out_m, -1.0, -10.0)])
    return 47.0 + north_m * METRE_DEG, np.full(north_m.shape, 8.5), north_m


def test_positions_near_start_and_end_are_cut() -> None:
    latitude, longitude, north_m = track()
    kept = far_from_ends(latitude, longitude, 200.0)
    np.testing.assert_array_equal(kept, north_m > 300.0)
    latitude[5] = np.nan
    assert not far_from_ends(latitude, longitude, 1.0)[5]
    assert not far_from_ends(latitude, longitude, 5000.0).any()
    assert not far_from_ends(np.full(3, np.nan), np.full(3, np.nan), 10.0).any()


def test_the_circle_is_not_about_the_start_and_contains_it() -> None:
    grid_m = np.linspace(-400.0, 400.0, 81)
    east_m, north_m = (part.ravel() for part in np.meshgrid(grid_m, grid_m))
    latitude = np.append(0.0, north_m * METRE_DEG)  # begins at the start, ends there
    longitude = np.append(0.0, east_m * METRE_DEG)
    latitude[-1] = longitude[-1] = 0.0
    for secret in (b"one", b"another"):
        kept = far_from_ends(latitude, longitude, 200.0, secret)[1:-1]
        near = np.hypot(north_m, east_m)[:-1] <= 200.0
        assert not kept[near].any()
        cut = ~kept
        centre_m = np.hypot(north_m[:-1][cut].mean(), east_m[:-1][cut].mean())
        assert 5.0 < centre_m <= 100.0
        np.testing.assert_array_equal(far_from_ends(latitude, longitude, 200.0, secret)[1:-1], kept)


def test_a_track_across_the_date_line() -> None:
    longitude = np.array([179.9999, -179.9999, -179.9, -179.8, -179.7, -179.7])
    kept = far_from_ends(np.zeros(6), longitude, 100.0)
    assert kept.tolist() == [False, False, True, True, False, False]


@pytest.mark.parametrize(
    "head", ["Latitude,Longitude", "lat,lon", " GPS Lat. , GPS Lon. ", "lat_deg,lng_deg"]
)
def test_positions_of_tables_are_cut(head: str) -> None:
    latitude, longitude, north_m = track()
    rows = "".join(
        f'{k},"a, b",{a!r},{b!r},20\r\n'
        for k, (a, b) in enumerate(zip(latitude.tolist(), longitude.tolist(), strict=True))
    )
    contents = f"Session,x\r\n\r\nstroke,text,{head},rate\r\n{rows}".encode()
    found = GpsCut(200.0).file(contents, "a.csv").decode()
    cells = list(csv.reader(io.StringIO(found)))[3:]
    assert [row[2] != "" for row in cells] == [row[3] != "" for row in cells] == (north_m > 300.0).tolist()
    assert all(row[1] == "a, b" and row[4] == "20" for row in cells)
    assert found.startswith("Session,x\r\n\r\nstroke,text,")
    plain = b"stroke,rate\n1,20\n"
    assert GpsCut(200.0).file(plain, "a.csv") == plain


def test_positions_of_other_files() -> None:
    latitude, longitude, north_m = track()
    points = "".join(
        f"<Trackpoint><Position>\n<LatitudeDegrees>{a!r}</LatitudeDegrees><LongitudeDegrees>{b!r}</LongitudeDegrees>"
        "</Position><Cadence>20</Cadence></Trackpoint>"
        for a, b in zip(latitude.tolist(), longitude.tolist(), strict=True)
    )
    found = GpsCut(200.0).file(points.encode(), "a.TCX")
    assert found.count(b"<Position>") == (north_m > 300.0).sum()
    assert found.count(b"<Cadence>") == len(north_m)
    for name, contents in {
        "a.fit": b"",
        "b.tcx": b"<Position>x",
    }.items():
        with pytest.raises(DataError, match="cut"):
            GpsCut(200.0).file(contents, name)
    with pytest.raises(DataError, match="Is the unit right"):
        GpsCut(-1.0)
    with pytest.raises(DataError, match="are not in degrees"):
        GpsCut(200.0).file(b"position_lat,position_long\n560000000,101000000\n", "a.csv")


def test_positions_are_cut_when_an_export_is_added_and_when_it_leaves(season: Season, tmp_path: Path) -> None:
    source = Path(__file__).parents[1] / "examples/strokes/rp3.csv"
    lines = source.read_text().splitlines()
    latitude, longitude, _ = track()
    body = [f"{line},{latitude[k]:.9f},{longitude[k]:.9f}" for k, line in enumerate(lines[1:])]
    (tmp_path / "rp3.csv").write_text("\n".join([f"{lines[0]},lat,lon", *body]) + "\n")
    add = ("season", "add", tmp_path / "season", tmp_path / "rp3.csv", "--date", "2026-05-01")
    run(*add, "--athlete", ONE, "--cut-gps-m", "5000")
    run(*add, "--athlete", OTHER)
    kept = {
        athlete: season.place.read(f"athlete={athlete}/recordings/{name}/export.csv")
        for name, athlete in season.recordings().items()
    }
    assert b"47.0" not in kept[ONE]
    assert b"47.0" in kept[OTHER]
    run(
        "season",
        "export",
        tmp_path / "season",
        "--athlete",
        OTHER,
        "--out",
        tmp_path / "o",
        "--cut-gps-m",
        "5000",
    )
    texts = [file.read_bytes() for file in (tmp_path / "o").rglob("*.csv")]
    assert texts
    assert not any(b"47.0" in text for text in texts)
