//! Columns of numbers of a stream, owned by the engine or borrowed from Python without a copy.

use std::fmt::Debug;
use std::sync::Arc;

/// A source of constant numbers. It avoids a copy of an hour of readings.
pub trait Lender: Debug + Send + Sync {
    /// Number of values.
    fn count(&self) -> usize;
    /// Copies values from `first` on into `to`, as many as fit.
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

/// A column of a stream, shared with its owner.
#[derive(Debug, Clone)]
pub struct Column(Arc<dyn Lender>);

impl Column {
    /// Read from `lender` while needed.
    pub fn lent(lender: impl Lender + 'static) -> Self {
        Column(Arc::new(lender))
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.0.count()
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number at `index`, if there is one.
    pub fn get(&self, index: usize) -> Option<f64> {
        (index < self.len()).then(|| self.at(index))
    }

    /// Copies values from `first` on into `to`, as many as fit; panics if there are fewer.
    pub fn read(&self, first: usize, to: &mut [f64]) {
        self.0.read(first, to);
    }

    /// All values in order.
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
