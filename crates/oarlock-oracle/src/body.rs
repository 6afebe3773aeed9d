//! Readings of a body in the plainest form: one number at a time, each frame's motion in its own axes as in eq. 9 of
//! Ruffaldi, Peppoloni and Filippeschi, with the terms that the printed equation omits.

use super::so3;
use nalgebra::{DVector, Matrix3, Vector3};
use oarlock::model::{Expr, Imu, JointKind, Model, Sensor, SensorKind, Transform};
use oarlock::rotation::Mat3;
use std::collections::HashMap;

/// Motion of a frame; vectors in its own axes.
#[derive(Clone, Copy)]
pub struct Motion {
    /// Rotation from the frame's axes to the root's.
    pub root_from_frame: Matrix3<f64>,
    /// Origin in root axes, m.
    pub place: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub spin: Vector3<f64>,
    /// Its derivative, rad/s2.
    pub spin_rate: Vector3<f64>,
    /// Acceleration of the origin minus gravity, m/s2.
    pub force: Vector3<f64>,
}

impl Motion {
    /// Specific force at `arm` from the origin.
    fn force_at(&self, arm: Vector3<f64>) -> Vector3<f64> {
        self.force + self.spin_rate.cross(&arm) + self.spin.cross(&self.spin.cross(&arm))
    }

    fn moved(self, turn: Matrix3<f64>, arm: Vector3<f64>) -> Motion {
        let back = turn.transpose();
        Motion {
            root_from_frame: self.root_from_frame * turn,
            place: self.place + self.root_from_frame * arm,
            spin: back * self.spin,
            spin_rate: back * self.spin_rate,
            force: back * self.force_at(arm),
        }
    }

    fn hinged(self, q: f64, qd: f64, qdd: f64) -> Motion {
        let z = Vector3::z();
        let mut next = self;
        next.spin = self.spin + z * qd;
        next.spin_rate = self.spin_rate + z * qdd + self.spin.cross(&z) * qd;
        let turn = *nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), q).matrix();
        next.moved(turn, Vector3::zeros())
    }

    fn slid(self, q: f64, qd: f64, qdd: f64) -> Motion {
        let z = Vector3::z();
        self.placed([z * q, z * qd, z * qdd])
    }

    /// Moves to a position with this velocity and acceleration, in the frame's own axes.
    fn placed(self, [q, qd, qdd]: [Vector3<f64>; 3]) -> Motion {
        let mut next = self;
        next.force = self.force_at(q) + self.spin.cross(&qd) * 2.0 + qdd;
        next.place = self.place + self.root_from_frame * q;
        next
    }

    /// Rotates by a rotation vector; `w` and `wd` are the child's relative angular velocity in the child's axes, and
    /// its derivative.
    fn balled(self, [r, w, wd]: [Vector3<f64>; 3]) -> Motion {
        let mut next = self.moved(so3::exp(r), Vector3::zeros());
        next.spin_rate += wd + next.spin.cross(&w);
        next.spin += w;
        next
    }
}

/// A coordinate with its derivatives; for a rotation vector, the child's angular rates.
pub type JointState = [f64; 3];

/// Workspace for one evaluation of the readings.
#[derive(Default)]
pub struct Room {
    joints: Vec<JointState>,
    frames: Vec<Motion>,
    rows: Vec<f64>,
}

/// A rotation and a translation.
type Step = (Matrix3<f64>, Vector3<f64>);

/// A model with its numbers, and the indices of its coordinates in a state.
pub struct Naive<'a> {
    /// The model's description.
    pub model: &'a Model,
    /// Names of the coordinates.
    pub coordinates: Vec<String>,
    /// First state of every rotation vector.
    pub turns: Vec<usize>,
    places: HashMap<String, usize>,
    /// Per coordinate: indices of its value, velocity and acceleration in the state.
    states: Vec<[Option<usize>; 3]>,
    /// State of the field's azimuth.
    pub azimuth: Option<usize>,
    bases: Vec<Option<usize>>,
    /// Rows and the states that are added to them.
    biases: Vec<(usize, usize)>,
    /// Transforms before and after every joint.
    transforms: Vec<[Option<Step>; 2]>,
    /// Per sensor: its position on the link, and the rotation from link to sensor axes.
    arms: Vec<Vector3<f64>>,
    backs: Vec<Matrix3<f64>>,
    /// Points of both sides of every closure, and of every sensor with two sides.
    ends: Vec<[Vector3<f64>; 2]>,
    spans: Vec<[Vector3<f64>; 2]>,
    /// Per sensor: the state of its heading, and the measured rotation of an orientation sensor, reference from sensor.
    headings: Vec<Option<usize>>,
    references: Vec<Matrix3<f64>>,
    field: [f64; 2],
}

impl<'a> Naive<'a> {
    /// `parameters` in the order of the model's; `names` are those of the states, in the order of the state.
    pub fn new(model: &'a Model, parameters: Vec<f64>, names: &[String]) -> Self {
        let places: HashMap<String, usize> = names.iter().cloned().zip(0..).collect();
        let coordinates = model.coordinate_names();
        let turns = model.joints.iter().filter_map(|joint| joint.turn());
        let turns = turns.filter_map(|c| places.get(&coordinates[c]).copied()).collect();
        let place = |name: &str| places.get(name).copied();
        let rate = |name: &str, what: &str| place(&format!("{name}.{what}"));
        let states = |c: &String| [place(c), rate(c, "velocity"), rate(c, "acceleration")];
        let biases = row_names(model).into_iter().enumerate().filter_map(|(row, name)| {
            let bias = name.replace(".gyro_", ".gyro_bias_").replace(".accel_", ".accel_bias_");
            let bias = bias.replace(".r", ".orientation_error_");
            place(&bias).filter(|_| bias != name).map(|state| (row, state))
        });
        let fixed = |t: &Option<Transform>| {
            let (turn, arm) = t.as_ref()?.evaluate(&parameters);
            Some((matrix(&turn), Vector3::from(arm)))
        };
        let point = |e: &[Expr; 3]| Vector3::from([0, 1, 2].map(|i| e[i].eval(&parameters)));
        let arm = |s: &Sensor| match &s.kind {
            SensorKind::Imu(Imu { mount, .. }) => point(&mount.offset),
            SensorKind::Encoder { .. } => Vector3::zeros(),
            SensorKind::Position(p) => point(&p.point),
            SensorKind::Range(_) | SensorKind::Orientation(_) => Vector3::zeros(),
        };
        let back = |s: &Sensor| match &s.kind {
            SensorKind::Imu(Imu { mount, .. }) => matrix(&mount.rotation).transpose(),
            SensorKind::Orientation(o) => matrix(&o.mount.rotation).transpose(),
            _ => Matrix3::identity(),
        };
        let span = |s: &Sensor| match &s.kind {
            SensorKind::Range(r) => [0, 1].map(|i| point(&r.ends[i].1)),
            _ => [Vector3::zeros(); 2],
        };
        let heading = |s: &Sensor| match &s.kind {
            SensorKind::Orientation(o) => o.heading.as_ref().and_then(|h| place(&format!("{}.heading", h.group))),
            _ => None,
        };
        Naive {
            model,
            turns,
            states: coordinates.iter().map(states).collect(),
            azimuth: place("azimuth"),
            bases: model.base_accelerations.iter().map(|b| place(&b.name)).collect(),
            biases: biases.collect(),
            transforms: model.frames.iter().map(|f| [fixed(&f.before), fixed(&f.after)]).collect(),
            arms: model.sensors.iter().map(arm).collect(),
            backs: model.sensors.iter().map(back).collect(),
            spans: model.sensors.iter().map(span).collect(),
            headings: model.sensors.iter().map(heading).collect(),
            references: vec![Matrix3::identity(); model.sensors.len()],
            ends: model.closures.iter().map(|c| [0, 1].map(|i| point(&c.sides[i].1))).collect(),
            field: [&model.world.magnetic_norm_ut, &model.world.magnetic_dip_rad].map(|e| e.eval(&parameters)),
            coordinates,
            places,
        }
    }

    /// Sets the measured rotation vector of an orientation sensor; its rows are differences from it.
    pub fn refer(&mut self, sensor: &str, measured: [f64; 3]) {
        if let Some(i) = self.model.sensors.iter().position(|s| s.name == sensor) {
            self.references[i] = so3::exp(Vector3::from(measured));
        }
    }

    /// Index of the state with this name.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.places.get(name).copied()
    }

    /// Of every free joint: first states of its position, velocity and acceleration, and of its rotation.
    pub fn free_joints(&self) -> Vec<(Vec<usize>, usize)> {
        let free = self.model.joints.iter().filter(|joint| joint.kind == JointKind::Free);
        let states = |joint: &oarlock::model::Joint| {
            let turn = self.states[joint.first + 3][0]?;
            Some((self.states[joint.first].into_iter().flatten().collect(), turn))
        };
        free.filter_map(states).collect()
    }

    /// Of every ball that nothing moving carries: its first state, and the vertical in the axes it turns from.
    pub fn first_balls(&self) -> Vec<(usize, Vector3<f64>)> {
        let turn = |step: &Option<Step>| step.map_or(Matrix3::identity(), |(turn, _)| turn);
        let ball = |i: usize| {
            let joint = &self.model.joints[self.model.frames[i].joint?.0];
            let (state, mut axes) = (self.states[joint.first][0]?, turn(&self.transforms[i][0]));
            let mut at = self.model.frames[i].parent;
            while at != 0 {
                if self.model.frames[at].joint.is_some() {
                    return None;
                }
                axes = turn(&self.transforms[at][0]) * turn(&self.transforms[at][1]) * axes;
                at = self.model.frames[at].parent;
            }
            let up = axes.transpose() * Vector3::from(self.model.world.up);
            (joint.kind == JointKind::Ball).then_some((state, up))
        };
        (1..self.model.frames.len()).filter_map(ball).collect()
    }

    /// Motion of all frames, the root's first.
    fn frames(&self, root: Motion, joints: &[JointState], frames: &mut Vec<Motion>) {
        frames.clear();
        frames.push(root);
        for (frame, [before, after]) in self.model.frames.iter().zip(&self.transforms).skip(1) {
            let mut m = fixed(frames[frame.parent], before);
            if let Some((j, sign)) = frame.joint {
                let first = self.model.joints[j].first;
                let [q, qd, qdd] = joints[first].map(|x| x * sign);
                m = match self.model.joints[j].kind {
                    JointKind::Fixed => m,
                    JointKind::Hinge => m.hinged(q, qd, qdd),
                    JointKind::Slide => m.slid(q, qd, qdd),
                    JointKind::Ball => m.balled(vectors(joints, first)),
                    JointKind::Free => m.placed(vectors(joints, first)).balled(vectors(joints, first + 3)),
                };
            }
            frames.push(fixed(m, after));
        }
    }

    /// All rows, in the order of the model, for a root with motion `root` in a field (uT) in root axes.
    pub fn rows(&self, root: Motion, field: Vector3<f64>, joints: &[JointState]) -> Vec<f64> {
        let mut room = Room { joints: joints.to_vec(), ..Room::default() };
        let states = vec![0.0; self.places.len()];
        self.read(root, field, &states, &mut room);
        room.rows
    }

    /// The same for the joints in `room`, which also receives the rows, and for headings in `states`.
    fn read(&self, root: Motion, field: Vector3<f64>, states: &[f64], room: &mut Room) {
        let Room { joints, frames, rows: out } = room;
        self.frames(root, joints, frames);
        out.clear();
        for (i, ((sensor, arm), back)) in self.model.sensors.iter().zip(&self.arms).zip(&self.backs).enumerate() {
            match &sensor.kind {
                SensorKind::Imu(Imu { frame, noise, .. }) => {
                    let m = frames[*frame];
                    noise.gyro_std.inspect(|_| out.extend((back * m.spin).iter()));
                    noise.accel_std.inspect(|_| out.extend((back * m.force_at(*arm)).iter()));
                    let local = m.root_from_frame.transpose() * field;
                    noise.mag_std.inspect(|_| out.extend((back * local).iter()));
                }
                SensorKind::Encoder(e) if self.model.joints[e.joint].input => {}
                SensorKind::Encoder(e) => out.push(joints[self.model.joints[e.joint].first][0]),
                SensorKind::Position(p) => {
                    out.extend((frames[p.frame].place + frames[p.frame].root_from_frame * arm).iter());
                }
                SensorKind::Range(r) => {
                    let end = |k: usize| {
                        let frame = &frames[r.ends[k].0];
                        frame.place + frame.root_from_frame * self.spans[i][k]
                    };
                    out.push((end(0) - end(1)).norm());
                }
                SensorKind::Orientation(o) => {
                    let heading = self.headings[i].map_or(0.0, |s| states[s]);
                    out.extend(self.off(i, frames[o.frame].root_from_frame * back.transpose(), heading).iter());
                }
            }
        }
        self.loop_rows(frames, out);
    }

    /// Rotation vector from the measured to the predicted orientation; the device's reference is rotated by `heading`.
    fn off(&self, i: usize, root_from_sensor: Matrix3<f64>, heading: f64) -> Vector3<f64> {
        let world = &self.model.world;
        let (up, forward) = (Vector3::from(world.up), Vector3::from(world.forward));
        let root_from_reference = Matrix3::from_columns(&[forward, up.cross(&forward), up]);
        let device = so3::exp(up * heading) * root_from_sensor;
        so3::log(&((root_from_reference * self.references[i]).transpose() * device))
    }

    fn loop_rows(&self, frames: &[Motion], out: &mut Vec<f64>) {
        for (closure, ends) in self.model.closures.iter().zip(&self.ends) {
            let end = |side: usize| {
                let frame = &frames[closure.sides[side].0];
                frame.place + frame.root_from_frame * ends[side]
            };
            out.extend((end(0) - end(1)).iter());
            if let Some(axes) = closure.axes {
                let axis = |side: usize| frames[closure.sides[side].0].root_from_frame * Vector3::from(axes[side]);
                out.extend((axis(0) - axis(1)).iter());
            }
        }
    }

    /// All rows at state `x`.
    pub fn measure(&self, x: &DVector<f64>, inputs: &[f64]) -> DVector<f64> {
        DVector::from_column_slice(self.measure_in(x, inputs, &mut Room::default()))
    }

    /// All rows at state `x`, in an existing workspace.
    pub fn measure_in<'r>(&self, x: &DVector<f64>, inputs: &[f64], room: &'r mut Room) -> &'r [f64] {
        let joint = |(states, &input): (&[Option<usize>; 3], &f64)| match states[0] {
            None => [if input.is_nan() { 0.0 } else { input }, 0.0, 0.0],
            Some(_) => states.map(|s| s.map_or(0.0, |s| x[s])),
        };
        room.joints.clear();
        room.joints.extend(self.states.iter().zip(inputs).map(joint));
        let world = &self.model.world;
        let mut force = Vector3::from(world.up) * world.gravity_m_s2;
        for (base, state) in self.model.base_accelerations.iter().zip(&self.bases) {
            force += Vector3::from(base.axis) * state.map_or(0.0, |s| x[s]);
        }
        let azimuth = self.azimuth.map_or(world.magnetic_azimuth_rad, |s| x[s]);
        self.read(resting(force), self.field(azimuth), x.as_slice(), room);
        for (row, state) in &self.biases {
            room.rows[*row] += x[*state];
        }
        &room.rows
    }

    fn field(&self, azimuth: f64) -> Vector3<f64> {
        let world = &self.model.world;
        let (up, forward) = (Vector3::from(world.up), Vector3::from(world.forward));
        let level = forward * azimuth.cos() + up.cross(&forward) * azimuth.sin();
        let [norm, dip] = self.field;
        (level * dip.cos() - up * dip.sin()) * norm
    }

    /// Standard deviation of each row.
    pub fn std(&self) -> Vec<f64> {
        let mut std = Vec::new();
        for sensor in &self.model.sensors {
            match &sensor.kind {
                SensorKind::Imu(Imu { noise, .. }) => {
                    let parts = [noise.gyro_std, noise.accel_std, noise.mag_std];
                    std.extend(parts.into_iter().flatten().flat_map(|s| [s; 3]));
                }
                SensorKind::Encoder(e) if self.model.joints[e.joint].input => {}
                SensorKind::Encoder(e) => std.push(e.std),
                SensorKind::Position(p) => std.extend([p.std_m; 3]),
                SensorKind::Range(r) => std.push(r.std_m),
                SensorKind::Orientation(o) if o.correlation_time_s > 0.0 => std.extend([o.white_std_rad; 3]),
                SensorKind::Orientation(o) => std.extend([o.std_rad; 3]),
            }
        }
        for closure in &self.model.closures {
            std.extend([closure.std_m; 3]);
            std.extend(closure.axes.iter().flat_map(|_| [closure.std_axis; 3]));
        }
        std
    }
}

fn fixed(m: Motion, transform: &Option<Step>) -> Motion {
    transform.map_or(m, |(turn, arm)| m.moved(turn, arm))
}

/// Names of the rows, without those of closures.
fn row_names(model: &Model) -> Vec<String> {
    let mut names = Vec::new();
    for sensor in &model.sensors {
        match &sensor.kind {
            SensorKind::Imu(Imu { noise, .. }) => {
                let parts = [("gyro", noise.gyro_std), ("accel", noise.accel_std), ("mag", noise.mag_std)];
                for (part, _) in parts.iter().filter(|p| p.1.is_some()) {
                    names.extend(["x", "y", "z"].map(|a| format!("{}.{part}_{a}", sensor.name)));
                }
            }
            SensorKind::Encoder(e) if model.joints[e.joint].input => {}
            SensorKind::Encoder { .. } => names.push(sensor.name.clone()),
            SensorKind::Position { .. } => names.extend(["x", "y", "z"].map(|a| format!("{}.{a}", sensor.name))),
            SensorKind::Range(_) => names.push(sensor.name.clone()),
            SensorKind::Orientation(_) => names.extend(["x", "y", "z"].map(|a| format!("{}.r{a}", sensor.name))),
        }
    }
    names
}

/// A root at rest with specific force `force`.
pub fn resting(force: Vector3<f64>) -> Motion {
    let zero = Vector3::zeros();
    Motion { root_from_frame: Matrix3::identity(), place: zero, spin: zero, spin_rate: zero, force }
}

/// Three consecutive coordinates with their rates.
fn vectors(joints: &[JointState], first: usize) -> [Vector3<f64>; 3] {
    [0, 1, 2].map(|d| Vector3::from([0, 1, 2].map(|i| joints[first + i][d])))
}

fn matrix(m: &Mat3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| m.0[i][j])
}
