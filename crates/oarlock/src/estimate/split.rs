//! Core and limbs of a state, for the factorised filter: limbs are coupled through the core only.

/// States of the core and of each limb, and the limb of each reading.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// States of the core, in order.
    pub core: Vec<usize>,
    /// States of each limb, in order; no limbs, or at least two.
    pub limbs: Vec<Vec<usize>>,
    /// Per row of the measurement vector: the limb on which it depends beside the core.
    pub row_limbs: Vec<Option<usize>>,
}

impl Split {
    /// From the limb of every state (`None` in the core) and the states on which each row depends. Limbs that share a row, such as that of a
    /// closed loop, are merged. A single limb counts as none.
    pub fn new(limb_of: &[Option<usize>], rows: &[Vec<usize>]) -> Self {
        let mut labels = limb_of.to_vec();
        for states in rows {
            let mut own = states.iter().filter_map(|&s| labels[s]);
            let Some(first) = own.next() else { continue };
            let others: Vec<usize> = own.filter(|&l| l != first).collect();
            for label in labels.iter_mut().flatten().filter(|l| others.contains(l)) {
                *label = first;
            }
        }
        let mut found: Vec<usize> = Vec::new();
        for label in labels.iter().flatten() {
            if !found.contains(label) {
                found.push(*label);
            }
        }
        if found.len() < 2 {
            return Split::whole(labels.len(), rows.len());
        }
        let of = |label: Option<usize>| (0..labels.len()).filter(|&s| labels[s] == label).collect();
        let limb = |states: &Vec<usize>| {
            let label = states.iter().find_map(|&s| labels[s])?;
            found.iter().position(|&l| l == label)
        };
        Split {
            core: of(None),
            limbs: found.iter().map(|&label| of(Some(label))).collect(),
            row_limbs: rows.iter().map(limb).collect(),
        }
    }

    /// All states in the core.
    pub fn whole(n: usize, rows: usize) -> Self {
        Split { core: (0..n).collect(), limbs: Vec::new(), row_limbs: vec![None; rows] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limbs_hang_on_a_core() {
        let split = Split::new(&[None, Some(5), Some(2), Some(5), None], &[vec![0, 1, 3], vec![2, 4], vec![0]]);
        assert_eq!(split.core, [0, 4]);
        assert_eq!(split.limbs, [vec![1, 3], vec![2]]);
        assert_eq!(split.row_limbs, [Some(0), Some(1), None]);
    }

    #[test]
    fn what_a_row_ties_together_is_one_limb() {
        let limbs = [Some(0), Some(1), Some(2), None, Some(3)];
        let split = Split::new(&limbs, &[vec![0, 1], vec![3, 4], vec![1, 2, 3]]);
        assert_eq!(split.limbs, [vec![0, 1, 2], vec![4]]);
        assert_eq!(split.row_limbs, [Some(0), Some(1), Some(0)]);
    }

    #[test]
    fn one_limb_alone_is_none() {
        assert_eq!(Split::new(&[None, Some(1)], &[vec![0, 1]]), Split::whole(2, 1));
    }
}
