"""Each effect of the field simulator is as strong as it was asked for, measured on signals, truth and markers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from exact_recording import ENCODERS, UNITS, sculler
from field_trial import BETWEEN_SAMPLES, SAME, SEED, SILENT, angle_rad, changed, trial, with_only
from oarlock.rowing import FieldEffects
from oarlock.rowing.field.anatomy import Anatomy
from oarlock.rowing.field.electronics import walk
from oarlock.rowing.field.signals import AmbientFields
from oarlock.rowing.field.skin import rung, swelling, twist


def test_mounts_are_turned_and_moved_by_their_errors():
    field, clean = with_only(mount_error_rad=0.07, mount_offset_m=0.012), trial()
    for sensor in sculler().describe().sensors[:5]:
        rotation, offset = field.calibration.mounts[sensor.name]
        nominal = np.asarray(sensor.mount.rotation)
        assert angle_rad(rotation @ nominal.T) == pytest.approx(0.07, rel=1e-6)
        assert np.linalg.norm(offset - sensor.mount.offset) == pytest.approx(0.012, rel=SAME)
        gyro = clean.recording[sensor.name].gyro_rad_s @ nominal.T @ rotation
        np.testing.assert_allclose(field.recording[sensor.name].gyro_rad_s, gyro, rtol=0, atol=1e-10)


def test_lengths_and_rig_differ_by_their_errors_and_hands_still_hold():
    field = with_only(length_error=0.05, rig_error_m=0.006)
    nominal = sculler().parameters
    for name, value in nominal.items():
        if name == "rail_slope_rad":
            continue
        true = field.calibration.parameters[name]
        off = (
            abs(true / value - 1.0) / 0.05
            if name[2:].split("_")[0] in ("b", "cl", "ua", "fa", "ha")
            else abs(true - value) / 0.006
        )
        assert off == pytest.approx(1.0, rel=1e-6), name
    at = {name: field.markers.position_m[:, k] for k, name in enumerate(field.markers.names)}
    upper = np.linalg.norm(at["r_elbow"] - at["r_shoulder"], axis=1)
    np.testing.assert_allclose(upper, field.calibration.parameters["l_ua_r"], rtol=1e-9)
    gap = np.linalg.norm(
        field.truth.frame_positions("r_hand") - field.truth.frame_positions("r_handle"), axis=1
    )
    assert gap.max() < 1e-6


def test_shoulders_glide_and_the_truth_tells_orientations():
    field = with_only(shoulder_protraction_m=0.02)
    for side in "rl":
        rigid = field.truth.frame_positions(f"{side}_shoulder")
        glide = field.markers.position_m[:, field.markers.names.index(f"{side}_shoulder")] - rigid
        lean = field.truth["trunk"].angle_rad
        forward = np.stack([np.zeros_like(lean), np.sin(lean), np.cos(lean)], axis=1)
        way = np.sum(glide * forward, axis=1)
        np.testing.assert_allclose(glide, way[:, None] * forward, atol=1e-12)
        assert np.abs(way).max() == pytest.approx(0.02, rel=BETWEEN_SAMPLES)
        reach = field.truth["r_oar_phi"].angle_rad
        assert np.corrcoef(way, reach)[0, 1] < -0.8  # forward at the catch, where phi is negative
        # elbows keep their distance, so limbs turn as the angles say
        carried = field.markers.position_m[:, field.markers.names.index(f"{side}_elbow")]
        np.testing.assert_allclose(carried - glide, field.truth.frame_positions(f"{side}_elbow"), atol=1e-12)


def test_a_spine_bends_under_the_back_sensor_only():
    anatomy, offset = Anatomy(sculler().describe()), np.array([-0.05, 0.195, 0.06])
    posture = np.zeros((3, len(anatomy.joint_names)))
    posture[:, anatomy.columns(["trunk"])] = 0.3
    posture[1, anatomy.columns(["spine_bend"])] = 0.2
    posture[2, anatomy.columns(["trunk_twist"])] = 0.1
    rotation, origin = anatomy.bone("r_shoulder", offset, posture)
    share = 1.0 - 0.05 / 0.52  # of the way from hip to shoulders
    assert angle_rad(rotation[0].T @ rotation[1]) == pytest.approx(0.2 * (share - 0.5), rel=1e-9)
    assert angle_rad(rotation[0].T @ rotation[2]) == pytest.approx(0.1 * share, rel=1e-9)
    place = origin + rotation @ offset
    assert 0.001 < np.linalg.norm(place[1] - place[0]) < 0.02
    found = anatomy.poses(posture, ["seat", "r_shoulder", "l_shoulder"])
    middle = 0.5 * (found["r_shoulder"][1] + found["l_shoulder"][1]) - found["seat"][1]
    # an arc of 0.52 m whose chord keeps the trunk's inclination
    lean = np.arctan2(-middle[:, 2], middle[:, 1])
    np.testing.assert_allclose(lean, 0.3, atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(middle, axis=1), 0.52 * np.sinc([0.0, 0.1 / np.pi, 0.0]), rtol=1e-12
    )
    np.testing.assert_allclose(found["r_shoulder"][0][1], found["r_shoulder"][0][0], atol=1e-15)


def test_hands_hold_the_handles_within_the_slip():
    field = with_only(grip_slip_m=0.008, grip_turn_rad=0.07)
    for side in "rl":
        poses = sculler().forward_kinematics(field.truth.q)
        hand, handle = (
            poses[:, list(sculler().frame_names).index(f"{side}_{f}")] for f in ("hand", "handle")
        )
        gap = hand[:, :3, 3] - handle[:, :3, 3]
        slip = np.sum(gap * handle[:, :3, 2], axis=1)
        assert np.linalg.norm(gap - slip[:, None] * handle[:, :3, 2], axis=1).max() < 1e-6  # HANDS_HOLD
        assert np.abs(slip).max() == pytest.approx(0.008, rel=BETWEEN_SAMPLES)
        tilt = np.arccos(np.clip(np.sum(hand[:, :3, 2] * handle[:, :3, 2], axis=1), -1.0, 1.0))
        assert tilt.max() == pytest.approx(0.07, rel=BETWEEN_SAMPLES)


def test_the_hull_rocks_by_its_strengths_and_not_when_it_stands_still():
    asked = (0.005, 0.03, 0.01)
    effects = replace(
        SILENT, hull_pitch_rad=asked[0], hull_roll_rad=asked[1], hull_yaw_rad=asked[2], hull_heave_m=0.02
    )
    afloat, ashore = trial(effects), trial(effects, condition="S-NB")
    assert np.abs(afloat.hull_angles_rad).max(axis=0) == pytest.approx(asked, rel=BETWEEN_SAMPLES)
    assert np.abs(afloat.hull_heave_m).max() == pytest.approx(0.02, rel=BETWEEN_SAMPLES)
    assert not ashore.hull_angles_rad.any() and not ashore.surge_m_s2.any()
    assert changed(ashore, trial(condition="S-NB")) == set()


def test_encoders_are_off_by_zero_and_scale():
    field = with_only(oar_offset_rad=0.005, oar_scale=0.01, seat_offset_m=0.003, seat_scale=0.02)
    for name in ENCODERS:
        scale, offset = np.polyfit(field.truth[name].value, field.recording[name].value, 1)
        asked = (0.003, 0.02) if name == "seat" else (0.005, 0.01)
        assert abs(offset) == pytest.approx(asked[0], rel=1e-6)
        assert abs(scale - 1.0) == pytest.approx(asked[1], rel=1e-6)
        assert field.encoders[name].offset == pytest.approx(offset)


def test_magnetometers_see_iron():
    hard, soft, rail = with_only(hard_iron_ut=3.0), with_only(soft_iron=0.04), with_only(rail_iron_ut=5.0)
    for unit in UNITS:
        clean = trial().recording[unit].mag_ut
        added = hard.recording[unit].mag_ut - clean
        np.testing.assert_allclose(added, np.broadcast_to(added[0], added.shape), atol=1e-12)
        assert np.linalg.norm(added[0]) == pytest.approx(3.0, rel=SAME)
        np.testing.assert_allclose(hard.calibration.mag_offsets_ut[unit], added[0], atol=1e-12)
        gain = np.linalg.lstsq(clean, soft.recording[unit].mag_ut, rcond=None)[0] - np.eye(3)
        assert np.abs(np.linalg.eigvalsh(gain)).max() == pytest.approx(0.04, rel=1e-6)
        assert np.ptp(np.linalg.norm(rail.recording[unit].mag_ut, axis=1)) > 0.02
    # The forearms come nearer to the rail than the back.
    most = {u: np.abs(rail.recording[u].mag_ut - trial().recording[u].mag_ut).max() for u in UNITS}
    assert max(most["r_forearm"], most["l_forearm"]) > most["back"]


def test_the_boats_iron_is_a_dipole_of_the_strength_asked():
    around = AmbientFields.of(sculler().describe().world, replace(SILENT, rail_iron_ut=5.0), SEED)
    moment = around.iron_ut / np.linalg.norm(around.iron_ut)
    fields = [np.linalg.norm(around.iron_field(around.iron_place_m + d * moment)) for d in (0.3, 3.0, 6.0)]
    assert fields[0] == pytest.approx(5.0, rel=SAME)
    assert fields[1] / fields[2] == pytest.approx(8.0, rel=SAME)


def test_biases_and_scales_are_those_asked():
    field = with_only(gyro_bias_rad_s=0.02, accel_bias_m_s2=0.1, gyro_scale=0.01, accel_scale=0.02)
    for unit in UNITS:
        for values, bias, scale in (("gyro_rad_s", 0.02, 0.01), ("accel_m_s2", 0.1, 0.02)):
            for axis in range(3):
                clean = trial().recording[unit].values[values][:, axis]
                gain, offset = np.polyfit(clean, field.recording[unit].values[values][:, axis], 1)
                assert abs(gain - 1.0) == pytest.approx(scale, rel=1e-6)
                assert abs(offset) == pytest.approx(bias, rel=1e-6)


def test_biases_walk():
    time_s = np.linspace(0.0, 60.0, 601)
    ends = np.array([walk(np.random.default_rng(seed), time_s, 0.01)[-1] for seed in range(200)])
    assert ends.std() == pytest.approx(0.01, rel=5.0 / np.sqrt(2.0 * ends.size))  # 5 standard errors
    assert not walk(np.random.default_rng(0), time_s, 0.0).any()


def test_clocks_are_off_by_offset_and_drift():
    field = with_only(clock_offset_s=0.01, clock_drift=1e-3)
    for unit in UNITS:
        clock = field.clocks[unit]
        assert abs(clock.offset_s) == pytest.approx(0.01) and abs(clock.drift) == pytest.approx(1e-3)
        stream, clean = field.recording[unit], trial().recording[unit]
        exact = make_interp_spline(clean.time_s, clean.gyro_rad_s, k=5)
        on_true_time, as_stamped = exact(clock.true(stream.time_s)), exact(stream.time_s)
        inside = slice(20, -20)
        # quintic splines through 8 ms samples
        np.testing.assert_allclose(stream.gyro_rad_s[inside], on_true_time[inside], atol=1e-4)
        assert np.abs(stream.gyro_rad_s - as_stamped)[inside].max() > 0.02
    for name in ENCODERS:
        assert np.array_equal(field.recording[name].time_s, trial().recording[name].time_s)


def test_stamps_jitter_and_stay_in_order():
    field = with_only(clock_jitter_s=0.0008)
    jitter = np.concatenate([field.recording[u].time_s - trial().recording[u].time_s for u in UNITS])
    assert jitter.std() == pytest.approx(0.0008, rel=5.0 / np.sqrt(2.0 * jitter.size))
    rough = with_only(clock_jitter_s=0.1)
    assert min(np.diff(rough.recording[u].time_s).min() for u in UNITS) > 0.0


def test_packets_are_lost_and_one_unit_falls_silent():
    lossy, silent = with_only(packet_loss=0.2), with_only(gap_s=0.7)
    whole = len(trial().recording["back"])
    for unit in UNITS:
        share = 1.0 - len(lossy.recording[unit]) / whole
        assert abs(share - 0.2) < 5.0 * np.sqrt(0.2 * 0.8 / whole)  # 5 standard errors
        kept = np.isin(trial().recording[unit].time_s, lossy.recording[unit].time_s)
        assert np.array_equal(trial().recording[unit].gyro_rad_s[kept], lossy.recording[unit].gyro_rad_s)
    mute = [u for u in UNITS if silent.recording[u].missing_share > 0.0]
    assert len(mute) == 1
    stream = silent.recording[mute[0]]
    gone = stream.time_s[np.isnan(stream.accel_m_s2).all(axis=1)]
    assert np.ptp(gone) == pytest.approx(0.7, abs=0.017)  # two samples
    assert np.isnan(stream.mag_ut).sum() == np.isnan(stream.gyro_rad_s).sum() == 3 * gone.size
    assert all(silent.recording[e].missing_share == 0.0 for e in ENCODERS)


def test_noise_and_range():
    louder = trial(replace(SILENT, noise_factor=3.0))
    usual = trial(FieldEffects.off())
    one, three = (
        t.recording["back"].accel_m_s2 - trial().recording["back"].accel_m_s2 for t in (usual, louder)
    )
    np.testing.assert_allclose(three, 3.0 * one, atol=1e-12)
    cut = with_only(gyro_range_rad_s=1.5, accel_range_m_s2=12.0)
    for unit in UNITS:
        for name, limit in (("gyro_rad_s", 1.5), ("accel_m_s2", 12.0)):
            clean = trial().recording[unit].values[name]
            assert np.array_equal(cut.recording[unit].values[name], np.clip(clean, -limit, limit))


# --- soft tissue ----------------------------------------------------------------------------------------


def test_soft_tissue_lags_swells_and_rings():
    time_s = np.arange(0.0, 2.0, 0.004)
    step = np.where(time_s > 0.5, 1.0, 0.0)[:, None] * np.ones(3)
    followed = rung(time_s, step)[:, 0]
    assert followed[-1] == pytest.approx(1.0, abs=1e-9)
    # a quarter of critical damping overshoots by exp(-pi d / sqrt(1 - d^2)) and rings at 10 sqrt(1 - d^2) Hz
    assert followed.max() == pytest.approx(1.0 + np.exp(-np.pi * 0.25 / np.sqrt(1 - 0.25**2)), rel=0.03)
    peak = time_s[np.argmax(followed)] - 0.5
    assert peak == pytest.approx(0.5 / (10.0 * np.sqrt(1 - 0.25**2)), abs=0.006)


def test_twist_is_the_turn_about_the_limb():
    anatomy = Anatomy(sculler().describe())
    posture = np.zeros((3, len(anatomy.joint_names)))
    posture[1, anatomy.columns(["r_elbow_rotation"])] = 0.6
    posture[2, anatomy.columns(["r_elbow_flexion"])] = 0.6
    found = twist(anatomy, ("r_elbow", "r_wrist"), posture)
    np.testing.assert_allclose(np.abs(found), [[0, 0, 0], [0, 0.6, 0], [0, 0, 0]], atol=1e-12)


def test_the_skin_does_not_follow_a_share_of_the_twist():
    field, clean = with_only(skin_twist=0.3), trial()
    anatomy, truth = Anatomy(sculler().describe()), clean.truth
    posture = np.zeros((len(truth.time_s), len(anatomy.joint_names)))
    posture[:, : truth.q.shape[1]] = truth.q
    for unit, frames in (("r_upperarm", ("r_shoulder", "r_elbow")), ("l_forearm", ("l_elbow", "l_wrist"))):
        apart = field.recording[unit].gyro_rad_s - clean.recording[unit].gyro_rad_s
        link_from_sensor = clean.calibration.mounts[unit][0]
        turns = twist(anatomy, frames, posture)
        axis = turns[0] / np.linalg.norm(turns[0])
        expected = -0.3 * make_interp_spline(truth.time_s, turns @ axis, k=5)(truth.time_s, 1)
        assert np.abs(expected).max() > 0.1
        # rates of the twist come from its values every 8 ms
        along = apart @ link_from_sensor.T @ axis
        np.testing.assert_allclose(along[10:-10], expected[10:-10], atol=2e-3)


def test_wander_has_its_rms():
    field, clean = with_only(skin_wander_rad=0.02), trial()
    for unit in UNITS:
        mag, still = field.recording[unit].mag_ut, clean.recording[unit].mag_ut
        turned = np.linalg.norm(mag - still, axis=1) / 47.0
        # two of three axes turn a direction: sqrt(2) of the rms, more or less where the field lies along one
        assert 0.6 * 0.02 < np.sqrt(np.mean(turned**2)) < 1.7 * 0.02


def test_muscle_lifts_and_tilts_at_a_right_angle():
    anatomy = Anatomy(sculler().describe())
    posture = np.zeros((3, len(anatomy.joint_names)))
    posture[1, anatomy.columns(["r_elbow_flexion"])] = np.pi / 2
    posture[2, anatomy.columns(["r_shoulder_flexion", "l_shoulder_flexion"])] = np.pi / 2
    np.testing.assert_allclose(swelling(anatomy, "r", posture), [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(swelling(anatomy, None, posture)[[0, 1]], 0.0, atol=1e-12)
    assert 0.7 < swelling(anatomy, None, posture)[2] < 1.1
