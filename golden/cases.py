"""What is computed through Oarlock's public names and commands, in groups. Used by `collect`, by main and tests."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pyarrow.parquet as pq

import oarlock
from golden.mistakes import mistakes
from golden.values import (
    Outputs,
    Value,
    outputs_of,
    outputs_of_file,
    outputs_of_folder,
    outputs_of_recording,
    outputs_of_track,
    printed_numbers,
    refusal,
    run_command,
)
from oarlock import rowing
from oarlock.formats.datasets.diodem import read_diodem
from oarlock.formats.datasets.openaxes import read_openaxes
from oarlock.movement import movement_angles, ranges_of_motion
from oarlock_lab.pages import recordings

ROOT = Path(__file__).parents[1]
EXCERPT = ROOT / "tests/data/exact_B-B_10s.npz"
STROKES, MARKERS = ROOT / "examples/strokes", ROOT / "examples/markers"
LARGEST_BYTES = 20 << 20
SIMILAR = 3
"""Files of one ending in one folder, or of one name, that are imported."""
EXPORTED_S = 2.0

Case = Callable[[Path], Outputs]


@dataclass(frozen=True)
class Group:
    """A group of cases.

    Args:
        name: first part of its keys.
        outputs: computes it in an empty folder.
        needs_data: whether it reads recordings of `OARLOCK_DATA`.
        is_long: whether it takes more than some seconds.
    """

    name: str
    outputs: Case
    needs_data: bool = False
    is_long: bool = False


GROUPS: dict[str, Group] = {}


def group(name: str, needs_data: bool = False, is_long: bool = False) -> Callable[[Case], Case]:
    """Registers a function as the group of this name."""

    def register(outputs: Case) -> Case:
        GROUPS[name] = Group(name, outputs, needs_data, is_long)
        return outputs

    return register


def collect(name: str) -> dict[str, Value]:
    """All outputs of a group by key."""
    with own_folder() as folder:
        return {f"{name}/{key}": value for key, value in GROUPS[name].outputs(folder)}


@contextmanager
def own_folder() -> Iterator[Path]:
    """An empty folder, in which Oarlock also keeps its state."""
    with tempfile.TemporaryDirectory(prefix="golden-") as place:
        state = {"XDG_STATE_HOME": f"{place}/state", "COLUMNS": "100", "NO_COLOR": "1"}
        with mock.patch.dict(os.environ, state):
            folder = Path(place, "run")
            folder.mkdir()
            yield folder


def data_folder() -> Path | None:
    """The folder `data` of `OARLOCK_DATA`, if it is there."""
    place = Path(os.environ.get("OARLOCK_DATA", ""), "data")
    return place if os.environ.get("OARLOCK_DATA") and place.is_dir() else None


def shared_data() -> Path:
    """The folder `data` of `OARLOCK_DATA`.

    Raises:
        FileNotFoundError: it is absent.
    """
    place = data_folder()
    if place is None:
        raise FileNotFoundError("OARLOCK_DATA names no folder with data/")
    return place


# --- bodies and movements -------------------------------------------------------------------------------


@cache
def sculler() -> oarlock.Model:
    """The shipped sculler."""
    return oarlock.load_model("sculler")


@cache
def excerpt() -> recordings.SimulatedRecording:
    """10 s of simulated sculling with biased units in a boat that surges."""
    return recordings.read_simulated(EXCERPT, "B-B", sculler())


@cache
def excerpt_track() -> oarlock.Track:
    """The excerpt, tracked with the default settings."""
    return oarlock.track(sculler(), excerpt().recording)


def waves(
    model: oarlock.Model, duration_s: float, still_s: float = 3.0, seed: int = 0
) -> oarlock.simulation.Motion:
    """Rest, then waves in all coordinates but those of a root that moves freely."""
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, duration_s, 0.02)
    moving_s = np.clip(time_s - still_s, 0.0, None)
    rise = np.clip(moving_s, 0.0, 1.0)
    joints = {}
    for joint in model.describe().joints:
        rest = np.atleast_1d(np.ravel(joint.rest))
        hertz, phase = random.uniform(0.3, 0.9, (2, len(rest)))
        swing = np.sin(2 * np.pi * hertz * moving_s[:, None] + phase) - np.sin(phase)
        size = 0.05 if joint.kind == "free" else 0.3
        course = rest + size * swing * (rise**3 * (10 - 15 * rise + 6 * rise**2))[:, None]
        joints[joint.name] = course if len(rest) > 1 else course[:, 0]
    return oarlock.simulation.Motion.from_joints(time_s, joints)


def recorded(
    model: oarlock.Model, motion: oarlock.simulation.Motion, seed: int = 0
) -> tuple[oarlock.Track, oarlock.Recording]:
    """The ground truth of a movement and the readings of biased inertial units at 50 Hz."""
    units = [sensor.name for sensor in model.describe().inertial_units]
    return oarlock.simulate(
        model, motion, units, seed, rate_hz=50.0, gyro_bias_rad_s=0.005, accel_bias_m_s2=0.05
    )


@cache
def legs() -> tuple[oarlock.Model, oarlock.Track, oarlock.Recording]:
    """A simulated lower body: its model, ground truth and recording."""
    model = oarlock.load_model("lower_body")
    return model, *recorded(model, waves(model, 12.0))


@cache
def legs_track() -> oarlock.Track:
    """The simulated lower body, tracked with nominal mounts."""
    model, _, recording = legs()
    return oarlock.track(model, recording)


@cache
def session() -> oarlock.simulation.SessionTrial:
    """A simulated calibration session of an arm."""
    return oarlock.simulation.simulate_session(oarlock.load_model("arm7"), seed=5)


# --- tracks ---------------------------------------------------------------------------------------------


@group("track")
def tracks(folder: Path) -> Outputs:
    """Tracks of recordings that ship with the project, and of simulated ones."""
    yield from outputs_of_track("sculler_excerpt", excerpt_track())
    yield from outputs_of_track("sculler_excerpt_smoothed", oarlock.smooth(excerpt_track()))
    recording = excerpt().recording
    settings: dict[str, dict[str, Any]] = {
        "sculler_tree": {"structure": "tree"},
        "sculler_tree_ekf": {"structure": "tree", "filter": "ekf"},
        "sculler_open": {"closures": False},
    }
    for key, keys in settings.items():
        tracked = oarlock.track(sculler(), recording, config=oarlock.Config(**keys))
        yield from outputs_of_track(key, tracked)
        if key == "sculler_tree":
            yield from outputs_of_track("sculler_smoothed", oarlock.smooth(tracked))
    pendulum = oarlock.import_recording(ROOT / "examples/pendulum/imuData01.csv")
    chain = oarlock.load_model("pendulum3")
    calibration = oarlock.calibration.calibrate_hinge_chain(chain, pendulum)
    yield from outputs_of_track("pendulum", oarlock.track(chain, pendulum, calibration))
    arm = oarlock.load_model("arm7")
    mounts = oarlock.calibration.calibrate_session(arm, session().recording)
    reach = recorded(arm, waves(arm, 8.0), seed=2)[1]
    yield from outputs_of_track("arm", oarlock.track(arm, reach, mounts))
    yield from outputs_of_track("lower_body", legs_track())
    limbs = oarlock.studies.track_independent_chains(sculler(), recording.slice(end_s=3.0))
    yield from outputs_of_track("sculler_limbs", limbs)


@group("shared_track", needs_data=True)
def shared_tracks(folder: Path) -> Outputs:
    """Tracks of public recordings."""
    place = shared_data()
    pair = oarlock.import_recording(place / "dfjimu/data_3D_01.mat")
    diodem = read_diodem(place / "diodem_arm/trial1", "rigid", 49.0)
    robot = read_openaxes(place / "openaxes_ur5", "circle-100")
    for key, recording in {"dfjimu": pair, "diodem_arm": diodem, "openaxes_ur5": robot}.items():
        part = recording.slice(recording.start_s, recording.start_s + 15.0)
        yield from outputs_of_track(key, oarlock.track(oarlock.load_model(key), part))


# --- imports --------------------------------------------------------------------------------------------


def importable(place: Path) -> Iterator[Path]:
    """Files that an importer may read, the first few of a kind."""
    similar: Counter[object] = Counter()
    for file in sorted(place.rglob("*")):
        if file.is_file() and file.stat().st_size <= LARGEST_BYTES and "__pycache__" not in file.parts:
            kinds = [(file.parent, file.suffix), file.name]
            similar.update(kinds)
            if max(similar[kind] for kind in kinds) <= SIMILAR:
                yield file


def file_key(root: Path, file: Path) -> str:
    """The path below a folder; of recordings of people a hash of it, because names of files may have initials."""
    path = file.relative_to(root).as_posix()
    is_of_person = path.startswith("people/")
    return f"people/{hashlib.sha256(path.encode()).hexdigest()[:12]}{file.suffix}" if is_of_person else path


def imports(root: Path, places: Iterable[Path]) -> Outputs:
    """Arrays of every file and folder that can be imported, or the class of the error."""
    for place in places:
        key = file_key(root, place)
        try:
            recording = oarlock.import_recording(place)
        except (oarlock.DataError, oarlock.ModelError) as error:
            yield key, type(error).__name__
        else:
            yield from outputs_of_recording(key, recording)


@group("import")
def shipped_imports(folder: Path) -> Outputs:
    """Files of tests and examples."""
    places = [ROOT / "tests/data/ximu3", ROOT / "examples/club_csv"]
    for below in (
        "tests/data",
        "examples/pendulum",
        "examples/club_csv",
        "examples/strokes",
        "examples/markers",
    ):
        places += importable(ROOT / below)
    yield from imports(ROOT, places)


@group("shared_import", needs_data=True)
def shared_imports(folder: Path) -> Outputs:
    """Files of the validation data, and its folders of several units."""
    place = shared_data()
    several = ("xio_imumocap_lower_body/Examples/logged_lower_body", "opensimrt_upper_limb_ngimu")
    yield from imports(place, [*(place / name for name in several), *importable(place)])


def marker_outputs(root: Path, files: Iterable[Path]) -> Outputs:
    """Positions of optical markers."""
    for file in files:
        key = file_key(root, file)
        try:
            markers = oarlock.markers.load_markers(file)
        except oarlock.DataError as error:
            yield key, type(error).__name__
        else:
            yield f"{key}/names", "; ".join(markers.names)
            yield f"{key}/time_s", markers.time_s
            yield f"{key}/position_m", np.asarray(markers.position_m)


def stroke_outputs(root: Path, files: Iterable[Path]) -> Outputs:
    """Tables of strokes of devices."""
    for file in files:
        key = file_key(root, file)
        try:
            table = rowing.load_export(file)
        except oarlock.DataError as error:
            yield key, type(error).__name__
        else:
            yield from outputs_of(key, table)
            if isinstance(table, rowing.StrokeTable):
                yield from outputs_of(f"{key}/summary", rowing.summarise_strokes(table))


@group("exports_of_devices")
def shipped_tables(folder: Path) -> Outputs:
    """Stroke exports and marker files that ship with the project."""
    yield from stroke_outputs(ROOT, sorted(STROKES.glob("*.csv")))
    yield from marker_outputs(ROOT, [*sorted(ROOT.glob("tests/data/opensim/*.trc")), MARKERS / "reach.trc"])


@group("shared_exports_of_devices", needs_data=True)
def shared_tables(folder: Path) -> Outputs:
    """Stroke exports and marker files of the validation data."""
    place = shared_data()
    stroke_files = [
        *importable(place / "rowingdata_samples"),
        *importable(place / "openrowingmonitor_recordings"),
    ]
    yield from stroke_outputs(
        place, [file for file in stroke_files if file.suffix in (".csv", ".tcx", ".fit", ".gz")]
    )
    yield from marker_outputs(place, [file for file in importable(place) if file.suffix in (".trc", ".c3d")])


# --- calibrations and evaluations -----------------------------------------------------------------------


@group("calibration")
def calibrations(folder: Path) -> Outputs:
    """Every calibration on simulated recordings."""
    for key, calibration in all_calibrations():
        file = folder / f"{key}.toml"
        calibration.save(file)
        yield from outputs_of_file(f"{key}/file", file)
        for name, (rotation, offset_m) in calibration.mounts.items():
            yield f"{key}/mounts/{name}", np.hstack([np.asarray(rotation), np.asarray(offset_m)[:, None]])
        yield from outputs_of(f"{key}/mount_stds_rad", calibration.mount_stds_rad)


def all_calibrations() -> Iterator[tuple[str, oarlock.Calibration]]:
    """Name and result of every calibration."""
    arm, chain = oarlock.load_model("arm7"), oarlock.load_model("pendulum3")
    yield "session", oarlock.calibration.calibrate_session(arm, session().recording)
    pendulum = oarlock.import_recording(ROOT / "examples/pendulum/imuData01.csv")
    yield "chain", oarlock.calibration.calibrate_hinge_chain(chain, pendulum)
    model, _, recording = legs()
    yield "sagittal", oarlock.calibration.calibrate_sagittal(model, recording)
    yield "pose", oarlock.calibration.calibrate_pose(model, recording)
    five = oarlock.load_model("diodem_arm")
    yield "axes", oarlock.calibration.calibrate_hinge_axes(five, recorded(five, waves(five, 12.0))[1])
    yield "joint_centers", oarlock.calibration.calibrate_joint_centers(model, recording)
    yield "field", oarlock.calibration.calibrate_field(arm, recorded(arm, waves(arm, 10.0, 4.0))[1])
    moving = recorded(arm, waves(arm, 14.0, 0.0), seed=3)[1]
    delayed = [
        replace(stream, time_s=stream.time_s + 0.004) if stream.name == "hand" else stream
        for stream in moving
    ]
    yield (
        "clocks",
        oarlock.calibration.calibrate_clocks(arm, oarlock.Recording(delayed), reference="upperarm", jobs=1),
    )


@group("motion_calibration", is_long=True)
def motion_calibration(folder: Path) -> Outputs:
    """Calibration from ordinary movement of a body with other mounts and lengths."""
    trial = rowing.simulate_field(sculler(), rowing.FieldEffects.misfit(), duration_s=16.0, seed=31)
    calibration = oarlock.calibration.calibrate_motion(sculler(), recordings.at_rate(trial.recording, 25.0))
    calibration.save(folder / "motion.toml")
    yield from outputs_of_file("file", folder / "motion.toml")


@group("evaluation")
def evaluations(folder: Path) -> Outputs:
    """Scores against ground truth and markers, ranges of motion, suspects, strokes."""
    yield from outputs_of("sculler", oarlock.evaluate(excerpt_track(), excerpt().truth))
    model, truth, _ = legs()
    tracked = legs_track()
    yield from outputs_of("lower_body", oarlock.evaluate(tracked, truth))
    yield from outputs_of(
        "frames", oarlock.evaluation.evaluate_frame_orientations(tracked, truth, remove_heading=True)
    )
    yield from outputs_of("ranges_of_motion", ranges_of_motion(movement_angles(tracked)))
    yield from outputs_of("joint_angles", oarlock.joint_angles(excerpt_track()))
    names = tuple(name for name in model.frame_names if name != "root")[:6]
    markers = oarlock.markers.Markers(names, truth.time_s, truth.positions_of(names))
    yield from outputs_of("markers", oarlock.markers.evaluate_markers(tracked, markers))
    first = excerpt().recording.slice(1.0, 2.5)
    exchanged = {"r_forearm": "r_upperarm", "r_upperarm": "r_forearm"}
    streams = [replace(stream, name=exchanged.get(stream.name, stream.name)) for stream in first]
    suspects = oarlock.evaluation.find_suspects(sculler(), oarlock.Recording(streams), budget_s=600.0)
    yield from outputs_of("suspects", suspects)
    strokes = rowing.find_strokes(excerpt_track())
    yield from outputs_of("strokes", strokes)
    technique = rowing.technique(excerpt_track(), strokes)
    yield from outputs_of(
        "technique", {n: value for n, value in vars(technique).items() if value is not strokes}
    )


@group("marker_study")
def marker_study(folder: Path) -> Outputs:
    """Sensors simulated from the shipped marker session, with fitted lengths."""
    shutil.copytree(MARKERS, folder / "markers")
    files = folder / "markers"
    words = ("--model", files / "arm.toml", "--attachments", files / "person.toml", "--estimate", "l_ua,l_fa")
    run_command("markers", "simulate", files / "reach.trc", *words, "--out", folder / "study")
    yield from outputs_of_recording("recording", oarlock.load_recording(folder / "study"))
    yield from outputs_of_track("truth", oarlock.load_track(folder / "study/truth"))
    yield from outputs_of_file("page/report.html", folder / "study/report.html")


# --- files and pages ------------------------------------------------------------------------------------


@group("export")
def exports(folder: Path) -> Outputs:
    """All files of an export, of a rower and of a body with ball joints."""
    pieces = {"sculler": (sculler(), excerpt().recording), "lower_body": (legs()[0], legs()[2])}
    for key, (model, recording) in pieces.items():
        track = oarlock.track(model, recording.slice(end_s=EXPORTED_S))
        oarlock.export(track, folder / key)
        yield from outputs_of_folder(key, folder / key)
        yield from marker_outputs(folder, [folder / key / "frames.c3d"])


@group("page")
def pages(folder: Path) -> Outputs:
    """Numbers of the pages of a rower, and of the commands that print the same."""
    track, truth, piece = folder / "rower", folder / "truth", folder / "piece"
    excerpt().recording.save(piece)
    excerpt().truth.save(truth)
    run_command("track", piece, "--model", "sculler", "--out", track, "--no-suspects")
    yield from outputs_of_file("track/report.html", track / "report.html")
    yield from outputs_of("track/sensors", pq.read_table(track / "sensors.parquet"))
    run_command("report", track, "--truth", truth, "--out", folder / "rowing.html")
    run_command("report", track, "--summary", "--out", folder / "summary.html")
    run_command("view", track, "--out", folder / "view.html", "--no-open")
    for name in ("rowing", "summary", "view"):
        yield from outputs_of_file(f"{name}.html", folder / f"{name}.html")
    yield from outputs_of("strokes", json.loads(run_command("rowing", "strokes", track, "--json")))
    yield from outputs_of("evaluate", json.loads(run_command("evaluate", track, truth, "--json")))


@group("other_page")
def other_pages(folder: Path) -> Outputs:
    """Numbers of pages of movements, sessions, devices, comparisons, crews and refusals."""
    legs_track().save(folder / "walk")
    run_command("report", folder / "walk", "--out", folder / "movement.html")
    session().recording.save(folder / "session")
    run_command("calibrate", "session", folder / "session", "--model", "arm7", "--out", folder / "worn.toml")
    for name in ("rp3", "speedcoach_empower"):
        rowing.write_strokes_report(rowing.load_export(STROKES / f"{name}.csv"), folder / f"{name}.html")
    for name in ("movement", "worn", "rp3", "speedcoach_empower"):
        yield from outputs_of_file(f"{name}.html", folder / f"{name}.html")
    short = excerpt().recording.slice(end_s=4.0)
    compared = oarlock.studies.compare(sculler(), short, excerpt().truth, ("ukf", "limbs"))
    yield from outputs_of("compared", [untimed(score) for score in compared.scores])
    yield from refused_page(folder)
    yield from crew_page(folder)


def untimed(score: object) -> dict[str, object]:
    """The scores of an estimator without the time that it took."""
    return {name: value for name, value in vars(score).items() if not name.endswith("_us")}


def refused_page(folder: Path) -> Outputs:
    """The page of a recording that cannot be tracked."""
    short = excerpt().recording.slice(end_s=4.0)
    wrong: list[Any] = list(short)
    in_g = np.asarray(short["back"].values["accel_m_s2"]) / 9.80665
    wrong[short.names.index("back")] = replace(wrong[short.names.index("back")], accel_m_s2=in_g)
    oarlock.Recording(wrong).save(folder / "in_g")
    out = folder / "refused"
    text = run_command("track", folder / "in_g", "--model", "sculler", "--out", out, status=1)
    yield "refused/words", str(len(text) > 0)
    yield from outputs_of_folder("refused", out)


def crew_page(folder: Path) -> Outputs:
    """The page of two seats that row with a delay of 15 ms."""
    seats = []
    for seed, delay_s in ((0, 0.0), (1, 0.015)):
        random = np.random.default_rng(seed)
        time_s = np.arange(0.0, 60.0, 0.01)
        stroke = 0.43 * (time_s - delay_s) + 0.01 * np.sin(0.7 * time_s)
        phi_rad = -0.25 - 0.85 * np.cos(2 * np.pi * stroke) + 0.001 * random.standard_normal(len(time_s))
        streams = [oarlock.recording.ScalarStream(f"{side}_oar_phi", time_s, phi_rad) for side in "rl"]
        seats.append(oarlock.Recording(streams))
    timing = rowing.crew_timing(rowing.crew_seats(seats, ["bow", "stroke"]), clock_std_s=0.0)
    for file in rowing.write_crew_report(timing, folder / "crew.html"):
        yield from outputs_of_file(file.name, file)
    yield from outputs_of("crew/findings", rowing.crew_findings(timing))


@group("live")
def live_session(folder: Path) -> Outputs:
    """A session of emulated units on a pendulum, from its packets as they arrived.

    session.zip has 6 s of the simulated model pendulum3 at 25 Hz; clocks drift by 40 ppm, 2 % of the packets are lost.
    """
    place = folder / "session"
    shutil.unpack_archive(Path(__file__).with_name("session.zip"), place)
    run_command("live", "recover", place)
    run_command("live", "track", place, "--out", folder / "track")
    yield from outputs_of_recording("recording", oarlock.load_recording(place / "recording"))
    yield from outputs_of_track("track", oarlock.load_track(folder / "track"))


@group("command")
def commands(folder: Path) -> Outputs:
    """Numbers that commands print."""
    yield "model_show", printed_numbers(run_command("model", "show", "sculler", "--json"))
    yield "model_show_arm", printed_numbers(run_command("model", "show", "arm"))
    yield "markers_show", printed_numbers(run_command("markers", "show", MARKERS / "reach.trc", "--json"))
    for file in sorted(STROKES.glob("*.csv")):
        yield f"strokes/{file.name}", printed_numbers(run_command("rowing", "strokes", file))
    for condition in ("S-NB", "B-B"):
        words = ("--duration-s", 6, "--condition", condition, "--seed", 3, "--out", folder / condition)
        run_command("simulate", *words)
        yield from outputs_of_recording(f"simulate/{condition}", oarlock.load_recording(folder / condition))
    field = ("--duration-s", 6, "--field", "careful", "--seed", 3, "--out", folder / "field")
    run_command("simulate", *field)
    yield from outputs_of_recording("simulate/field", oarlock.load_recording(folder / "field"))


@group("mistake")
def refusals(folder: Path) -> Outputs:
    """Errors of wrong inputs."""
    for key, call in mistakes(folder):
        yield key, refusal(call, folder)
