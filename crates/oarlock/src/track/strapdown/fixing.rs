//! How units sit on their links: the likelihood of the first seconds of movement decides. `strapdown` follows every possibility until then.

use super::super::Tracker;
use super::LinkState;
use crate::error::Result;
use crate::model::{Fixing, Links};
use crate::recording::Recording;
use crate::strapdown::filter::{Node, State, StrapdownFilter};
use crate::strapdown::increment::{square, Readings};

/// Times of movement after which skin may be decided, and after which everything is, s.
const SKIN_AFTER_S: f64 = 10.0;
const DECIDED_AFTER_S: f64 = 20.0;
/// After this time of movement, s, what trails by so much, log-likelihood per unit and second, is not followed further: no body came back.
const CLEAR_AFTER_S: f64 = 3.0;
const CLEARLY_BEHIND: f64 = 10.0;
/// Log-likelihood per unit and second by which no skin must be likelier than a little. Skin that is left out wrongly costs 2 to 6 deg, and
/// one that is not there 0.3 deg. Without skin it is 3.2, with that of the simulator of `oarlock simulate` at most 0.8.
const NONE_LEADS_BY: f64 = 2.0;
/// A body moves if some unit turns faster, rad/s. Skin that does not move looks like none.
const MOVING_RAD_S: f64 = 0.5;
/// Longest part of a recording that is read ahead, s: a body that hardly moves does not decide.
const AHEAD_S: f64 = 120.0;

/// What the filter knows if units sit otherwise.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rival {
    pub fixing: Fixing,
    pub state: State,
    pub log_likelihood: f64,
}

impl Tracker {
    /// Reads from a recording how units sit, so that its first rows know it too.
    pub(in super::super) fn read_fixing(&mut self, recording: &Recording) -> Result<()> {
        if self.strapdown.is_none() || self.body().model.links.skin_std_rad.is_none() {
            return Ok(());
        }
        let mut ahead = self.clone();
        let (mut cursor, mut sample) = (recording.start(), ahead.empty_sample());
        let is_open = |ahead: &Tracker| links_of(ahead).is_none_or(|links| !links.rivals.is_empty());
        let mut end_s = f64::INFINITY;
        while is_open(&ahead) && recording.next(&mut cursor, &mut sample) && sample.time_s < end_s {
            end_s = end_s.min(sample.time_s + AHEAD_S);
            ahead.step(&sample)?;
        }
        let fixing = links_of(&ahead).map(|links| links.fixing);
        self.strapdown.iter_mut().for_each(|links| links.fixing = fixing);
        Ok(())
    }
}

fn links_of(tracker: &Tracker) -> Option<&LinkState> {
    tracker.hypothesis()?.links.as_deref()
}

impl LinkState {
    /// Whether some unit turns.
    pub(super) fn is_moving(&self, time_s: f64) -> bool {
        let rate = |readings: &Readings| square(readings.at(time_s).gyro);
        self.state.readings.iter().map(rate).any(|rate: f64| rate > MOVING_RAD_S * MOVING_RAD_S)
    }

    /// Moves everything that is followed to a time; `node` receives the updates of what leads.
    pub(super) fn advance(
        &mut self,
        filter: &mut StrapdownFilter,
        stated: &Links,
        time_s: f64,
        (node, for_smoother): (&mut dyn FnMut(Node), bool),
    ) {
        let before_s = self.state.time_s;
        let is_moving = !self.rivals.is_empty() && self.is_moving(time_s);
        for rival in &mut self.rivals {
            filter.links = filter.stated(&stated.with(rival.fixing, false));
            filter.correction.log_likelihood = 0.0;
            filter.advance(&mut rival.state, time_s, &mut |_| {}, false);
            rival.log_likelihood += if is_moving { filter.correction.log_likelihood } else { 0.0 };
        }
        filter.links = filter.stated(&stated.with(self.fixing, self.rivals.is_empty()));
        filter.advance(&mut self.state, time_s, node, for_smoother);
        if is_moving {
            self.moved_s += self.state.time_s - before_s;
        }
    }

    /// Decides once the body has moved for long enough.
    pub(super) fn choose(&mut self) {
        if self.rivals.is_empty() || self.moved_s < CLEAR_AFTER_S {
            return;
        }
        self.leave_behind();
        let likeliest = self.likeliest();
        let is_only = self.rivals.iter().all(|rival| rival.fixing == Fixing::ThinSkin);
        let is_skin = likeliest == Fixing::Skin && self.moved_s >= SKIN_AFTER_S;
        if is_only || is_skin || self.moved_s >= DECIDED_AFTER_S {
            self.settle(likeliest);
        }
    }

    /// Log-likelihood for so much of each unit and second.
    fn in_all(&self, of_unit_and_second: f64) -> f64 {
        of_unit_and_second * self.state.readings.len() as f64 * self.moved_s
    }

    /// Does not follow further what trails clearly; a little skin is what others are compared with.
    fn leave_behind(&mut self) {
        let best = self.rivals.iter().map(|rival| rival.log_likelihood).fold(f64::NEG_INFINITY, f64::max);
        let least = best - self.in_all(CLEARLY_BEHIND);
        self.rivals.retain(|rival| rival.fixing == Fixing::ThinSkin || rival.log_likelihood > least);
    }

    /// How units sit by what has been read so far.
    fn likeliest(&self) -> Fixing {
        let worth = |fixing: Fixing| {
            let rival = self.rivals.iter().find(|rival| rival.fixing == fixing);
            rival.map_or(f64::NEG_INFINITY, |rival| rival.log_likelihood)
        };
        let [thin, mount, exact] = [Fixing::ThinSkin, Fixing::Mount, Fixing::Exact].map(worth);
        let needed = self.in_all(NONE_LEADS_BY);
        match () {
            () if mount.max(exact) < thin + needed => Fixing::Skin,
            () if mount < exact => Fixing::Exact,
            () => Fixing::Mount,
        }
    }

    fn lead(&mut self, rival: usize) {
        let rival = &mut self.rivals[rival];
        std::mem::swap(&mut self.state, &mut rival.state);
        std::mem::swap(&mut self.fixing, &mut rival.fixing);
        self.spread_s = f64::NAN;
    }

    /// Only as `fixing` says, if that is followed.
    pub(in super::super) fn settle(&mut self, fixing: Fixing) {
        if let Some(rival) = self.rivals.iter().position(|rival| rival.fixing == fixing) {
            self.lead(rival);
        }
        self.rivals.clear();
    }
}
