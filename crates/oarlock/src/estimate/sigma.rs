//! The scaled unscented transform in its odd/even form, which has no negative weight.
//!
//! With P = U'U, g = alpha sqrt(n + kappa) and h+- = h(x +- g u_i): H_i = (h+ - h-) / 2g, E_i = (h+ + h- - 2 h0) / 2g and
//! d = sum E_i / g. Then the innovation is z - h0 - d and Pzz = H H' + E E' + (beta - alpha^2) d d' + R, Pxz = U' H': the
//! textbook transform (Wan and van der Merwe 2000) rearranged, equal to it while beta >= alpha^2.

use super::dense::Square;
use super::{Partition, System};
use crate::lane::{Lane, LANES};

/// Spread of the sigma points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Scale of the points, in (0, 1].
    pub alpha: f64,
    /// Weight of the second-order part; 2 is right for a Gaussian.
    pub beta: f64,
    /// Usually 0.
    pub kappa: f64,
}

impl Spread {
    /// How far out the points lie, in standard deviations.
    pub fn reach(&self, n: usize) -> f64 {
        self.alpha * (n as f64 + self.kappa).sqrt()
    }
}

/// Readings around the mean. Row r of `g` is [sqrt(beta - alpha^2) d, E, H with its columns reversed], unscaled by noise.
#[derive(Debug, Clone)]
pub struct Fan {
    /// At the mean.
    pub center: Vec<f64>,
    /// d: what curvature adds to the mean reading.
    pub bend: Vec<f64>,
    /// One row a reading, `width` numbers each.
    pub g: Vec<f64>,
    /// 1 + curved + n.
    pub width: usize,
    delta: Vec<Lane>,
    state: Vec<Lane>,
    out: Vec<Lane>,
}

#[derive(Clone, Copy)]
struct Point {
    column: usize,
    sign: f64,
}

impl Fan {
    /// Room for `rows` readings.
    pub fn new(partition: Partition, rows: usize) -> Self {
        let n = partition.dim();
        let width = 1 + partition.curved() + n;
        Fan {
            center: vec![0.0; rows],
            bend: vec![0.0; rows],
            g: vec![0.0; rows * width],
            width,
            delta: vec![Lane([0.0; LANES]); n],
            state: vec![Lane([0.0; LANES]); n],
            out: vec![Lane([0.0; LANES]); rows],
        }
    }

    /// Spreads the points along the rows of `factor` and reads them all. Allocates nothing.
    pub fn spread<S: System>(
        &mut self,
        system: &S,
        moment: &S::Moment,
        scratch: &mut S::Scratch,
        mean: &[f64],
        factor: &Square,
        spread: Spread,
    ) {
        let part = system.partition();
        let (n, curved) = (part.dim(), part.curved());
        let reach = spread.reach(n);
        let total = 1 + 2 * curved + (n - curved);
        let mut first = 0;
        while first < total {
            let count = LANES.min(total - first);
            self.place(first..first + count, curved, factor, reach);
            system.retract(mean, &self.delta, &mut self.state);
            system.readings(moment, scratch, &self.state, &mut self.out);
            self.gather(first..first + count, curved);
            first += count;
        }
        self.combine(curved, n, reach, spread);
    }

    /// Point 0 is the mean; then plus and minus twins of the curved columns; then single points of the linear ones.
    fn point(index: usize, curved: usize) -> Option<Point> {
        let k = index.checked_sub(1)?;
        if k < 2 * curved {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            return Some(Point { column: k / 2, sign });
        }
        Some(Point { column: k - curved, sign: 1.0 })
    }

    fn place(&mut self, points: std::ops::Range<usize>, curved: usize, factor: &Square, reach: f64) {
        self.delta.fill(Lane([0.0; LANES]));
        for (lane, index) in points.enumerate() {
            let Some(p) = Self::point(index, curved) else { continue };
            let step = p.sign * reach;
            let row = &factor.row(p.column)[p.column..];
            for (d, u) in self.delta[p.column..].iter_mut().zip(row) {
                d.0[lane] = step * u;
            }
        }
    }

    /// Puts plus (and single) readings where H belongs, minus readings where E belongs.
    fn gather(&mut self, points: std::ops::Range<usize>, curved: usize) {
        for (lane, index) in points.enumerate() {
            let slot = match Self::point(index, curved) {
                None => {
                    self.center.iter_mut().zip(&self.out).for_each(|(c, o)| *c = o.0[lane]);
                    continue;
                }
                Some(p) if p.sign < 0.0 => 1 + p.column,
                Some(p) => self.width - 1 - p.column,
            };
            for (g, o) in self.g.chunks_exact_mut(self.width).zip(&self.out) {
                g[slot] = o.0[lane];
            }
        }
    }

    fn combine(&mut self, curved: usize, n: usize, reach: f64, spread: Spread) {
        let (half, one) = (0.5 / reach, 1.0 / reach);
        let outer = (spread.beta - spread.alpha * spread.alpha).max(0.0).sqrt();
        for ((g, &h0), bend) in self.g.chunks_exact_mut(self.width).zip(&self.center).zip(&mut self.bend) {
            let mut sum = 0.0;
            for i in 0..curved {
                let (plus, minus) = (g[self.width - 1 - i], g[1 + i]);
                g[self.width - 1 - i] = (plus - minus) * half;
                g[1 + i] = ((plus - h0) + (minus - h0)) * half;
                sum += g[1 + i];
            }
            for i in curved..n {
                g[self.width - 1 - i] = (g[self.width - 1 - i] - h0) * one;
            }
            *bend = sum * one;
            g[0] = outer * *bend;
        }
    }
}
