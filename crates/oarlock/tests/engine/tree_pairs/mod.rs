//! Joints and hinge axes between two simulated bodies; postures and fields that are seen at rest.

mod bodies;
mod rest;
use crate::hinge_chain::signals;

use bodies::{signals, Bodies, HINGE};
use nalgebra::{Matrix6, Vector3, Vector6};
use oarlock::calibrate::hinge_axes::{hinge_axis, AxisOptions, FoundAxis, NominalAxis};
use oarlock::calibrate::joint_centers::{joint_center, CenterOptions, FoundCenter};
use oarlock::Error;
use signals::{Noise, Readings};

const NOISE: Noise = Noise { gyro: 0.005, accel: 0.05, mag: 0.5 };
/// At 100 Hz and 6 rad/s, interpolating the gyroscope linearly costs 0.1 mm of a lever of 0.2 m.
const SAMPLING_M: f64 = 3e-4;
/// Seven standard deviations: no seed of a normal error gets there.
const SIGMAS: f64 = 7.0;
const NOWHERE: [[f64; 3]; 2] = [[0.0; 3]; 2];

fn center(read: &[Readings; 2], expected: [[f64; 3]; 2]) -> FoundCenter {
    joint_center(
        [&signals("one", &read[0]), &signals("two", &read[1])],
        expected,
        &CenterOptions::default(),
        &mut || true,
    )
    .expect("the recording is a good one")
}

/// Mounts of which nothing is known.
const ANYHOW: NominalAxis = NominalAxis { axes: [[1.0, 0.0, 0.0]; 2], std_rad: [std::f64::consts::FRAC_PI_2; 2] };

fn axis(read: &[Readings; 2], nominal: &NominalAxis) -> FoundAxis {
    hinge_axis([&signals("one", &read[0]), &signals("two", &read[1])], nominal, &AxisOptions::default(), &mut || true)
        .expect("the recording is a good one")
}

fn both(first: [f64; 3], second: [f64; 3]) -> Vector6<f64> {
    let (a, b) = (first, second);
    Vector6::new(a[0], a[1], a[2], b[0], b[1], b[2])
}

fn error(found: &FoundCenter, bodies: &Bodies) -> Vector6<f64> {
    let [first, second] = bodies.levers();
    both(found.first_m, found.second_m) - both(first.into(), second.into())
}

#[test]
fn a_ball_joint_is_found_however_the_units_are_turned() {
    for seed in 0..5 {
        let bodies = Bodies::ball(seed);
        let found = center(&bodies.read(40.0, Noise::default(), seed), NOWHERE);
        assert!(error(&found, &bodies).amax() < SAMPLING_M, "{:?}", error(&found, &bodies));
        assert!(found.loose.is_empty());
    }
}

#[test]
fn errors_agree_with_the_standard_deviations() {
    let mut squares = 0.0;
    for seed in 0..12 {
        let bodies = Bodies::ball(seed).with_biases(seed + 50, 0.005, 0.1);
        let found = center(&bodies.read(40.0, NOISE, seed), NOWHERE);
        let covariance = Matrix6::from_fn(|i, j| found.covariance_m2[i][j]);
        let e = error(&found, &bodies);
        squares += e.dot(&(covariance.try_inverse().expect("no direction is exact") * e)) / 6.0;
        assert!(e.amax() < 0.005, "{e:?}");
        // The accelerometer's noise averaged over 0.2 s of both units, and little more.
        assert!(found.residual_m_s2 < 0.04, "{}", found.residual_m_s2);
    }
    // NEES: 1 on average where the noise is all there is; a residual that counts once a second errs on the safe side.
    assert!((0.05..3.0).contains(&(squares / 12.0)), "{}", squares / 12.0);
}

#[test]
fn a_hinge_is_loose_along_its_axis_and_nowhere_else() {
    let bodies = Bodies::hinge(3);
    let along = both(bodies.hinge_in_sensor(0).into(), bodies.hinge_in_sensor(1).into()).normalize();
    let [first, second] = bodies.levers();
    for (shift, noise) in [(0.0, Noise::default()), (0.1, Noise::default()), (0.1, NOISE)] {
        let expected = [first + bodies.hinge_in_sensor(0) * shift, second + bodies.hinge_in_sensor(1) * shift];
        let found = center(&bodies.read(40.0, noise, 1), expected.map(Into::into));
        assert_eq!(found.loose.len(), 1);
        let loose = both(found.loose[0].first, found.loose[0].second);
        assert!(loose.dot(&along).abs() > 0.99, "{loose:?} {along:?}");
        let e = error(&found, &bodies);
        // Errors of the turning itself, by noise or sampling, hold the free direction a little.
        let (moved, std) = (e.dot(&along) - shift * 2.0_f64.sqrt(), found.loose[0].std_m);
        assert!(moved.abs() < 3.0 * std, "{moved} of {std}");
        assert!((e - along * e.dot(&along)).amax() < 0.002, "{e:?}");
    }
}

#[test]
fn a_gyroscopes_noise_is_no_turning() {
    let bodies = Bodies::planar(6);
    // The quieter the accelerometers, the more the noise of the gyroscopes seems to tell.
    let found = center(&bodies.read(60.0, Noise { accel: 0.003, ..NOISE }, 2), NOWHERE);
    assert_eq!(found.loose.len(), 2, "{:?}", found.loose);
    let along = [bodies.hinge_in_sensor(0), bodies.hinge_in_sensor(1)];
    let e = error(&found, &bodies);
    for (unit, axis) in along.iter().enumerate() {
        let own = e.fixed_rows::<3>(3 * unit).into_owned();
        assert!((own - axis * own.dot(axis)).amax() < 0.002, "{own:?}");
    }
    assert!(found.loose.iter().all(|l| l.std_m > 0.2), "{:?}", found.loose);
}

#[test]
fn without_motion_nothing_is_claimed() {
    let expected = [[0.1, 0.2, 0.3], [-0.2, 0.0, 0.1]];
    let found = center(&Bodies::resting(1).read(20.0, NOISE, 2), expected);
    assert_eq!(found.loose.len(), 6);
    let moved = both(found.first_m, found.second_m) - both(expected[0], expected[1]);
    assert!(moved.amax() < 3.0 * CenterOptions::default().prior_std_m, "{moved:?}");
    assert!(found.loose.iter().all(|l| l.std_m > 0.1), "{:?}", found.loose);
}

#[test]
fn knocks_do_not_bend_it() {
    let bodies = Bodies::ball(4);
    let mut read = bodies.read(40.0, NOISE, 3);
    for start in (50..3900).step_by(200) {
        for row in &mut read[1].accel[start..start + 10] {
            row[0] += 15.0;
        }
    }
    let found = center(&read, NOWHERE);
    // A fifth of the windows hold a knock; plain least squares is off by 20 mm.
    assert!(error(&found, &bodies).amax() < 0.004, "{:?}", error(&found, &bodies));
}

#[test]
fn a_scale_and_gaps_do_no_harm() {
    let bodies = Bodies::ball(5);
    let mut read = bodies.read(60.0, NOISE, 4);
    read[0].accel.iter_mut().flatten().for_each(|x| *x *= 1.02);
    for start in (300..5500).step_by(500) {
        read[0].gyro[start..start + 40].fill([f64::NAN; 3]);
        read[1].accel[start + 100][1] = f64::NAN;
    }
    let found = center(&read, NOWHERE);
    // Both accelerometers count alike: 1 % either way of a lever of 0.2 m.
    assert!(error(&found, &bodies).amax() < 0.005, "{:?}", error(&found, &bodies));
    assert!(found.used_s < 60.0 - 10.0 * 0.4);
}

#[test]
fn clocks_may_differ() {
    let bodies = Bodies::ball(6);
    let mut read = bodies.read(40.0, Noise::default(), 0);
    let slower = |read: &mut Readings| {
        let third = |k: &usize| k % 3 == 1;
        let rows: Vec<usize> = (0..read.time_s.len()).filter(third).collect();
        read.time_s = rows.iter().map(|&k| read.time_s[k]).collect();
        read.gyro = rows.iter().map(|&k| read.gyro[k]).collect();
        read.accel = rows.iter().map(|&k| read.accel[k]).collect();
    };
    slower(&mut read[1]);
    // Linear between samples 30 ms apart.
    assert!(error(&center(&read, NOWHERE), &bodies).amax() < 0.003);
}

#[test]
fn a_hinge_axis_is_found_in_both_units() {
    for seed in 0..5 {
        let bodies = Bodies::hinge(seed).with_biases(seed + 9, 0.005, 0.1);
        let found = axis(&bodies.read(40.0, NOISE, seed), &ANYHOW);
        let [one, two] = [found.first, found.second].map(Vector3::from);
        let truth = [bodies.hinge_in_sensor(0), bodies.hinge_in_sensor(1)];
        let ends = [one.dot(&truth[0]).signum(), two.dot(&truth[1]).signum()];
        for (k, found_axis) in [one, two].iter().enumerate() {
            let off = (found_axis * ends[k]).angle(&truth[k]);
            assert!(off < SIGMAS * found.std_rad[k] && off < 0.01, "{off} of {:?}", found.std_rad);
        }
        let same = ends[0] * ends[1];
        assert!(same * found.sense > 0.1, "{} with {ends:?} of the {HINGE:?}", found.sense);
    }
}

#[test]
fn a_body_that_does_not_turn_does_not_tell_its_axis() {
    let bodies = Bodies::hinge(2);
    let [_, moving] = bodies.read(30.0, NOISE, 5);
    let [resting, _] = Bodies::resting(2).read(30.0, NOISE, 6);
    let found = axis(&[resting, moving], &ANYHOW);
    assert!(found.std_rad[0] > 0.5, "{:?}", found.std_rad);
}

#[test]
fn bad_recordings_are_refused_by_name() {
    let read = Bodies::ball(1).read(5.0, NOISE, 1);
    let refused = |change: fn(&mut [Readings; 2])| {
        let mut broken = Bodies::ball(1).read(5.0, NOISE, 1);
        change(&mut broken);
        let units = [&signals("one", &broken[0]), &signals("two", &broken[1])];
        joint_center(units, NOWHERE, &CenterOptions::default(), &mut || true).expect_err("it is bad").to_string()
    };
    assert!(refused(|r| r[1].gyro.truncate(9)).contains("`two`: 500 time stamps, 9 rows"));
    assert!(refused(|r| r[0].time_s[3] = 0.0).contains("time does not increase"));
    assert!(refused(|r| r[0].time_s.iter_mut().for_each(|t| *t += 100.0)).contains("one clock"));
    assert!(refused(|r| r[0].accel.fill([f64::NAN; 3])).contains("fewer than 2 complete rows"));
    assert!(refused(|r| (0..500).filter(|k| k % 12 < 6).for_each(|k| r[1].accel[k][2] = f64::NAN))
        .contains("without a gap"));
    let units = [&signals("one", &read[0]), &signals("two", &read[1])];
    let nowhere = joint_center(units, [[f64::NAN; 3]; 2], &CenterOptions::default(), &mut || true);
    assert!(nowhere.expect_err("it is bad").to_string().contains("not finite"));
}

#[test]
fn a_search_stops_on_request() {
    let read = Bodies::ball(1).read(5.0, NOISE, 1);
    let units = [&signals("one", &read[0]), &signals("two", &read[1])];
    let mut left = 3;
    let mut thrice = || {
        left -= 1;
        left > 0
    };
    assert_eq!(joint_center(units, NOWHERE, &CenterOptions::default(), &mut thrice), Err(Error::Stopped));
    assert_eq!(hinge_axis(units, &ANYHOW, &AxisOptions::default(), &mut thrice), Err(Error::Stopped));
    assert_eq!(left, -1, "each ends at the first refusal");
}
