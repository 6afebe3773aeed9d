//! The sequence of a step: from a sample to the updated state estimate.

use super::bank::Bank;
use super::begin::{Seen, Start};
use super::hypothesis::Hypothesis;
use super::{diverged, lost, regain, Sink, Status, Tracker};
use crate::error::Result;
use crate::estimate::belief::Belief;
use crate::estimate::filter::{Diverged, Measurement};
use crate::estimate::transition::Transition;
use crate::recording::Sample;

/// Longest single prediction, s. In a gap the spring of unobserved joints must take effect.
const LONGEST_STEP_S: f64 = 0.1;
/// In a long gap a prediction may last this share of the time already bridged: a variance grows by at most 1.1^5 in one
/// of them, and a wrong time stamp costs hundreds of predictions instead of billions.
const STEP_SHARE: f64 = 0.1;
impl Tracker {
    /// Processes one sample. After a divergence error the state estimate is discarded, and the next samples start anew.
    pub fn step(&mut self, sample: &Sample) -> Result<Status> {
        self.step_with(sample, &mut |_, _, _| {})
    }

    /// Processes one sample and those that waited for the start window; `sink` receives each corrected sample.
    pub fn step_with(&mut self, sample: &Sample, sink: Sink) -> Result<Status> {
        self.check(sample)?;
        let mut corrected = std::mem::take(&mut self.corrected);
        corrected.clone_from(sample);
        self.entry.correct(&mut corrected);
        let done = self.check_finite(&corrected).and_then(|()| self.take_in(&corrected, sink));
        self.corrected = corrected;
        done
    }

    /// Processes a corrected sample.
    fn take_in(&mut self, sample: &Sample, sink: Sink) -> Result<Status> {
        if self.strapdown.is_some() {
            return self.take_in_links(sample, sink);
        }
        let Some(mut one) = self.hypothesis.take() else {
            return self.gather(sample, sink);
        };
        if sample.time_s <= one.belief.time_s || !sample.time_s.is_finite() {
            self.hypothesis = Some(one);
            return Ok(Status::OutOfOrder);
        }
        self.advance_all(&mut one, sample)?;
        sink(sample, &one, &self.info);
        self.hypothesis = Some(one);
        Ok(Status::Tracking)
    }

    /// Processes samples that still wait for a full start window at the end of the recording.
    pub fn finish(&mut self, sink: Sink) -> Result<()> {
        if self.strapdown.is_some() {
            return self.finish_links(sink);
        }
        if self.hypothesis.is_none() && !self.waiting.is_empty() {
            self.begin(sink)?;
        }
        Ok(())
    }

    fn gather(&mut self, sample: &Sample, sink: Sink) -> Result<Status> {
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

    /// Fits the start and processes the samples that waited for it.
    fn begin(&mut self, sink: Sink) -> Result<()> {
        let waiting = std::mem::take(&mut self.waiting);
        let mut one = self.fit_start(&waiting)?;
        self.filter.begin_sample();
        for (i, sample) in waiting.iter().enumerate() {
            if i == 0 {
                self.prepare(sample);
                self.open_bank(&mut one);
                self.update_all(&mut one, sample)?;
            } else {
                self.advance_all(&mut one, sample)?;
            }
            sink(sample, &one, &self.info);
        }
        self.hypothesis = Some(one);
        Ok(())
    }

    /// State estimate at the first sample, before its update.
    pub(super) fn fit_start(&mut self, samples: &[Sample]) -> Result<Hypothesis> {
        let see = |sample: &Sample| {
            self.prepare(sample);
            let z = self.readings.without(&self.subject, &self.magnetic.excluded);
            Seen { time_s: sample.time_s, moment: self.readings.moment.clone(), z }
        };
        let window = samples.iter().map(see).collect();
        Start { subject: &self.subject, initial_q: self.config.initial_q.as_deref() }.fit(window)
    }

    /// Steps every hypothesis; the likeliest leads.
    fn advance_all(&mut self, one: &mut Hypothesis, sample: &Sample) -> Result<()> {
        self.competes = !one.rivals.is_empty();
        if one.rivals.is_empty() {
            self.advance(one, sample, &mut |_, _| {})?;
            self.open_bank(one);
            return Ok(());
        }
        self.compete(one, &mut |tracker, one| tracker.advance(one, sample, &mut |_, _| {}))
    }

    /// Updates every hypothesis with the first sample.
    fn update_all(&mut self, one: &mut Hypothesis, sample: &Sample) -> Result<()> {
        self.competes = !one.rivals.is_empty();
        if one.rivals.is_empty() {
            self.prepare(sample);
            return self.update(one, false);
        }
        self.compete(one, &mut |tracker, one| {
            tracker.prepare(sample);
            tracker.update(one, false)
        })
    }

    fn compete(
        &mut self,
        leader: &mut Hypothesis,
        go: &mut dyn FnMut(&mut Self, &mut Hypothesis) -> Result<()>,
    ) -> Result<()> {
        let rivals = std::mem::take(&mut leader.rivals);
        let mut alive = Vec::new();
        let mut failed = None;
        for mut one in std::iter::once(leader.clone()).chain(rivals) {
            match go(self, &mut one) {
                Ok(()) => {
                    one.score += self.info.log_likelihood;
                    alive.push((one, self.info.clone()));
                }
                Err(e) => failed = Some(e),
            }
        }
        match (self.bank().settle(alive), failed) {
            (Some((likeliest, info)), _) => (*leader, self.info) = (likeliest, info),
            (None, Some(e)) => return Err(e),
            (None, None) => return Err(diverged(Diverged { what: "no hypothesis fits".into() }, leader.belief.time_s)),
        }
        Ok(())
    }

    fn bank(&self) -> Bank<'_> {
        Bank { subject: &self.subject, moment: &self.readings.moment }
    }

    /// Splits a hypothesis if a joint's direction is very uncertain.
    pub(super) fn open_bank(&self, one: &mut Hypothesis) {
        self.bank().open(one);
    }

    /// Predicts to the sample's time and updates; `on_predicted` receives each prediction.
    pub(super) fn advance(
        &mut self,
        one: &mut Hypothesis,
        sample: &Sample,
        on_predicted: &mut dyn FnMut(&Transition, &Belief),
    ) -> Result<()> {
        let since_s = one.belief.time_s;
        self.filter.begin_sample();
        loop {
            let now_s = one.belief.time_s;
            let step_s = LONGEST_STEP_S.max(STEP_SHARE * (now_s - since_s));
            // At large time stamps a short step may be lost to rounding.
            let is_last = sample.time_s - now_s <= step_s || now_s + step_s <= now_s;
            self.predict(one, if is_last { sample.time_s } else { now_s + step_s });
            if !is_last {
                on_predicted(&self.transition, &one.belief);
                continue;
            }
            self.prepare(sample);
            let patience_s = self.filter.patience_s(self.settings.gate);
            let is_lost = self.config.gate && lost::is_lost(&self.subject, &self.readings, one, patience_s);
            if is_lost {
                lost::give_up(&self.subject, &self.readings, one);
            }
            on_predicted(&self.transition, &one.belief);
            return self.update(one, is_lost);
        }
    }

    fn predict(&mut self, one: &mut Hypothesis, to_s: f64) {
        self.filter.predict(&self.subject.body, &mut one.belief, to_s, &mut self.transition);
        if let Some(scoring) = &self.scoring {
            scoring.predict(&self.transition, &mut one.slopes);
        }
    }

    /// Adds inputs and closures, removes readings that are not measurements, and excludes disturbed magnetometers.
    fn prepare(&mut self, sample: &Sample) {
        let Tracker { subject, readings, .. } = self;
        readings.take(sample);
        self.faults.silence_clipped(subject, readings);
        readings.refer(subject);
        let is_empty = sample.z.iter().chain(&sample.inputs).all(|x| x.is_nan());
        self.loops.fill(subject, readings, is_empty);
        readings.silence_what_needs_missing_inputs(subject, sample);
        self.magnetic.judge_norms(subject, readings);
        readings.mark_active(subject);
    }

    /// Updates with the prepared sample; `is_lost`: the filter was reset before it.
    fn update(&mut self, one: &mut Hypothesis, is_lost: bool) -> Result<()> {
        let Tracker { subject, readings, .. } = self;
        let time_s = one.belief.time_s;
        self.faults.silence_stuck(subject, &mut one.sources, readings, time_s);
        self.magnetic.follow_norms(subject, &mut one.sources, readings, time_s);
        self.rest.notice(&mut one.sources, readings, time_s);
        self.stance.notice(&mut one.sources, readings, time_s);
        self.loops.wait(subject, &one.sources, time_s, readings);
        let must_regain = is_lost || regain::is_due(subject, &self.loops, readings, one);
        if !(must_regain && self.regain(one, is_lost)) {
            self.filter_readings(one)?;
        }
        self.info.lost = is_lost;
        self.faults.report(&self.subject, &self.readings, &mut self.info);
        self.subject.excuse_virtual(&mut self.info);
        Ok(())
    }

    /// Fits the posture to the prepared sample; false if no fit succeeds.
    fn regain(&mut self, one: &mut Hypothesis, is_lost: bool) -> bool {
        let excluded = &self.magnetic.excluded;
        let Some(info) = regain::regain(&self.subject, &self.readings, excluded, &mut one.belief) else {
            return false;
        };
        self.info = info;
        self.readings.mark_seen(&mut one.sources, one.belief.time_s);
        // The fit does not depend on the mean before it.
        one.slopes.fill(0.0);
        if is_lost {
            lost::doubt_fit(&self.subject, &mut one.belief);
        }
        true
    }

    /// The update with its tests.
    fn filter_readings(&mut self, one: &mut Hypothesis) -> Result<()> {
        let Tracker { subject, readings, magnetic, .. } = self;
        let time_s = one.belief.time_s;
        self.loops.hush(subject, &one.sources, time_s, readings);
        readings.mark_seen(&mut one.sources, time_s);
        self.own_time.bring(subject, &one.belief, readings);
        magnetic.raise(subject, &one.sources, readings);
        magnetic.measure_dips(subject, &mut one.sources, readings, &one.belief.mean);
        if let Some(scoring) = &mut self.scoring {
            scoring.linearise(&one.belief, &mut one.slopes, &readings.moment);
        }
        let measured = Measurement {
            z: &readings.z,
            std: &readings.std,
            excluded: &magnetic.excluded,
            strict: &self.strict,
            direction_tests: &magnetic.direction_tests,
            groups: &subject.groups,
        };
        let (moment, settings) = (&readings.moment, self.settings);
        let done = self.filter.update(&subject.body, moment, &mut one.belief, measured, settings, &mut self.info);
        done.map_err(|lost| diverged(lost, time_s))?;
        if let Some(scoring) = &mut self.scoring {
            scoring.take_update((subject, readings), (&self.filter, &self.info), one, !self.competes);
        }
        Ok(())
    }
}
