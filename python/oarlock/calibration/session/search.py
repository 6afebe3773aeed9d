"""Entry point `calibrate_session`: finds the steps, calibrates sensors, encoders and mounts, collects checks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from oarlock.calibration.session.body import BodyKinematics
from oarlock.calibration.session.checks import REDO, Check
from oarlock.calibration.session.encoders import encoder_scales
from oarlock.calibration.session.mount_checks import mount_checks, rest_checks
from oarlock.calibration.session.mounts import Mounts, MountSearch
from oarlock.calibration.session.plan import SessionPlan, default_plan
from oarlock.calibration.session.sensors import SensorSearch
from oarlock.calibration.session.step_summary import missing_steps, step_note
from oarlock.calibration.session.timing import located
from oarlock.calibration.session.unit_rows import Span, UnitRows
from oarlock.calibration.session.world_field import field_checks, field_parameters
from oarlock.calibration.static.worn_model import Worn
from oarlock.recording.calibration import Calibration
from oarlock.recording.corrections import corrected
from oarlock.recording.inertial_units import chosen_units
from oarlock.recording.plausibility import require_plausible
from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import EncoderScale
from oarlock.recording.streams import ImuStream
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress, shown

if TYPE_CHECKING:
    from oarlock._core import Model

SEARCH = "session"
FOUND_AGAIN = (
    "gyro_biases_rad_s",
    "gyro_bias_stds_rad_s",
    "accel_biases_m_s2",
    "accel_scales",
    "mag_matrices",
)


def calibrate_session(
    model: Model,
    recording: Recording,
    plan: SessionPlan | None = None,
    *,
    sensors: Iterable[str] | None = None,
    calibration: Calibration | None = None,
    progress: Progress = None,
) -> Calibration:
    """Calibrate all sensors from one short guided session.

    Intervals at rest give gyroscope biases and, in several attitudes, bias and scale of accelerometers (Ferraris et al.
    1995). Rotation in all directions gives hard and soft iron of magnetometers. Gravity in postures and axes in
    movements give the mounts (Wahba 1965, with full covariances). Marked positions and common movement give zeros,
    scales and signs of encoders.

    Args:
        model: the body. During the session its root is at rest, or is the body's own free joint.
        recording: gyroscope and accelerometer of the units, and magnetometers and scalar streams if available.
        plan: the steps; None takes the protocol that ships with the model. Steps without times are located.
        sensors: names of the units to use; None takes all recorded units of the model.
        calibration: an earlier calibration, such as clocks and lengths; its clocks are applied first.
        progress: True shows that it runs.

    Returns:
        The given calibration with all results and their standard deviations. Values that the session does not determine
        are unchanged. ``noted["session"]`` contains the plan's name, the times of the steps, and the checks: value,
        standard deviation, limit, outcome (`pass`, `redo` or `kept`) and a sentence. `oarlock.report` shows them.

    Raises:
        DataError: the plan does not fit the model or the recording, no unit has gyroscope and accelerometer, or no
            unit is ever at rest.
    """
    plan = default_plan(model) if plan is None else plan
    plan.check(model)
    names = chosen_units(model, recording, sensors, SEARCH)
    before = Calibration() if calibration is None else calibration
    worn = Worn.of(model, before)
    clocked = corrected(recording, Calibration(clocks=before.clocks))
    require_plausible(clocked.only(names))
    units = {name: _rows(clocked[name]) for name in names}
    body = BodyKinematics.of(worn.model, names)
    spans = located(plan, body, units)
    _check_spans(plan, spans, clocked)
    nominal = model.describe()
    described, gravity = {s.name: s for s in nominal.inertial_units}, nominal.world.gravity_m_s2
    searches = {n: SensorSearch.of(unit, plan, spans, gravity) for n, unit in units.items()}
    known = _with_sensors(before, searches)
    rows = {n: s.corrected(known) for n, s in searches.items()}
    with shown(progress, "calibrating"):
        found = MountSearch(body, plan, spans, rows, {n: worn.rotations[n] for n in names}).run()
    encoders, encoder_checks = encoder_scales(plan.steps, spans, clocked)
    parameters = field_parameters(worn.model, searches)
    checks = [
        *missing_steps(plan, spans),
        *(c for n, s in searches.items() for c in s.checks(described[n])),
        *field_checks(worn.model, searches),
        *rest_checks(plan, spans, rows),
        *mount_checks(found, plan, body, worn.rotations),
        *encoder_checks,
    ]
    return _calibrated(known, worn, found, encoders, parameters, plan, spans, checks)


def _rows(stream: object) -> UnitRows:
    assert isinstance(stream, ImuStream)
    rows = UnitRows.of(stream)
    if len(rows.time_s) < 50:
        raise DataError(
            f'{SEARCH}: stream "{stream.name}" has {len(rows.time_s)} complete readings of gyroscope and '
            "accelerometer; a session takes a minute or two. Leave the unit out with sensors, or record again"
        )
    return rows


def _check_spans(plan: SessionPlan, spans: Mapping[str, Span], recording: Recording) -> None:
    for step in plan.steps:
        span = spans.get(step.name)
        if span is not None and (span[1] <= recording.start_s or span[0] >= recording.end_s):
            raise DataError(
                f'plan, step "{step.name}": lasts from {span[0]:.2f} to {span[1]:.2f} s, but the recording from '
                f"{recording.start_s:.2f} to {recording.end_s:.2f} s. Times count on the recording's own axis"
            )
    if not spans:
        raise DataError(
            f'{SEARCH}: none of the steps of "{plan.name}" was found: no unit rests for a second anywhere. '
            "Hold still for three seconds before and after each step, or give start_s and end_s in the plan"
        )


def _with_sensors(before: Calibration, searches: Mapping[str, SensorSearch]) -> Calibration:
    """The calibration with what the units' own sensors need."""
    fields: dict[str, dict[str, Any]] = {
        name: dict(getattr(before, name)) for name in (*FOUND_AGAIN, "mag_offsets_ut")
    }
    for unit, search in searches.items():
        for field, value in search.fields().items():
            fields[field][unit] = value
    return replace(before, **fields)


def _calibrated(
    known: Calibration,
    worn: Worn,
    found: Mounts,
    encoders: Mapping[str, EncoderScale],
    parameters: Mapping[str, float],
    plan: SessionPlan,
    spans: Mapping[str, Span],
    checks: Sequence[Check],
) -> Calibration:
    mounts = {n: (s.link_from_sensor, worn.offsets[n]) for n, s in found.solved.items()}
    noted = {
        "how": "a guided session",
        "session": {
            "plan": plan.name,
            "model": worn.model.name,
            "passed": not any(c.outcome == REDO for c in checks),
            "step": [step_note(step, plan, spans, checks) for step in plan.steps],
            "check": [c.as_dict() for c in checks],
        },
    }
    calibrated = worn.calibrated(mounts, noted, parameters)
    return replace(
        known,
        parameters=calibrated.parameters,
        mounts=calibrated.mounts,
        noted=calibrated.noted,
        parameter_stds=calibrated.parameter_stds,
        mount_stds_rad={**known.mount_stds_rad, **{n: s.std_rad for n, s in found.solved.items()}},
        encoders={**known.encoders, **encoders},
    )
