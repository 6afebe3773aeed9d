"""`run`: from the files of a recording to angles and a report."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

from oarlock._core import Config, Model
from oarlock.calibration.session.plan import default_plan
from oarlock.evaluation.scores import Evaluation
from oarlock.evaluation.suspects.suspect import Suspect
from oarlock.evaluation.suspects.suspects import find_suspects
from oarlock.formats.contents import read_recording
from oarlock.model.ball_joint import with_ball_joint
from oarlock.model.load import load_model
from oarlock.recording.calibration import Calibration, load_calibration
from oarlock.recording.folder import INDEX_FILE
from oarlock.recording.recording import Recording
from oarlock.recording.unit_names import units_of, with_unit_names
from oarlock.report.fields import write_report
from oarlock.report.session_page import write_session_page
from oarlock.storage.errors import DataError, ModelError
from oarlock.storage.folder_writer import read_manifest, replaced_folder
from oarlock.storage.paths import AnyPath
from oarlock.storage.progress import Progress
from oarlock.storage.write_file import check_empty
from oarlock.tracking.settings import Settings
from oarlock.tracking.track import Track
from oarlock.tracking.tracking import checked_config, track

LOG = logging.getLogger("oarlock")


def run(
    recording: Recording | AnyPath,
    out: AnyPath,
    *,
    model: Model | AnyPath,
    units: Mapping[str, str] | AnyPath | None = None,
    sensors: Sequence[str] | None = None,
    stature_m: float | None = None,
    mass_kg: float | None = None,
    session: Recording | AnyPath | None = None,
    pose: str = "N",
    calibration: Calibration | AnyPath | None = None,
    low_pass_hz: float | None = None,
    pick: str | None = None,
    together: bool = False,
    force: bool = False,
    progress: Progress = None,
    **settings: Unpack[Settings],
) -> Track:
    """Import, calibrate with what is there, track, smooth and report: from files to angles.

    Without `calibration` and `session`, mounts come from the recording itself: it begins with two seconds of standing
    still in the rest posture, and most movement is forward and backward.

    Args:
        recording: a recording, or its file, folder or zip file in any format.
        out: folder for recording/, calibration.toml and track/ with report.html.
        model: a model, its file, or the name of a shipped one.
        units: which unit sits where: sensor -> unit or a part of its name, or a units.toml. Default: by names.
        sensors: inertial units that are worn; the body is cut to what they measure. Default: all recorded.
        stature_m: standing height, m; sets the lengths of a body.
        mass_kg: mass, kg; sets the radii of limbs.
        session: recording of a guided calibration session.
        pose: still pose of the session: N (arms hanging), T (arms level) or sitting.
        calibration: a calibration or its file, so that nothing is calibrated.
        low_pass_hz: cut-off of the readings of inertial units, Hz.
        pick: which of several recordings.
        together: all files of the place are units of one recording.
        force: replace what is in `out`.
        progress: True shows bars or lines.
        settings: of the filter, such as `filter="ekf"`.

    Raises:
        DataError: an unreadable recording, units without a place, or other files in the way.
        ModelError: an unreadable model, or settings that do not fit it.
        DivergedError: the filter diverged.
    """
    out = Path(out)
    check_empty(out / "track", force)
    if isinstance(model, Model) and (stature_m, mass_kg) != (None, None):
        raise DataError("run: stature_m and mass_kg are for a model's name or file; give them to load_model")
    body = model if isinstance(model, Model) else load_model(model, stature_m=stature_m, mass_kg=mass_kg)
    measured = _imported(recording, out / "recording", body, units, pick, together, force)
    body = body.with_units(sensors) if sensors is not None else recorded_part(body, measured)
    known: Calibration | None
    if session is not None:
        guided = _imported(session, out / "session", body, units, None, False, force)
        plan = default_plan(body, pose)
        from oarlock.calibration.session.search import calibrate_session

        known = calibrate_session(body, guided, plan)
        file = _saved(known, out / "calibration.toml", force)
        still = next((dict(step.pose) for step in plan.steps if step.kind == "pose"), None)
        write_session_page(known, file.with_suffix(".html"), body, still)
        LOG.log(*_session_outcome(known))
    elif calibration is None:
        from oarlock.calibration.static.sagittal import calibrate_sagittal

        known = calibrate_sagittal(body, measured)
        _saved(known, out / "calibration.toml", force)
    else:
        known = calibration if isinstance(calibration, Calibration) else load_calibration(calibration)
    for upper, lower in balls_of(known):
        body = with_ball_joint(body, upper, lower)
    if low_pass_hz:
        measured = measured.low_passed(low_pass_hz)
    result = track(body, measured, known, smooth=True, progress=progress, **settings)
    suspects = searched_suspects(body, measured, known, checked_config(None, settings))
    result = result.with_notes(*(one.note for one in suspects), *map(ball_note, balls_of(known)))
    with replaced_folder(out / "track", "track", force) as stage:
        write_track(result, stage, progress=progress)
    return result


def _imported(
    source: Recording | AnyPath,
    folder: Path,
    body: Model,
    units: Mapping[str, str] | AnyPath | None,
    pick: str | None,
    together: bool,
    force: bool,
) -> Recording:
    """The recording with units named as sensors of the body; written, unless it is a folder of Oarlock's as it is."""
    measured = source if isinstance(source, Recording) else read_recording(source, pick, together)
    place = None if isinstance(source, Recording) else Path(source)
    if place is not None and (place / INDEX_FILE).is_file() and units is None:
        return measured
    sensors = [sensor.name for sensor in body.describe().inertial_units]
    by_hand, ids = units_of(units, place)
    measured, _ = with_unit_names(measured, sensors, by_hand, ids)
    check_empty(folder, force)
    with replaced_folder(folder, "recording", force) as stage:
        measured.save(stage)
    return measured


def recorded_part(body: Model, recording: Recording) -> Model:
    """The body cut to the inertial units that were recorded; the whole body if that is all, or none."""
    sensors = [sensor.name for sensor in body.describe().inertial_units]
    recorded = [name for name in sensors if name in recording.names]
    return body.with_units(recorded) if recorded and len(recorded) < len(sensors) else body


def balls_of(calibration: Calibration) -> list[tuple[str, str]]:
    """Pairs of hinges, the upper one first, whose axes a calibration from movement left unknown."""
    pairs: Any = calibration.noted.get("balls", ())
    return [(upper, lower) for upper, lower in pairs]


def ball_note(hinges: tuple[str, str]) -> str:
    """What a reader of angles must know of a ball in place of two hinges."""
    upper, lower = hinges
    return (
        f"{upper} and {lower} are one ball, because their axes are unknown. "
        "Only the angle between the segments has a meaning. For all angles record a session (`oarlock calibrate "
        "session`, docs/calibration.md) or move the joint about both axes"
    )


def searched_suspects(
    model: Model, recording: Recording, calibration: Calibration | None, config: Config | None = None
) -> tuple[Suspect, ...]:
    """Sensors that appear to be faulty. A search that fails costs no track: it is logged as an error."""
    try:
        return find_suspects(model, recording, calibration, config)
    except (DataError, ModelError):
        raise
    except Exception:
        LOG.exception("faults of sensors could not be searched for")
        return ()


def _session_outcome(calibration: Calibration) -> tuple[int, str]:
    """Level of the log and text: which steps of a session to repeat, or that none needs it."""
    session: Any = calibration.noted["session"]
    if session["passed"]:
        return logging.INFO, "the calibration session passed"
    steps = dict.fromkeys(check["step"] for check in session["check"] if check["outcome"] == "redo")
    return (
        logging.WARNING,
        f"calibration session: repeat {', '.join(steps)}; the page calibration.html says why",
    )


def _saved(calibration: Calibration, file: Path, force: bool) -> Path:
    read_manifest(file.parent).check_free(file.name, force)
    calibration.save(file)
    return file


def write_track(
    result: Track,
    folder: Path,
    evaluation: Evaluation | None = None,
    truth: Track | None = None,
    *,
    progress: Progress = None,
) -> None:
    """Write a track's tables, run.toml and report.html into a folder of `replaced_folder`.

    A report that fails is logged as an error; the track stays.
    """
    result.save(folder)
    try:
        write_report(result, folder / "report.html", evaluation, truth, progress=progress)
    except OSError:  # a full disk is no fault of the report; the folder stays as it was
        raise
    except Exception:
        LOG.exception("the track is written, and has no report")
