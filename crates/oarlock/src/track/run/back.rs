//! Going back over a run with the smoother.

use super::super::{diverged, Tracker};
use super::{Checkpoint, Progress, Run};
use crate::error::{Error, Result};
use crate::estimate::belief::Belief;
use crate::estimate::smoother::Smoother;
use crate::estimate::transition::Transition;
use crate::recording::Cursor;

impl Run {
    /// Rauch-Tung-Striebel smoothing. Filters again between the kept beliefs, from the last to the first, so that only
    /// one stretch at a time is in memory.
    pub fn smooth(&self, progress: Progress) -> Result<Run> {
        if self.smoothed {
            return Err(Error::Data("this track is smoothed already; smooth the filtered one".into()));
        }
        let mut out = self.clone();
        let mut tracker = self.tracker.clone();
        let mut smoother = Smoother::new(tracker.body.layout.dim());
        let mut next = match &self.last {
            Some(belief) => belief.alone(belief.line),
            None => return Err(Error::Data("nothing was tracked: nothing to smooth".into())),
        };
        let mut stretch = Stretch::default();
        for (k, checkpoint) in self.checkpoints.iter().enumerate().rev() {
            let stop = self.checkpoints.get(k + 1).map(|c| &c.cursor);
            stretch.refilter(self, &mut tracker, checkpoint, stop)?;
            for node in stretch.nodes[..stretch.used].iter_mut().rev() {
                let belief = &mut node.filtered;
                let done = smoother.back(&tracker.body, belief, &node.transition, &node.predicted, &next);
                done.map_err(|lost| diverged(lost, belief.time_s))?;
                if let Some(row) = node.row {
                    out.write(row, belief);
                }
                std::mem::swap(&mut next, belief);
            }
            out.checkpoints[k].belief.clone_from(&next);
            if !progress(1.0 - k as f64 / self.checkpoints.len() as f64) {
                return Err(Error::Stopped);
            }
        }
        out.smoothed = true;
        Ok(out)
    }
}

/// A step of a stretch: the belief before, how it moved, the belief after moving.
struct Node {
    filtered: Belief,
    /// Row of output that `filtered` belongs to.
    row: Option<usize>,
    transition: Transition,
    predicted: Belief,
}

/// The filter's way from one checkpoint to the next. Nodes that a stretch has no use for are room for the one after it.
#[derive(Default)]
struct Stretch {
    nodes: Vec<Node>,
    used: usize,
}

impl Stretch {
    /// Follows the hypothesis that won.
    fn refilter(&mut self, run: &Run, tracker: &mut Tracker, from: &Checkpoint, stop: Option<&Cursor>) -> Result<()> {
        let (mut cursor, mut sample) = (from.cursor.clone(), tracker.empty_sample());
        let mut belief = run.proven(&from.belief);
        let mut row = from.is_row.then_some(from.row);
        let mut next_row = from.row + usize::from(from.is_row);
        self.used = 0;
        while stop != Some(&cursor) && run.recording.next(&mut cursor, &mut sample) {
            if sample.time_s <= belief.time_s {
                continue;
            }
            tracker.learns = !run.partings.iter().any(|p| p.from_s < sample.time_s && sample.time_s <= p.to_s);
            let first = self.used;
            self.begin(&belief, row.take());
            tracker.advance(&mut belief, &sample, &mut |transition, predicted| {
                if self.used > first {
                    self.go_on();
                }
                self.end(transition, predicted);
            })?;
            if run.partings.iter().any(|p| p.from_s == sample.time_s) {
                tracker.open_bank(&mut belief);
                belief = run.proven(&belief);
            }
            if run.series.time_s.get(next_row) == Some(&sample.time_s) {
                row = Some(next_row);
                next_row += 1;
            }
        }
        Ok(())
    }

    /// A node that begins at a belief.
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

    /// A node that begins where the last one ends: a gap is bridged by several predictions.
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
