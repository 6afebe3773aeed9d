"""Units that contradict themselves or each other are named with cause and size, within a budget; sound ones are not."""

from collections.abc import Callable
from functools import cache, partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from oarlock import Recording
from oarlock.evaluation.suspects.joint_forces import JointForces
from oarlock.evaluation.suspects.rest_gravity import RestGravity
from oarlock.evaluation.suspects.turning import own_suspect
from oarlock.recording import ImuStream
from oarlock.recording.undetermined_mounts import mount_notes
from walking_body import walk

suspects = partial(oarlock.evaluation.find_suspects, budget_s=600.0)
"""However busy the machine is."""
SEEDS = (11, pytest.param(12, marks=pytest.mark.long))
FROM_S = 14.0

Change = Callable[[ImuStream], ImuStream]


@cache
def arm(seed: int) -> tuple[oarlock.Model, Recording]:
    """Three units on a machine's arm; all joints turn by sums of sines."""
    model, random = oarlock.load_model("arm7"), np.random.default_rng(seed)
    time_s, q = np.arange(0.0, 30.0, 0.01), []
    for _ in model.joint_names:
        frequency_hz, phase_rad = random.uniform(0.1, 0.8, 4), random.uniform(0.0, 6.28, 4)
        waves = (
            0.3 * np.sin(2.0 * np.pi * frequency_hz * time_s[:, None] + phase_rad).sum(axis=1) / np.sqrt(2.0)
        )
        q.append(np.minimum(time_s / 2.0, 1.0) * waves)
    motion = oarlock.simulation.Motion(model.joint_names, time_s, np.column_stack(q))
    return model, oarlock.simulate(model, motion, seed=seed)[1]


def changed(name: str, change: Change) -> Callable[[Recording], Recording]:
    return lambda recording: Recording([change(s) if s.name == name else s for s in recording])


def values(**by: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Change:
    return lambda s: ImuStream(
        s.name,
        s.time_s,
        **{key: by[key](rows, s.time_s) if key in by else rows for key, rows in s.values.items()},
    )


def shifted(by_s: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda s: s.at_rows(slice(None), time_s=by_s(s.time_s))


def turned(angle_deg: float, from_s: float = 0.0) -> Change:
    matrix = Rotation.from_rotvec(np.radians(angle_deg) * np.array([0.6, -0.64, 0.48])).as_matrix()
    turn = lambda rows, t: np.where(t[:, None] >= from_s, rows @ matrix.T, rows)  # noqa: E731
    return values(gyro_rad_s=turn, accel_m_s2=turn, mag_ut=turn)


def exchanged(a: str, b: str) -> Callable[[Recording], Recording]:
    other = {a: b, b: a}
    return lambda recording: Recording(
        [ImuStream(other.get(s.name, s.name), s.time_s, **s.values) for s in recording]
    )


def times(factor: float) -> Change:
    return values(gyro_rad_s=lambda rows, t: factor * rows)


BIAS = np.radians([4.0, -4.0, 4.0])
FAULTS = {
    "late": (changed("hand", shifted(lambda t: t + 0.2)), "clock", {"hand"}, "0.20 s late", (5.0, 90.0)),
    "drifts": (
        changed("forearm", shifted(lambda t: 1.01 * t)),
        "clock",
        {"forearm"},
        "% fast",
        (5.0, 180.0),
    ),
    "exchanged": (
        exchanged("upperarm", "hand"),
        "exchanged",
        {"upperarm", "hand"},
        "exchanged",
        (90.0, 90.0),
    ),
    "gravity": (
        changed("upperarm", values(accel_m_s2=lambda r, t: -r)),
        "sign",
        {"upperarm"},
        "gravity",
        (180.0, 180.0),
    ),
    "mount": (changed("forearm", turned(40.0)), "mount", {"forearm"}, "turned by about", (20.0, 50.0)),
    "slips": (
        changed("forearm", turned(40.0, FROM_S)),
        "mount",
        {"forearm"},
        "begins at about",
        (20.0, 50.0),
    ),
    "accel": (
        changed("forearm", values(accel_m_s2=lambda r, t: r + np.array([1.2, -1.2, 1.0]))),
        "bias",
        {"forearm"},
        "biased by 2",
        (8.0, 15.0),
    ),
    "scale": (changed("hand", times(1.2)), "scale", {"hand"}, "1.20 times", (10.0, 13.0)),
    "twice": (changed("hand", times(np.pi / 180.0)), "unit", {"hand"}, "deg/s twice", (180.0, 180.0)),
    "axis": (
        changed("hand", values(gyro_rad_s=lambda r, t: r * [1, -1, 1])),
        "axes",
        {"hand"},
        "y reversed",
        (90.0, 90.0),
    ),
    "bias": (
        changed("hand", values(gyro_rad_s=lambda r, t: r + 1.5 * BIAS)),
        "bias",
        {"hand"},
        "biased by 10",
        (9.0, 12.0),
    ),
    "step": (
        changed("hand", values(gyro_rad_s=lambda r, t: r + BIAS * (t[:, None] > FROM_S))),
        "bias",
        {"hand"},
        "changes its bias",
        (5.0, 9.0),
    ),
}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_with_its_size(name: str, seed: int) -> None:
    spoil, fault, streams, words, (least_deg, most_deg) = FAULTS[name]
    model, recording = arm(seed)
    first, *others = suspects(model, spoil(recording))
    assert (first.fault, set(first.streams)) == (fault, streams), (first, others)
    assert words in first.message and "by more than their bands" in first.message
    assert least_deg <= np.degrees(first.error_rad) <= most_deg


@pytest.mark.parametrize("seed", SEEDS)
def test_sound_units_agree(seed: int) -> None:
    model, recording = arm(seed)
    assert suspects(model, recording) == ()
    forces = JointForces.of(model, recording, None)
    assert forces is not None and forces.agreeing() == {"upperarm", "forearm", "hand"}


@cache
def chain() -> oarlock.Model:
    """Two links on parallel hinges; one inertial unit, on the second link, and an encoder on the first hinge."""
    links = oarlock.load_model("pendulum3").with_parameters({"l_upper": 0.4})
    links = links.without(sensors=["upper", "middle", "lower"], frames=["lower_link"])
    unit = {"name": "unit", "kind": "imu", "frame": "middle_link", "mount": {"offset": [0.1, 0, 0]}}
    noise = {"gyro_std_rad_s": 0.005, "accel_std_m_s2": 0.03}
    encoder = {"name": "encoder", "kind": "encoder", "joint": "upper_hinge", "std": 0.0035}
    return links.with_tables({"sensor": [{**unit, **noise}, encoder]})


def swing(seed: int, angles_deg: tuple[float, float], frequencies_hz: tuple[float, float]) -> Recording:
    """20 s of the chain, each hinge with one amplitude and frequency."""
    time_s = np.arange(0.0, 20.0, 0.01)
    q = np.radians(angles_deg) * np.sin(2.0 * np.pi * np.array(frequencies_hz) * time_s[:, None])
    motion = oarlock.simulation.Motion(chain().joint_names, time_s, q)
    return oarlock.simulate(chain(), motion, seed=seed)[1]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("angles_deg", [(40.0, 60.0), (20.0, 30.0), (60.0, 80.0), (40.0, 0.0)])
def test_the_acceleration_of_a_swing_is_no_scale(angles_deg: tuple[float, float], seed: int) -> None:
    recording = swing(seed, angles_deg, (0.5, 0.8))
    fault = own_suspect(recording["unit"])
    assert fault is not None and fault[0].fault == "scale", "the unit alone cannot distinguish them"
    assert suspects(chain(), recording) == ()


@pytest.mark.parametrize("factor", [0.5, 1.3, 2.0])
def test_a_scale_is_named_without_a_second_unit(factor: float) -> None:
    recording = changed("unit", times(factor))(swing(0, (40.0, 60.0), (0.1, 0.17)))
    (suspect,) = suspects(chain(), recording)
    assert suspect.fault == "scale" and f"{factor:.1f}" in suspect.message


@pytest.mark.parametrize(("factor", "words"), [(180.0 / np.pi, "in deg/s"), (np.pi / 180.0, "deg/s twice")])
def test_a_wrong_unit_is_named_in_a_swing(factor: float, words: str) -> None:
    recording = changed("unit", times(factor))(swing(0, (40.0, 60.0), (0.5, 0.8)))
    (suspect,) = suspects(chain(), recording)
    assert suspect.fault == "unit" and words in suspect.message


def test_a_search_without_time_says_so() -> None:
    model, recording = arm(11)
    found = oarlock.evaluation.find_suspects(model, FAULTS["late"][0](recording), budget_s=0.0)
    assert [s.fault for s in found] == ["unfinished"] and "0 s" in found[0].message


def test_two_units_that_disagree_and_one_that_is_alone() -> None:
    model, recording = arm(11)
    pair = recording.only(["forearm", "hand"])
    (late,) = suspects(model, FAULTS["late"][0](pair))
    assert late.fault == "clock" and set(late.streams) <= {"forearm", "hand"}
    assert JointForces.of(model, recording.only(["hand"]), None) is None


@pytest.mark.parametrize("seed", [1, 3, 4, 7])
def test_a_unit_whose_heading_is_not_known_is_no_suspect(seed: int) -> None:
    """Its levers point anywhere, and some turns and signs bring the forces together."""
    model, recording = oarlock.load_model("lower_body"), walk(seed).recording
    known = oarlock.calibration.calibrate_sagittal(model, recording)
    assert suspects(model, recording, known) == ()
    (note,) = mount_notes(recording, known)
    assert note.startswith("pelvis: the heading of its mount is not determined (standard deviation 104 deg)")
    assert mount_notes(recording, None) == mount_notes(recording.without("pelvis"), known) == ()


def test_gravity_at_rest_refuses_what_contradicts_it() -> None:
    walked, about_up = walk(3), Rotation.from_rotvec([0.0, np.pi / 2, 0.0])
    model, known = oarlock.load_model("lower_body"), walked.calibration
    gravity = RestGravity.of(model, walked.recording, known)
    unit = Rotation.from_matrix(known.mounts["pelvis"][0])
    tilted = Rotation.from_rotvec([0.2, 0.0, 0.0])
    for change, is_refused in ((about_up, False), (tilted, True), (about_up * tilted, True)):
        matrix = (unit.inv() * change * unit).as_matrix()
        assert gravity.contradicts(("pelvis",), matrix) == is_refused
        assert not gravity.contradicts(("pelvis",), matrix, from_s=5.0), "nobody rests then"
    assert gravity.contradicts(("thigh_r", "thigh_l"), -np.eye(3))
    assert not gravity.contradicts(("pelvis",), None)
    upside_down = changed("pelvis", values(accel_m_s2=lambda rows, t: -rows))(walked.recording)
    assert not RestGravity.of(model, upside_down, known).contradicts(("pelvis",), -np.eye(3))


@pytest.mark.parametrize("length_s", [0.05, 0.4, 1.2, 2.5, 4.0])
def test_short_recordings_are_searched_and_a_lag_that_leaves_nothing_to_compare_explains_nothing(
    length_s: float,
) -> None:
    model, recording = arm(11)
    found = suspects(model, FAULTS["gravity"][0](recording).slice(5.0, 5.0 + length_s))
    assert not {"unfinished", "clock"} & {s.fault for s in found}
