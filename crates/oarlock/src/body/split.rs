//! Division of a body's state for the factorised filter: limbs behind the last branchings of the tree, and the core.

use super::Body;
use crate::estimate::split::Split;
use crate::estimate::FastSystem;
use crate::model::{Joint, JointKind, Model};

impl Body {
    /// A limb has its joints, the biases and mounts of its units, and the lengths that only its readings depend on. The
    /// core is shared by all limbs: the joints that carry them, the field's azimuth, and base accelerations.
    pub(super) fn limbs(&self) -> Split {
        let links = links(&self.model);
        let limbs = limbs(&self.model, &links);
        let mut found = vec![None; self.layout.dim()];
        for (joint, &limb) in self.model.joints.iter().zip(&limbs) {
            for slots in self.layout.coordinates[joint.coordinates()].iter().flatten() {
                found[slots.q] = limb;
                slots.rates.into_iter().for_each(|(rate, accel)| (found[rate], found[accel]) = (limb, limb));
            }
        }
        for (s, sensor) in self.model.sensors.iter().enumerate() {
            let Some(frame) = sensor.kind.frame() else { continue };
            let limb = joint_of(&self.model, links[frame]).and_then(|joint| limbs[joint]);
            let mounts = self.layout.mounts.iter().filter(|m| m.0 == s).map(|m| m.1..m.1 + 3);
            let errors = self.layout.errors.iter().filter(|slot| slot.sensor == s);
            let errors = errors.map(|slot| slot.first..slot.first + 3);
            mounts.chain(errors).flatten().for_each(|state| found[state] = limb);
        }
        let rows = self.states_of_rows();
        let lengths = self.layout.lengths.iter().map(|l| l.1);
        for shared in lengths.chain(self.layout.headings.iter().map(|h| h.0)) {
            let feel = rows.iter().filter(|states| states.contains(&shared));
            let mut felt = feel.map(|states| states.iter().find_map(|&s| found[s]));
            let first = felt.next().flatten();
            found[shared] = first.filter(|_| felt.all(|other| other == first));
        }
        Split::new(&found, &rows)
    }

    /// Per row: the states that it depends on.
    fn states_of_rows(&self) -> Vec<Vec<usize>> {
        let mut rows = vec![Vec::new(); self.suite.len()];
        let straight = self.jacobian_pattern().unwrap_or_default();
        for triple in &straight.triples {
            let states = straight.slopes[triple.slopes.clone()].iter().map(|s| s.state).filter(|&s| s < straight.n);
            let states: Vec<usize> = states.collect();
            for (i, row) in rows[triple.row..triple.row + triple.count].iter_mut().enumerate() {
                row.extend(&states);
                row.extend(triple.added.map(|first| first + i));
            }
        }
        rows
    }
}

/// Whether a joint is a state.
fn moves(joint: &Joint) -> bool {
    !joint.input && joint.kind != JointKind::Fixed
}

/// The joint that moves a link, if the joint is a state.
fn joint_of(model: &Model, link: usize) -> Option<usize> {
    model.frames[link].joint.map(|(j, _)| j).filter(|&j| moves(&model.joints[j]))
}

/// Per frame: the nearest frame towards the root that a state moves relative to its parent; the root if there is none.
fn links(model: &Model) -> Vec<usize> {
    let mut links = vec![0; model.frames.len()];
    for (f, frame) in model.frames.iter().enumerate().skip(1) {
        links[f] = if joint_of(model, f).is_some() { f } else { links[frame.parent] };
    }
    links
}

/// Per joint: its limb, named by one of its joints; `None` in the core and for joints that are no states.
fn limbs(model: &Model, links: &[usize]) -> Vec<Option<usize>> {
    let parents = parents(model, links);
    let children = |joint: usize| parents.iter().filter(|p| p.contains(&joint)).count();
    let mut chains: Vec<usize> = (0..parents.len()).collect();
    for (j, own) in parents.iter().enumerate() {
        // A joint shared by several chains joins them.
        for &parent in own.iter().filter(|&&p| own.len() > 1 || children(p) == 1) {
            let (from, to) = (chains[j], chains[parent]);
            chains.iter_mut().filter(|c| **c == from).for_each(|c| *c = to);
        }
    }
    let carries =
        |chain: usize| parents.iter().zip(&chains).any(|(p, &c)| c != chain && p.iter().any(|&p| chains[p] == chain));
    let limb = |j: usize| moves(&model.joints[j]) && !carries(chains[j]);
    (0..chains.len()).map(|j| limb(j).then_some(chains[j])).collect()
}

/// Per joint: the joints directly before it; more than one if frames share it.
fn parents(model: &Model, links: &[usize]) -> Vec<Vec<usize>> {
    let mut parents = vec![Vec::new(); model.joints.len()];
    for (f, frame) in model.frames.iter().enumerate().skip(1) {
        let Some(j) = joint_of(model, f) else { continue };
        let parent = joint_of(model, links[frame.parent]).filter(|&p| p != j && !parents[j].contains(&p));
        parents[j].extend(parent);
    }
    parents
}
