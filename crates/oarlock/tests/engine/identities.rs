//! Rotations, twists and signals obey the equations that define them.

use crate::support;

use oarlock::body::Body;
use oarlock::kernels::lane::{Lane, Real, LANES};
use oarlock::kinematics::{FrameMotion, JointMotion};
use oarlock::rotation::{Mat3, Vec3};
use oarlock::simulate::{signals, Around, Spot, STENCIL};
use oarlock::track::loops::readings_from;
use support::chance::Chance;
use support::{body, model, numbers, plain, vectors, worse, CHAIN, SCULLER};

/// A few roundings of numbers near one.
const ROUNDING: f64 = 4e-16;
/// Eighth differences 0.5 ms to 4 ms wide of motions of a few rad/s: what is cut off and what is rounded are both far below.
const RATE: f64 = 1e-10;
/// Second differences divide the rounding of a position by the step squared.
const ACCELERATION: f64 = 1e-8;

/// 0, the smallest angles that matter, and round the circle.
fn angles() -> Vec<f64> {
    let small = (0..=6).map(|k| 1e-9 * 10_f64.powi(k));
    let wide = [0.1, 1.0, std::f64::consts::FRAC_PI_2, 3.0, std::f64::consts::PI];
    let up: Vec<f64> = small.chain(wide).collect();
    let down = up.iter().map(|a| -a);
    std::iter::once(0.0).chain(up.clone()).chain(down).collect()
}

fn gap(a: &Mat3<f64>, b: &Mat3<f64>) -> f64 {
    let pairs = a.0.iter().flatten().zip(b.0.iter().flatten());
    pairs.fold(0.0, |worst, (x, y)| worse(worst, (x - y).abs()))
}

#[test]
fn rotations_are_a_group() {
    let about = [Mat3::about_x, Mat3::about_y, Mat3::about_z];
    for (axis, turn) in about.into_iter().enumerate() {
        for a in angles() {
            let r = turn(a);
            let (defect, determinant) = r.rotation_defect();
            assert!(defect <= ROUNDING && (determinant - 1.0).abs() <= ROUNDING, "{axis} {a}");
            assert!(gap(&r.transposed(), &turn(-a)) == 0.0, "{axis} {a}: inverse");
            let mut unit = [0.0; 3];
            unit[axis] = 1.0;
            assert_eq!(r.apply_f64(unit).0, unit, "{axis} {a}: its own axis");
            for b in angles() {
                let sum = gap(&r.times(&turn(b)), &turn(a + b));
                // The sum of two angles is rounded before its sine is taken.
                assert!(sum <= 2.0 * ROUNDING + 1e-16 * (a + b).abs(), "{axis} {a} {b}: {sum:e}");
            }
        }
    }
}

#[test]
fn lanes_turn_as_single_numbers_do() {
    let first = Mat3::about_x(0.3).times(&Mat3::about_y(-1.1));
    for chunk in angles().chunks(LANES) {
        let mut lane: Lane = Lane([0.0; LANES]);
        chunk.iter().enumerate().for_each(|(i, a)| lane.0[i] = *a);
        let (sin, cos) = lane.sin_cos();
        let turned = Mat3(first.0.map(|row| row.map(Lane::splat))).turned_about_z(sin, cos);
        for (i, &a) in chunk.iter().enumerate() {
            let one = Mat3(turned.0.map(|row| row.map(|x| x.0[i])));
            assert!(gap(&one, &first.times(&Mat3::about_z(a))) <= ROUNDING, "{a}");
            let back = one.apply_transposed(one.apply_f64([0.2, -0.5, 0.8]));
            let wanted = [0.2, -0.5, 0.8];
            assert!(back.0.iter().zip(wanted).all(|(x, y)| (x - y).abs() <= ROUNDING), "{a}");
        }
    }
}

/// A motion of all joints with known derivatives: a constant acceleration.
struct Throw {
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
}

impl Throw {
    fn at(&self, t: f64) -> Vec<f64> {
        (0..self.q.len()).map(|j| self.q[j] + t * self.qd[j] + 0.5 * t * t * self.qdd[j]).collect()
    }
}

/// Postures of random joints and those whose angles are tiny or half a turn.
fn throws(joints: usize) -> Vec<Throw> {
    let mut chance = Chance::new(21);
    let mut throws = Vec::new();
    let moves = |q: Vec<f64>, chance: &mut Chance| {
        let (qd, qdd) = (chance.normals(q.len()), chance.normals(q.len()));
        Throw { q, qd: qd.iter().map(|x| 2.0 * x).collect(), qdd: qdd.iter().map(|x| 8.0 * x).collect() }
    };
    for angle in angles() {
        throws.push(moves(vec![angle; joints], &mut chance));
    }
    for _ in 0..20 {
        let q = (0..joints).map(|_| chance.between(-3.2, 3.2)).collect();
        throws.push(moves(q, &mut chance));
    }
    throws
}

fn frames(body: &Body, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<FrameMotion<f64>> {
    let root = FrameMotion::resting(Vec3(body.field.lift));
    let mut frames = vec![root; body.tree.len()];
    let all = vec![true; frames.len()];
    body.tree.motions(root, JointMotion { q, qd, qdd, lengths: &[], anchors: &[] }, &all, &mut frames);
    frames
}

const FIRST: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
const SECOND: [f64; 4] = [8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];

/// First and second derivative at 0 by differences of eighth order.
fn derivatives(f: impl Fn(f64) -> [f64; 3], step: f64) -> [[f64; 3]; 2] {
    let middle = f(0.0);
    let (mut first, mut second) = ([0.0; 3], [0.0; 3]);
    for k in 1..=4 {
        let (after, before) = (f(k as f64 * step), f(-(k as f64) * step));
        for i in 0..3 {
            first[i] += FIRST[k - 1] * (after[i] - before[i]) / step;
            second[i] += SECOND[k - 1] * (after[i] + before[i] - 2.0 * middle[i]) / (step * step);
        }
    }
    [first, second]
}

fn off(found: [f64; 3], wanted: [f64; 3]) -> f64 {
    found.iter().zip(wanted).fold(0.0, |worst, (f, w)| worse(worst, (f - w).abs()))
}

/// Every frame's angular velocity, its derivative and the acceleration of its origin are the derivatives of its pose.
#[test]
fn twists_are_derivatives_of_poses() {
    // A slide on a link that turns feels what the sculler's seat on its still root does not.
    let slide = CHAIN.replacen("[[frame]]", "[[joint]]\nname = \"rail\"\nkind = \"slide\"\n[[frame]]", 1);
    let frame = "[[frame]]\nname = \"sled\"\nparent = \"lower\"\ndh = { a = 0.1, alpha = 0.7, d = 0.2, theta = 0.5 }\n";
    let slide = slide.replacen("[[sensor]]", &format!("{frame}joint = \"rail\"\n[[sensor]]"), 1);
    for text in [SCULLER, &slide] {
        assert_twists(text);
    }
}

fn assert_twists(text: &str) {
    let model = model(text);
    let body = body(&model, &plain(&[]));
    let still = vec![0.0; model.joints.len()];
    let (mut rates, mut turns, mut accelerations) = (0.0, 0.0, 0.0);
    for throw in throws(still.len()) {
        let now = frames(&body, &throw.q, &throw.qd, &throw.qdd);
        let pose = |i: usize, t: f64| frames(&body, &throw.at(t), &still, &still)[i];
        for (i, frame) in now.iter().enumerate().skip(1) {
            let spin = frame.angular_velocity;
            for c in 0..3 {
                let axis = frame.rotation.column(c);
                let [first, second] = derivatives(|t| pose(i, t).rotation.column(c).0, 2e-3);
                rates = worse(rates, off(first, spin.cross(axis).0));
                let bent = frame.angular_acceleration.cross(axis) + spin.cross(spin.cross(axis));
                turns = worse(turns, off(second, bent.0));
            }
            let [_, second] = derivatives(|t| pose(i, t).position.0, 2e-3);
            let force = (Vec3(second) + Vec3(body.field.lift)).0;
            accelerations = worse(accelerations, off(force, frame.proper_acceleration.0));
        }
    }
    println!("twists: spin {rates:.1e} rad/s, its rate {turns:.1e} rad/s2, acceleration {accelerations:.1e} m/s2");
    assert!(rates < RATE && turns < ACCELERATION && accelerations < ACCELERATION);
}

/// The velocity of a point is the Jacobian, column by column from poses, times the joints' rates.
#[test]
fn jacobian_times_rates_is_the_spin() {
    let model = model(SCULLER);
    let body = body(&model, &plain(&[]));
    let still = vec![0.0; 22];
    let mut worst = 0.0;
    for throw in throws(22) {
        let now = frames(&body, &throw.q, &throw.qd, &still);
        let mut turning = vec![[[0.0; 3]; 3]; now.len()];
        for j in 0..22 {
            let bumped = |t: f64| {
                let mut q = throw.q.clone();
                q[j] += t;
                frames(&body, &q, &still, &still)
            };
            for (i, turning) in turning.iter_mut().enumerate() {
                for (c, turning) in turning.iter_mut().enumerate() {
                    let [column, _] = derivatives(|t| bumped(t)[i].rotation.column(c).0, 1e-2);
                    (0..3).for_each(|x| turning[x] += column[x] * throw.qd[j]);
                }
            }
        }
        for (frame, turning) in now.iter().zip(&turning) {
            for (c, turning) in turning.iter().enumerate() {
                let wanted = frame.angular_velocity.cross(frame.rotation.column(c)).0;
                worst = worse(worst, off(*turning, wanted));
            }
        }
    }
    println!("Jacobian times rates: {worst:.1e} rad/s");
    assert!(worst < RATE);
}

/// The simulator differentiates poses, the filter follows the recursion: two ways to the same signals.
#[test]
fn simulator_and_filter_agree_on_signals() {
    let model = model(SCULLER);
    let body = body(&model, &plain(&[]));
    let sensors = vectors("filter_blocks.json")["sensors"].clone();
    let three = |v: &serde_json::Value| -> [f64; 3] { numbers(v).try_into().unwrap() };
    let spot = |s: &serde_json::Value| Spot {
        frame: s["frame"].as_u64().unwrap() as usize,
        rotation: Mat3([0, 1, 2].map(|i| three(&s["R_link_from_sensor"][i]))),
        offset: three(&s["offset_in_link"]),
    };
    let spots: Vec<Spot> = sensors.as_array().unwrap().iter().map(spot).collect();
    let field = body.field.magnetic(0.4);
    let push = [0.3, -0.2, 2.0];
    let around = Around { lift: body.field.lift, magnetic_field: field.0, root_acceleration: push };
    let root = FrameMotion::resting(Vec3(body.field.lift) + Vec3(push));
    let (step, middle) = (2e-3, (STENCIL / 2) as f64);
    let mut worst = 0.0;
    for throw in throws(22) {
        let q: Vec<Vec<f64>> = (0..STENCIL).map(|k| throw.at((k as f64 - middle) * step)).collect();
        let q: [&[f64]; STENCIL] = std::array::from_fn(|k| q[k].as_slice());
        let simulated = signals(&body.tree, &q, step, &around, &spots);
        let predicted = readings_from(&body, root, field, &throw.q, &throw.qd, &throw.qdd);
        for (simulated, predicted) in simulated.iter().flatten().zip(&predicted) {
            worst = worse(worst, (simulated - predicted).abs());
        }
    }
    println!("simulator against filter: {worst:.1e}");
    assert!(worst < ACCELERATION);
}
