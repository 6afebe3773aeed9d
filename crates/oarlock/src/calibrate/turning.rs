//! Rest and swing of one sensor: bias, up, hinge axis and angle.

use super::chain_sensor::{ChainOptions, ChainSensor};
use super::rest::Rest;
use super::spin_axis::{spin_axis, SpinAxis};
use crate::{Error, Result};
use nalgebra::Vector3;

/// A sensor's rest and its rotation.
pub(crate) struct Turning {
    pub rest: Rest,
    pub spin: SpinAxis,
    /// Time, rate about the axis and angle about it, during the swing.
    pub time_s: Vec<f64>,
    pub rate_rad_s: Vec<f64>,
    angle_rad: Vec<f64>,
}

impl Turning {
    pub fn of(sensor: &ChainSensor, still_s: (f64, f64), options: &ChainOptions) -> Result<Self> {
        let mut turning = Self {
            rest: Rest::of(&sensor.signals(), still_s)?,
            spin: SpinAxis { axis: Vector3::z(), off_axis_share: 0.0, std_rad: 0.0 },
            time_s: Vec::new(),
            rate_rad_s: Vec::new(),
            angle_rad: Vec::new(),
        };
        turning.swing(sensor, options)?;
        Ok(turning)
    }

    fn swing(&mut self, sensor: &ChainSensor, options: &ChainOptions) -> Result<()> {
        let mut rates = Vec::new();
        for (&t, row) in sensor.time_s.iter().zip(sensor.gyro_rad_s) {
            let rate = Vector3::from(*row) - self.rest.bias;
            if sensor.swings_at(t, self.rest.still_s) && rate.iter().all(|x| x.is_finite()) {
                self.time_s.push(t);
                rates.push(rate);
            }
        }
        self.spin = spin_axis(&rates);
        self.rate_rad_s = rates.iter().map(|w| w.dot(&self.spin.axis)).collect();
        self.angle_rad = integrated(&self.time_s, &self.rate_rad_s, self.rest.still_s);
        check_swing(sensor.name, self, options)
    }

    pub fn reverse(&mut self) {
        self.spin.axis = -self.spin.axis;
        self.rate_rad_s.iter_mut().chain(&mut self.angle_rad).for_each(|x| *x = -*x);
    }

    /// Whether the link first rotates by `clear_rad` in the positive sense of the axis.
    pub fn first_turns_positive(&self, clear_rad: f64) -> bool {
        let first = self.angle_rad.iter().find(|a| a.abs() >= clear_rad);
        first.is_none_or(|&a| a > 0.0)
    }

    pub fn range(&self) -> (f64, f64) {
        self.angle_rad.iter().fold((0.0, 0.0), |(lo, hi), &a| (a.min(lo), a.max(hi)))
    }
}

/// Angles by the trapezoidal rule. A still stretch within the swing adds nothing.
fn integrated(time_s: &[f64], rate: &[f64], still_s: (f64, f64)) -> Vec<f64> {
    let mut angle = 0.0;
    let mut angles = Vec::with_capacity(rate.len());
    for k in 0..rate.len() {
        if k > 0 && !(time_s[k - 1] <= still_s.0 && time_s[k] >= still_s.1) {
            angle += 0.5 * (rate[k] + rate[k - 1]) * (time_s[k] - time_s[k - 1]);
        }
        angles.push(angle);
    }
    angles
}

fn check_swing(name: &str, turning: &Turning, options: &ChainOptions) -> Result<()> {
    let (low, high) = turning.range();
    let span = match (turning.time_s.first(), turning.time_s.last()) {
        (Some(start), Some(end)) => format!("between {start:.2} and {end:.2} s"),
        _ => "outside the still stretch (no rows)".to_owned(),
    };
    if (high - low).is_nan() || high - low < options.least_turn_rad {
        return Err(Error::Data(format!(
            "sensor `{name}`: turns by {:.1} deg only {span}, at least {:.1} deg are needed. Swing the chain further",
            (high - low).to_degrees(),
            options.least_turn_rad.to_degrees()
        )));
    }
    if turning.spin.off_axis_share > options.most_off_axis_share {
        return Err(Error::Data(format!(
            "sensor `{name}`: {:.1} % of the gyroscope's energy {span} is off one axis, at most {:.1} % is allowed: \
             this is no swing about one hinge. Swing about the hinge alone, or name the part of the recording where it does",
            100.0 * turning.spin.off_axis_share,
            100.0 * options.most_off_axis_share
        )));
    }
    Ok(())
}
