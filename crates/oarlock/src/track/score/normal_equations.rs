//! `NormalEquations` of parameters, collected from the innovations of the filter (Friedland 1969). `scoring` adds the updates.
//!
//! With B = J dx/dp + dh/dp, the innovations are B p plus white noise of covariance S = J P J' + R. By Woodbury's
//! identity
//! B'S^-1 B = B'WB - (J'WB)'P+(J'WB) with W = R^-1, and B'S^-1 nu = B'W nu - (J'WB)'dx with the step dx of the update. Where
//! readings are curved, W is the inverse of the noise and of what the filter adds to it for curvature (U5).

use crate::kernels::dense::accumulate;

/// Normal equations of one window.
#[derive(Debug, Clone, Default)]
pub struct Window {
    /// Start and end, s.
    pub span_s: (f64, f64),
    /// B'S^-1 B, row-major; parameters in units of their standard deviations.
    pub normal: Vec<f64>,
    /// B'S^-1 nu.
    pub right: Vec<f64>,
    /// Number of rows used.
    pub rows: usize,
}

/// Finished windows and the current one.
#[derive(Debug, Clone)]
pub(super) struct NormalEquations {
    settle_s: f64,
    window_s: f64,
    begun_s: f64,
    width: usize,
    now: Window,
    full: Vec<Window>,
}

impl NormalEquations {
    pub(super) fn new(width: usize, settle_s: f64, window_s: f64) -> Self {
        let now = Window::default();
        NormalEquations { settle_s, window_s, begun_s: f64::NAN, width, now, full: Vec::new() }
    }

    /// Whether rows at this time are counted.
    pub(super) fn begin(&mut self, time_s: f64) -> bool {
        if self.begun_s.is_nan() {
            self.begun_s = time_s;
        }
        if time_s < self.begun_s + self.settle_s {
            return false;
        }
        if self.now.rows == 0 || time_s >= self.now.span_s.0 + self.window_s {
            self.close();
            self.now.span_s = (time_s, time_s);
            self.now.normal = vec![0.0; self.width * self.width];
            self.now.right = vec![0.0; self.width];
        }
        self.now.span_s.1 = time_s;
        true
    }

    /// Adds one row: its derivatives B and its innovation, both multiplied by a factor of W.
    pub(super) fn add_row(&mut self, answer: &[f64], innovation: f64) {
        self.now.rows += 1;
        for (row, &a) in self.now.normal.chunks_exact_mut(self.width).zip(answer) {
            accumulate(row, std::iter::once((a, answer)));
        }
        accumulate(&mut self.now.right, std::iter::once((innovation, answer)));
    }

    /// Subtracts the effect of the update: `pull` is J'WB, `lost` is P+ J'WB, and the mean moved by `shift`.
    pub(super) fn subtract_states(&mut self, pull: &[f64], lost: &[f64], shift: &[f64]) {
        let width = self.width;
        for (state, pulled) in pull.chunks_exact(width).enumerate().filter(|(_, p)| p.iter().any(|x| *x != 0.0)) {
            let lost = &lost[state * width..(state + 1) * width];
            for (row, &p) in self.now.normal.chunks_exact_mut(width).zip(pulled) {
                accumulate(row, std::iter::once((-p, lost)));
            }
            accumulate(&mut self.now.right, std::iter::once((-shift[state], pulled)));
        }
    }

    fn close(&mut self) {
        if self.now.rows > 0 {
            self.full.push(std::mem::take(&mut self.now));
        }
    }

    /// All windows.
    pub(super) fn finish(mut self) -> Vec<Window> {
        self.close();
        self.full
    }
}
