"""Eight kinds of recordings: each number has one value in terminal, report, JSON and notes, and counts are right."""

import html
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oarlock
from command_line import run
from exact_recording import sculler
from oarlock import Recording
from oarlock.cli.track_folder import document
from oarlock.recording import ImuStream
from oarlock.recording.packets import missing_share, quantity_rates
from oarlock.recording.plausibility import plausibility
from oarlock.rowing import simulate_field
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.simulation import Motion
from oarlock.storage.folder_writer import MANIFEST

RATE_HZ = 125.0
DURATION_S = 5.0
GAP_S = (2.0, 3.0)
SLOWER = 6
LOST = slice(200, 210)
COUNTS = ("expected", "used", "rejected", "missing")


@cache
def rowed() -> Recording:
    return simulate_sculling(sculler(), "B-NB", DURATION_S, seed=3)[1]


def swung(moving: float) -> Recording:
    model = oarlock.load_model("pendulum3")
    time_s = np.linspace(0.0, DURATION_S, 200)
    turns = {name: moving * np.sin(2.0 * time_s + k) for k, name in enumerate(model.joint_names)}
    return oarlock.simulate(model, Motion.from_joints(time_s, turns), seed=2, rate_hz=RATE_HZ)[1]


def replaced(recording: Recording, *streams: Any) -> Recording:
    new = {stream.name: stream for stream in streams}
    return Recording([new.get(stream.name, stream) for stream in recording])


def in_the_field() -> Recording:
    return simulate_field(sculler(), duration_s=DURATION_S, seed=4).recording


def without_magnetometers() -> Recording:
    units = [(s.name, s.time_s, s.gyro_rad_s, s.accel_m_s2) for s in swung(0.4) if isinstance(s, ImuStream)]
    return Recording(
        [ImuStream(name, t, gyro_rad_s=gyro, accel_m_s2=accel) for name, t, gyro, accel in units]
    )


def without_a_stream() -> Recording:
    return rowed().only(name for name in rowed().names if name != "l_forearm")


def with_a_slow_seat() -> Recording:
    return replaced(rowed(), rowed()["seat"].at_rows(slice(None, None, SLOWER)))


def with_slow_magnetometers() -> Recording:
    """One unit has empty cells between its magnetometer's readings, another has rows of their own for them."""
    back, arm = rowed()["back"], rowed()["r_forearm"]
    mag = np.full_like(back.mag_ut, np.nan)
    mag[::SLOWER] = back.mag_ut[::SLOWER]
    between = arm.time_s[:-1:SLOWER] + 0.4 / RATE_HZ
    time_s = np.sort(np.concatenate([arm.time_s, between]))
    own, later = np.searchsorted(time_s, arm.time_s), np.searchsorted(time_s, between)
    fields = {name: np.full((len(time_s), 3), np.nan) for name in arm.values}
    for name in ("gyro_rad_s", "accel_m_s2"):
        fields[name][own] = arm.values[name]
    fields["mag_ut"][later] = arm.mag_ut[:-1:SLOWER]
    slow = {**back.values, "mag_ut": mag}
    return replaced(rowed(), ImuStream("back", back.time_s, **slow), ImuStream("r_forearm", time_s, **fields))


def with_gaps() -> Recording:
    back, arm = rowed()["back"], rowed()["r_forearm"]
    silent = (back.time_s >= GAP_S[0]) & (back.time_s < GAP_S[1])
    values = {name: np.where(silent[:, None], np.nan, array) for name, array in back.values.items()}
    rows = np.delete(np.arange(len(arm)), LOST)
    return replaced(rowed(), ImuStream("back", back.time_s, **values), arm.at_rows(rows))


def at_rest() -> Recording:
    return swung(0.0)


KINDS: Mapping[str, tuple[str, Callable[[], Recording]]] = {
    "exact": ("sculler", rowed),
    "field": ("sculler", in_the_field),
    "no magnetometers": ("pendulum3", without_magnetometers),
    "absent stream": ("sculler", without_a_stream),
    "slow encoder": ("sculler", with_a_slow_seat),
    "slow magnetometers": ("sculler", with_slow_magnetometers),
    "gaps": ("sculler", with_gaps),
    "rest": ("pendulum3", at_rest),
}


@dataclass(frozen=True)
class Told:
    """What the same track says in four places."""

    terminal: str
    page: str
    json: dict[str, Any]
    recording: Recording
    track: oarlock.Track


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Told]:
    @cache
    def of(kind: str) -> Told:
        model, made = KINDS[kind]
        folder = tmp_path_factory.mktemp("counts")
        recording = made()
        recording.save(folder / "trial")
        words = ("track", folder / "trial", "--model", model, "--no-suspects", "--smooth", "--out")
        terminal = run(*words, folder / "out", "--verbose").output
        as_json = json.loads(run(*words, folder / "json", "--json").stdout)
        page = (
            (folder / "out" / "report.html")
            .read_text(encoding="utf-8")
            .replace("\xa0", " ")
            .replace("<wbr>", "")
        )
        return Told(terminal, page, as_json, recording, oarlock.load_track(folder / "out"))

    return of


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def line(terminal: str, name: str) -> str:
    """Value of `name  value` at the top of the terminal's output."""
    (found,) = re.findall(rf"^{name}  +(.+)$", terminal, flags=re.M)
    return str(found)


def terminal_rows(terminal: str) -> dict[str, list[str]]:
    table = terminal.split("\nSensors ")[1].split("\n\n")[0]
    whole = re.sub(r"\n {4,}(?=\S)", " ", table).splitlines()  # A cell that is too wide goes on below.
    return {cells[0]: cells for cells in (re.split(r"  +", row.strip()) for row in whole[3:])}


def terminal_heads(terminal: str) -> list[str]:
    return re.split(r"  +", terminal.split("\nSensors ")[1].splitlines()[1].strip())


def page_rows(page: str) -> tuple[list[str], dict[str, list[str]]]:
    table = page.split('<table id="sensors-table"')[1].split("</table>")[0]
    cells = [
        [
            html.unescape(re.sub(r"<[^>]+>", "", cell))
            for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)
        ]
        for row in table.split("<tr>")[1:]
    ]
    return cells[0], {row[0]: row for row in cells[1:]}


@pytest.mark.parametrize("kind", KINDS)
def test_each_number_has_one_value(kind: str, told: Callable[[str], Told]) -> None:
    said = told(kind)
    heads, rows = page_rows(said.page)
    printed, titles = terminal_rows(said.terminal), terminal_heads(said.terminal)
    sensors = said.json["sensors"]
    assert set(printed) == set(rows) == set(sensors)
    for name, score in sensors.items():
        nis = "–" if score["nis_per_measurement"] is None else f"{score['nis_per_measurement']:.2f}"
        assert rows[name][1] == nis
        assert printed[name][1] == nis.replace("–", "-")
        if "expected" not in score:
            assert len(printed[name]) == 2
            continue
        for title in COUNTS:
            number = f"{score[title]:,}"
            assert rows[name][heads.index(title)] == number
            assert printed[name][titles.index(title)] == number
        assert score["received"] == score["used"] + score["rejected"] + score["unused"]
        assert score["expected"] == score["received"] + score["missing"]
        assert float(printed[name][titles.index("Hz")]) == pytest.approx(score["rate_hz"], rel=1e-3)
        shares = ", ".join(f"{k} {100 * v:.1f} %" for k, v in score["disturbed"].items() if v >= 5e-4)
        assert not shares or (shares in rows[name] and shares in printed[name])


@pytest.mark.parametrize("kind", KINDS)
def test_sums_rates_and_joints_have_one_value(kind: str, told: Callable[[str], Told]) -> None:
    said = told(kind)
    text = plain(re.sub(r"<[^>]+>", " ", html.unescape(said.page)))
    counted = [score for score in said.json["sensors"].values() if "expected" in score]
    sums = said.json["readings"]
    assert all(sums[key] == sum(score[key] for score in counted) for key in sums)
    share = f"{100 * sums['used'] / sums['expected']:.1f} %"
    beside = f"{sums['rejected']:,} rejected, {sums['missing']:,} missing"
    assert line(said.terminal, "readings").startswith(f"{share} used, {beside}")
    assert f"readings used {share} {beside}" in text
    rate = f"{said.json['samples']:,} rows at {said.json['rate_hz']:.4g} Hz"
    assert rate in text and f"{said.json['rate_hz']:.4g} Hz" in line(said.terminal, "rows")
    assert line(said.terminal, "streams") == said.json["stream_rates"]
    assert f"the sensors' rates: {said.json['stream_rates']}" in text
    observed = f"{said.json['joints_observed']} of {said.json['joints']}"
    assert line(said.terminal, "joints") == f"{observed} observed"
    assert f"joints observed {observed}" in text
    missed = {note.split(":")[0] for note in said.json["notes"] if ": not observed" in note}
    assert missed == set(said.json["not_observed"])
    assert ("All joints were observed." in text) == (not missed)


@pytest.mark.parametrize("kind", KINDS)
def test_notes_say_what_the_tables_say(kind: str, told: Callable[[str], Told]) -> None:
    said = told(kind)
    notes, scores = said.json["notes"], said.json["sensors"]
    assert notes == list(said.track.notes)
    for note in notes:
        assert plain(note) in plain(said.terminal.replace("\n  ", " "))
        assert note in html.unescape(said.page)
        assert " 0.0 %" not in note
    for name, score in scores.items():
        rejected = [re.search(r"(\d+) of (\d+) readings", n) for n in notes if n.startswith(f"{name}: ")]
        for match in filter(None, rejected):
            assert (int(match[1]), int(match[2])) == (score["rejected"], score["received"])
        shares = [f"{test} {100 * v:.1f} %" for test, v in score.get("disturbed", {}).items() if v >= 5e-4]
        disturbed = [n for n in notes if n.startswith(f"{name}: magnetic field disturbed")]
        assert len(disturbed) == bool(shares) and all(share in disturbed[0] for share in shares)


@pytest.mark.parametrize("kind", KINDS)
def test_a_folder_keeps_the_counts(kind: str, told: Callable[[str], Told], tmp_path: Path) -> None:
    said = told(kind)
    again = json.loads(json.dumps(document(said.track, tmp_path), default=_plain))
    assert again["readings"] == said.json["readings"]
    for name, score in again["sensors"].items():
        assert {key: score.get(key) for key in COUNTS} == {
            key: said.json["sensors"][name].get(key) for key in COUNTS
        }


def test_damaged_counts_are_refused(told: Callable[[str], Told], tmp_path: Path) -> None:
    told("rest").track.save(tmp_path / "track")
    file = tmp_path / "track" / "run.toml"
    (tmp_path / "track" / MANIFEST).unlink()
    file.write_text(
        file.read_text(encoding="utf-8").replace("expected = ", "unexpected = "), encoding="utf-8"
    )
    with pytest.raises(oarlock.DataError, match=r"run\.toml: \[streams\] is damaged"):
        oarlock.load_track(tmp_path / "track")


def _plain(value: Any) -> Any:
    return vars(value) if hasattr(value, "__dataclass_fields__") else str(value)


def count(said: Told, name: str) -> dict[str, int]:
    score = said.json["sensors"][name]
    return {key: score[key] for key in (*COUNTS, "unused")}


@pytest.mark.parametrize("kind", ["exact", "rest"])
def test_a_whole_recording_misses_nothing(kind: str, told: Callable[[str], Told]) -> None:
    said = told(kind)
    for stream in said.recording:
        width = sum(values.shape[1] if values.ndim > 1 else 1 for values in stream.values.values())
        expected = width * len(stream)
        assert count(said, stream.name)["expected"] == expected
        assert (count(said, stream.name)["missing"], count(said, stream.name)["unused"]) == (0, 0)
        # Readings of rest and of closures would make more of it.
        assert count(said, stream.name)["used"] == expected - count(said, stream.name)["rejected"]
        assert missing_share(said.recording, stream) == 0.0


def test_a_slow_sensor_misses_nothing(told: Callable[[str], Told]) -> None:
    said = told("slow encoder")
    rows = len(said.recording["seat"])
    assert count(said, "seat")["expected"] == rows == -(-len(rowed()["seat"]) // SLOWER)
    assert (count(said, "seat")["missing"], count(said, "seat")["used"]) == (0, rows)
    assert said.json["stream_rates"] == f"125 Hz (9 streams), {RATE_HZ / SLOWER:.4g} Hz (seat)"
    assert said.json["readings"]["missing"] == 0


def test_a_slow_magnetometer_misses_nothing(told: Callable[[str], Told]) -> None:
    said = told("slow magnetometers")
    rows = len(rowed()["back"])
    for name in ("back", "r_forearm"):
        stream = said.recording[name]
        slow = int(np.isfinite(stream.mag_ut).all(axis=1).sum())
        assert missing_share(said.recording, stream) == 0.0
        rates = quantity_rates(said.recording, stream)
        assert rates["mag_ut"] == pytest.approx(RATE_HZ / SLOWER)
        assert rates["gyro_rad_s"] == pytest.approx(RATE_HZ)
        assert count(said, name)["expected"] == 6 * rows + 3 * slow
        assert count(said, name)["missing"] == 0
    assert said.json["stream_rates"] == "125 Hz"
    assert not [finding for finding in plausibility(said.recording) if "missing" in finding.message]


def test_rows_of_magnetometers_alone_do_not_make_a_track_faster() -> None:
    recording = swung(0.3)
    streams = []
    for unit in recording:
        between = unit.time_s[:-1:2] + 0.4 / RATE_HZ
        time_s = np.sort(np.concatenate([unit.time_s, between]))
        fields = {name: np.full((len(time_s), 3), np.nan) for name in (*unit.values, "mag_ut")}
        for name in ("gyro_rad_s", "accel_m_s2"):
            fields[name][np.searchsorted(time_s, unit.time_s)] = unit.values[name]
        fields["mag_ut"][np.searchsorted(time_s, between)] = [30.0, 0.0, 40.0]
        streams.append(ImuStream(unit.name, time_s, **fields))
    track = oarlock.track(oarlock.load_model("pendulum3"), Recording(streams))
    assert (len(track.time_s) - 1) / (track.time_s[-1] - track.time_s[0]) == pytest.approx(RATE_HZ, rel=0.01)


def test_gaps_are_missing_readings(told: Callable[[str], Told]) -> None:
    said = told("gaps")
    silent = (rowed()["back"].time_s >= GAP_S[0]) & (rowed()["back"].time_s < GAP_S[1])
    assert count(said, "back")["missing"] == 9 * int(silent.sum())
    assert count(said, "r_forearm")["missing"] == 9 * (LOST.stop - LOST.start)
    assert said.json["readings"]["missing"] == 9 * (int(silent.sum()) + LOST.stop - LOST.start)
    shares = {stream.name: missing_share(said.recording, stream) for stream in said.recording}
    for name, share in shares.items():
        assert share == pytest.approx(count(said, name)["missing"] / count(said, name)["expected"])


def test_an_absent_stream_is_one_line_and_counts_nowhere(told: Callable[[str], Told]) -> None:
    said = told("absent stream")
    assert "l_forearm" not in said.json["sensors"]
    assert len([note for note in said.json["notes"] if "l_forearm" in note]) == 1
    assert said.json["readings"]["missing"] == 0


def test_a_page_without_magnetometers_says_so_once(told: Callable[[str], Told]) -> None:
    said = told("no magnetometers")
    notes = [note for note in said.json["notes"] if "magnet" in note]
    assert notes == ["no unit has a magnetometer: headings are relative"]
    text = re.sub(r"<style>.*?</style>", "", said.page, flags=re.S)
    before, _, after = text.partition('id="provenance"')
    # The settings name the filter's use of magnetometers.
    assert after and len(re.findall("magnet", before)) == 1
    assert len(re.findall("magnet", said.terminal)) == 1
    for score in said.json["sensors"].values():
        assert score.get("missing", 0) == 0
