//! Smooths a run backwards from its checkpoints.

use super::super::{diverged, Tracker};
use super::{Progress, Run};
use crate::error::{Error, Result};
use crate::estimate::belief::Belief;
use crate::estimate::smoother::Smoother;
use crate::estimate::transition::Transition;

impl Run {
    /// Rauch-Tung-Striebel smoother. Filters again between the checkpoints, from the last to the first, so that only
    /// one stretch at a time is in memory.
    pub fn smooth(&self, progress: Progress) -> Result<Run> {
        Run { checkpoints: self.checkpoints.clone(), ..self.with(self.series.blank()) }.into_smooth(progress)
    }

    /// Smooths in place of the filtered estimates, which takes half the memory.
    pub fn into_smooth(self, progress: Progress) -> Result<Run> {
        if self.smoothed {
            return Err(Error::Data("this track is smoothed already; smooth the filtered one".into()));
        }
        if self.tracker.strapdown.is_some() {
            return self.back_links(progress);
        }
        self.back(progress)
    }

    fn back(mut self, progress: Progress) -> Result<Run> {
        let Some(mut next) = self.last.as_ref().map(|known| known.belief.clone()) else {
            return Err(Error::Data("nothing was tracked: nothing to smooth".into()));
        };
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
            }
            self.checkpoints[k].known.replace(&next);
            if !progress(1.0 - k as f64 / all as f64) {
                return Err(Error::Stopped);
            }
        }
        self.smoothed = true;
        Ok(self)
    }
}

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
            tracker.competes = run.partings.iter().any(|p| p.from_s < sample.time_s && sample.time_s <= p.to_s);
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
