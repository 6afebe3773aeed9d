//! Readings of a simulated hinge chain, by numerical differentiation of its poses.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

pub const GRAVITY: f64 = 9.80665;
pub const UP: Vector3<f64> = Vector3::new(0.0, 1.0, 0.0);

/// One hinge with its link and sensor. Vectors in link axes unless named otherwise.
#[derive(Clone)]
pub struct Hinge {
    /// Rotation of the link against the link before it, at angle zero.
    pub parent_from_link: Rotation3<f64>,
    pub axis: Vector3<f64>,
    pub angle: fn(f64) -> f64,
    pub to_next: Vector3<f64>,
    pub sensor: Vector3<f64>,
    pub link_from_sensor: Rotation3<f64>,
    pub gyro_bias: Vector3<f64>,
    pub accel_bias: Vector3<f64>,
    pub mag_offset: Vector3<f64>,
}

/// Standard deviations of white noise per axis.
#[derive(Clone, Copy, Default)]
pub struct Noise {
    pub gyro: f64,
    pub accel: f64,
    pub mag: f64,
}

pub struct Readings {
    pub time_s: Vec<f64>,
    pub gyro: Vec<[f64; 3]>,
    pub accel: Vec<[f64; 3]>,
    pub mag: Vec<[f64; 3]>,
}

/// A link's rotation and its sensor's position in the world.
fn pose(chain: &[Hinge], index: usize, t: f64) -> (Rotation3<f64>, Vector3<f64>) {
    let (mut turn, mut place) = (Rotation3::identity(), Vector3::zeros());
    for (k, hinge) in chain[..=index].iter().enumerate() {
        if k > 0 {
            place += turn * chain[k - 1].to_next;
        }
        let about = Unit::new_normalize(hinge.axis);
        turn = turn * hinge.parent_from_link * Rotation3::from_axis_angle(&about, (hinge.angle)(t));
    }
    (turn, place + turn * chain[index].sensor)
}

pub fn world_from_link(chain: &[Hinge], index: usize, t: f64) -> Rotation3<f64> {
    pose(chain, index, t).0
}

/// What sensor `index` reads at `time_s` in the field `field` (world axes).
pub fn readings(
    chain: &[Hinge],
    index: usize,
    time_s: &[f64],
    field: Vector3<f64>,
    noise: Noise,
    seed: u64,
) -> Readings {
    let hinge = &chain[index];
    let mut white = White::new(seed * 97 + index as u64);
    let mut out = Readings { time_s: time_s.to_vec(), gyro: vec![], accel: vec![], mag: vec![] };
    for &t in time_s {
        let (turn, rate, acceleration) = derivatives(chain, index, t);
        let sensor_from_world = (turn * hinge.link_from_sensor).inverse();
        let gyro = hinge.link_from_sensor.inverse() * rate + hinge.gyro_bias;
        let accel = sensor_from_world * (acceleration + GRAVITY * UP) + hinge.accel_bias;
        let mag = sensor_from_world * field + hinge.mag_offset;
        out.gyro.push((gyro + white.vector(noise.gyro)).into());
        out.accel.push((accel + white.vector(noise.accel)).into());
        out.mag.push((mag + white.vector(noise.mag)).into());
    }
    out
}

/// Rotation, angular velocity in link axes, the sensor's acceleration in world axes.
fn derivatives(chain: &[Hinge], index: usize, t: f64) -> (Rotation3<f64>, Vector3<f64>, Vector3<f64>) {
    // Truncation and rounding both stay below 1e-6 rad/s and m/s2.
    const STEP: f64 = 3e-4;
    let [before, here, after] = [-STEP, 0.0, STEP].map(|d| pose(chain, index, t + d));
    let rate = turn_vector((before.0.inverse() * after.0).matrix()) / (2.0 * STEP);
    let acceleration = (after.1 - 2.0 * here.1 + before.1) / (STEP * STEP);
    (here.0, rate, acceleration)
}

/// A seeded source of Gaussian numbers.
pub struct White(u64);

impl White {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x1234_5678_9abc_def1)
    }

    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn gaussian(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    pub fn vector(&mut self, std: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| std * self.gaussian())
    }

    pub fn rotation(&mut self) -> Rotation3<f64> {
        Rotation3::new(self.vector(1.5))
    }
}

/// Turn that takes `truth` to `found`, in the axes that both lead to.
pub fn small_turn(found: &Matrix3<f64>, truth: &Rotation3<f64>) -> Vector3<f64> {
    turn_vector(&(found * truth.inverse().matrix()))
}

/// Rotation vector of a turn below a right angle; unlike the arc cosine of the trace it is exact for small ones.
fn turn_vector(m: &Matrix3<f64>) -> Vector3<f64> {
    let twice = Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12);
    let sine = 0.5 * twice.norm();
    if sine > 0.0 {
        twice * (0.5 * sine.min(1.0).asin() / sine)
    } else {
        twice
    }
}

/// Zero until `t0`, one from `t0 + 1` on, with two smooth derivatives.
pub fn onset(t: f64, t0: f64) -> f64 {
    let s = (t - t0).clamp(0.0, 1.0);
    s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
}
