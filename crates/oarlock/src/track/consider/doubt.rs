//! `Doubt`: the effect of consider states on the mean of the filter, and their learnt scale.

/// The shift dx/dp of the mean for one standard deviation of each consider state, and the statistics from which their
/// common scale is learnt.
#[derive(Debug, PartialEq)]
pub struct Doubt {
    /// Common scale of the parameters' errors, in units of their standard deviations.
    pub(super) scale: f64,
    /// The scale by the longest memory alone.
    pub(super) lasting: f64,
    /// Length of each state's and row's block: the number of parameters, padded.
    pub(super) width: usize,
    /// Number of parameters with a standard deviation from a calibration. They come first. The scale applies to them
    /// only where it exceeds 1.
    pub(super) told: usize,
    pub(super) bounds: Bounds,
    /// Per state.
    pub(super) slopes: Vec<f64>,
    /// Per row of the measurement vector: averages of its innovations.
    pub(super) rows: Vec<RowAverages>,
    /// Per row: the expected average innovation for each parameter.
    pub(super) expected: Vec<f64>,
}

/// Scale at which the standard deviations of lengths and positions count by half. A tenth of the mounts' standard deviation
/// is more than noise makes of right mounts.
const HALF_SCALE: f64 = 0.1;

/// What limits the effect of consider states.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bounds {
    /// Per parameter: whether it is a mount's. Gyroscopes and magnetometers, of which the scale is learnt, determine
    /// how wrong mounts are. They say that lengths and positions may be wrong, but hardly how much.
    pub mounts: Vec<bool>,
    /// Per calibrated parameter: the greatest scale, at which it is as uncertain as without the calibration.
    pub most: Vec<f64>,
    /// Per state: largest variance; infinite if there is none.
    pub reach: Vec<f64>,
}

/// Averages of the innovations of one row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RowAverages {
    /// Average innovation, and the last innovation.
    pub low: f64,
    pub last: f64,
    /// Time of the last innovation, s; NaN if there was none.
    pub last_s: f64,
    /// Number of innovations.
    pub count: f64,
    /// For each memory.
    pub squares: [Squares; 2],
}

impl RowAverages {
    pub(super) const NONE: Self = {
        let none = Squares { power: 0.0, white: 0.0, share: 0.0 };
        RowAverages { low: 0.0, last: 0.0, last_s: f64::NAN, count: 0.0, squares: [none; 2] }
    };
}

/// Mean squares of the average of innovations, of the average of white noise, and of the expected average.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Squares {
    pub power: f64,
    pub white: f64,
    pub share: f64,
}

/// What consider states without a calibration do to each state, for the smoother.
#[derive(Debug, Clone)]
pub(in crate::track) struct Shares {
    /// The scale at that time.
    scale: f64,
    /// Per state: variance by mounts and by all others, each wrong by one standard deviation.
    variances: Vec<[f64; 2]>,
}

/// Consider states side by side.
const WIDE: usize = 8;

/// Numbers at the start of the flat form: layout, scale, width, number of calibrated parameters, and lasting scale.
const HEAD: usize = 5;
/// Number of the layout; another one with every change of it. Negative, because forms without a layout begin with the scale.
const LAYOUT: f64 = -1.0;
const PER_ROW: usize = 10;

impl Clone for Doubt {
    fn clone(&self) -> Self {
        let Doubt { bounds, slopes, rows, expected, .. } = self;
        let (slopes, rows, expected) = (slopes.clone(), rows.clone(), expected.clone());
        Doubt { bounds: bounds.clone(), slopes, rows, expected, ..*self }
    }

    fn clone_from(&mut self, from: &Self) {
        let Doubt { scale, lasting, width, told, bounds, slopes, rows, expected } = self;
        (*scale, *lasting, *width, *told) = (from.scale, from.lasting, from.width, from.told);
        bounds.mounts.clone_from(&from.bounds.mounts);
        bounds.most.clone_from(&from.bounds.most);
        bounds.reach.clone_from(&from.bounds.reach);
        slopes.clone_from(&from.slopes);
        rows.clone_from(&from.rows);
        expected.clone_from(&from.expected);
    }
}

impl Doubt {
    /// A new doubt: no parameter has affected the mean yet.
    pub(super) fn new(scale: f64, (states, rows, width): (usize, usize, usize), told: usize, bounds: Bounds) -> Self {
        Doubt {
            scale,
            lasting: 0.0,
            width,
            told,
            bounds,
            slopes: vec![0.0; states * width],
            rows: vec![RowAverages::NONE; rows],
            expected: vec![0.0; rows * width],
        }
    }

    /// Numbers of states, rows and padded parameters.
    pub fn size(&self) -> (usize, usize, usize) {
        (self.slopes.len() / self.width.max(1), self.rows.len(), self.width)
    }

    /// Adds to variances of all states, due to noise, those due to the consider states. A joint is not beyond its range, whatever the
    /// derivatives say.
    pub(in crate::track) fn widen(&self, variance: &mut [f64]) {
        if self.scale != 0.0 || self.told != 0 {
            let stated = stated(self.scale);
            for first in (0..self.width).step_by(WIDE) {
                let scales = std::array::from_fn(|k| self.scale_of(first + k, stated));
                self.add_squares(first, scales, variance);
            }
        }
        variance.iter_mut().zip(&self.bounds.reach).for_each(|(variance, reach)| *variance = variance.min(*reach));
    }

    /// Adds to variances of all states what the learnt scale adds to those of noise and of the calibration's own uncertainty.
    pub(in crate::track) fn add_learnt(&self, variance: &mut [f64]) {
        let unlearnt = Doubt { scale: 0.0, ..self.clone() };
        let [mut all, mut own] = [0, 1].map(|_| vec![0.0; variance.len()]);
        self.widen(&mut all);
        unlearnt.widen(&mut own);
        variance.iter_mut().zip(all.iter().zip(&own)).for_each(|(variance, (all, own))| *variance += all - own);
    }

    /// Adds the squares of the slopes by some neighbouring parameters, each times its scale. Slopes by those that are missing count as zero.
    fn add_squares(&self, first: usize, scales: [f64; WIDE], variance: &mut [f64]) {
        for (slopes, variance) in self.slopes.chunks_exact(self.width).zip(variance) {
            let mut some = [0.0; WIDE];
            match slopes[first..].first_chunk() {
                Some(whole) => some = *whole,
                None => some[..slopes.len() - first].copy_from_slice(&slopes[first..]),
            }
            let squares: [f64; WIDE] = std::array::from_fn(|k| (some[k] * scales[k]).powi(2));
            let pairs: [f64; WIDE / 2] = std::array::from_fn(|k| squares[k] + squares[k + WIDE / 2]);
            *variance += (pairs[0] + pairs[2]) + (pairs[1] + pairs[3]);
        }
    }

    /// Scale of a consider state, with that of lengths and positions. The uncertainty of a calibrated parameter is never less than the
    /// calibration's own and never more than without it.
    fn scale_of(&self, parameter: usize, stated: f64) -> f64 {
        match self.bounds.most.get(parameter) {
            Some(&most) => self.scale.min(most).max(1.0),
            None if self.bounds.mounts.get(parameter) == Some(&true) => self.scale,
            None => stated,
        }
    }

    /// What the smoother needs later, when the scale of the whole recording is known.
    pub(in crate::track) fn shares(&self) -> Shares {
        let of_state = |slopes: &[f64]| {
            let rest = slopes.iter().zip(&self.bounds.mounts).skip(self.told);
            rest.fold(
                [0.0; 2],
                |[mounts, others], (s, &is_mount)| {
                    if is_mount {
                        [mounts + s * s, others]
                    } else {
                        [mounts, others + s * s]
                    }
                },
            )
        };
        let variances = self.slopes.chunks_exact(self.width.max(1)).map(of_state).collect();
        Shares { scale: self.scale, variances }
    }

    /// Scale that the innovations of minutes show.
    pub(in crate::track) fn lasting_scale(&self) -> f64 {
        self.lasting
    }

    /// The flat form in pickled state estimates.
    pub fn to_flat(&self) -> Vec<f64> {
        let head = [LAYOUT, self.scale, self.width as f64, self.told as f64, self.lasting];
        let rows = self.rows.iter().flat_map(|row| row.to_flat());
        let (slopes, expected) = (self.slopes.iter().copied(), self.expected.iter().copied());
        let Bounds { mounts, most, reach } = &self.bounds;
        let mounts = mounts.iter().map(|&is| f64::from(u8::from(is)));
        head.into_iter()
            .chain(slopes)
            .chain(mounts)
            .chain(most.iter().chain(reach).copied())
            .chain(rows)
            .chain(expected)
            .collect()
    }

    /// Reads the result of `to_flat` for this number of states; `None` if the numbers do not fit.
    pub fn from_flat(flat: &[f64], states: usize) -> Option<Self> {
        let (&[layout, scale, width, told, lasting], rest) = flat.split_first_chunk::<HEAD>()?;
        let (width, told) = (count(width, flat.len())?, count(told, flat.len())?);
        let (slopes, rest) = rest.split_at_checked(states.checked_mul(width)?)?;
        let (mounts, rest) = rest.split_at_checked(width)?;
        let (most, rest) = rest.split_at_checked(told)?;
        let (reach, rest) = rest.split_at_checked(states)?;
        let mounts = mounts.iter().map(|&is| is != 0.0).collect();
        let bounds = Bounds { mounts, most: most.to_vec(), reach: reach.to_vec() };
        let count = rest.len() / (PER_ROW + width);
        let (rows, expected) = rest.split_at(count * PER_ROW);
        let (rows, []) = rows.as_chunks::<PER_ROW>() else { return None };
        let fits = layout == LAYOUT && told <= width && expected.len() == count * width;
        let rows = rows.iter().map(RowAverages::from_flat).collect();
        let (slopes, expected) = (slopes.to_vec(), expected.to_vec());
        fits.then_some(Doubt { scale, lasting, width, told, bounds, slopes, rows, expected })
    }
}

impl Shares {
    /// Variance that the band of a state lacks if the scale is at least this one. `counted`: whether the band has the
    /// consider states at their own scale.
    pub(in crate::track) fn lack(&self, state: usize, scale: f64, counted: bool) -> f64 {
        let before = if counted { self.scale } else { 0.0 };
        let [mounts, others] = self.variances[state];
        let more = |now: f64, before: f64| (now * now - before * before).max(0.0);
        mounts * more(scale, before) + others * more(stated(scale), stated(before))
    }
}

/// Scale of lengths, positions and zeros for this one of mounts. Where the model is wrong, their standard deviations count in
/// full; where it is right, not at all.
fn stated(scale: f64) -> f64 {
    let square = scale * scale;
    scale.max(square / (square + HALF_SCALE * HALF_SCALE))
}

/// Reads a whole number of at most `most`.
fn count(number: f64, most: usize) -> Option<usize> {
    (number >= 0.0 && number <= most as f64 && number.fract() == 0.0).then_some(number as usize)
}

impl RowAverages {
    fn to_flat(self) -> [f64; PER_ROW] {
        let RowAverages { low, last, last_s, count, squares: [a, b] } = self;
        [low, last, last_s, count, a.power, a.white, a.share, b.power, b.white, b.share]
    }

    fn from_flat(flat: &[f64; PER_ROW]) -> Self {
        let &[low, last, last_s, count, ref squares @ ..] = flat;
        let squares = [0, 3].map(|k| Squares { power: squares[k], white: squares[k + 1], share: squares[k + 2] });
        RowAverages { low, last, last_s, count, squares }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flat_form_leads_back() {
        // 3 states with a bound each and 2 rows of 10 averages, with 4 parameters each, one of them with a bound.
        let rest = (0..12).chain([0, 1, 1, 0]).chain(12..44).map(f64::from);
        let flat: Vec<f64> = [LAYOUT, 0.5, 4.0, 1.0, 0.25].into_iter().chain(rest).collect();
        let doubt = Doubt::from_flat(&flat, 3).unwrap();
        assert_eq!(doubt.size(), (3, 2, 4));
        let mounts = vec![false, true, true, false];
        assert_eq!(doubt.bounds, Bounds { mounts, most: vec![12.0], reach: vec![13.0, 14.0, 15.0] });
        assert_eq!((doubt.rows[1].low, doubt.expected[0]), (26.0, 36.0));
        assert_eq!(doubt.to_flat(), flat);
    }

    /// Of 3 states, the first of which has a variance of 4 at most, with 4 parameters: a calibrated one, two of mounts, a length.
    fn doubt(scale: f64) -> Doubt {
        let mounts = vec![false, true, true, false];
        let bounds = Bounds { mounts, most: vec![5.0], reach: vec![4.0, f64::INFINITY, f64::INFINITY] };
        Doubt::new(scale, (3, 2, 4), 1, bounds)
    }

    fn widened(doubt: &Doubt, state: usize, noise: f64) -> f64 {
        let mut variance = [noise; 3];
        doubt.widen(&mut variance);
        variance[state]
    }

    #[test]
    fn a_joint_is_not_beyond_its_range() {
        let mut doubt = doubt(1.0);
        doubt.slopes.fill(100.0);
        assert_eq!(widened(&doubt, 0, 0.1), 4.0);
        assert_eq!(widened(&doubt, 0, 9.0), 4.0);
        assert_eq!(widened(&doubt, 1, 0.5), 40_000.5);
    }

    #[test]
    fn a_calibrated_parameter_is_never_less_certain_than_without_its_calibration() {
        let by_the_first = |scale: f64| {
            let mut doubt = doubt(scale);
            doubt.slopes[4] = 1.0;
            widened(&doubt, 1, 0.0)
        };
        assert_eq!([0.0, 1.0, 3.0, 5.0, 1000.0].map(by_the_first), [1.0, 1.0, 9.0, 25.0, 25.0]);
    }

    #[test]
    fn a_calibrations_own_uncertainty_is_not_learnt() {
        let learnt = |scale: f64| {
            let mut doubt = doubt(scale);
            doubt.slopes[4..6].copy_from_slice(&[7.0, 1.0]);
            let mut variance = [0.0; 3];
            doubt.add_learnt(&mut variance);
            variance[1]
        };
        assert_eq!([0.0, 1.0, 2.0].map(learnt), [0.0, 1.0, 3.0 * 49.0 + 4.0]);
    }

    #[test]
    fn lengths_count_more_than_mounts_where_the_model_is_wrong() {
        let std = |parameter: usize, scale: f64| {
            let mut doubt = doubt(scale);
            doubt.slopes[4 + parameter] = 1.0;
            widened(&doubt, 1, 0.0).sqrt()
        };
        let (mount, length) = (|scale: f64| std(1, scale), |scale: f64| std(3, scale));
        assert_eq!([0.0, 0.1, 0.5, 2.0].map(mount), [0.0, 0.1, 0.5, 2.0]);
        assert_eq!((length(0.0), length(2.0)), (0.0, 2.0));
        assert!((length(HALF_SCALE) - 0.5).abs() < 1e-12);
        assert!((0.95..1.0).contains(&length(0.5)));
        assert!(length(0.01) < 0.011);
    }

    #[test]
    fn the_smoother_adds_what_the_scale_lacked() {
        let mut early = doubt(0.25);
        early.slopes[4..8].copy_from_slice(&[7.0, 1.0, 2.0, 3.0]);
        let shares = early.shares();
        assert_eq!(shares.lack(1, 0.2, true), 0.0);
        early.scale = 0.5;
        let late = widened(&early, 1, 0.0);
        early.scale = 0.25;
        assert!((shares.lack(1, 0.5, true) - (late - widened(&early, 1, 0.0))).abs() < 1e-12);
        // A calibrated parameter counts in full at scales up to 1.
        assert!((shares.lack(1, 0.5, false) - (late - 49.0)).abs() < 1e-12);
        assert_eq!((shares.lack(0, 0.5, false), shares.lack(1, 0.0, false)), (0.0, 0.0));
    }

    #[test]
    fn other_numbers_are_no_doubt() {
        let whole = doubt(1.0).to_flat();
        assert!(Doubt::from_flat(&whole, 3).is_some());
        assert!(Doubt::from_flat(&whole[..whole.len() - 1], 3).is_none());
        for (place, wrong) in
            [(0, 1.0), (0, LAYOUT - 1.0), (2, 5.0), (2, -4.0), (2, 4.5), (2, f64::NAN), (3, 5.0), (3, f64::INFINITY)]
        {
            let mut flat = whole.clone();
            flat[place] = wrong;
            assert!(Doubt::from_flat(&flat, 3).is_none(), "{place} {wrong}");
        }
    }
}
