//! Analytic Jacobians against differences of the readings.

use super::mixed::{standing, MIXED};
use super::support::chance::Chance;
use super::support::extended::shipped as whole;
use super::support::tree::{spanned, TREE};
use super::support::{body, model, plain, worse, CHAIN};
use oarlock::body::{Body, Moment};
use oarlock::estimate::{FastSystem, PerturbedStates, Points, System};
use oarlock::kernels::lane::{Lane, LANES};
use std::f64::consts::PI;
use std::path::Path;

/// Of the difference, in units of the state: its fourth order leaves 1e-12 of a reading, rounding 1e-13 of it.
const STEP: f64 = 1e-3;
/// Against the largest entry of its row or the reading itself, whichever is more: a hundred times what the difference leaves.
const SAME_SLOPE: f64 = 1e-10;

/// The shipped models but those of persons, whose left sides and parts only the package makes.
fn shipped() -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../python/oarlock/model/shipped");
    let files = std::fs::read_dir(folder).expect("the models are there").map(|f| f.expect("a file").path());
    let models = files.filter(|f| f.extension().is_some_and(|e| e == "toml"));
    let name = |f: std::path::PathBuf| f.file_stem().expect("a name").to_string_lossy().into_owned();
    let texts = models.map(name).map(|n| (n.clone(), whole(&n)));
    let is_mirrored = |text: &str| text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("mirror"));
    texts.filter(|(_, text)| !is_mirrored(text)).collect()
}

/// Somewhere in the state space: angles and rates of order one, lengths near what the model says.
fn somewhere(body: &Body, chance: &mut Chance) -> (Vec<f64>, Moment) {
    let mut mean: Vec<f64> = (0..body.layout.dim()).map(|_| 0.7 * chance.normal()).collect();
    for ((_, state), nominal) in body.layout.lengths.iter().zip(body.lengths()) {
        mean[*state] = nominal + 0.05 * chance.normal();
    }
    let mut moment = body.moment();
    moment.inputs.iter_mut().for_each(|x| *x = 0.7 * chance.normal());
    moment.active.fill(true);
    moment.needed.fill(true);
    (mean, moment)
}

/// Readings and their derivative by differences of fourth order, two directions at a time.
fn by_differences(body: &Body, mean: &[f64], moment: &Moment) -> (Vec<f64>, Vec<f64>) {
    let (n, m, inputs) = (mean.len(), body.row_count(), body.input_std().len());
    let (width, zero) = (n + inputs, Lane([0.0; LANES]));
    let (mut h, mut jacobian, mut scratch) = (vec![0.0; m], vec![0.0; m * width], body.scratch());
    let mut out = vec![zero; m];
    for first in (0..width).step_by(2) {
        let (mut delta, mut off) = (vec![zero; n], vec![zero; inputs]);
        let columns = first..width.min(first + 2);
        for (column, lane_at) in columns.clone().zip([0, 4]) {
            let (lane, size) = match column.checked_sub(n) {
                None => (&mut delta[column], 1.0),
                Some(k) => (&mut off[k], body.input_std()[k]),
            };
            let steps = [1.0, -1.0, 2.0, -2.0].map(|s| s * STEP * size);
            lane.0[lane_at..lane_at + 4].copy_from_slice(&steps);
        }
        body.readings(moment, &mut scratch, Points { mean, delta: &delta, off: &off }, &mut out);
        for (r, o) in out.iter().enumerate() {
            for column in columns.clone() {
                let at = |i: usize| o.0[4 * (column - first) + i];
                jacobian[r * width + column] = (8.0 * (at(0) - at(1)) - (at(2) - at(3))) / (12.0 * STEP);
            }
        }
    }
    body.readings(moment, &mut scratch, Points { mean, delta: &vec![zero; n], off: &vec![zero; inputs] }, &mut out);
    h.iter_mut().zip(&out).for_each(|(h, o)| *h = o.0[0]);
    (h, jacobian)
}

fn compare(what: &str, body: &Body, seed: u64) {
    let mut chance = Chance::new(seed);
    let mut worst = 0.0_f64;
    let mut scratch = body.scratch();
    for _ in 0..5 {
        let (mean, moment) = somewhere(body, &mut chance);
        let (h, wanted) = by_differences(body, &mean, &moment);
        let width = mean.len() + body.input_std().len();
        // What was there before must not matter.
        let (mut center, mut found) = (vec![f64::NAN; h.len()], vec![f64::NAN; wanted.len()]);
        body.linearise(&moment, &mut scratch, &mean, &mut center, &mut found);
        let names = body.suite.row_names();
        for r in 0..h.len() {
            let row = r * width..(r + 1) * width;
            let size = wanted[row.clone()].iter().fold(h[r].abs().max(1.0), |a, x| a.max(x.abs()));
            assert!((center[r] - h[r]).abs() <= 1e-13 * size, "{what}: {} {} {}", names[r], center[r], h[r]);
            for (c, (found, wanted)) in found[row.clone()].iter().zip(&wanted[row]).enumerate() {
                let gap = (found - wanted).abs() / size;
                worst = worse(worst, gap);
                let state = body.layout.names.get(c).map_or("an input", String::as_str);
                assert!(gap < SAME_SLOPE, "{what}: {} by {state}: {found} instead of {wanted}", names[r]);
            }
        }
    }
    println!("{what}: {} states, {} rows, {worst:.1e}", body.layout.dim(), body.row_count());
}

/// Everything that the model can estimate.
fn all(text: &str) -> Body {
    let model = model(text);
    let own = model.base_accelerations.iter().map(|b| b.name.as_str());
    let estimate: Vec<&str> = own.chain(["gyro_bias", "accel_bias", "lengths", "mounts"]).collect();
    body(&model, &plain(&estimate))
}

#[test]
fn of_all_shipped_models() {
    let models = shipped();
    assert!(models.len() >= 10, "{}", models.len());
    for (seed, (path, text)) in models.iter().enumerate() {
        compare(path, &all(text), seed as u64);
        compare(path, &body(&model(text), &plain(&[])), seed as u64);
    }
}

#[test]
fn of_every_joint_sensor_and_state() {
    for (seed, text) in [MIXED, &standing(), TREE, CHAIN, &spanned()].into_iter().enumerate() {
        compare("all states", &all(text), seed as u64);
    }
    let body = all(MIXED);
    let names = &body.layout.names;
    for part in ["parameters.l_first", "on_b.mount_rx", "azimuth", "float.x", "ball.rz.acceleration", "drift", "heave"]
    {
        assert!(names.iter().any(|n| n == part), "{part}: {names:?}");
    }
    assert_eq!(body.input_std().len(), 2);
}

/// Readings near a mean, computed on the pieces of the tree in their own axes, are those of the whole tree.
#[test]
fn readings_near_a_mean() {
    for (seed, text) in [MIXED, &standing()].into_iter().enumerate() {
        let body = all(text);
        let mut chance = Chance::new(seed as u64);
        let (mean, mut moment) = somewhere(&body, &mut chance);
        moment.moving.fill(true);
        let zero = Lane([0.0; LANES]);
        let mut lanes =
            |n: usize| -> Vec<Lane> { (0..n).map(|_| Lane(std::array::from_fn(|_| 0.3 * chance.normal()))).collect() };
        let (delta, off) = (lanes(mean.len()), lanes(body.input_std().len()));
        let (still, none) = (vec![zero; delta.len()], vec![zero; off.len()]);
        let (mut near, mut plain) = (vec![zero; body.row_count()], vec![zero; body.row_count()]);
        let mut scratch = body.scratch();
        body.readings_at_mean::<false>(
            &moment,
            &mut scratch,
            Points { mean: &mean, delta: &still, off: &none },
            &mut near,
        );
        let points = Points { mean: &mean, delta: &delta, off: &off };
        let all_differ = PerturbedStates { from: 0, inputs: true };
        body.readings_near_mean::<false>(&moment, &mut scratch, points, all_differ, &mut near);
        body.readings(&moment, &mut scratch, points, &mut plain);
        for ((near, plain), name) in near.iter().zip(&plain).zip(body.suite.row_names()) {
            for (a, b) in near.0.iter().zip(&plain.0) {
                assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{name}: {a} instead of {b}");
            }
        }
    }
}

/// Rotation vectors at nothing and near half a turn, where formulas divide by their length.
#[test]
fn at_hard_rotations() {
    let body = all(MIXED);
    let mut chance = Chance::new(9);
    for length in [0.0, 1e-9, 1e-5, 0.999 * PI] {
        let (mut mean, moment) = somewhere(&body, &mut chance);
        let turns = body.layout.turns.iter().map(|(_, slots)| slots.q);
        for q in turns.chain(body.layout.mounts.iter().map(|m| m.1)) {
            mean[q..q + 3].copy_from_slice(&[0.6 * length, 0.0, -0.8 * length]);
        }
        let (_, wanted) = by_differences(&body, &mean, &moment);
        let (mut center, mut found) = (vec![0.0; body.row_count()], vec![0.0; wanted.len()]);
        body.linearise(&moment, &mut body.scratch(), &mean, &mut center, &mut found);
        let gap = found.iter().zip(&wanted).fold(0.0, |w, (a, b)| worse(w, (a - b).abs() / (1.0 + b.abs())));
        println!("rotations of {length}: {gap:.1e}");
        // Readings here reach a hundred, so differences round a hundred times as coarsely as one does.
        assert!(gap < 100.0 * SAME_SLOPE, "{length}: {gap:e}");
    }
}

/// What is not there is not written, and costs nothing.
#[test]
fn silent_sources_are_left_alone() {
    let body = all(MIXED);
    let (mean, mut moment) = somewhere(&body, &mut Chance::new(4));
    moment.active.fill(false);
    moment.active[1] = true;
    moment.needed.fill(false);
    body.suite.mark_frames(1, &mut moment.needed);
    body.tree.mark_ancestors(&mut moment.needed);
    let width = mean.len() + body.input_std().len();
    let (mut center, mut found) = (vec![f64::NAN; body.row_count()], vec![f64::NAN; body.row_count() * width]);
    body.linearise(&moment, &mut body.scratch(), &mean, &mut center, &mut found);
    for (r, x) in center.iter().enumerate() {
        let own = body.suite.sources[1].rows.contains(&r);
        assert_eq!(x.is_nan(), !own);
        assert!(found[r * width..(r + 1) * width].iter().all(|x| x.is_nan() != own));
    }
}
