//! Numbers of a stream, read where they lie.

use std::fmt::Debug;
use std::sync::Arc;

/// Somebody who holds numbers that never change, and reads them out. An hour of readings is not copied for the engine.
pub trait Lender: Debug + Send + Sync {
    /// How many there are.
    fn count(&self) -> usize;
    /// Those from `first` on, as many as there is room for.
    fn read(&self, first: usize, to: &mut [f64]);
}

impl Lender for Vec<f64> {
    fn count(&self) -> usize {
        self.len()
    }

    fn read(&self, first: usize, to: &mut [f64]) {
        to.copy_from_slice(&self[first..first + to.len()]);
    }
}

/// Numbers of a stream, shared with whoever holds them.
#[derive(Debug, Clone)]
pub struct Column(Arc<dyn Lender>);

impl Column {
    /// Read from `lender` as long as they are needed.
    pub fn lent(lender: impl Lender + 'static) -> Self {
        Column(Arc::new(lender))
    }

    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.0.count()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number at `index`, if there is one.
    pub fn get(&self, index: usize) -> Option<f64> {
        (index < self.len()).then(|| self.at(index))
    }

    /// Those from `first` on, as many as there is room for; panics where there are fewer.
    pub fn read(&self, first: usize, to: &mut [f64]) {
        self.0.read(first, to);
    }

    /// All in turn.
    pub fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.len()).map(|i| self.at(i))
    }

    fn at(&self, index: usize) -> f64 {
        let mut one = [0.0];
        self.read(index, &mut one);
        one[0]
    }
}

impl From<Vec<f64>> for Column {
    fn from(values: Vec<f64>) -> Self {
        Column::lent(values)
    }
}
