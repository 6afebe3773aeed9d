//! What the filter believes at one instant.

use super::System;
use crate::kernels::dense::Square;

/// Time, mean and covariance: the one thing that a step replaces.
#[derive(Debug, PartialEq)]
pub struct Belief {
    /// On the recording's clock, s.
    pub time_s: f64,
    /// State.
    pub mean: Vec<f64>,
    /// In the tangent space at the mean.
    pub covariance: Square,
    /// Per driven coordinate (`System::driven`): how much stronger its driving noise is than the model says (variance).
    pub drive: Vec<f64>,
    /// Per part of the measurement vector: usual size of its innovations, as a factor on what is expected (variance).
    pub usual_nis: Vec<f64>,
    /// How much larger the noise of inertial units is than the model says (variance).
    pub inflation: f64,
    /// Usual size of the innovations of all inertial units together, as a factor on what is expected (variance).
    pub surprise: f64,
    /// How much larger the noise of accelerometers is beyond that (variance), and the usual size of what an update leaves of them, as a
    /// factor on what is expected.
    pub roughness: f64,
    /// See `roughness`.
    pub leftover: f64,
    /// Per source: when it last said anything, NaN if it never did.
    pub seen_s: Vec<f64>,
    /// Per part of the measurement vector: since when it has been rejected without a break, NaN if it is not.
    pub rejected_since_s: Vec<f64>,
    /// Per source: what is remembered of its latest readings to tell rest and faults; `estimate` only keeps it.
    pub memory: Vec<[f64; MEMORY]>,
    /// How far what is only considered may have led astray: its scale, how many numbers there are of each state, to how many of them the scale
    /// applies only beyond 1 (they come first), then those, the shift of the state by one standard deviation of each parameter;
    /// `estimate` only keeps what else follows. Empty if nothing is considered.
    pub doubt: Vec<f64>,
    /// Its number among the hypotheses into which the belief last parted.
    pub line: u64,
    /// Logarithm of its likelihood, against that of the others.
    pub score: f64,
    /// Other hypotheses that are still alive, none of them with rivals of its own.
    pub rivals: Vec<Belief>,
}

/// Numbers remembered of a source.
pub const MEMORY: usize = 35;
/// Most hypotheses into which one parts.
pub const BRANCHES: u64 = 12;

impl Clone for Belief {
    fn clone(&self) -> Self {
        Belief {
            mean: self.mean.clone(),
            covariance: self.covariance.clone(),
            drive: self.drive.clone(),
            usual_nis: self.usual_nis.clone(),
            seen_s: self.seen_s.clone(),
            rejected_since_s: self.rejected_since_s.clone(),
            memory: self.memory.clone(),
            doubt: self.doubt.clone(),
            rivals: self.rivals.clone(),
            ..*self
        }
    }

    /// Into the room that is there: beliefs are copied at every step of a stretch that is filtered again.
    fn clone_from(&mut self, from: &Self) {
        // All fields, so that a new one cannot be forgotten.
        let Belief {
            time_s,
            mean,
            covariance,
            drive,
            usual_nis,
            inflation,
            surprise,
            roughness,
            leftover,
            seen_s,
            rejected_since_s,
            memory,
            doubt,
            line,
            score,
            rivals,
        } = self;
        mean.clone_from(&from.mean);
        covariance.clone_from(&from.covariance);
        drive.clone_from(&from.drive);
        usual_nis.clone_from(&from.usual_nis);
        seen_s.clone_from(&from.seen_s);
        rejected_since_s.clone_from(&from.rejected_since_s);
        memory.clone_from(&from.memory);
        doubt.clone_from(&from.doubt);
        rivals.clone_from(&from.rivals);
        (*time_s, *inflation, *surprise) = (from.time_s, from.inflation, from.surprise);
        (*roughness, *leftover) = (from.roughness, from.leftover);
        (*line, *score) = (from.line, from.score);
    }
}

impl Belief {
    /// The hypothesis `line` alone; this one if there is none of that number.
    pub fn alone(&self, line: u64) -> Belief {
        let chosen = std::iter::once(self).chain(&self.rivals).find(|b| b.line == line);
        Belief { rivals: Vec::new(), ..chosen.unwrap_or(self).clone() }
    }

    /// Variances into `variance`, of noise alone; while there are rivals, those of all together about this one's mean.
    pub fn variances<S: System>(&self, system: &S, variance: &mut [f64]) {
        self.covariance.diagonal(variance);
        if !self.rivals.is_empty() {
            self.mix(system, variance);
        }
        variance.iter_mut().for_each(|x| *x = x.max(0.0));
    }

    /// Variances of noise alone into standard deviations with what is only considered.
    pub fn widen(&self, variance: &mut [f64]) {
        variance.iter_mut().enumerate().for_each(|(i, x)| *x = (*x + self.doubted(i)).sqrt());
    }

    /// Standard deviations into `std`; while there are rivals, those of all together about this one's mean.
    pub fn spread<S: System>(&self, system: &S, std: &mut [f64]) {
        self.variances(system, std);
        self.widen(std);
    }

    /// Standard deviations of this hypothesis alone.
    pub fn own_spread(&self) -> Vec<f64> {
        let mut std = vec![0.0; self.mean.len()];
        self.covariance.diagonal(&mut std);
        std.iter_mut().for_each(|x| *x = x.max(0.0));
        self.widen(&mut std);
        std
    }

    /// Variance of a state by what is only considered.
    pub fn doubted(&self, state: usize) -> f64 {
        let [scale, width, told, ref slopes @ ..] = self.doubt[..] else { return 0.0 };
        let (width, told) = (width as usize, told as usize);
        if scale == 0.0 && told == 0 {
            return 0.0;
        }
        let (told, rest) = slopes[state * width..(state + 1) * width].split_at(told);
        let square = |slopes: &[f64]| slopes.iter().map(|s| s * s).sum::<f64>();
        // What a calibration tells is known no better than it says, whatever the innovations.
        scale.max(1.0).powi(2) * square(told) + scale * scale * square(rest)
    }

    fn mix<S: System>(&self, system: &S, variance: &mut [f64]) {
        let weight = |b: &Belief| (b.score - self.score).min(0.0).exp();
        let total = 1.0 + self.rivals.iter().map(weight).sum::<f64>();
        let mut away = vec![0.0; variance.len()];
        variance.iter_mut().for_each(|v| *v /= total);
        for rival in &self.rivals {
            system.difference(&rival.mean, &self.mean, &mut away);
            let share = weight(rival) / total;
            for (i, (v, d)) in variance.iter_mut().zip(&away).enumerate() {
                *v += share * (rival.covariance.at(i, i) + d * d);
            }
        }
    }
}
