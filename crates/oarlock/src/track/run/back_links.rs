//! Smooths a run of strapdown links backwards from its checkpoints, as `back` does for trees.

use super::super::hypothesis::Hypothesis;
use super::super::strapdown::{Lack, RowMotion, Strapdown};
use super::super::Tracker;
use super::{Checkpoint, Progress, Run};
use crate::error::{Error, Result};
use crate::estimate::smoother::Backward;
use crate::kernels::dense::Square;
use crate::model::Fixing;
use crate::recording::Recording;
use crate::strapdown::filter::{Means, Node};
use std::sync::mpsc::{sync_channel, Receiver, SyncSender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

/// Rows between two updates: their numbers in the output and what moved them.
type Rows = Vec<(usize, RowMotion)>;

/// The updates between two checkpoints, each with the rows from its beginning on, and the rows after the last update.
struct Stretch {
    checkpoint: usize,
    nodes: Vec<(Node, Rows)>,
    rest: Rows,
    /// Filtered means and covariance at the end.
    end: Option<(Means, Square)>,
    /// The filter at the end.
    strapdown: Strapdown,
}

/// What filtering needs that smoothing does not change but for the checkpoints.
struct Source {
    recording: Arc<Recording>,
    time_s: Vec<f64>,
    checkpoints: Mutex<Vec<Checkpoint>>,
    fixing: Fixing,
}

impl Run {
    /// One thread filters again, the other smooths what it has filtered.
    pub(super) fn back_links(mut self, progress: Progress) -> Result<Run> {
        let Some(last) = self.last.clone() else {
            return Err(Error::Data("nothing was tracked: nothing to smooth".into()));
        };
        let mut tracker = self.tracker.clone();
        tracker.resume_links(&last)?;
        let source = Source {
            recording: self.recording.clone(),
            time_s: self.series.time_s.clone(),
            checkpoints: Mutex::new(std::mem::take(&mut self.checkpoints)),
            fixing: last.links.as_ref().map_or(Fixing::Skin, |links| links.fixing),
        };
        // One stretch waits while another is smoothed: each takes megabytes.
        let (sender, receiver) = sync_channel(0);
        let done = thread::scope(|scope| {
            scope.spawn(|| source.refilter_all(tracker, sender));
            self.smooth_stretches(receiver, &source, last.belief.mean, progress)
        });
        self.checkpoints = source.checkpoints.into_inner().unwrap_or_else(PoisonError::into_inner);
        done?;
        self.smoothed = true;
        Ok(self)
    }

    fn smooth_stretches(
        &mut self,
        stretches: Receiver<Stretch>,
        source: &Source,
        mut near: Vec<f64>,
        progress: Progress,
    ) -> Result<()> {
        let all = source.checkpoints().len();
        let mut backward: Option<Backward> = None;
        let mut next: Option<(Means, Square)> = None;
        for stretch in stretches {
            let Stretch { checkpoint, nodes, rest, end, strapdown } = stretch;
            let Some(filter) = &strapdown.filter else { continue };
            let backward = backward.get_or_insert_with(|| Backward::new(filter.size, &filter.lasting()));
            let (mut smoothed, mut covariance) = match (next.take(), end) {
                (Some(next), _) | (None, Some(next)) => next,
                (None, None) => continue,
            };
            // After the last update of the recording there is nothing to learn from.
            if !rest.is_empty() {
                let filtered = smoothed.clone();
                self.write_links(&strapdown, &rest, (&smoothed, &filtered, &covariance), None, &mut near);
            }
            for (node, rows) in nodes.iter().rev() {
                let (before, spread) = filter.back(backward, node, &smoothed, &covariance)?;
                let lack = Lack::of(filter, node, &before, &smoothed);
                self.write_links(&strapdown, rows, (&before, &node.before, &spread), Some(&lack), &mut near);
                (smoothed, covariance) = (before, spread);
            }
            self.replace_checkpoint(source, checkpoint, &strapdown, (&smoothed, &covariance), &near);
            next = Some((smoothed, covariance));
            if !progress(1.0 - checkpoint as f64 / all as f64) {
                return Err(Error::Stopped);
            }
        }
        Ok(())
    }

    /// Writes rows that begin at smoothed means.
    fn write_links(
        &mut self,
        strapdown: &Strapdown,
        rows: &Rows,
        (smoothed, filtered, covariance): (&Means, &Means, &Square),
        lack: Option<&Lack>,
        near: &mut Vec<f64>,
    ) {
        let mut spread: Option<Square> = None;
        for (row, motion) in rows.iter().rev() {
            let coordinates = strapdown.smoothed(self.tracker.body(), (smoothed, filtered), motion, lack, near);
            let silent = strapdown.silent_covariance(smoothed, motion.silence_s).map(|s| coordinates.covariance(&s));
            let usual = &*spread.get_or_insert_with(|| coordinates.covariance(covariance));
            let spread = silent.as_ref().unwrap_or(usual);
            self.write_row(*row, &coordinates.mean, |_, variance| spread.diagonal(variance));
            let off_axis: Vec<f64> = coordinates.off_axis.concat();
            self.series.off_axis[*row * off_axis.len()..][..off_axis.len()].copy_from_slice(&off_axis);
            *near = coordinates.mean;
        }
    }

    /// The smoothed state estimate at a checkpoint.
    fn replace_checkpoint(
        &self,
        source: &Source,
        k: usize,
        strapdown: &Strapdown,
        (means, covariance): (&Means, &Square),
        near: &[f64],
    ) {
        let mut known = source.known(k);
        let Some(links) = &known.links else { return };
        let signals: Vec<_> = links.state.readings.iter().map(|r| r.at(known.belief.time_s)).collect();
        let coordinates = strapdown.coordinates(self.tracker.body(), means, &signals, near);
        known.belief.covariance = coordinates.covariance(covariance);
        known.belief.mean = coordinates.mean;
        source.checkpoints()[k].known.replace(&known.belief);
    }
}

impl Source {
    fn checkpoints(&self) -> MutexGuard<'_, Vec<Checkpoint>> {
        self.checkpoints.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn known(&self, k: usize) -> Hypothesis {
        self.checkpoints()[k].known.whole()
    }

    /// From the last checkpoint to the first, while somebody receives.
    fn refilter_all(&self, mut tracker: Tracker, sender: SyncSender<Stretch>) {
        let all = self.checkpoints().len();
        for k in (0..all).rev() {
            let stretch = self.refilter(&mut tracker, k);
            if stretch.is_none_or(|stretch| sender.send(stretch).is_err()) {
                break;
            }
        }
    }

    /// Filters again from a checkpoint to the next one, or to the end.
    fn refilter(&self, tracker: &mut Tracker, checkpoint: usize) -> Option<Stretch> {
        let (mut one, mut cursor, mut row, is_row, stop_s) = {
            let checkpoints = self.checkpoints();
            let (from, to) = (&checkpoints[checkpoint], checkpoints.get(checkpoint + 1));
            let stop_s = to.map_or(f64::INFINITY, |c| c.known.time_s());
            (from.known.whole(), from.cursor.clone(), from.row, from.is_row, stop_s)
        };
        one.links.iter_mut().for_each(|links| links.settle(self.fixing));
        let mut sample = tracker.empty_sample();
        let (mut nodes, mut rest): (Vec<(Node, Rows)>, Rows) = (Vec::new(), Rows::new());
        if is_row {
            rest.extend(first_row(&one).map(|motion| (row, motion)));
            row += 1;
        }
        let mut is_end = false;
        loop {
            let mut updates = Vec::new();
            match tracker.process_one(&mut one, is_end, &mut |node| updates.push(node), true) {
                Some((sample, motion)) => {
                    for node in updates {
                        nodes.push((node, std::mem::take(&mut rest)));
                    }
                    if sample.time_s >= stop_s {
                        break;
                    }
                    if self.time_s.get(row) == Some(&sample.time_s) {
                        rest.extend(motion.map(|motion| (row, motion)));
                        row += 1;
                    }
                }
                None if is_end => break,
                None if self.recording.next(&mut cursor, &mut sample) => {
                    tracker.entry.correct(&mut sample);
                    if one.links.as_ref().is_some_and(|links| sample.time_s > links.taken_s()) {
                        tracker.take_readings(&mut one, &sample);
                    }
                }
                None => is_end = true,
            }
        }
        if stop_s.is_finite() {
            // The next checkpoint has the rows from its own time on.
            rest.clear();
        }
        let end = one.links.map(|links| (links.state.means, links.state.covariance));
        Some(Stretch { checkpoint, nodes, rest, end, strapdown: tracker.strapdown.clone()? })
    }
}

/// The row of a checkpoint, which stands at an update.
fn first_row(one: &Hypothesis) -> Option<RowMotion> {
    let state = &one.links.as_ref()?.state;
    let time_s = one.belief.time_s;
    let signals = state.readings.iter().map(|r| r.at(time_s)).collect();
    let inputs = state.means.inputs.clone();
    Some(RowMotion { time_s, increments: state.increments.clone(), signals, inputs, silence_s: 0.0 })
}

#[cfg(test)]
mod tests {
    use crate::config::Config;
    use crate::model::Model;
    use crate::recording::{Channel, Stream};
    use crate::sensor::Quantity;
    use crate::strapdown::covariance::UNIT;
    use crate::track::{run::track, Calibration};
    use nalgebra::{DMatrix, DVector};
    use std::sync::Arc;

    const ARM: &str = r#"
format = 1
name = "arm"
structure = "strapdown"
links = { joints = "bone" }
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

    #[test]
    fn information_on_a_turn_of_everything_about_the_vertical_never_rises() {
        let model = Arc::new(Model::from_toml(ARM, "arm.toml").unwrap());
        let time_s: Vec<f64> = (0..600).map(|k| 0.01 * f64::from(k)).collect();
        let stream = |name: &str, phase: f64| {
            let channel = |quantity, size: f64, lift: f64| {
                let wave = |t: f64, k: f64| size * (9.0 * t + phase + 2.0 * k).sin();
                let values: Vec<f64> =
                    time_s.iter().flat_map(|t| [wave(*t, 0.0), wave(*t, 1.0), wave(*t, 2.0) + lift]).collect();
                Channel { quantity, values: values.into() }
            };
            let channels = vec![channel(Quantity::Gyro, 3.0, 0.3), channel(Quantity::Accel, 5.0, 9.8)];
            Stream { name: name.into(), time_s: time_s.clone().into(), channels }
        };
        let streams = vec![stream("trunk", 0.0), stream("arm", 1.0)];
        let config = Config { belief_interval_s: 0.1, ..Config::default() };
        let run = track(model, streams, &Calibration::default(), &config, None, &mut |_| true).unwrap();
        let information: Vec<f64> = run
            .checkpoints
            .iter()
            .map(|checkpoint| {
                let known = checkpoint.known.whole();
                let covariance = &known.links.as_ref().unwrap().state.covariance;
                let n = covariance.n();
                let whole = DMatrix::from_fn(n, n, |i, j| covariance.at(i, j));
                // Both units turn about the vertical of the room, in which errors have one origin.
                let turn = DVector::from_fn(n, |i, _| f64::from(u8::from(i == 2 || i == UNIT + 2)));
                turn.dot(&whole.cholesky().expect("positive").solve(&turn))
            })
            .collect();
        assert!(information.len() > 50);
        // Rounding of an inverse whose condition is 1e7.
        assert!(information.windows(2).all(|two| two[1] <= two[0] * (1.0 + 1e-8)), "{information:?}");
        assert!(information[0] > 1.001 * information[information.len() - 1], "{information:?}");
    }
}
