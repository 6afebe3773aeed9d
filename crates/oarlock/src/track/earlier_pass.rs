//! What a pass over a whole recording found, for the next one: the smoothed course and the average noise. `run` makes it, `step` uses it.

use super::hypothesis::Hypothesis;
use crate::estimate::belief::Belief;

/// A finished pass.
#[derive(Debug, Clone)]
pub(super) struct EarlierPass {
    /// State about which readings are linearised, per sample.
    pub course: Course,
    /// Factors on the noise, which are not learnt again.
    pub levels: NoiseLevels,
    /// Whether the first pass began with several hypotheses.
    pub had_rivals: bool,
}

impl EarlierPass {
    /// Takes the noise levels over into every hypothesis.
    pub fn set_noise(&self, one: &mut Hypothesis) {
        std::iter::once(&mut one.belief).chain(one.rivals.iter_mut().map(|r| &mut r.belief)).for_each(|belief| {
            belief.drive.clone_from(&self.levels.drive);
            (belief.inflation, belief.roughness) = (self.levels.inflation, self.levels.roughness);
        });
    }

    /// Settles hypotheses of the start: moves it to the smoothed posture. Its covariance stays. Any other start keeps its
    /// mean, because readings must count only once.
    pub fn settle_start(&self, one: &mut Hypothesis, pose_states: usize) {
        one.rivals.clear();
        if !self.had_rivals {
            return;
        }
        if let Some(mean) = self.course.at(one.belief.time_s) {
            one.belief.mean[..pose_states].copy_from_slice(&mean[..pose_states]);
        }
    }
}

/// Smoothed states by time.
#[derive(Debug, Clone, Default)]
pub(super) struct Course {
    time_s: Vec<f64>,
    mean: Vec<f64>,
}

impl Course {
    /// Adds a state before all others.
    pub fn precede(&mut self, belief: &Belief) {
        self.time_s.push(belief.time_s);
        self.mean.extend(&belief.mean);
    }

    /// The state of the sample at this time; `None` if there is none.
    pub fn at(&self, time_s: f64) -> Option<&[f64]> {
        // The last state comes first.
        let row = self.time_s.partition_point(|t| *t > time_s);
        let width = self.mean.len() / self.time_s.len().max(1);
        (self.time_s.get(row) == Some(&time_s)).then(|| &self.mean[row * width..(row + 1) * width])
    }
}

/// Factors on the noise that the model gives (variances), as in `Belief`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NoiseLevels {
    drive: Vec<f64>,
    inflation: f64,
    roughness: f64,
}

/// Averages of learnt factors over time. They are geometric, because a factor is learnt in proportion to itself.
#[derive(Debug, Clone, Default)]
pub(super) struct NoiseAverages {
    logs: Vec<f64>,
    total_s: f64,
    last_s: Option<f64>,
}

impl NoiseAverages {
    /// Adds the state estimate of the next sample.
    pub fn take(&mut self, belief: &Belief) {
        let factors = belief.drive.iter().chain([&belief.inflation, &belief.roughness]);
        self.logs.resize(belief.drive.len() + 2, 0.0);
        let lasted_s = belief.time_s - self.last_s.unwrap_or(belief.time_s);
        self.logs.iter_mut().zip(factors).for_each(|(log, factor)| *log += lasted_s * factor.ln());
        (self.total_s, self.last_s) = (self.total_s + lasted_s, Some(belief.time_s));
    }

    /// The averages; `None` before the second state estimate.
    pub fn levels(&self) -> Option<NoiseLevels> {
        let average = |log: &f64| (log / self.total_s).exp();
        let ([inflation, roughness], drive) = self.logs.split_last_chunk().map(|(drive, rest)| (*rest, drive))?;
        (self.total_s > 0.0).then(|| NoiseLevels {
            drive: drive.iter().map(average).collect(),
            inflation: average(&inflation),
            roughness: average(&roughness),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::dense::Square;

    fn belief(time_s: f64, factor: f64) -> Belief {
        Belief {
            time_s,
            mean: vec![time_s, 2.0 * time_s],
            covariance: Square::zeros(0),
            drive: vec![factor, 1.0],
            usual_nis: Vec::new(),
            inflation: factor * factor,
            surprise: 1.0,
            roughness: 1.0,
            leftover: 1.0,
            rejected_since_s: Vec::new(),
        }
    }

    #[test]
    fn a_course_gives_the_state_of_each_sample_and_no_other() {
        let mut course = Course::default();
        [3.0, 2.0, 0.5].iter().for_each(|t| course.precede(&belief(*t, 1.0)));
        assert_eq!(course.at(2.0), Some(&[2.0, 4.0][..]));
        assert_eq!((course.at(0.5), course.at(3.0)), (Some(&[0.5, 1.0][..]), Some(&[3.0, 6.0][..])));
        assert_eq!((course.at(1.0), course.at(4.0), course.at(0.0)), (None, None, None));
    }

    #[test]
    fn averages_weigh_factors_by_time() {
        let mut averages = NoiseAverages::default();
        averages.take(&belief(0.0, 100.0));
        assert_eq!(averages.levels(), None);
        averages.take(&belief(1.0, 2.0));
        averages.take(&belief(4.0, 16.0));
        let levels = averages.levels().unwrap();
        // 2^(1/4) 16^(3/4)
        let expected = 2.0_f64.powf(3.25);
        assert!((levels.drive[0] / expected - 1.0).abs() < 1e-12 && levels.drive[1] == 1.0);
        assert!((levels.inflation / expected.powi(2) - 1.0).abs() < 1e-12 && levels.roughness == 1.0);
    }
}
