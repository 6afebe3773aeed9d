//! Encoder: reads a coordinate of a joint that is a state (eq. 10).

use super::kind::{Described, Kind, Pending, Reads, Sits};
use super::near::{Homes, Nearby};
use super::slopes::{Answers, Cause, Found, Group, Moving};
use super::{Fit, Quantity, RowGroups, Scene};
use crate::kernels::lane::Real;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::near::Reach;
use crate::model::section::{Known, Section};
use crate::model::JointKind;
use serde_json::{json, Value};

/// An encoder of a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Encoder {
    /// Index of the joint.
    pub joint: usize,
    /// Standard deviation, rad or m.
    pub std: f64,
}

impl Kind for Encoder {
    const NAME: &'static str = "encoder";
    const KEYS: Known = &["joint", "std"];
    type Reader = EncoderReader;

    fn read(section: &Section) -> Pending<Self> {
        let named = section.need_reference("joint", "\"seat\"");
        let std = section.need_positive("std", "0.001", "rad or m");
        Box::new(move |at| {
            let joint = at.joint("joint", &named)?;
            let (place, name) = (named?.at, &at.model.joints[joint].name);
            match at.model.joints[joint].kind {
                JointKind::Ball | JointKind::Free => at.mistake(
                    place,
                    format!("joint `{name}` turns in all directions, an encoder reads one; make it a hinge or slide"),
                ),
                JointKind::Fixed => at.mistake(
                    place,
                    format!(
                        "joint `{name}` is fixed, an encoder has nothing to read; make it a hinge or slide, or remove \
                         the sensor"
                    ),
                ),
                JointKind::Hinge | JointKind::Slide => {}
            }
            Some(Encoder { joint, std })
        })
    }

    fn describe(&self, at: &Described) -> Value {
        json!({"joint": at.model.joints[self.joint].name, "std": self.std})
    }

    /// Encoders of input joints have no rows: their readings are inputs.
    fn reader(&self, fit: &Fit) -> Option<EncoderReader> {
        let joint = &fit.model.joints[self.joint];
        (!joint.input).then_some(EncoderReader { coordinate: joint.first, std: self.std })
    }
}

/// An encoder at one set of parameters.
#[derive(Debug, Clone)]
pub struct EncoderReader {
    coordinate: usize,
    /// Standard deviation, rad or m.
    std: f64,
}

impl Reads for EncoderReader {
    type Seat = EncoderSeat;

    /// One row with the sensor's own name.
    fn rows(&self) -> RowGroups {
        vec![(Quantity::Joint, &[""], vec![self.std])]
    }

    #[inline(always)]
    fn predict<T: Real>(&self, scene: &Scene<T>, out: &mut [T]) {
        out[0] = scene.q[self.coordinate];
    }

    fn causes(&self, row: usize, answers: &Answers) -> Vec<Found> {
        let own = answers.columns.coordinates[self.coordinate].map(|column| (column, (Cause::Own, 0)));
        vec![Found { row, count: 1, part: 0, columns: own.into_iter().collect() }]
    }

    #[inline(always)]
    fn slopes<const FUSED: bool>(&self, groups: &[Group], _: Moving, out: &mut SparseJacobian) {
        for group in groups {
            out.rows_of(group.triple).iter_mut().for_each(|s| s.rows = [1.0, 0.0, 0.0, 0.0]);
        }
    }

    fn seat(&self, row: usize, _: &Homes) -> (EncoderSeat, Reach) {
        let reach = Reach { last: usize::MAX, input: true, ..Reach::default() };
        (EncoderSeat { row, coordinate: self.coordinate }, reach)
    }
}

/// Its row and coordinate.
#[derive(Debug, Clone)]
pub struct EncoderSeat {
    row: usize,
    coordinate: usize,
}

impl Sits for EncoderSeat {
    #[inline(always)]
    fn predict<const FUSED: bool>(&self, near: Nearby<FUSED>) {
        near.out[self.row] = near.around.joints.q[self.coordinate].cast();
    }
}
