//! Averages of innovations, and the common scale of the consider states that they show.

use super::doubt::{Doubt, RowAverages, Squares};
use crate::kernels::arch::{madd, Arch, Kernel};
use crate::kernels::registers::VECTOR;

/// Time over which innovations are averaged, s: longer than the correlation of noise, learnt process noise and soft
/// tissue motion; shorter than a movement cycle.
const AVERAGE_S: f64 = 0.6;
/// Memories of the mean squares of averages, s. Parameters are constants, so evidence that they are wrong lasts, also while a
/// body moves in a way that does not show it. The short memory follows a unit that slips.
const MEMORIES_S: [f64; 2] = [5.0, 300.0];
/// Squared scales that the memories take from one reading at most. What goes on for minutes after a burst, such as a fault or a lost
/// estimate, must be bounded: two standard deviations.
const MOST_SQUARED: [f64; 2] = [f64::MAX, 4.0];
/// Averages with at most this multiple of white noise's mean square count as chance.
const CHANCE: f64 = 1.5;

/// Adds the innovations of the rows that are `told`, and their derivatives `answers` by each parameter, to the averages.
pub(super) fn take(arch: Arch, doubt: &mut Doubt, answers: &[f64], at: (f64, &[f64]), told: impl Fn(usize) -> bool) {
    arch.run(Taking { doubt, answers, at, told });
}

struct Taking<'a, T> {
    doubt: &'a mut Doubt,
    answers: &'a [f64],
    at: (f64, &'a [f64]),
    told: T,
}

impl<T: Fn(usize) -> bool> Kernel for Taking<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Taking { doubt, answers, at: (time_s, innovation), told } = self;
        let Doubt { rows, expected, width, .. } = doubt;
        let each = expected.chunks_exact_mut(*width).zip(answers.chunks_exact(*width));
        for (r, (row, (expected, answers))) in rows.iter_mut().zip(each).enumerate().filter(|(r, _)| told(*r)) {
            row.take::<FUSED>(expected, answers, (time_s, innovation[r]));
        }
    }
}

/// Learns the scale from the rows that tell it; `scales` is a workspace.
pub(super) fn learn(doubt: &mut Doubt, telling: &[bool], scales: &mut Vec<f64>) {
    let [short, lasting] = [0, 1].map(|memory| {
        scales.clear();
        let rows = doubt.rows.iter().zip(telling).filter(|(_, telling)| **telling);
        scales.extend(rows.filter_map(|(row, _)| row.squares[memory].scale_squared()));
        let middle = scales.len() / 2;
        (!scales.is_empty()).then(|| {
            let (_, &mut median, _) = scales.select_nth_unstable_by(middle, f64::total_cmp);
            median.max(0.0).sqrt()
        })
    });
    doubt.lasting = lasting.unwrap_or(doubt.lasting);
    if short.or(lasting).is_some() {
        doubt.scale = short.unwrap_or_default().max(doubt.lasting);
    }
}

impl RowAverages {
    /// Adds one innovation and its derivatives by each parameter to the averages.
    #[inline(always)]
    fn take<const FUSED: bool>(&mut self, expected: &mut [f64], answers: &[f64], (time_s, innovation): (f64, f64)) {
        let dt = time_s - self.last_s;
        if !dt.is_finite() {
            (self.last, self.last_s) = (innovation, time_s);
            return;
        }
        let pace = (dt / AVERAGE_S).min(1.0);
        self.low += pace * (innovation - self.low);
        let owed = approach::<FUSED>(expected, answers, pace);
        self.count += 1.0;
        let jump = innovation - self.last;
        let floor = pace / (2.0 - pace) * 0.5 * jump * jump;
        for (squares, (memory_s, most)) in self.squares.iter_mut().zip(MEMORIES_S.into_iter().zip(MOST_SQUARED)) {
            let keep = (dt / memory_s).max(1.0 / self.count).min(1.0);
            squares.power += keep * ((self.low * self.low).min(CHANCE * floor + most * owed) - squares.power);
            squares.white += keep * (floor - squares.white);
            squares.share += keep * (owed - squares.share);
        }
        (self.last, self.last_s) = (innovation, time_s);
    }
}

/// Takes averages a share of the way to new numbers, as many as a multiple of a vector's. Returns their sum of squares.
#[inline(always)]
fn approach<const FUSED: bool>(averages: &mut [f64], new: &[f64], share: f64) -> f64 {
    let mut sums = [0.0; VECTOR];
    for (e, a) in averages.as_chunks_mut::<VECTOR>().0.iter_mut().zip(new.as_chunks::<VECTOR>().0) {
        for k in 0..VECTOR {
            e[k] = madd::<FUSED>(share, a[k] - e[k], e[k]);
            sums[k] = madd::<FUSED>(e[k], e[k], sums[k]);
        }
    }
    sums.iter().sum()
}

impl Squares {
    /// Squared scale of the parameters' errors; `None` where noise is larger than what they explain.
    fn scale_squared(&self) -> Option<f64> {
        (self.share > self.white && self.white > 0.0).then(|| (self.power - CHANCE * self.white) / self.share)
    }
}
