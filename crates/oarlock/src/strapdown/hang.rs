//! How the links of a skeleton hang together: states of links without a unit, joints that close, and the way from a unit to a point.

use super::joint::Turns;
use super::skeleton::{Closure, End, Leg, Link, Pose, Skeleton, Way};
use crate::rotation::Vec3;

/// Joints that turn by less than this are stiff, rad.
const STIFF_RAD: f64 = 0.4;

impl Leg {
    pub fn of(link: usize, vector: Vec3<f64>) -> Leg {
        Leg { link: Some(link), vector, by: None }
    }
}

impl Skeleton {
    /// Gives each link without a unit a state against the neighbour on its way to the nearest unit; where loops of the model hold what hangs on
    /// the room alone, against the room.
    pub(super) fn hang(&mut self, has_loops: bool) {
        for (link, child, share) in self.between() {
            self.links[link].pose = Pose::Between(child, share);
        }
        let mut todo: Vec<usize> = self.units.iter().map(|u| u.link).collect();
        let is_known = |link: &Link| matches!(link.pose, Pose::Unit(_) | Pose::Between(..) | Pose::Driven);
        let mut known: Vec<bool> = self.links.iter().map(is_known).collect();
        let mut next = 0;
        while next < todo.len() {
            let here = todo[next];
            next += 1;
            for l in self.neighbours(here) {
                if !known[l] {
                    known[l] = true;
                    self.links[l].pose = Pose::State(self.loose.len(), Some(here));
                    self.loose.push(l);
                    todo.push(l);
                }
            }
        }
        for l in 0..self.links.len() {
            let parent = self.links[l].parent;
            if has_loops && !known[l] && parent.is_none_or(|p| known[p]) {
                known[l] = true;
                self.links[l].pose = Pose::State(self.loose.len(), parent);
                self.loose.push(l);
            }
        }
    }

    /// Links without a unit between two units by stiff joints: the link, its child, and the share of its own joint.
    fn between(&self) -> Vec<(usize, usize, f64)> {
        let has_unit = |l: usize| matches!(self.links[l].pose, Pose::Unit(_));
        let stiff = |l: usize| self.links[l].turns.locked() == 0 && self.links[l].range_rad[0] <= STIFF_RAD;
        let find = |l: usize| {
            let parent = self.links[l].parent.filter(|p| has_unit(*p))?;
            let neighbours = self.neighbours(l);
            let child = neighbours.iter().copied().find(|c| *c != parent).filter(|c| has_unit(*c))?;
            let is_it = !has_unit(l) && neighbours.len() == 2 && stiff(l) && stiff(child);
            let [own, other] = [l, child].map(|l| self.links[l].range_rad[0].powi(2));
            is_it.then(|| (l, child, own / (own + other)))
        };
        (0..self.links.len()).filter_map(find).collect()
    }

    /// Whether a joint locks a direction between two links whose orientations units tell.
    pub fn is_hinged(&self, l: usize) -> bool {
        let is_known = |l: usize| !self.is_loose(l);
        let link = &self.links[l];
        link.turns.locked() > 0 && link.pose != Pose::Driven && is_known(l) && link.parent.is_none_or(is_known)
    }

    /// Whether a link has a joint state.
    pub fn is_loose(&self, l: usize) -> bool {
        matches!(self.links[l].pose, Pose::State(..))
    }

    /// Units beyond a closure, seen from its first end.
    pub fn beyond(&self, closure: usize) -> Vec<usize> {
        let mut found: Vec<usize> = self.closures[closure].to.unit().into_iter().collect();
        let mut next = 0;
        while next < found.len() {
            let joints = self.closures.iter().enumerate().filter(|(_, other)| other.loop_std_m.is_none());
            for (c, other) in joints.filter(|(c, _)| *c != closure) {
                let ends = [other.from.unit(), other.to.unit()];
                let here = ends.contains(&Some(found[next])) && c != closure;
                let new = ends.into_iter().flatten().find(|u| here && !found.contains(u));
                found.extend(new);
            }
            next += 1;
        }
        found
    }

    /// Links whose joints a closure goes through: its own, and those of links without a unit.
    pub fn joints_through(&self, closure: usize) -> Vec<usize> {
        let Closure { link, through, .. } = &self.closures[closure];
        let mut found = vec![*link];
        for l in through.iter().filter_map(|leg| leg.link) {
            if let Pose::State(_, Some(anchor)) = self.links[l].pose {
                let joint = if self.links[l].parent == Some(anchor) { l } else { anchor };
                found.push(joint);
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    fn neighbours(&self, link: usize) -> Vec<usize> {
        let children = (0..self.links.len()).filter(|l| self.links[*l].parent == Some(link));
        self.links[link].parent.into_iter().chain(children).collect()
    }

    /// Joints that close: each meeting of two links whose chains of states begin at different units, and joints with the room.
    pub(super) fn close(&mut self) {
        let mut closures = Vec::new();
        for (l, link) in self.links.iter().enumerate() {
            let to = self.way(l, Vec3([0.0; 3]));
            let from = match (link.parent, &link.turns) {
                (_, Turns::Free(..)) => continue,
                (None, _) if self.pushed => continue,
                (None, _) => (End::Room(link.arm), Vec::new()),
                (Some(parent), _) => self.way(parent, link.arm),
            };
            if from.0.unit() == to.0.unit() {
                continue;
            }
            closures.push(self.closure(l, from, to, None));
        }
        self.closures = closures;
    }

    /// The meeting of two points, each with its way from a unit.
    pub(super) fn closure(&self, link: usize, from: Way, to: Way, loop_std_m: Option<f64>) -> Closure {
        let back = to.1.iter().rev().map(|leg| Leg { vector: leg.vector * -1.0, ..*leg });
        let through = from.1.iter().copied().chain(back).flat_map(|leg| self.carried(leg)).collect();
        Closure {
            link,
            from: from.0,
            through,
            to: to.0,
            spread_m2: [Vec3([0.0; 3]); 2],
            lengths: Vec::new(),
            loop_std_m,
        }
    }

    /// A vector of a link, carried by the links that its orientation comes from.
    fn carried(&self, leg: Leg) -> Vec<Leg> {
        let Some(link) = leg.link else { return vec![leg] };
        match (self.links[link].pose, self.links[link].parent) {
            (Pose::Between(child, share), Some(parent)) => {
                let first = self.links[link].rest.apply(leg.vector) * (1.0 - share);
                let second = self.links[child].rest.apply_transposed(leg.vector) * share;
                vec![Leg::of(parent, first), Leg::of(child, second)]
            }
            _ => vec![leg],
        }
    }

    /// From a link's unit to a point of the link: the unit's end, and the vector through each link without a unit.
    pub fn way(&self, link: usize, point: Vec3<f64>) -> Way {
        let (mut l, mut at, mut through) = (link, point, Vec::new());
        loop {
            match self.links[l].pose {
                Pose::Unit(u) => {
                    let unit = &self.units[u];
                    through.reverse();
                    return (End::Unit(u, unit.mount.apply_transposed(at - unit.offset)), through);
                }
                Pose::State(_, None) => {
                    through.push(Leg::of(l, at));
                    return (End::Room(self.links[l].arm), through);
                }
                Pose::State(_, Some(anchor)) => {
                    let (own, there) = self.meeting(l, anchor);
                    through.push(Leg::of(l, at - own));
                    (l, at) = (anchor, there);
                }
                Pose::Between(..) | Pose::Driven => {
                    let Link { parent, arm, turns, .. } = &self.links[l];
                    through.push(Leg::of(l, at));
                    if let Turns::Slide(coordinate, _, axis) = turns {
                        through.push(Leg { link: *parent, vector: *axis, by: Some(*coordinate) });
                    }
                    let Some(parent) = *parent else { return (End::Room(*arm), through) };
                    (l, at) = (parent, *arm);
                }
            }
        }
    }

    /// The joint between two neighbours, in the axes of each, m.
    pub fn meeting(&self, a: usize, b: usize) -> (Vec3<f64>, Vec3<f64>) {
        if self.links[a].parent == Some(b) {
            (Vec3([0.0; 3]), self.links[a].arm)
        } else {
            (self.links[b].arm, Vec3([0.0; 3]))
        }
    }
}
