//! What a pass over a whole recording found, for the next one: the smoothed course, noise, and which readings were rejected. `run` makes it,
//! `step` uses it.

use super::hypothesis::Hypothesis;
use crate::estimate::belief::Belief;
use crate::estimate::filter::Info;
use crate::estimate::System;
use std::sync::Arc;

/// A finished pass.
#[derive(Debug, Clone)]
pub(super) struct EarlierPass {
    /// State about which readings are linearised, and noise, per sample.
    pub course: Arc<Course>,
    /// What the first pass did with each reading.
    pub verdicts: Arc<Verdicts>,
    /// Factors on the process noise of the whole recording.
    pub drive: Arc<Vec<f64>>,
    /// Whether the first pass began with several hypotheses.
    pub had_rivals: bool,
}

impl EarlierPass {
    /// Takes the process noise of the whole recording, and the measurement noise that the first pass had learnt after the sample
    /// at this time.
    pub fn set_noise(&self, belief: &mut Belief) {
        belief.drive.copy_from_slice(&self.drive);
        if let Some(inflation) = self.course.inflation_at(belief.time_s) {
            belief.inflation = inflation;
        }
    }

    /// The states of the course at the ends of a step; `None` if there are none, or if the filter was reset between them.
    pub fn step(&self, from_s: f64, to_s: f64) -> Option<(&[f64], &[f64])> {
        let states = || Some((self.course.at(from_s)?, self.course.at(to_s)?));
        if self.verdicts.is_lost_at(to_s) {
            None
        } else {
            states()
        }
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

/// Which parts of each sample the first pass rejected, and where it was lost. Later passes use the same readings.
#[derive(Debug, Clone, Default)]
pub(super) struct Verdicts {
    time_s: Vec<f64>,
    /// Per sample, one for each part.
    rejected: Vec<bool>,
    lost: Vec<bool>,
}

impl Verdicts {
    /// Adds the next sample.
    pub fn take(&mut self, time_s: f64, info: &Info) {
        self.time_s.push(time_s);
        self.rejected.extend(&info.rejected);
        self.lost.push(info.lost);
    }

    /// Per part of the sample at this time: whether it was rejected. `None` if there was no such sample.
    pub fn rejected_at(&self, time_s: f64) -> Option<&[bool]> {
        let row = self.row(time_s)?;
        let width = self.rejected.len() / self.time_s.len();
        Some(&self.rejected[row * width..(row + 1) * width])
    }

    /// Whether the filter was reset before the sample at this time.
    pub fn is_lost_at(&self, time_s: f64) -> bool {
        self.row(time_s).is_some_and(|row| self.lost[row])
    }

    fn row(&self, time_s: f64) -> Option<usize> {
        self.time_s.binary_search_by(|t| t.total_cmp(&time_s)).ok()
    }
}

/// Smoothed states, and factors on the noise, by time.
#[derive(Debug, Clone, Default)]
pub(super) struct Course {
    time_s: Vec<f64>,
    mean: Vec<f64>,
    /// Factors on the noise of inertial units (variances).
    inflation: Vec<f64>,
}

impl Course {
    /// Adds a state before all others.
    pub fn precede(&mut self, belief: &Belief) {
        self.time_s.push(belief.time_s);
        self.mean.extend(&belief.mean);
        self.inflation.push(belief.inflation);
    }

    /// The state of the sample at this time; `None` if there is none.
    pub fn at(&self, time_s: f64) -> Option<&[f64]> {
        let width = self.mean.len() / self.time_s.len().max(1);
        self.row(time_s).map(|row| &self.mean[row * width..(row + 1) * width])
    }

    /// Halves the way of every state from that of another course over the same samples.
    pub fn halve_step_from<S: System>(&mut self, other: &Course, system: &S) {
        let width = self.mean.len() / self.time_s.len().max(1);
        let mut step = vec![0.0; width];
        for (mean, to) in self.mean.chunks_exact_mut(width).zip(other.mean.chunks_exact(width)) {
            system.difference(to, mean, &mut step);
            step.iter_mut().for_each(|x| *x *= 0.5);
            system.shift(mean, &step);
        }
    }

    fn inflation_at(&self, time_s: f64) -> Option<f64> {
        self.row(time_s).map(|row| self.inflation[row])
    }

    fn row(&self, time_s: f64) -> Option<usize> {
        // The last state comes first.
        let row = self.time_s.partition_point(|t| *t > time_s);
        (self.time_s.get(row) == Some(&time_s)).then_some(row)
    }
}

/// Averages of the learnt factors on the process noise over time. They are geometric, because a factor is learnt in proportion to
/// itself.
#[derive(Debug, Clone, Default)]
pub(super) struct DriveAverages {
    logs: Vec<f64>,
    total_s: f64,
    last_s: Option<f64>,
}

impl DriveAverages {
    /// Adds the state estimate of the next sample.
    pub fn take(&mut self, belief: &Belief) {
        self.logs.resize(belief.drive.len(), 0.0);
        let lasted_s = belief.time_s - self.last_s.unwrap_or(belief.time_s);
        self.logs.iter_mut().zip(&belief.drive).for_each(|(log, factor)| *log += lasted_s * factor.ln());
        (self.total_s, self.last_s) = (self.total_s + lasted_s, Some(belief.time_s));
    }

    /// The averages; `None` before the second state estimate.
    pub fn drive(&self) -> Option<Vec<f64>> {
        (self.total_s > 0.0).then(|| self.logs.iter().map(|log| (log / self.total_s).exp()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::filter::{RowGroups, Verdict};
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
        let mut averages = DriveAverages::default();
        averages.take(&belief(0.0, 100.0));
        assert_eq!(averages.drive(), None);
        averages.take(&belief(1.0, 2.0));
        averages.take(&belief(4.0, 16.0));
        let drive = averages.drive().unwrap();
        // 2^(1/4) 16^(3/4)
        assert!((drive[0] / 2.0_f64.powf(3.25) - 1.0).abs() < 1e-12 && drive[1] == 1.0);
    }

    #[test]
    fn a_later_pass_has_one_process_noise_and_the_measurement_noise_of_each_sample() {
        let mut course = Course::default();
        [3.0, 2.0].iter().for_each(|t| course.precede(&belief(*t, *t)));
        let drive = Arc::new(vec![7.0, 1.0]);
        let earlier = EarlierPass { course: Arc::new(course), verdicts: Arc::default(), drive, had_rivals: false };
        let mut now = belief(2.0, 50.0);
        earlier.set_noise(&mut now);
        assert_eq!((&now.drive[..], now.inflation), (&[7.0, 1.0][..], 4.0));
    }

    #[test]
    fn verdicts_are_found_by_time() {
        let groups = RowGroups { parts: vec![0..3, 3..6], sources: vec![0..3, 3..6], ..RowGroups::default() };
        let mut info = Info::new(&groups, 6);
        let mut verdicts = Verdicts::default();
        let mut take = |time_s, parts: [Verdict; 2], lost: bool| {
            info.parts = parts.to_vec();
            info.note_rejected();
            // The filter uses the axes of a clipped part that are not at the end of the range.
            info.parts[0] = Verdict::Clipped;
            info.lost = lost;
            verdicts.take(time_s, &info);
        };
        take(1.0, [Verdict::Accepted, Verdict::Outlier], false);
        take(2.0, [Verdict::Excluded, Verdict::Missing], true);
        assert_eq!(verdicts.rejected_at(1.0), Some(&[false, true][..]));
        assert_eq!(verdicts.rejected_at(2.0), Some(&[true, false][..]));
        assert_eq!((verdicts.rejected_at(1.5), verdicts.rejected_at(3.0)), (None, None));
        assert_eq!([1.0, 1.5, 2.0].map(|t| verdicts.is_lost_at(t)), [false, false, true]);
    }
}
