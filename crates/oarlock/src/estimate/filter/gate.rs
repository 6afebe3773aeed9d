//! Innovation gate of the filter: which parts of a measurement are used, and the report of each source.

use super::{DirectionTest, Filter, Gate, Info, Measurement, RowGroups, SourceInfo, UpdateSettings, Verdict};
use crate::estimate::belief::Belief;
use crate::estimate::FastSystem;
use crate::kernels::mahalanobis::{self, InnovationBlock, MAX_ROWS};
use crate::kernels::tiles::VECTOR;
use std::ops::Range;

/// Upper quantiles of chi-square at 1e-6 for 1 to 16 degrees of freedom.
const THRESHOLDS: [f64; MAX_ROWS] = [
    23.928, 27.631, 30.665, 33.377, 35.888, 38.258, 40.522, 42.701, 44.811, 46.863, 48.866, 50.825, 52.747, 54.635,
    56.493, 58.324,
];

/// Quantile of the NIS of `rows` readings: a consistent filter exceeds it once in a million.
fn threshold(rows: usize) -> f64 {
    THRESHOLDS[rows.clamp(1, MAX_ROWS) - 1]
}

/// No belief is so wrong that a reading is a million standard deviations off: such a number is no reading.
const ABSURD_NIS: f64 = 1e12;

impl<S: FastSystem> Filter<S> {
    /// Tests every part of the current stage; the rows of a rejected part are taken out of the update.
    pub(super) fn gate_parts(
        &mut self,
        measured: Measurement,
        settings: UpdateSettings,
        belief: &mut Belief,
        info: &mut Info,
    ) {
        let gate = settings.gate;
        let groups = measured.groups;
        (self.rejected_nis, self.rejected_rows) = (0.0, 0);
        self.test_parts(groups);
        for (p, rows) in groups.parts.iter().enumerate() {
            let source = self.part_sources[p];
            if self.stages[source] != self.stage {
                continue;
            }
            let count = self.used[rows.clone()].iter().filter(|&&u| u).count();
            info.parts[p] = Verdict::Missing;
            if count == 0 {
                continue;
            }
            let first = rows.start - groups.sources[source].start;
            let weight = self.weight[rows.start];
            let wrong_direction =
                measured.direction_tests[p].is_some_and(|s| self.is_wrong_direction(source, first, weight, s));
            let (excluded, strict) = (measured.excluded[p] || wrong_direction, measured.strict[p]);
            let slack = if strict { 1.0 } else { gate.slack };
            let since = &mut belief.rejected_since_s[p];
            let patience_s = if strict { gate.strict_patience_s } else { self.patience_s(gate) };
            let patient = since.is_nan() || belief.time_s - *since <= patience_s;
            let nis = self.tested[p];
            let absurd = nis.is_nan() || nis >= ABSURD_NIS;
            let nis = if absurd { ABSURD_NIS } else { nis };
            let beyond = gate.on && nis > slack * threshold(count);
            let outlier = absurd || (beyond && patient);
            if outlier && !excluded {
                self.rejected_nis += nis.min(slack * threshold(count));
                self.rejected_rows += count;
            }
            if excluded || outlier {
                self.used[rows.clone()].fill(false);
                rows.clone().for_each(|r| self.information.reject(r));
            }
            info.parts[p] = match (measured.excluded[p], wrong_direction, outlier) {
                (true, ..) => Verdict::Excluded,
                (_, true, _) => Verdict::WrongDirection,
                (.., true) => Verdict::Outlier,
                _ => Verdict::Accepted,
            };
            let doubted = if strict { (absurd || beyond) && !excluded } else { outlier };
            *since = if doubted { since.min(belief.time_s) } else { f64::NAN };
        }
    }

    /// Whether a part fails its direction test; its rows begin at row `first` of their source.
    fn is_wrong_direction(&self, source: usize, first: usize, weight: f64, direction: DirectionTest) -> bool {
        let block = self.information.innovation_covariance(source);
        let along = direction.along;
        let term = |i: usize, j: usize| along[i] * along[j] * block.at(first + i.min(j), first + i.max(j));
        let all: f64 = (0..3).map(|i| (0..3).map(|j| term(i, j)).sum::<f64>()).sum();
        // S contains the noise, which is 1 here.
        let spread = (all - 1.0).max(0.0).sqrt();
        (direction.off * weight).abs() > (direction.tolerance * weight).max(direction.sigmas * spread)
    }

    /// How long a part may be rejected before it is accepted again, s: three samples at least.
    pub fn patience_s(&self, gate: Gate) -> f64 {
        gate.patience_s.max(3.0 * self.since_s)
    }

    /// NIS of the used rows of some groups, each within one source, into `tested`.
    fn test<'a>(
        &mut self,
        rows: impl ExactSizeIterator<Item = (usize, &'a Range<usize>)> + Clone,
        sources: &[Range<usize>],
    ) {
        let (count, mut found) = (rows.len(), std::mem::take(&mut self.tested));
        let test = |(source, rows): (usize, &Range<usize>)| InnovationBlock {
            covariance: self.information.innovation_covariance(source),
            first: rows.start - sources[source].start,
            y: &self.y[rows.clone()],
            used: &self.used[rows.clone()],
        };
        let on = |&(source, _): &(usize, &Range<usize>)| self.stages[source] == self.stage;
        for (k, tested) in found[..count].chunks_mut(VECTOR).enumerate() {
            if !rows.clone().skip(k * VECTOR).take(VECTOR).any(|one| on(&one)) {
                continue;
            }
            // The last group fills the lanes that are left.
            let four = std::array::from_fn(|i| test(rows.clone().nth((k * VECTOR + i).min(count - 1)).expect("fewer")));
            tested.copy_from_slice(&mahalanobis::nis(self.arch, &four)[..tested.len()]);
        }
        self.tested = found;
    }

    fn test_parts(&mut self, groups: &RowGroups) {
        let sources = std::mem::take(&mut self.part_sources);
        self.test(sources.iter().copied().zip(&groups.parts), &groups.sources);
        self.part_sources = sources;
    }

    pub(super) fn report(&mut self, measured: Measurement, info: &mut Info) {
        let sources = &measured.groups.sources;
        self.test(sources.iter().enumerate(), sources);
        for (s, rows) in sources.iter().enumerate().filter(|(s, _)| self.stages[*s] == self.stage) {
            let there = rows.clone().filter(|&r| !info.innovation[r].is_nan()).count();
            let used = rows.clone().filter(|&r| self.used[r]).count();
            let nis = if used > 0 { self.tested[s] } else { f64::NAN };
            let (missing, rejected) = (rows.len() - there, there - used);
            info.sources[s] = SourceInfo { nis, used: used as u8, rejected: rejected as u8, missing: missing as u8 };
        }
    }

    pub(super) fn report_missing(&mut self, measured: Measurement, info: &mut Info) {
        info.innovation.fill(f64::NAN);
        info.nis = f64::NAN;
        info.inertial = (f64::NAN, 0);
        info.log_likelihood = 0.0;
        info.parts.fill(Verdict::Missing);
        for (source, rows) in info.sources.iter_mut().zip(&measured.groups.sources) {
            *source = SourceInfo { nis: f64::NAN, used: 0, rejected: 0, missing: rows.len() as u8 };
        }
    }
}
