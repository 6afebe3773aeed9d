//! Closed loop as a virtual sensor that always reads zero: two points agree, and two axes (eqs. 15 to 18).

use super::{Quantity, RowGroups, Wearing, Worn};
use crate::kernels::lane::Real;
use crate::kinematics::FrameMotion;
use crate::model::{Closure, Point};

/// A loop at one set of parameters.
#[derive(Debug, Clone)]
pub struct Loop {
    pub(super) sides: [(usize, Point); 2],
    pub(super) axes: Option<[[f64; 3]; 2]>,
    std_m: f64,
    std_axis: f64,
}

impl Loop {
    /// From the model's description.
    pub fn new(closure: &Closure, worn: &Wearing) -> Self {
        let side = |s: &(usize, [crate::model::Expr; 3])| (s.0, Point::of(&s.1, worn.parameters, worn.estimated));
        Loop {
            sides: [side(&closure.sides[0]), side(&closure.sides[1])],
            axes: closure.axes,
            std_m: closure.std_m,
            std_axis: closure.std_axis,
        }
    }

    /// The frames on either side.
    pub fn frames(&self) -> [usize; 2] {
        [self.sides[0].0, self.sides[1].0]
    }

    /// Gap x, y, z, then the difference of the axes if they must agree.
    pub fn rows(&self) -> RowGroups {
        let gap: &'static [&'static str] = &["x", "y", "z"];
        let both: &'static [&'static str] = &["x", "y", "z", "axis_x", "axis_y", "axis_z"];
        let mut std = vec![self.std_m; 3];
        if self.axes.is_none() {
            return vec![(Quantity::Closure, gap, std)];
        }
        std.extend([self.std_axis; 3]);
        vec![(Quantity::Closure, both, std)]
    }

    /// First side minus second side, in root axes.
    #[inline(always)]
    pub fn predict<T: Real>(&self, frames: &[FrameMotion<T>], worn: Worn<T>, out: &mut [T]) {
        self.predict_between(self.frames().map(|f| frames[f]), worn, out);
    }

    /// The same for the frames on either side.
    #[inline(always)]
    pub fn predict_between<T: Real>(&self, [a, b]: [FrameMotion<T>; 2], worn: Worn<T>, out: &mut [T]) {
        let end = |f: &FrameMotion<T>, p: &Point| f.position + p.turned(&f.rotation, worn.lengths);
        let gap = end(&a, &self.sides[0].1) - end(&b, &self.sides[1].1);
        [out[0], out[1], out[2]] = gap.0;
        if let Some([za, zb]) = self.axes {
            let turn = a.rotation.apply_f64(za) - b.rotation.apply_f64(zb);
            [out[3], out[4], out[5]] = turn.0;
        }
    }
}
