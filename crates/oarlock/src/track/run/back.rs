//! Smooths a run backwards from its checkpoints.

use super::super::earlier_pass::{Course, EarlierPass};
use super::super::{diverged, Tracker};
use super::{Progress, Run};
use crate::error::{Error, Result};
use crate::estimate::belief::Belief;
use crate::estimate::smoother::Smoother;
use crate::estimate::transition::Transition;
use std::sync::Arc;

impl Run {
    /// Rauch-Tung-Striebel smoother. Filters again between the checkpoints, from the last to the first, so that only
    /// one stretch at a time is in memory.
    pub fn smooth(&self, progress: Progress) -> Result<Run> {
        self.iterated(1, progress)
    }

    /// As `into_iterated`, beside the filtered estimates.
    pub fn iterated(&self, iterations: usize, progress: Progress) -> Result<Run> {
        self.check_smoothable()?;
        Run { checkpoints: self.checkpoints.clone(), ..self.with(self.series.blank()) }
            .into_iterated(iterations, progress)
    }

    /// Smooths in place of the filtered estimates, which takes half the memory.
    pub fn into_smooth(self, progress: Progress) -> Result<Run> {
        if self.tracker.strapdown.is_some() {
            return self.back_links(progress);
        }
        self.back(&mut |_| {}, progress)
    }

    /// Smooths up to `iterations` times. Each time after the first, the recording is filtered again with readings linearised
    /// about the smoothed states (Bell 1994), with the readings that the first pass accepted and with the noise that it learnt.
    /// Each course is judged by its objective (`track::objective`), which the next filtering finds. Returns the lowest.
    pub fn into_iterated(self, iterations: usize, progress: Progress) -> Result<Run> {
        self.check_smoothable()?;
        if self.tracker.strapdown.is_some() {
            return self.back_links(progress);
        }
        if iterations <= 1 {
            return self.back(&mut |_| {}, progress);
        }
        let all = iterations as f64;
        let (mut best, mut course) = self.with_course(&mut |share| progress(0.5 * share / all))?;
        if best.drive.drive().is_none() {
            return Ok(best);
        }
        let mut follower = best.relinearised(&course, &mut |share| progress(0.5 * (1.0 + share) / all))?;
        for done in 1..iterations {
            let highest = follower.objective;
            let mut part = |share: f64| progress((done as f64 + share) / all);
            let Some(pass) = follower.improved(&course, &mut part)? else { break };
            (best, course, follower) = pass;
            if highest - follower.objective < LEAST_FALL {
                break;
            }
        }
        // The course that it was linearised about is not needed any more.
        best.tracker.earlier = None;
        Ok(best)
    }

    /// Smooths a run that was filtered about `course`, and filters about the result, or about a half or a quarter of the step to it where
    /// the objective does not fall. `None` if none lowers it.
    fn improved(self, course: &Course, progress: Progress) -> Result<Option<(Run, Arc<Course>, Run)>> {
        let highest = self.objective;
        let (mut next, mut further) = self.with_course(&mut |share| progress(0.5 * share))?;
        let mut follower = next.relinearised(&further, &mut |share| progress(0.5 * (1.0 + share)))?;
        for _ in 0..HALVINGS {
            if follower.objective < highest {
                break;
            }
            // The follower shares the course, which is halved in place.
            drop(follower);
            Arc::make_mut(&mut further).halve_step_from(course, next.tracker.body());
            next.take_course(&further);
            follower = next.relinearised(&further, &mut |_| progress(1.0))?;
        }
        Ok((follower.objective < highest).then_some((next, further, follower)))
    }

    /// Replaces the estimates by the states of a course.
    fn take_course(&mut self, course: &Course) {
        let n = self.tracker.body().layout.dim();
        for (time_s, mean) in self.series.time_s.iter().zip(self.series.mean.chunks_exact_mut(n)) {
            course.at(*time_s).into_iter().for_each(|state| mean.copy_from_slice(state));
        }
        for checkpoint in &mut self.checkpoints {
            let time_s = checkpoint.known.time_s();
            course.at(time_s).into_iter().for_each(|state| checkpoint.known.move_to(state));
        }
    }

    /// The smoothed run, with the smoothed states of all samples.
    fn with_course(self, progress: Progress) -> Result<(Run, Arc<Course>)> {
        let mut course = Course::default();
        let run = self.back(&mut |belief| course.precede(belief), progress)?;
        Ok((run, Arc::new(course)))
    }

    /// The recording filtered again about an earlier pass. What became of each reading was decided by the first.
    fn relinearised(&self, course: &Arc<Course>, progress: Progress) -> Result<Run> {
        let (verdicts, had_rivals) = (self.verdicts.clone(), self.started_with_rivals());
        let drive = Arc::new(self.drive.drive().unwrap_or_default());
        let mut next = self.unfiltered();
        next.tracker.follow(EarlierPass { course: course.clone(), verdicts: verdicts.clone(), drive, had_rivals });
        next.filter(progress)?;
        (next.verdicts, next.drive, next.tally) = (verdicts, self.drive.clone(), self.tally.clone());
        next.series.take_reports(&self.series);
        Ok(next)
    }

    fn started_with_rivals(&self) -> bool {
        let begin_s = self.checkpoints.first().map_or(f64::NAN, |c| c.known.time_s());
        self.tracker.followed_rivals() || self.partings.iter().any(|p| p.from_s <= begin_s)
    }

    /// `smoothed` receives the smoothed states from the last to the first.
    fn back(mut self, smoothed: &mut dyn FnMut(&Belief), progress: Progress) -> Result<Run> {
        self.check_smoothable()?;
        let Some(mut next) = self.last.as_ref().map(|known| known.belief.clone()) else {
            return Err(Error::Data("nothing was tracked: nothing to smooth".into()));
        };
        smoothed(&next);
        let mut tracker = self.tracker.clone();
        let (mut smoother, mut stretch) = (Smoother::new(tracker.body().layout.dim()), Stretch::default());
        let all = self.checkpoints.len();
        for k in (0..all).rev() {
            stretch.refilter(&self, &mut tracker, k)?;
            for node in stretch.nodes[..stretch.used].iter_mut().rev() {
                let belief = &mut node.filtered;
                let done = smoother.back(tracker.body(), belief, &node.transition, &node.predicted, &next);
                done.map_err(|lost| diverged(lost, belief.time_s))?;
                if let Some(row) = node.row {
                    self.write_row(row, &belief.mean, |_, variance| belief.variances(variance));
                }
                std::mem::swap(&mut next, belief);
                smoothed(&next);
            }
            self.checkpoints[k].known.replace(&next);
            if !progress(1.0 - k as f64 / all as f64) {
                return Err(Error::Stopped);
            }
        }
        self.smoothed = true;
        Ok(self)
    }

    fn check_smoothable(&self) -> Result<()> {
        if self.smoothed {
            return Err(Error::Data("this track is smoothed already; smooth the filtered one".into()));
        }
        Ok(())
    }
}

/// By how much the objective, squared standard deviations, must fall for a further pass: the states then move by some hundredths of theirs.
const LEAST_FALL: f64 = 1e-3;
/// How often a step is halved that does not lower the objective.
const HALVINGS: usize = 2;

/// A step of a stretch: estimate before, prediction, estimate after prediction.
struct Node {
    filtered: Belief,
    /// Output row of `filtered`.
    row: Option<usize>,
    transition: Transition,
    predicted: Belief,
}

/// The filtered steps between two checkpoints. Unused nodes are reused by the next stretch.
#[derive(Default)]
struct Stretch {
    nodes: Vec<Node>,
    used: usize,
}

impl Stretch {
    /// Follows the final hypothesis.
    fn refilter(&mut self, run: &Run, tracker: &mut Tracker, checkpoint: usize) -> Result<()> {
        let (from, to) = (&run.checkpoints[checkpoint], run.checkpoints.get(checkpoint + 1));
        let stop = to.map(|c| &c.cursor);
        let (mut cursor, mut sample) = (from.cursor.clone(), tracker.empty_sample());
        let mut one = run.proven(&from.known.whole());
        let mut row = from.is_row.then_some(from.row);
        let mut next_row = from.row + usize::from(from.is_row);
        self.used = 0;
        while stop != Some(&cursor) && run.recording.next(&mut cursor, &mut sample) {
            if sample.time_s <= one.belief.time_s {
                continue;
            }
            tracker.entry.correct(&mut sample);
            tracker.learns = !run.partings.iter().any(|p| p.from_s < sample.time_s && sample.time_s <= p.to_s);
            let first = self.used;
            self.begin(&one.belief, row.take());
            tracker.advance(&mut one, &sample, &mut |transition, predicted| {
                if self.used > first {
                    self.go_on();
                }
                self.end(transition, predicted);
            })?;
            if run.partings.iter().any(|p| p.from_s == sample.time_s) {
                tracker.open_bank(&mut one);
                one = run.proven(&one);
            }
            if run.series.time_s.get(next_row) == Some(&sample.time_s) {
                row = Some(next_row);
                next_row += 1;
            }
        }
        Ok(())
    }

    /// A node that starts at a state estimate.
    fn begin(&mut self, filtered: &Belief, row: Option<usize>) {
        match self.nodes.get_mut(self.used) {
            Some(node) => {
                node.filtered.clone_from(filtered);
                node.row = row;
            }
            None => {
                let (filtered, predicted) = (filtered.clone(), filtered.clone());
                self.nodes.push(Node { filtered, row, transition: Transition::default(), predicted });
            }
        }
    }

    /// A node that starts at the end of the last one. Several predictions bridge a gap.
    fn go_on(&mut self) {
        let last = self.nodes[self.used - 1].predicted.clone();
        self.begin(&last, None);
    }

    fn end(&mut self, transition: &Transition, predicted: &Belief) {
        let node = &mut self.nodes[self.used];
        let Transition { blocks, turnings } = transition;
        node.transition.blocks.clone_from(blocks);
        node.transition.turnings.clone_from(turnings);
        node.predicted.clone_from(predicted);
        self.used += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::estimate::System as _;
    use crate::model::Model;
    use crate::recording::{Channel, Stream};
    use crate::sensor::Quantity;
    use crate::track::{run::track, Calibration};

    const BALLS: &str = r#"
format = 1
name = "balls"
joint = [ { name = "trunk", kind = "free" }, { name = "shoulder", kind = "ball" } ]
frame = [
    { name = "trunk", parent = "root", transform = {}, joint = "trunk" },
    { name = "arm", parent = "trunk", transform = { translation = [0, 0, 0.3] }, joint = "shoulder" },
]
sensor = [
    { name = "trunk", kind = "imu", frame = "trunk", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.1 },
    { name = "arm", kind = "imu", frame = "arm", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.1 },
]
world = { up = [0, 0, 1], forward = [1, 0, 0] }
"#;

    /// Of a body that turns and is shaken.
    fn filtered() -> Run {
        let model = Arc::new(Model::from_toml(BALLS, "balls.toml").unwrap());
        let time_s: Vec<f64> = (0..60).map(|k| 0.01 * f64::from(k)).collect();
        let wave = |size: f64, phase: f64| {
            move |t: &f64| {
                [0.0, 1.0, 2.0].map(|k| size * (9.0 * t + phase + 2.0 * k).sin() + if k == 2.0 { size } else { 0.0 })
            }
        };
        let stream = |name: &str, phase: f64| {
            let channel = |quantity, size| {
                let values: Vec<f64> = time_s.iter().flat_map(wave(size, phase)).collect();
                Channel { quantity, values: values.into() }
            };
            let channels = vec![channel(Quantity::Gyro, 3.0), channel(Quantity::Accel, 9.8)];
            Stream { name: name.into(), time_s: time_s.clone().into(), channels }
        };
        let streams = vec![stream("trunk", 0.0), stream("arm", 1.0)];
        let config = Config { belief_interval_s: 0.2, ..Config::default() };
        track(model, streams, &Calibration::default(), &config, None, &mut |_| true).unwrap()
    }

    /// Tangent vectors between two courses, for all rows.
    fn steps(run: &Run, to: &[f64], from: &[f64]) -> Vec<f64> {
        let n = run.tracker.body().layout.dim();
        let mut steps = vec![0.0; to.len()];
        for ((to, from), step) in to.chunks(n).zip(from.chunks(n)).zip(steps.chunks_mut(n)) {
            run.tracker.body().difference(to, from, step);
        }
        steps
    }

    /// Of rotations of up to half a turn, there and back.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn parts_of_a_step_are_parts_of_its_tangent_vectors() {
        let (first, from) = filtered().with_course(&mut |_| true).unwrap();
        let (mut next, to) = first.relinearised(&from, &mut |_| true).unwrap().with_course(&mut |_| true).unwrap();
        let (start, whole) = (first.series.mean.clone(), next.series.mean.clone());
        let all = steps(&next, &whole, &start);
        assert!(all.iter().any(|x| x.abs() > 1e-3), "the courses differ");
        // Step 1 is the new course and step 0 the old one, to the bit.
        for (course, mean) in [(&to, &whole), (&from, &start)] {
            next.take_course(course);
            assert_eq!(&next.series.mean, mean);
            for checkpoint in &next.checkpoints {
                assert_eq!(checkpoint.known.whole().belief.mean, course.at(checkpoint.known.time_s()).unwrap());
            }
        }
        let mut part = (*to).clone();
        for share in [0.5, 0.25] {
            part.halve_step_from(&from, next.tracker.body());
            next.take_course(&part);
            let found = steps(&next, &next.series.mean, &start);
            for (found, all) in found.iter().zip(&all) {
                assert!((found - share * all).abs() < ROUNDING * (1.0 + all.abs()), "{share}: {found} {all}");
            }
        }
    }
}
