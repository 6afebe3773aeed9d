//! Slides that no encoder reads: position and speed about rest, critically damped (a Matern process of order 3/2; Rasmussen and Williams 2006,
//! eq. 4.17, with the frequency as damping). `filter` uses it.

use super::covariance::Rows;
use super::filter::{Means, State, StrapdownFilter};
use super::increment::{skew, sum, ZERO};
use super::skeleton::{Leg, Skeleton};
use crate::body::Body;
use crate::model::{JointKind, Model};
use crate::rotation::{Mat3, Vec3};

/// A slide whose position and speed are states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slide {
    /// In the model.
    pub coordinate: usize,
    /// Position at rest, and how far it is from there, standard deviation, m.
    pub rest_m: f64,
    pub std_m: f64,
    /// Frequency of its motion, rad/s.
    pub rate_rad_s: f64,
}

/// Share of a slide's position and speed, rows by columns, that a time leaves.
pub type Share = [[f64; 2]; 2];

impl Slide {
    /// Of all slides of a body without an encoder.
    pub fn all(body: &Body) -> Vec<Slide> {
        let slides =
            body.model.joints.iter().filter(|j| j.kind == JointKind::Slide && !is_encoded(&body.model, j.first));
        let slide = |coordinate: usize| {
            let axis = &body.axes[coordinate];
            let [place, speed, _] = axis.process.start_std;
            Slide { coordinate, rest_m: axis.rest, std_m: axis.prior_std(), rate_rad_s: speed / place }
        };
        slides.map(|joint| slide(joint.first)).collect()
    }

    fn share(&self, step_s: f64) -> Share {
        let (w, left) = (self.rate_rad_s, (-self.rate_rad_s * step_s).exp());
        [[left * (1.0 + w * step_s), left * step_s], [-left * w * w * step_s, left * (1.0 - w * step_s)]]
    }

    /// Variances of position and speed at rest.
    fn variances(&self) -> [f64; 2] {
        [self.std_m.powi(2), (self.std_m * self.rate_rad_s).powi(2)]
    }
}

/// Whether readings tell a coordinate. An input without an encoder is at rest.
pub fn is_encoded(model: &Model, coordinate: usize) -> bool {
    model.encoder(coordinate).is_some() || model.joints.iter().any(|joint| joint.input && joint.first == coordinate)
}

impl Skeleton {
    /// Number of a slide that is a state, by coordinate.
    pub fn slide(&self, coordinate: usize) -> Option<usize> {
        self.slides.iter().position(|slide| slide.coordinate == coordinate)
    }
}

impl StrapdownFilter {
    /// First state of a slide: its position, then its speed.
    pub fn slide_state(&self, number: usize) -> usize {
        self.length_state(0) - 2 * (self.skeleton.slides.len() - number)
    }

    /// What a time leaves of all slides, by first state.
    pub(super) fn slide_shares(&self, step_s: f64) -> Vec<(usize, Share)> {
        let slides = self.skeleton.slides.iter().enumerate();
        slides.map(|(number, slide)| (self.slide_state(number), slide.share(step_s))).collect()
    }

    /// Variances of all slides at rest, by state.
    pub(super) fn slide_variances(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let slides = self.skeleton.slides.iter().enumerate();
        slides.flat_map(|(number, slide)| (self.slide_state(number)..).zip(slide.variances()))
    }

    /// Slides go on, and get their noise.
    pub(super) fn slide_on(&self, state: &mut State, step_s: f64) {
        for (number, slide) in self.skeleton.slides.iter().enumerate() {
            let (share, [place, speed]) = (slide.share(step_s), slide.variances());
            let mean = &mut state.means.slides[number];
            let from_rest = [mean[0] - slide.rest_m, mean[1]];
            *mean = share.map(|row| row[0] * from_rest[0] + row[1] * from_rest[1]);
            mean[0] += slide.rest_m;
            let first = self.slide_state(number);
            for r in 0..2 {
                for c in 0..2 {
                    let kept = share[r][0] * place * share[c][0] + share[r][1] * speed * share[c][1];
                    *state.covariance.at_mut(first + r, first + c) +=
                        if r == c { [place, speed][r] } else { 0.0 } - kept;
                }
            }
        }
    }

    /// Length of a leg in its vectors.
    pub(super) fn leg_length(&self, means: &Means, leg: &Leg) -> f64 {
        let slid = |c: usize| self.skeleton.slide(c).map_or(means.inputs[c][0], |number| means.slides[number][0]);
        leg.by.map_or(1.0, slid)
    }

    /// A leg in the room's axes, m.
    pub(super) fn leg(&self, means: &Means, leg: &Leg) -> Vec3<f64> {
        self.orientation_of(means, leg.link).apply(leg.vector) * self.leg_length(means, leg)
    }

    /// Derivatives of a leg in the room's axes, times `m`. Returns the leg, m.
    pub(super) fn push_leg(&self, rows: &mut Rows, means: &Means, leg: &Leg, m: &Mat3<f64>) -> Vec3<f64> {
        let along = self.orientation_of(means, leg.link).apply(leg.vector);
        let arm = along * self.leg_length(means, leg);
        self.push_link(rows, means, leg.link, &sum(&ZERO, &m.times(&skew(arm)), -1.0));
        if let Some(number) = leg.by.and_then(|c| self.skeleton.slide(c)) {
            rows.push_one(self.slide_state(number), m.apply(along).0);
        }
        arm
    }
}
