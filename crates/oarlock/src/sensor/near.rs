//! Readings near a mean: sensors on links that stand as they do there need no rotations of their own.

use super::{Reader, Suite, Surroundings, Worn};
use crate::kinematics::near::{Apart, Differs, Reach, Stance};
use crate::kinematics::FrameMotion;
use crate::lane::Real;
use crate::rotation::{Mat3, Vec3};

/// How a sensor stands at the mean, in root axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand {
    /// Root from sensor.
    pub rotation: Mat3<f64>,
    /// From its link's origin, m.
    pub arm: Vec3<f64>,
}

impl Stand {
    /// Of a sensor that does not care.
    pub const ANY: Stand = Stand { rotation: Mat3([[0.0; 3]; 3]), arm: Vec3([0.0; 3]) };
}

/// Links around the mean.
#[derive(Debug, Clone, Copy)]
pub struct Around<'a, T> {
    /// Where they differ from the mean.
    pub frames: &'a [FrameMotion<T>],
    /// At the mean.
    pub stances: &'a [Stance],
    /// In what they differ.
    pub differs: &'a [Differs],
    /// Values of the joints.
    pub q: &'a [T],
    /// The magnetic field, uT, where it differs from the mean's.
    pub field: Option<Vec3<T>>,
    /// At the mean, uT.
    pub mean_field: Vec3<f64>,
    /// What differs at all.
    pub apart: Apart,
}

impl<T: Real> Around<'_, T> {
    /// A frame in full.
    #[inline(always)]
    fn frame(&self, i: usize) -> FrameMotion<T> {
        let (mut frame, stance, differs) = (self.frames[i], &self.stances[i].frame, self.differs[i]);
        if !differs.pose {
            frame.rotation = stance.rotation.everywhere();
            frame.position = stance.position.everywhere();
        }
        if !differs.motion {
            frame.angular_velocity = stance.angular_velocity.everywhere();
            frame.angular_acceleration = stance.angular_acceleration.everywhere();
            frame.proper_acceleration = stance.proper_acceleration.everywhere();
        }
        frame
    }
}

impl Suite {
    /// Of which states and inputs each source's posture depends, given those of the frames and of lengths and mounts.
    pub fn reaches(
        &self,
        frames: &[Reach],
        length: impl Fn(usize) -> usize,
        mount: impl Fn(usize) -> usize,
    ) -> Vec<Reach> {
        let points = |mut reach: Reach, point: &crate::model::Point| {
            point.moved_by().for_each(|l| reach.last = reach.last.max(length(l) + 1));
            reach
        };
        let reach = |reader: &Reader| match reader {
            Reader::Imu(s) => {
                let mut reach = points(frames[s.frame], &s.offset);
                reach.last = reach.last.max(s.mount.map_or(0, |i| mount(i) + 3));
                reach
            }
            Reader::Encoder(_) => Reach { last: usize::MAX, input: true, ..Reach::default() },
            Reader::Position(s) => points(frames[s.frame], &s.point),
            Reader::Closure(s) => {
                let [(a, at), (b, bt)] = &s.sides;
                let (a, b) = (points(frames[*a], at), points(frames[*b], bt));
                Reach { last: a.last.max(b.last), input: a.input || b.input, ..a }
            }
        };
        self.readers.iter().map(reach).collect()
    }

    /// How the sensors stand at the mean.
    #[inline(always)]
    pub fn settle(&self, stances: &[Stance], worn: Worn<f64>, active: &[bool], stands: &mut [Stand]) {
        for ((reader, stand), &on) in self.readers.iter().zip(stands).zip(active) {
            if let (Reader::Imu(s), true) = (reader, on) {
                *stand = s.stand(&stances[s.frame].frame, worn);
            }
        }
    }

    /// Predicts the rows of every `active` source into `out`, from `center` where nothing differs. Allocates nothing.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // they are all different things
    pub fn predict_near<T: Real>(
        &self,
        around: Around<T>,
        worn: Worn<T>,
        reaches: &[Reach],
        stands: &[Stand],
        active: &[bool],
        center: &[f64],
        out: &mut [T],
    ) {
        let apart = around.apart;
        for (i, (reader, source)) in self.readers.iter().zip(&self.sources).enumerate() {
            if !active[i] {
                continue;
            }
            let posed = reaches[i].last > apart.from || (apart.inputs && reaches[i].input);
            let out = &mut out[source.rows.clone()];
            if !posed {
                for (o, c) in out.iter_mut().zip(&center[source.rows.clone()]) {
                    *o = T::splat(*c);
                }
                if let Reader::Imu(s) = reader {
                    let motion = around.differs[s.frame].motion.then_some(&around.frames[s.frame]);
                    s.predict_kept(motion, around.field, &stands[i], out);
                }
                continue;
            }
            match reader {
                Reader::Imu(s) => {
                    let magnetic_field = around.field.unwrap_or(around.mean_field.everywhere());
                    s.predict(&around.frame(s.frame), &Surroundings { magnetic_field }, worn, out);
                }
                Reader::Encoder(s) => out[0] = around.q[s.coordinate],
                Reader::Position(s) => s.predict(&around.frame(s.frame), worn, out),
                Reader::Closure(s) => s.predict_between(s.frames().map(|f| around.frame(f)), worn, out),
            }
        }
    }
}
