//! From samples to beliefs: start, step, and the whole recording.

pub mod bank;
pub mod begin;
mod consider;
pub mod faults;
pub mod loops;
pub mod lost;
pub mod magnetic;
pub mod many;
pub mod north;
pub mod notes;
mod postures;
pub mod regain;
pub mod rest;
pub mod run;
pub mod score;
mod worn;

use crate::body::posture::Posture;
use crate::body::{Body, Moment};
use crate::config::{Config, FilterKind, Magnetometer};
use crate::error::{Error, Result};
use crate::estimate::belief::Belief;
use crate::estimate::filter::{DirectionTest, Diverged, Filter, Gate, Info, Measurement, RowGroups, UpdateSettings};
use crate::estimate::learn::Learning;
use crate::estimate::sigma::Spread;
use crate::estimate::transition::Transition;
use crate::estimate::System;
use crate::kernels::arch::Arch;
use crate::model::Model;
use crate::recording::Sample;
use crate::sensor::imu::MountValue;
use crate::sensor::Quantity;
use consider::Considering;
use faults::Fault;
use loops::Loop;
use std::collections::BTreeMap;
use std::sync::Arc;
use worn::{as_known, check_stds, row_offsets};
pub use worn::{mount_values, parameter_values};

/// What is known of one wearing of the sensors.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Calibration {
    /// Parameter values that differ from the model's defaults.
    pub parameters: BTreeMap<String, f64>,
    /// Per inertial unit: link from sensor, and its origin in the link, m.
    pub mounts: BTreeMap<String, MountValue>,
    /// Per inertial unit: constant part of its magnetometer's readings, uT in sensor axes.
    pub mag_offsets: BTreeMap<String, [f64; 3]>,
    /// Standard deviations of parameters, in their unit: at the start of those that are estimated; else they widen the bands,
    /// as do the next two.
    pub parameter_stds: BTreeMap<String, f64>,
    /// Per inertial unit: standard deviations of its mount about the link's axes, rad.
    pub mount_stds_rad: BTreeMap<String, [f64; 3]>,
    /// Per inertial unit: standard deviations of its origin in the link, m.
    pub mount_offset_stds_m: BTreeMap<String, [f64; 3]>,
}

/// What became of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Kept until the start window is full.
    Starting,
    /// Taken in.
    Tracking,
    /// Not later than the belief: refused, nothing changed.
    OutOfOrder,
}

/// Longest single prediction, s: after a gap the spring that holds unobserved joints must be able to set in.
const LONGEST_STEP_S: f64 = 0.1;
/// In a long gap predictions may be as long as this share of the time already bridged: a variance grows by at most 1.1^5
/// in one of them, and a stamp from another clock costs hundreds of predictions, not billions.
const STEP_SHARE: f64 = 0.1;
/// Readings that feel the body's own motion are odd only far beyond the quantile: a jolt is not a fault.
const GATE_SLACK: f64 = 10.0;

/// A belief and its workspace.
#[derive(Debug, Clone)]
pub struct Tracker {
    /// The model with its numbers.
    pub body: Body,
    config: Config,
    filter: Filter<Body>,
    groups: RowGroups,
    quantities: Vec<Quantity>,
    loops: Vec<Loop>,
    /// Per source and joint: whether the source feels the joint.
    depends: Vec<Vec<bool>>,
    std: Vec<f64>,
    /// What is subtracted from each row before use.
    offset: Vec<f64>,
    moment: Moment,
    z: Vec<f64>,
    excluded: Vec<bool>,
    /// Per row: the largest that its sensor can read.
    range: Vec<f64>,
    /// Per part: what is wrong with it in this sample.
    faults: Vec<Fault>,
    /// Per part: its field seems to have turned.
    turned: Vec<bool>,
    strict: Vec<bool>,
    direction_tests: Vec<Option<DirectionTest>>,
    /// Room for the belief's mean.
    posture: Posture<f64>,
    settings: UpdateSettings,
    /// Off while several hypotheses compete: who is surprised more often must not excuse it by stronger driving noise.
    learns: bool,
    /// The belief was given up just before this sample's update.
    lost: bool,
    transition: Transition,
    considering: Option<Considering>,
    /// Of each row: its part, and whether an inertial unit reads it.
    part_of: Vec<usize>,
    inertial_rows: Vec<bool>,
    rough_rows: Vec<bool>,
    info: Info,
    belief: Option<Belief>,
    waiting: Vec<Sample>,
}

impl Tracker {
    /// Puts model, calibration and configuration together. Allocates all that steps will need.
    pub fn new(model: Arc<Model>, calibration: &Calibration, config: &Config) -> Result<Self> {
        config.check()?;
        let parameters = parameter_values(&model, &calibration.parameters)?;
        let mounts = mount_values(&model, &calibration.mounts)?;
        check_stds(&model, calibration)?;
        let body = Body::new(as_known(model, calibration), &parameters, &mounts, config)?;
        if body.layout.partition.pose == 0 || body.suite.is_empty() {
            return Err(Error::Model(format!(
                "model '{}': nothing to track: it needs a joint that moves (and is no input) and a sensor",
                body.model.name
            )));
        }
        let considering = Considering::new(&body, &mounts, calibration, config)?;
        let (groups, depends) = (body.groups(), loops::dependence(&body));
        let part_of = groups.parts.iter().enumerate().flat_map(|(p, rows)| rows.clone().map(move |_| p)).collect();
        let rows = body.suite.len();
        Ok(Tracker {
            filter: filter(&body, &groups, config.filter),
            loops: loops::loops(&body, &depends),
            depends,
            quantities: body.quantities(),
            std: body.suite.std(),
            offset: row_offsets(&body, &calibration.mag_offsets)?,
            moment: body.moment(),
            z: vec![f64::NAN; rows],
            excluded: vec![false; groups.parts.len()],
            range: faults::ranges(&body),
            faults: vec![Fault::None; groups.parts.len()],
            turned: vec![false; groups.parts.len()],
            strict: strict(&body, config),
            direction_tests: vec![None; groups.parts.len()],
            posture: Posture::new(&body),
            settings: update_settings(config),
            learns: true,
            lost: false,
            transition: Transition::default(),
            considering,
            part_of,
            rough_rows: (0..rows).map(|r| groups.rough.contains(&r)).collect(),
            inertial_rows: (0..rows).map(|r| groups.inertial.contains(&r)).collect(),
            info: Info::new(&groups, rows),
            belief: None,
            waiting: Vec::new(),
            config: config.clone(),
            groups,
            body,
        })
    }

    /// Goes on from a belief of an earlier run instead of fitting a start.
    pub fn resume(&mut self, belief: Belief) -> Result<()> {
        for one in std::iter::once(&belief).chain(&belief.rivals) {
            self.check_belief(one)?;
        }
        self.belief = Some(belief);
        Ok(())
    }

    /// Refuses a belief of another shape, and numbers that are none.
    fn check_belief(&self, belief: &Belief) -> Result<()> {
        let (n, own, parts) = (belief.mean.len(), self.body.layout.dim(), self.groups.parts.len());
        let fits = n == own
            && belief.covariance.n() == own
            && belief.drive.len() == self.body.driven().len()
            && belief.usual_nis.len() == parts
            && belief.seen_s.len() == self.groups.sources.len()
            && belief.memory.len() == self.groups.sources.len()
            && (belief.doubt.is_empty() || belief.doubt.len() == self.considering.as_ref().map_or(0, Considering::len))
            && belief.rejected_since_s.len() == parts;
        if !fits {
            return Err(Error::Data(format!(
                "belief of {n} states does not fit model '{}' with {own} states: use the same model and config",
                self.body.model.name
            )));
        }
        let scalars =
            [belief.time_s, belief.inflation, belief.surprise, belief.roughness, belief.leftover, belief.score];
        let lists = [&belief.mean, belief.covariance.as_slice(), &belief.drive, &belief.usual_nis, &scalars];
        if !lists.into_iter().flatten().all(|x| x.is_finite()) {
            return Err(Error::Data(format!(
                "belief at {} s holds numbers that are not finite: start without it, or from an earlier one",
                belief.time_s
            )));
        }
        Ok(())
    }

    /// Uses these instructions instead of the machine's best; to compare.
    #[doc(hidden)]
    pub fn use_arch(&mut self, arch: Arch) {
        self.filter.use_arch(arch);
    }

    /// What is believed now; `None` until the start window is full.
    pub fn belief(&self) -> Option<&Belief> {
        self.belief.as_ref()
    }

    /// Report of the last update.
    pub fn info(&self) -> &Info {
        &self.info
    }

    /// The report on a sample that was not taken in: nothing was used.
    pub fn blank_info(&self) -> Info {
        Info::new(&self.groups, self.z.len())
    }

    /// A sample to fill in.
    pub fn empty_sample(&self) -> Sample {
        Sample::empty(&self.body.model, &self.body.suite)
    }

    /// Takes in one sample. After an error of divergence the belief is gone, and the next samples make a new start.
    pub fn step(&mut self, sample: &Sample) -> Result<Status> {
        self.step_with(sample, &mut |_, _, _| {})
    }

    /// Takes in one sample; `sink` sees every sample that was worked off, with the belief and the report behind it.
    pub fn step_with(&mut self, sample: &Sample, sink: &mut dyn FnMut(&Sample, &Belief, &Info)) -> Result<Status> {
        self.check(sample)?;
        let Some(mut belief) = self.belief.take() else {
            return self.gather(sample, sink);
        };
        if sample.time_s <= belief.time_s || !sample.time_s.is_finite() {
            self.belief = Some(belief);
            return Ok(Status::OutOfOrder);
        }
        self.advance_all(&mut belief, sample)?;
        sink(sample, &belief, &self.info);
        self.belief = Some(belief);
        Ok(Status::Tracking)
    }

    /// Refuses a sample of another shape, and readings that no sensor can give.
    fn check(&self, sample: &Sample) -> Result<()> {
        let (rows, joints) = (self.z.len(), self.moment.inputs.len());
        if (sample.z.len(), sample.inputs.len()) != (rows, joints) {
            return Err(Error::Data(format!(
                "sample at {:.3} s holds {} readings and {} inputs; model '{}' has {rows} and {joints}: \
                 make it with this tracker's own model",
                sample.time_s,
                sample.z.len(),
                sample.inputs.len(),
                self.body.model.name
            )));
        }
        if let Some(row) = sample.z.iter().position(|z| z.is_infinite()) {
            let names = self.body.suite.row_names();
            return Err(Error::Data(format!(
                "sample at {:.3} s: {} is infinite; write NaN for a missing value",
                sample.time_s, names[row]
            )));
        }
        if let Some(joint) = sample.inputs.iter().position(|x| x.is_infinite()) {
            return Err(Error::Data(format!(
                "sample at {:.3} s: {} is infinite; write NaN for a missing value",
                sample.time_s,
                self.body.model.coordinate_names()[joint]
            )));
        }
        Ok(())
    }

    /// Works off what still waits for a full start window: the recording is over.
    pub fn finish(&mut self, sink: &mut dyn FnMut(&Sample, &Belief, &Info)) -> Result<()> {
        if self.belief.is_none() && !self.waiting.is_empty() {
            self.begin(sink)?;
        }
        Ok(())
    }

    fn gather(&mut self, sample: &Sample, sink: &mut dyn FnMut(&Sample, &Belief, &Info)) -> Result<Status> {
        let late = self.waiting.last().is_some_and(|w| sample.time_s <= w.time_s);
        if late || !sample.time_s.is_finite() {
            return Ok(Status::OutOfOrder);
        }
        self.waiting.push(sample.clone());
        if sample.time_s - self.waiting[0].time_s < self.config.start_window_s {
            return Ok(Status::Starting);
        }
        self.begin(sink)?;
        Ok(Status::Tracking)
    }

    /// Fits the start and works off the samples that waited for it.
    fn begin(&mut self, sink: &mut dyn FnMut(&Sample, &Belief, &Info)) -> Result<()> {
        let waiting = std::mem::take(&mut self.waiting);
        let mut belief = self.fit_start(&waiting)?;
        self.filter.await_sample();
        for (i, sample) in waiting.iter().enumerate() {
            if i == 0 {
                self.prepare(sample);
                self.open_bank(&mut belief);
                self.update_all(&mut belief, sample)?;
            } else {
                self.advance_all(&mut belief, sample)?;
            }
            sink(sample, &belief, &self.info);
        }
        self.belief = Some(belief);
        Ok(())
    }

    /// Predicts to the sample's time and updates; `on_predicted` sees each prediction and how it came about.
    fn advance(
        &mut self,
        belief: &mut Belief,
        sample: &Sample,
        on_predicted: &mut dyn FnMut(&Transition, &Belief),
    ) -> Result<()> {
        let since = belief.time_s;
        self.filter.await_sample();
        loop {
            let step = LONGEST_STEP_S.max(STEP_SHARE * (belief.time_s - since));
            let next = belief.time_s + step;
            // At large stamps a short step may be lost in rounding.
            let last = sample.time_s - belief.time_s <= step || next <= belief.time_s;
            let to = if last { sample.time_s } else { next };
            self.filter.predict(&self.body, belief, to, &mut self.transition);
            if let Some(considering) = &self.considering {
                considering.predict(&self.transition, &mut belief.doubt);
            }
            if last {
                self.prepare(sample);
                self.lost = self.is_lost(belief);
                if self.lost {
                    self.give_up(belief);
                }
            }
            on_predicted(&self.transition, belief);
            if last {
                return self.update(belief);
            }
        }
    }

    /// Takes in the prepared sample.
    fn update(&mut self, belief: &mut Belief) -> Result<()> {
        let lost = std::mem::take(&mut self.lost);
        self.notice_faults(belief);
        self.notice_rest(belief);
        if (lost || self.must_regain(belief)) && self.regain(belief) {
            self.info.lost = lost;
            if let Some(considering) = &self.considering {
                considering.forget(&mut belief.doubt);
            }
            if lost {
                self.doubt(belief);
            }
            self.report_faults();
            return Ok(());
        }
        self.info.lost = lost;
        self.hush_loops(belief);
        self.mark_seen(belief);
        self.measure_dips(belief);
        self.look_around(belief);
        self.bar_turned(belief);
        let measured = Measurement {
            z: &self.z,
            std: &self.std,
            excluded: &self.excluded,
            strict: &self.strict,
            direction_tests: &self.direction_tests,
            groups: &self.groups,
        };
        let learning = if self.learns { self.settings.learning } else { Learning { memory_s: f64::INFINITY } };
        let settings = UpdateSettings { learning, ..self.settings };
        let done = self.filter.update(&self.body, &self.moment, belief, measured, settings, &mut self.info);
        done.map_err(|lost| diverged(lost, belief.time_s))?;
        self.follow_doubt(belief);
        self.watch_north(belief);
        self.report_faults();
        Ok(())
    }

    /// Fills in inputs and loops, and bars disturbed magnetometers.
    fn prepare(&mut self, sample: &Sample) {
        let readings = sample.z.iter().zip(&self.offset);
        self.z.iter_mut().zip(readings).for_each(|(z, (reading, offset))| *z = reading - offset);
        self.notice_clipping(sample);
        for l in &self.loops {
            let rows = self.body.suite.sources[l.source].rows.clone();
            let speaks = self.config.closures && l.speaks(sample);
            self.z[rows].fill(if speaks { 0.0 } else { f64::NAN });
        }
        self.silence_what_needs_missing_inputs(sample);
        self.judge_norms();
        for (input, &value) in self.moment.inputs.iter_mut().zip(&sample.inputs) {
            *input = if value.is_nan() { 0.0 } else { value };
        }
        self.mark_active();
    }
}

/// Parts that are no judge of motion: magnetometers, unless they are to be used whatever they read.
fn strict(body: &Body, config: &Config) -> Vec<bool> {
    let gated = config.magnetometer == Magnetometer::Gated;
    body.quantities().iter().map(|&q| gated && q == Quantity::Mag).collect()
}

fn filter(body: &Body, groups: &RowGroups, kind: FilterKind) -> Filter<Body> {
    match kind {
        FilterKind::Ukf => Filter::new(body, groups),
        FilterKind::Ekf => Filter::extended(body, groups),
        FilterKind::Factorised => Filter::factorised(body, groups),
    }
}

fn update_settings(c: &Config) -> UpdateSettings {
    UpdateSettings {
        spread: Spread { alpha: c.alpha, beta: c.beta, kappa: c.kappa },
        gate: Gate {
            on: c.gate,
            slack: GATE_SLACK,
            patience_s: c.gate_patience_s,
            strict_patience_s: magnetic::PATIENCE_S.max(c.gate_patience_s),
        },
        learning: Learning { memory_s: c.learning_memory_s.unwrap_or(f64::INFINITY) },
    }
}

fn diverged(lost: Diverged, time_s: f64) -> Error {
    let text = format!(
        "the filter lost the track at {time_s:.3} s: {}. Check mounts and lengths, units and clocks of the streams, \
         or try wider noise in the model file",
        lost.what
    );
    Error::Diverged { time_s, text }
}
