//! Random trees of all kinds of joints against products of matrix exponentials and their derivatives.

use super::support::chance::Chance;
use super::support::wave::Wave;
use super::support::{body, plain, so3, worse};
use nalgebra::{Matrix3, Vector3};
use oarlock::body::Body;
use oarlock::kernels::lane::{Lane, LANES};
use oarlock::kinematics::{FrameMotion, JointMotion};
use oarlock::model::Model;
use oarlock::rotation::{Mat3, Vec3};
use std::f64::consts::PI;
use std::fmt::Write;
use std::sync::Arc;

/// Rounding of chains of up to 14 frames and several metres, where the oracle's six squarings cost six bits.
const POSE: f64 = 2e-12;
/// Eighth differences over 2 ms of motions below 2 Hz: what is cut off and what is rounded are both below.
const RATE: f64 = 1e-10;
/// Second differences divide the rounding of a pose by the step squared.
const ACCELERATION: f64 = 2e-8;

const KINDS: [&str; 5] = ["ball", "free", "hinge", "slide", "fixed"];

/// One frame of a random tree, as it is written to the file.
struct Link {
    parent: usize,
    turn: Matrix3<f64>,
    arm: Vector3<f64>,
    joint: Option<usize>,
    axis: Vector3<f64>,
    sign: f64,
}

struct Tree {
    kinds: Vec<&'static str>,
    links: Vec<Link>,
}

impl Tree {
    /// Two joints of every kind but the last, and a few frames more than joints: some share one, some have none.
    fn random(chance: &mut Chance) -> Self {
        let mut kinds: Vec<&str> = KINDS.iter().chain(&KINDS[..4]).copied().collect();
        for i in (1..kinds.len()).rev() {
            kinds.swap(i, (chance.uniform() * (i + 1) as f64) as usize);
        }
        let count = kinds.len();
        let mut links = Vec::new();
        for i in 0..count + 5 {
            let vector = |chance: &mut Chance| Vector3::from_vec(chance.normals(3));
            let shared = || (0..count).find(|&j| kinds[j] == "ball");
            let joint = match i - i.min(count) {
                0 if i < count => Some(i),
                1 | 3 => shared(),
                2 => Some((chance.uniform() * count as f64) as usize),
                _ => None,
            };
            links.push(Link {
                // The later part of the tree, so that chains get long.
                parent: (i as f64 * chance.between(0.4, 1.0)).round() as usize,
                turn: so3::exp(vector(chance)),
                arm: vector(chance) * 0.3,
                joint,
                axis: vector(chance).normalize(),
                sign: if chance.uniform() < 0.5 { -1.0 } else { 1.0 },
            });
        }
        Tree { kinds, links }
    }

    fn turns_freely(&self, joint: usize) -> bool {
        ["ball", "free"].contains(&self.kinds[joint])
    }

    fn text(&self) -> String {
        let mut text = "format = 1\nname = \"tree\"\n[world]\nup = [0, 0, 1]\nforward = [1, 0, 0]\n".to_string();
        for (j, kind) in self.kinds.iter().enumerate() {
            write!(text, "[[joint]]\nname = \"j{j}\"\nkind = \"{kind}\"\n").unwrap();
        }
        let list = |v: &Vector3<f64>| format!("[{:e}, {:e}, {:e}]", v.x, v.y, v.z);
        for (i, link) in self.links.iter().enumerate() {
            let parent = if link.parent == 0 { "root".to_string() } else { format!("f{}", link.parent) };
            let rows = [0, 1, 2].map(|r| list(&link.turn.row(r).transpose())).join(", ");
            let arm = list(&link.arm);
            writeln!(text, "[[frame]]\nname = \"f{}\"\nparent = \"{parent}\"", i + 1).unwrap();
            writeln!(text, "transform = {{ rotation = [{rows}], translation = {arm} }}").unwrap();
            if let Some(j) = link.joint {
                writeln!(text, "joint = \"j{j}\"").unwrap();
                if !self.turns_freely(j) {
                    writeln!(text, "axis = {}\nsign = {}", list(&link.axis), link.sign).unwrap();
                }
            }
        }
        text + "[[sensor]]\nname = \"s\"\nkind = \"position\"\nframe = \"f1\"\nstd_m = 1\n"
    }

    /// Rotation and place of every frame, root first.
    fn poses(&self, model: &Model, q: &[f64]) -> Vec<(Matrix3<f64>, Vector3<f64>)> {
        let mut poses = vec![(Matrix3::identity(), Vector3::zeros())];
        for link in &self.links {
            let (r, p) = poses[link.parent];
            let mut pose = (r * link.turn, p + r * link.arm);
            if let Some(j) = link.joint {
                let first = model.joints[j].first;
                match self.kinds[j] {
                    "ball" => pose.0 *= so3::exp(so3::three(q, first)),
                    "free" => {
                        pose.1 += pose.0 * so3::three(q, first);
                        pose.0 *= so3::exp(so3::three(q, first + 3));
                    }
                    "hinge" => pose.0 *= so3::exp(link.axis * link.sign * q[first]),
                    "slide" => pose.1 += pose.0 * link.axis * link.sign * q[first],
                    _ => {}
                }
            }
            poses.push(pose);
        }
        poses
    }
}

/// A random tree as the engine reads it.
fn tree(seed: u64) -> (Tree, Arc<Model>, Body, Chance) {
    let mut chance = Chance::new(seed);
    let tree = Tree::random(&mut chance);
    let model = super::support::model(&tree.text());
    let body = body(&model, &plain(&[]));
    (tree, model, body, chance)
}

fn motions(body: &Body, q: &[f64], qd: &[f64], qdd: &[f64], anchors: &[Mat3<f64>]) -> Vec<FrameMotion<f64>> {
    let root = FrameMotion::resting(Vec3(body.field.lift));
    let mut frames = vec![root; body.tree.len()];
    let all = vec![true; frames.len()];
    body.tree.motions(root, JointMotion { q, qd, qdd, lengths: &[], anchors }, &all, &mut frames);
    frames
}

fn vector(v: Vec3<f64>) -> Vector3<f64> {
    Vector3::from(v.0)
}

fn matrix(m: &Mat3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| m.0[i][j])
}

/// Nothing, the smallest turns that matter, where series end, and round to half a turn and beyond.
fn angles() -> Vec<f64> {
    let small = (0..=7).map(|k| 1e-9 * 10_f64.powi(k));
    let ends = [0.99e-2, 1.01e-2, 1.0, 3.0, PI - 1e-9, PI, PI + 1e-9, 5.0, 2.0 * PI - 1e-7];
    std::iter::once(0.0).chain(small).chain(ends).collect()
}

#[test]
fn poses_are_products_of_exponentials() {
    let mut worst = 0.0;
    for seed in 0..30 {
        let (tree, model, body, mut chance) = tree(seed);
        for angle in angles() {
            let mut q = chance.normals(model.coordinate_count());
            for first in model.joints.iter().filter_map(|j| j.turn()) {
                let axis = Vector3::from_vec(chance.normals(3)).normalize();
                q[first..first + 3].copy_from_slice((axis * angle).as_slice());
            }
            let still = vec![0.0; q.len()];
            let found = motions(&body, &q, &still, &still, &[]);
            for (found, (turn, place)) in found.iter().zip(tree.poses(&model, &q)) {
                worst = worse(worst, (matrix(&found.rotation) - turn).amax());
                worst = worse(worst, (vector(found.position) - place).amax());
                let force = vector(found.proper_acceleration) - Vector3::from(body.field.lift);
                worst = worse(worst, worse(force.amax(), vector(found.angular_velocity).amax()));
            }
        }
    }
    println!("poses of 30 trees: {worst:.1e}");
    assert!(worst < POSE, "{worst:e}");
}

const FIRST: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
const SECOND: [f64; 4] = [8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];

/// Every frame's spin, its derivative, and the velocity and acceleration of its origin, by differences of eighth order of poses that are
/// `step` s apart.
fn differentiate(poses: &[Vec<(Matrix3<f64>, Vector3<f64>)>; 9], i: usize, step: f64) -> [Vector3<f64>; 4] {
    let (turn, place) = poses[4][i];
    let (mut rate, mut bend) = (Matrix3::zeros(), Matrix3::zeros());
    let (mut velocity, mut acceleration) = (Vector3::zeros(), Vector3::zeros());
    for k in 1..=4 {
        let (after, before) = (&poses[4 + k][i], &poses[4 - k][i]);
        rate += (after.0 - before.0) * (FIRST[k - 1] / step);
        bend += (after.0 + before.0 - 2.0 * turn) * (SECOND[k - 1] / (step * step));
        velocity += (after.1 - before.1) * (FIRST[k - 1] / step);
        acceleration += (after.1 + before.1 - 2.0 * place) * (SECOND[k - 1] / (step * step));
    }
    // R' = [w] R and R'' = ([w'] + [w][w]) R, both in root axes.
    let spin = rate * turn.transpose();
    let bent = bend * turn.transpose() - spin * spin;
    let axis = |m: Matrix3<f64>| {
        let odd = (m - m.transpose()) * 0.5;
        Vector3::new(odd[(2, 1)], odd[(0, 2)], odd[(1, 0)])
    };
    [axis(spin), axis(bent), velocity, acceleration]
}

#[test]
fn twists_are_derivatives_of_poses() {
    let (mut rates, mut turns, mut accelerations) = (0.0, 0.0, 0.0);
    let step = 2e-3;
    for seed in 0..20 {
        let (tree, model, body, mut chance) = tree(100 + seed);
        // Some trees swing through half a turn, where the shortest rotation vector would jump.
        let wave = Wave::random(&model, 0.3 + 0.1 * seed as f64, 1.0, &mut chance);
        for t in [0.0, 0.37, 1.9] {
            let now = wave.at(t);
            let found = motions(&body, &now.q, &now.qd, &now.qdd, &[]);
            let around = std::array::from_fn(|k| tree.poses(&model, &wave.at(t + (k as f64 - 4.0) * step).q));
            for (i, found) in found.iter().enumerate() {
                let [spin, change, velocity, acceleration] = differentiate(&around, i, step);
                rates = worse(rates, (vector(found.angular_velocity) - spin).amax());
                rates = worse(rates, (vector(found.velocity) - velocity).amax());
                turns = worse(turns, (vector(found.angular_acceleration) - change).amax());
                let force = acceleration + Vector3::from(body.field.lift);
                accelerations = worse(accelerations, (vector(found.proper_acceleration) - force).amax());
            }
        }
    }
    println!("twists: spin and velocity {rates:.1e} rad/s, m/s, its rate {turns:.1e} rad/s2, acceleration {accelerations:.1e} m/s2");
    assert!(rates < RATE && turns < ACCELERATION && accelerations < ACCELERATION);
}

/// A turn from an anchor is the same as the whole turn from nothing, alone and in every lane.
#[test]
fn anchors_change_nothing() {
    let mut worst = 0.0;
    for seed in 0..20 {
        let (_, model, body, mut chance) = tree(200 + seed);
        for size in angles().into_iter().filter(|&a| a <= PI) {
            let moves: [Vec<f64>; 3] = std::array::from_fn(|_| chance.normals(model.coordinate_count()));
            let [whole, qd, qdd] = moves;
            let mut part = whole.clone();
            let mut anchors = Vec::new();
            for first in model.joints.iter().filter_map(|j| j.turn()) {
                let away = Vector3::from_vec(chance.normals(3)).normalize() * size;
                let anchor = so3::exp(so3::three(&whole, first)) * so3::exp(away).transpose();
                anchors.push(Mat3([0, 1, 2].map(|i| [0, 1, 2].map(|j| anchor[(i, j)]))));
                part[first..first + 3].copy_from_slice(away.as_slice());
            }
            let wanted = motions(&body, &whole, &qd, &qdd, &[]);
            for found in [motions(&body, &part, &qd, &qdd, &anchors), last_lane(&body, [&part, &qd, &qdd], &anchors)] {
                for (found, wanted) in found.iter().zip(&wanted) {
                    worst = worse(worst, (matrix(&found.rotation) - matrix(&wanted.rotation)).amax());
                    let pairs = [
                        (found.position, wanted.position),
                        (found.velocity, wanted.velocity),
                        (found.angular_velocity, wanted.angular_velocity),
                        (found.angular_acceleration, wanted.angular_acceleration),
                        (found.proper_acceleration, wanted.proper_acceleration),
                    ];
                    for (f, w) in pairs {
                        let scale = vector(w).amax().max(1.0);
                        worst = worse(worst, (vector(f) - vector(w)).amax() / scale);
                    }
                }
            }
        }
    }
    println!("anchors: {worst:.1e}");
    assert!(worst < POSE, "{worst:e}");
}

/// The motion of the last lane while the others hold something else.
fn last_lane(body: &Body, [q, qd, qdd]: [&[f64]; 3], anchors: &[Mat3<f64>]) -> Vec<FrameMotion<f64>> {
    let lanes = |v: &[f64]| -> Vec<Lane> {
        let lane = |&x: &f64| Lane(std::array::from_fn(|l| if l + 1 == LANES { x } else { 0.3 * x + l as f64 }));
        v.iter().map(lane).collect()
    };
    let [q, qd, qdd] = [lanes(q), lanes(qd), lanes(qdd)];
    let root = FrameMotion::resting(Vec3::splat(body.field.lift));
    let mut frames = vec![root; body.tree.len()];
    let all = vec![true; frames.len()];
    body.tree.motions(root, JointMotion { q: &q, qd: &qd, qdd: &qdd, lengths: &[], anchors }, &all, &mut frames);
    let vector = |v: Vec3<Lane>| Vec3(v.0.map(|x| x.0[LANES - 1]));
    let one = |f: &FrameMotion<Lane>| FrameMotion {
        rotation: Mat3(f.rotation.0.map(|row| row.map(|x| x.0[LANES - 1]))),
        position: vector(f.position),
        velocity: vector(f.velocity),
        angular_velocity: vector(f.angular_velocity),
        angular_acceleration: vector(f.angular_acceleration),
        proper_acceleration: vector(f.proper_acceleration),
    };
    frames.iter().map(one).collect()
}
