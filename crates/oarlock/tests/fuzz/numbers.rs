//! Numbers as they come from broken cables, wrong units and careless typing.

use super::support::chance::Chance;

/// One of `count` places.
pub fn index(chance: &mut Chance, count: usize) -> usize {
    ((chance.uniform() * count as f64) as usize).min(count - 1)
}

pub fn one_in(chance: &mut Chance, n: usize) -> bool {
    index(chance, n) == 0
}

pub fn pick<'a, T>(chance: &mut Chance, all: &'a [T]) -> &'a T {
    &all[index(chance, all.len())]
}

const EXTREMES: [f64; 18] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    -5e-324,
    1e-300,
    1e300,
    1e154,
    1.34e154,
    1e-154,
    f64::EPSILON,
    1e16,
    std::f64::consts::PI,
    9_007_199_254_740_993.0,
];

/// Any finite number; everyday ones, and then all that a double can hold.
pub fn finite(chance: &mut Chance) -> f64 {
    match index(chance, 8) {
        0..=3 => 20.0 * chance.normal(),
        4 => *pick(chance, &EXTREMES),
        5 => chance.normal() * 10_f64.powf(chance.between(-300.0, 300.0)),
        6 => chance.normal() * 10_f64.powf(chance.between(-12.0, 12.0)),
        _ => f64::from_bits((chance.uniform() * 1.844e19) as u64),
    }
    .clamp(f64::MIN, f64::MAX)
}

/// Any double at all.
pub fn odd(chance: &mut Chance) -> f64 {
    match index(chance, 12) {
        0 => f64::NAN,
        1 if one_in(chance, 20) => *pick(chance, &[f64::INFINITY, f64::NEG_INFINITY]),
        _ => finite(chance),
    }
}
