//! Flat form of a source's memory in pickled state estimates.

use super::SourceMemory;
use crate::track::faults::Repeats;
use crate::track::stance::StanceState;

/// Number of values.
pub const MEMORY: usize = 66;

impl SourceMemory {
    /// Excludes the time of the last reading, which is saved separately.
    pub fn to_flat(mut self) -> [f64; MEMORY] {
        let mut flat = [f64::NAN; MEMORY];
        flat.iter_mut().zip(self.numbers()).for_each(|(to, from)| *to = *from);
        flat
    }

    /// Reads the result of `to_flat`.
    pub fn from_flat(seen_s: f64, flat: &[f64; MEMORY]) -> Self {
        let mut memory = SourceMemory::new(seen_s);
        memory.numbers().zip(flat).for_each(|(to, from)| *to = *from);
        memory
    }

    fn numbers(&mut self) -> impl Iterator<Item = &mut f64> {
        let SourceMemory { rest, faults, stance, field, iron, lag, .. } = self;
        let rest = rest.gyro.iter_mut().chain(&mut rest.accel).chain([&mut rest.since_s, &mut rest.used_s]);
        let faults = [&mut faults.gyro, &mut faults.accel, &mut faults.mag].into_iter().flat_map(repeats);
        let StanceState { since_s, used_s } = stance;
        let iron = iron.field_ut.iter_mut().chain(&mut iron.covariance);
        let magnetic = field.numbers().into_iter().chain(iron);
        rest.chain(faults).chain([since_s, used_s]).chain(magnetic).chain(lag.numbers())
    }
}

fn repeats(of: &mut Repeats) -> impl Iterator<Item = &mut f64> {
    let Repeats { reading, came_s, repeated, quantum, longest_s } = of;
    reading.iter_mut().chain([came_s, repeated, quantum, longest_s])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_keeps_its_place() {
        let flat: [f64; MEMORY] = std::array::from_fn(|i| i as f64);
        let memory = SourceMemory::from_flat(7.5, &flat);
        assert_eq!(memory.to_flat(), flat);
        assert_eq!((memory.seen_s, memory.rest.accel, memory.rest.used_s), (7.5, [3.0, 4.0, 5.0], 7.0));
        assert_eq!(
            (memory.faults.gyro.came_s, memory.faults.accel.repeated, memory.faults.mag.quantum),
            (11.0, 19.0, 27.0)
        );
        assert_eq!((memory.stance.since_s, memory.stance.used_s), (29.0, 30.0));
        assert_eq!((memory.field.came_s, memory.iron.field_ut[0], memory.iron.covariance[5]), (31.0, 44.0, 52.0));
        assert_eq!((memory.lag.came_s, memory.lag.variance_s2, memory.lag.slope[2]), (53.0, 56.0, 65.0));
    }

    #[test]
    fn nothing_remembered_is_saved_as_no_numbers() {
        assert!(SourceMemory::new(0.0).to_flat().iter().all(|x| x.is_nan()));
    }
}
