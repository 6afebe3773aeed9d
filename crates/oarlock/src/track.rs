//! Tracks a model: `Tracker` takes samples one by one and returns state estimates. `run` and the Python package use it.

pub mod arrivals;
mod bank;
mod begin;
mod entry;
pub mod faults;
pub mod hypothesis;
pub mod loops;
mod lost;
pub mod magnetic;
pub mod many;
pub mod notes;
mod own_time;
mod postures;
mod readings;
mod regain;
mod rest;
pub mod run;
pub mod score;
mod stance;
mod step;
mod strapdown;
mod subject;
mod worn;

use crate::body::Body;
use crate::config::{Config, FilterKind};
use crate::corrections::{Clock, Corrections};
use crate::error::{Error, Result};
use crate::estimate::belief::Belief;
use crate::estimate::filter::{Diverged, Filter, Gate, Info, UpdateSettings};
use crate::estimate::sigma::Spread;
use crate::estimate::transition::Transition;
use crate::kernels::arch::Arch;
use crate::model::Model;
use crate::recording::timing::Streams;
use crate::recording::{Sample, Stream};
use crate::sensor::MountValue;
use entry::Entry;
use faults::{Fault, Faults};
use hypothesis::Hypothesis;
use loops::Loops;
use magnetic::{Field, Magnetic};
use own_time::OwnTime;
use readings::Readings;
use rest::Rest;
use score::Scoring;
use stance::Stance;
use std::collections::BTreeMap;
use std::sync::Arc;
pub use strapdown::structure_of;
use strapdown::Strapdown;
use subject::Subject;
use worn::{as_known, check_stds};
pub use worn::{calibrated, mount_values, parameter_values};

/// Calibration of one session: everything about the sensors and the body that differs from the model file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Calibration {
    /// Parameter values that differ from the model's defaults.
    pub parameters: BTreeMap<String, f64>,
    /// Per inertial unit: rotation from sensor to link axes, and the sensor's origin in the link, m.
    pub mounts: BTreeMap<String, MountValue>,
    /// Corrections of time stamps and readings.
    pub corrections: Corrections,
    /// Standard deviations of parameters, in their unit. An estimated parameter starts with this standard deviation.
    pub parameter_stds: BTreeMap<String, f64>,
    /// Per inertial unit: standard deviations of its mount about the link's axes, rad.
    pub mount_stds_rad: BTreeMap<String, [f64; 3]>,
    /// Per inertial unit: standard deviations of its origin in the link, m.
    pub mount_offset_stds_m: BTreeMap<String, [f64; 3]>,
}

/// How the tracker used a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Stored until the start window is full.
    Starting,
    /// Used.
    Tracking,
    /// Refused because it is not later than the state estimate. Nothing changed.
    OutOfOrder,
}

/// Factor on the gate of gyroscopes and accelerometers: a jolt makes large innovations but is not a sensor fault.
const GATE_SLACK: f64 = 10.0;

/// Called for every processed sample, with the state estimate and the report of its update.
pub type Sink<'a> = &'a mut dyn FnMut(&Sample, &Hypothesis, &Info);

/// The state estimate and the stages of a step with their workspaces.
#[derive(Debug, Clone)]
pub struct Tracker {
    subject: Subject,
    config: Config,
    settings: UpdateSettings,
    /// Per part: whether it is a magnetometer, which is tested more strictly.
    strict: Vec<bool>,
    entry: Entry,
    /// The current sample after corrections.
    corrected: Sample,
    readings: Readings,
    faults: Faults,
    rest: Rest,
    stance: Stance,
    loops: Loops,
    own_time: OwnTime,
    magnetic: Magnetic,
    filter: Filter<Body>,
    /// Only while a recording is scored.
    scoring: Option<Box<Scoring>>,
    transition: Transition,
    info: Info,
    /// Whether several hypotheses compete.
    competes: bool,
    hypothesis: Option<Hypothesis>,
    waiting: Vec<Sample>,
    /// Of a model that is tracked as strapdown links.
    strapdown: Option<Strapdown>,
}

impl Tracker {
    /// Combines model, calibration and configuration. Allocates all memory that steps need.
    pub fn new(model: Arc<Model>, calibration: &Calibration, config: &Config) -> Result<Self> {
        config.check()?;
        let model = match &config.inputs {
            Some(kept) => Arc::new(model.with_inputs(kept)?),
            None => model,
        };
        let model = as_known(model, calibration);
        let parameters = parameter_values(&model, &calibration.parameters)?;
        let mounts = mount_values(&model, &calibration.mounts)?;
        check_stds(&model, calibration)?;
        let body = Body::new(model, &parameters, &mounts, config)?;
        if body.layout.partition.pose == 0 || body.suite.is_empty() {
            return Err(Error::Model(format!(
                "model '{}': nothing to track: it needs a joint that moves (and is no input) and a sensor",
                body.model.name
            )));
        }
        let strapdown = Strapdown::new(&body, calibration, &mounts, config.structure)?;
        let entry = Entry::new(&body, &calibration.corrections)?;
        let subject = Subject::new(body);
        Ok(Tracker {
            settings: update_settings(config),
            strict: magnetic::strict(&subject, config.magnetometer),
            corrected: Sample::empty(&subject.body.model, &subject.body.suite),
            readings: Readings::new(&subject.body),
            faults: Faults::new(&subject, &entry),
            entry,
            rest: Rest::new(&subject.body),
            stance: Stance::new(&subject.body, config.contacts),
            loops: Loops::new(&subject, config.closures),
            own_time: OwnTime::new(&subject, config),
            magnetic: Magnetic::new(&subject, config.magnetometer),
            filter: filter(&subject, config.filter),
            scoring: None,
            transition: Transition::default(),
            info: Info::new(&subject.groups, subject.rows()),
            competes: false,
            hypothesis: None,
            waiting: Vec::new(),
            strapdown,
            config: config.clone(),
            subject,
        })
    }

    /// The configuration with all that it leaves to be found from the time stamps of these streams.
    pub fn settle(&self, streams: &[Stream], clocks: &BTreeMap<String, Clock>, config: &Config) -> Result<Config> {
        let Subject { body, depends, .. } = &self.subject;
        Streams { model: &body.model, suite: &body.suite, depends, streams, clocks }.settle(config)
    }

    /// Continues from a state estimate of an earlier run instead of fitting a start.
    pub fn resume(&mut self, mut start: Hypothesis) -> Result<()> {
        for one in std::iter::once(&start).chain(&start.rivals) {
            self.check_start(one)?;
        }
        self.resume_links(&start)?;
        self.admit_known(&mut start)?;
        self.hypothesis = Some(start);
        Ok(())
    }

    /// Refuses a state estimate of another size or with numbers that are not finite.
    fn check_start(&self, start: &Hypothesis) -> Result<()> {
        let (belief, body, groups) = (&start.belief, &self.subject.body, &self.subject.groups);
        let (n, own, parts) = (belief.mean.len(), body.layout.dim(), groups.parts.len());
        let fits = n == own
            && belief.covariance.n() == own
            && belief.rejected_since_s.len() == parts
            && start.sources.len() == groups.sources.len()
            && start.links.is_some() == self.strapdown.is_some();
        if !fits {
            return Err(Error::Data(format!(
                "belief of {n} states does not fit model '{}' with {own} states: use the same model and config",
                body.model.name
            )));
        }
        let scalars = [belief.time_s, start.score];
        let lists = [&belief.mean, belief.covariance.as_slice(), &scalars];
        if !lists.into_iter().flatten().all(|x| x.is_finite()) {
            return Err(Error::Data(format!(
                "belief at {} s contains numbers that are not finite: start without it, or from an earlier one",
                belief.time_s
            )));
        }
        Ok(())
    }

    /// Selects an instruction set instead of the best one of the machine; for comparisons.
    #[doc(hidden)]
    pub fn use_arch(&mut self, arch: Arch) {
        self.filter.use_arch(arch);
    }

    /// The model with its calibrated numbers.
    pub fn body(&self) -> &Body {
        &self.subject.body
    }

    /// Current state estimate; `None` until the start window is full.
    pub fn belief(&self) -> Option<&Belief> {
        self.hypothesis.as_ref().map(|one| &one.belief)
    }

    /// The leading hypothesis with all that a later tracker needs to continue; `None` until the start window is full.
    pub fn hypothesis(&self) -> Option<&Hypothesis> {
        self.hypothesis.as_ref()
    }

    /// Report of the last update.
    pub fn info(&self) -> &Info {
        &self.info
    }

    /// The report on a sample that was not used.
    pub fn blank_info(&self) -> Info {
        Info::new(&self.subject.groups, self.subject.rows())
    }

    /// Per source: how its magnetometer's reading was judged.
    pub fn fields<'a>(&'a self, info: &'a Info) -> impl Iterator<Item = Field> + 'a {
        magnetic::by_source(&self.subject, info)
    }

    /// Per source: the fault of its readings.
    pub fn source_faults<'a>(&'a self, info: &'a Info) -> impl Iterator<Item = Fault> + 'a {
        faults::by_source(&self.subject, info)
    }

    /// Whether the first samples still wait for the fit of the start.
    pub fn is_starting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// An empty sample of the right size.
    pub fn empty_sample(&self) -> Sample {
        Sample::empty(&self.subject.body.model, &self.subject.body.suite)
    }

    /// Refuses a sample of another size and readings that no sensor can give.
    fn check(&self, sample: &Sample) -> Result<()> {
        let (rows, joints) = (self.subject.rows(), self.readings.moment.inputs.len());
        if (sample.z.len(), sample.inputs.len()) != (rows, joints) {
            return Err(Error::Data(format!(
                "sample at {:.3} s holds {} readings and {} inputs; model '{}' has {rows} and {joints}: \
                 make it with this tracker's own model",
                sample.time_s,
                sample.z.len(),
                sample.inputs.len(),
                self.subject.body.model.name
            )));
        }
        if let Some(offset_s) = sample.offset_s.iter().find(|s| !s.is_finite()) {
            return Err(Error::Data(format!(
                "sample at {:.3} s: a reading is {offset_s} s after it; expected a finite time",
                sample.time_s
            )));
        }
        self.check_finite(sample)
    }

    fn check_finite(&self, sample: &Sample) -> Result<()> {
        if let Some(row) = sample.z.iter().position(|z| z.is_infinite()) {
            let names = self.subject.body.suite.row_names();
            return Err(Error::Data(format!(
                "sample at {:.3} s: {} is infinite; write NaN for a missing value",
                sample.time_s, names[row]
            )));
        }
        if let Some(joint) = sample.inputs.iter().position(|x| x.is_infinite()) {
            return Err(Error::Data(format!(
                "sample at {:.3} s: {} is infinite; write NaN for a missing value",
                sample.time_s,
                self.subject.body.model.coordinate_names()[joint]
            )));
        }
        Ok(())
    }
}

fn filter(subject: &Subject, kind: FilterKind) -> Filter<Body> {
    let Subject { body, groups, .. } = subject;
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
