"""Faults of sensors are named from one second of readings, and a sound recording is left alone."""

from collections.abc import Callable
from functools import cache, partial
from math import pi

import numpy as np
import pytest

import oarlock
from exact_recording import sculler
from oarlock import Recording
from oarlock.evaluation.suspects.changes import MIRRORS, PROPER, turns
from oarlock.evaluation.suspects.fit import USUAL
from oarlock.recording import ImuStream, ScalarStream
from oarlock.recording.frozen_signals import clipped_texts, stuck_texts
from oarlock.report import write_page
from oarlock.rowing import FieldEffects, simulate_field

suspects = partial(oarlock.evaluation.find_suspects, budget_s=600.0)
"""However busy the machine is."""
SEEDS = (41, 42, 43)
FROM_S = 1.2
EFFECTS = {41: FieldEffects.misfit(), 42: FieldEffects(), 43: FieldEffects.off()}
UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0])
EARTH_G = 9.80665

Spoil = Callable[[Recording], Recording]


@cache
def second(seed: int) -> Recording:
    """One second of sculling: a wrong wearing, a careful session, or all as modelled."""
    trial = simulate_field(sculler(), EFFECTS[seed], duration_s=2.5, rate_spm=28.0, seed=seed)
    return trial.recording.slice(FROM_S, FROM_S + 1.0)


def exchanged(*names: str) -> Spoil:
    a, b = names
    other = {a: b, b: a}
    return lambda r: Recording([type(s)(other.get(s.name, s.name), s.time_s, **s.values) for s in r])


def times(factor: float, field: str, *names: str) -> Spoil:
    return changed(lambda rows: rows * factor, (field,), *names)


def turned(matrix: np.ndarray, *names: str) -> Spoil:
    return changed(lambda rows: rows @ matrix.T, ("gyro_rad_s", "accel_m_s2", "mag_ut"), *names)


def changed(change: Callable[[np.ndarray], np.ndarray], fields: tuple[str, ...], *names: str) -> Spoil:
    def spoilt(recording: Recording) -> Recording:
        streams = []
        for s in recording:
            values = {n: change(v) if n in fields and s.name in names else v for n, v in s.values.items()}
            streams.append(type(s)(s.name, s.time_s, **values))
        return Recording(streams)

    return spoilt


@cache
def suspected(name: str, seed: int) -> tuple[oarlock.evaluation.Suspect, ...]:
    return suspects(sculler(), ASKED[name][0](second(seed)))


ASKED = {
    "forearms": (exchanged("r_forearm", "l_forearm"), "exchanged", {"r_forearm", "l_forearm"}),
    "degrees": (times(180.0 / pi, "gyro_rad_s", "r_forearm"), "unit", {"r_forearm"}),
    "phi": (times(-1.0, "value", "r_oar_phi"), "sign", {"r_oar_phi"}),
    "upside down": (turned(UPSIDE_DOWN, "r_forearm"), "turned", {"r_forearm"}),
}


QUICK = {("degrees", 42)}
"""The fault that is found first; the others search through more changes."""


@pytest.mark.parametrize(
    ("name", "seed"),
    [
        pytest.param(name, seed, marks=() if (name, seed) in QUICK else pytest.mark.long)
        for name in ASKED
        for seed in SEEDS
    ],
)
def test_a_fault_is_named_from_one_second(name: str, seed: int) -> None:
    _, fault, streams = ASKED[name]
    found = suspected(name, seed)
    assert [(s.fault, set(s.streams)) for s in found] == [(fault, streams)]
    assert found[0].misfit_after <= USUAL < found[0].misfit_before


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sound_second_has_no_suspect(seed: int) -> None:
    assert suspects(sculler(), second(seed)) == ()


@pytest.mark.long
def test_two_faults_are_named_one_after_the_other() -> None:
    phi, forearms = ASKED["phi"][0], ASKED["forearms"][0]
    found = suspects(sculler(), phi(forearms(second(41))))
    assert {s.fault for s in found} == {"sign", "exchanged"}
    assert found[-1].misfit_after <= USUAL


@cache
def arm(seed: int) -> tuple[oarlock.Model, Recording]:
    """A second of an arm that no encoder reads."""
    model = oarlock.load_model("arm7")
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, 1.5, 0.01)
    rate = random.uniform(2.0, 5.0, len(model.joint_names))
    q = 0.3 + 0.4 * np.sin(time_s[:, None] * rate + random.uniform(0.0, 6.0, len(rate)))
    recording = oarlock.simulate(model, oarlock.simulation.Motion(model.joint_names, time_s, q), seed=seed)[1]
    return model, recording.slice(0.2, 1.2)


ARM_FAULTS = {
    "exchanged": (exchanged("upperarm", "hand"), {"upperarm", "hand"}),
    "unit": (times(180.0 / pi, "gyro_rad_s", "forearm"), {"forearm"}),
    "sign": (times(-1.0, "accel_m_s2", "upperarm"), {"upperarm"}),
}


@pytest.mark.parametrize("seed", [*(pytest.param(s, marks=pytest.mark.long) for s in SEEDS[1:]), SEEDS[0]])
@pytest.mark.parametrize("fault", ARM_FAULTS)
def test_an_arm_without_encoders(fault: str, seed: int) -> None:
    model, recording = arm(seed)
    assert suspects(model, recording) == ()
    spoil, streams = ARM_FAULTS[fault]
    found = suspects(model, spoil(recording))
    assert found and (found[0].fault, set(found[0].streams)) == (fault, streams)


def test_what_is_still_cannot_be_told() -> None:
    model = oarlock.load_model("arm7")
    time_s = np.arange(0.0, 1.5, 0.01)
    q = np.full((len(time_s), len(model.joint_names)), 0.2)
    recording = oarlock.simulate(model, oarlock.simulation.Motion(model.joint_names, time_s, q), seed=1)[1]
    assert [s.fault for s in suspects(model, recording)] == ["untold"]


def test_few_samples_tell_nothing() -> None:
    assert suspects(sculler(), second(41).slice(FROM_S, FROM_S + 0.05)) == ()


def test_the_summary_of_a_report_begins_with_suspects(tmp_path) -> None:
    model, recording = arm(SEEDS[0])
    spoilt = ARM_FAULTS["sign"][0](recording)
    notes = (suspect.note for suspect in suspects(model, spoilt))
    track = oarlock.track(model, spoilt).with_notes(*notes)
    assert track.notes[0].startswith("Suspect: accelerometer of upperarm")
    page = write_page(track, tmp_path).read_text(encoding="utf-8")
    lead = page[page.index('class="lead"') :]
    assert lead.index("accelerometer of upperarm looks with the sign of gravity") < lead.index("samples")
    track.save(tmp_path)
    assert oarlock.load_track(tmp_path).notes[0] == track.notes[0]


def test_changes_undo_what_they_name() -> None:
    assert len(PROPER) == 23 and len(MIRRORS) == 6
    recording = second(41)
    for change in turns(["back"]):
        if change.fault == "turned":
            spoilt = turned(np.asarray(change.matrix).T, "back")(recording)
            assert np.array_equal(change.applied(spoilt)["back"].gyro_rad_s, recording["back"].gyro_rad_s)


# --- what one stream alone shows ----------------------------------------------------------------------


def unit(seed: int = 0) -> ImuStream:
    random = np.random.default_rng(seed)
    time_s = np.arange(200) / 100.0
    gyro = 3.0 * np.sin(4.0 * time_s[:, None] + np.arange(3)) + 0.01 * random.standard_normal((200, 3))
    accel = EARTH_G * np.array([0.0, 0.6, 0.8]) + 0.5 * random.standard_normal((200, 3))
    return ImuStream("back", time_s, gyro_rad_s=gyro, accel_m_s2=accel)


def test_a_frozen_axis_is_stuck() -> None:
    gyro = np.array(unit().gyro_rad_s)
    assert stuck_texts(unit(), True) == [] and clipped_texts(unit()) == []
    gyro[60:, 1] = gyro[60, 1]
    (text,) = stuck_texts(
        ImuStream("back", unit().time_s, gyro_rad_s=gyro, accel_m_s2=unit().accel_m_s2), True
    )
    assert "gyro_rad_s looks stuck: y read" in text and "0.60 to 1.99 s" in text


def test_a_frozen_unit_is_stuck_if_others_move() -> None:
    rows = np.tile([0.1, 0.2, 9.7], (200, 1))
    frozen = ImuStream("back", unit().time_s, gyro_rad_s=0.01 * rows, accel_m_s2=rows)
    assert len(stuck_texts(frozen, True)) == 1
    assert stuck_texts(frozen, False) == []


def test_flat_tops_are_clipped_and_the_range_is_guessed() -> None:
    top = np.radians(250.0)
    gyro = np.clip(2.0 * np.array(unit().gyro_rad_s), -top, top)
    (text,) = clipped_texts(ImuStream("back", unit().time_s, gyro_rad_s=gyro))
    assert "a range of 250 deg/s" in text


def test_a_signal_that_rests_at_its_largest_value_is_not_clipped() -> None:
    steps = np.round(np.array(unit().gyro_rad_s), 1)
    assert clipped_texts(ImuStream("back", unit().time_s, gyro_rad_s=steps)) == []


@pytest.mark.long
def test_an_encoder_that_does_not_follow_is_stuck() -> None:
    streams = [
        ScalarStream(s.name, s.time_s, 0 * s.value + 0.4) if s.name == "r_oar_phi" else s for s in second(41)
    ]
    found = suspects(sculler(), Recording(streams))
    assert found and (found[0].fault, found[0].streams) == ("stuck", ("r_oar_phi",))
