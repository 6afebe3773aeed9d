//! The scaled unscented transform in its odd/even form, which has no negative weight.
//!
//! With P = U'U, g = alpha sqrt(n + kappa) and h+- = h(x +- g u_i): H_i = (h+ - h-) / 2g, E_i = (h+ + h- - 2 h0) / 2g and
//! d = sum E_i / g. Then the innovation is z - h0 - d and Pzz = H H' + E E' + (beta - alpha^2) d d' + R, Pxz = U' H': the
//! textbook transform (Wan and van der Merwe 2000) rearranged, equal to it while beta >= alpha^2.

use super::dense::Square;
use super::{Partition, Points, System};
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

/// Readings around the mean. Row r of `g` is [sqrt(beta - alpha^2) d, E, D, H with its columns reversed], unscaled by
/// noise. D, a column for each noisy input, is what the readings change by when that input is off by its standard
/// deviation: D D' adds to R.
#[derive(Debug, Clone)]
pub struct Fan {
    /// At the mean.
    pub center: Vec<f64>,
    /// d: what curvature adds to the mean reading.
    pub bend: Vec<f64>,
    /// One row a reading, `width` numbers each.
    pub g: Vec<f64>,
    /// 1 + curved + inputs + n.
    pub width: usize,
    off: Vec<Lane>,
    delta: Vec<Lane>,
    out: Vec<Lane>,
}

/// Where a point lies from the mean.
#[derive(Clone, Copy)]
enum Point {
    Mean,
    /// Along a column of the factor, with its sign.
    Along(usize, f64),
    /// Off by one standard deviation of an input.
    Input(usize),
}

impl Fan {
    /// Room for `rows` readings.
    pub fn new(partition: Partition, inputs: usize, rows: usize) -> Self {
        let n = partition.dim();
        let width = 1 + partition.curved() + inputs + n;
        Fan {
            center: vec![0.0; rows],
            bend: vec![0.0; rows],
            g: vec![0.0; rows * width],
            width,
            off: vec![Lane([0.0; LANES]); inputs],
            delta: vec![Lane([0.0; LANES]); n],
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
        let total = 1 + curved + n + self.off.len();
        let mut first = 0;
        while first < total {
            let count = LANES.min(total - first);
            let points = first..first + count;
            self.place(points.clone(), part, factor, reach, system.input_std());
            let at = Points { mean, delta: &self.delta, off: &self.off };
            system.readings(moment, scratch, at, &mut self.out);
            self.gather(points, part);
            first += count;
        }
        self.combine(curved, n, reach, spread);
    }

    /// The mean; plus and minus twins of the curved columns; single points of the linear ones; the inputs.
    fn point(index: usize, part: Partition) -> Point {
        let (n, curved) = (part.dim(), part.curved());
        match index {
            0 => Point::Mean,
            i if i <= 2 * curved => Point::Along((i - 1) / 2, if i % 2 == 1 { 1.0 } else { -1.0 }),
            i if i <= curved + n => Point::Along(i - 1 - curved, 1.0),
            i => Point::Input(i - 1 - curved - n),
        }
    }

    fn place(
        &mut self,
        points: std::ops::Range<usize>,
        part: Partition,
        factor: &Square,
        reach: f64,
        input_std: &[f64],
    ) {
        self.delta.fill(Lane([0.0; LANES]));
        self.off.fill(Lane([0.0; LANES]));
        for (lane, index) in points.enumerate() {
            match Self::point(index, part) {
                Point::Mean => {}
                Point::Input(k) => self.off[k].0[lane] = input_std[k],
                Point::Along(column, sign) => {
                    let step = sign * reach;
                    let row = &factor.row(column)[column..];
                    for (d, u) in self.delta[column..].iter_mut().zip(row) {
                        d.0[lane] = step * u;
                    }
                }
            }
        }
    }

    /// Puts plus (and single) readings where H belongs, minus readings where E belongs.
    fn gather(&mut self, points: std::ops::Range<usize>, part: Partition) {
        for (lane, index) in points.enumerate() {
            let slot = match Self::point(index, part) {
                Point::Mean => {
                    self.center.iter_mut().zip(&self.out).for_each(|(c, o)| *c = o.0[lane]);
                    continue;
                }
                Point::Along(column, sign) if sign < 0.0 => 1 + column,
                Point::Along(column, _) => self.width - 1 - column,
                Point::Input(k) => 1 + part.curved() + k,
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
            g[1 + curved..self.width - n].iter_mut().for_each(|x| *x -= h0);
            *bend = sum * one;
            g[0] = outer * *bend;
        }
    }
}
