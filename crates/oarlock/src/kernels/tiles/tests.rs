//! Tests of the kernels on panels, at every remainder.

use super::*;

/// [1 + G'G | B], and its factor.
fn both(arch: Arch, g: &Panel, n: usize, right: usize) -> (Panel, Panel) {
    let (rows, width) = (2 * n, padded(n) + padded(right));
    let mut starts = vec![0; width / VECTOR];
    find_starts(arch, g, rows, 0..padded(n), &mut starts);
    let mut a = Panel::zeros(n, width);
    (0..n).for_each(|i| a.row_mut(i)[i] = 1.0);
    let rows = Rows { panel: g, rows: 0..rows, column: 0, starts: &starts };
    gram(arch, &mut a, [n, padded(n)], rows, false);
    for i in 0..n {
        (0..right).for_each(|j| a.row_mut(i)[padded(n) + j] = ((i * 7 + j * 3) % 11) as f64 - 5.0);
    }
    let mut u = a.clone();
    starts.fill(0);
    factor(arch, &mut u, Sweep { n, width, starts: &starts }).expect("positive");
    (a, u)
}

fn sample(rows: usize, n: usize) -> Panel {
    let mut g = Panel::zeros(rows, padded(n));
    for r in 0..rows {
        for c in (0..n).filter(|c| r >= c / 3) {
            g.row_mut(r)[c] = ((r * 31 + c * 17) % 23) as f64 / 23.0 - 0.5;
        }
    }
    g
}

/// A handful of roundings of sums of some forty products.
const ROUNDING: f64 = 1e-12;

#[test]
fn factor_and_substitution_undo_each_other_at_every_size() {
    for (n, right) in (1..30).map(|n| (n, 1 + n * 2 / 3)) {
        let (g, base) = (sample(2 * n, n), padded(n));
        for arch in [Arch::PORTABLE, Arch::best()] {
            let (a, u) = both(arch, &g, n, right);
            for i in 0..n {
                for j in i..n {
                    let direct: f64 = (0..2 * n).map(|r| g.at(r, i) * g.at(r, j)).sum();
                    assert!((a.at(i, j) - direct - f64::from(i == j)).abs() < ROUNDING, "{n}: {i} {j}");
                }
                for j in (i..n).chain(base..base + right) {
                    let product: f64 = (0..=i).map(|k| u.at(k, i) * u.at(k, j)).sum();
                    assert!((product - a.at(i, j)).abs() < ROUNDING, "{n}: {i} {j}");
                }
            }
        }
    }
}

/// Of three row patterns: nothing, steps and everything.
fn panel(rows: usize, width: usize, step: usize) -> (Panel, Vec<usize>) {
    let mut panel = Panel::zeros(rows, padded(width));
    for r in 0..rows {
        for c in (0..width).filter(|c| step * r >= *c) {
            panel.row_mut(r)[c] = (1.3 * r as f64 + 0.7 * (c * c) as f64).sin();
        }
    }
    let mut starts = vec![0; padded(width) / VECTOR];
    find_starts(Arch::PORTABLE, &panel, rows, 0..padded(width), &mut starts);
    (panel, starts)
}

#[test]
fn products_of_panels_are_those_of_plain_matrices_at_every_size() {
    for (n, width, rows) in (1..26).map(|n| (n, 1 + n * 5 % 23, n * 7 % 31)) {
        for (step, arch) in [(0, Arch::PORTABLE), (1, Arch::best()), (3, Arch::PORTABLE), (30, Arch::best())] {
            let ((a, a_starts), (b, b_starts)) = (panel(rows, n, step), panel(rows, width, step + 1));
            let part = |panel, starts| Rows { panel, rows: 0..rows, column: 0, starts };
            let mut out = Panel::zeros(n, padded(width));
            product(arch, &mut out, [n, padded(width)], [part(&a, &a_starts), part(&b, &b_starts)]);
            for (i, j) in (0..n).flat_map(|i| (0..width).map(move |j| (i, j))) {
                let plain: f64 = (0..rows).map(|r| a.at(r, i) * b.at(r, j)).sum();
                assert!((out.at(i, j) - plain).abs() < ROUNDING, "{n} {width} {rows}: {i} {j}");
            }
        }
    }
}

#[test]
fn later_substitutions_are_those_of_the_factor() {
    for (n, right) in (1..30).map(|n| (n, 1 + n * 2 / 3)) {
        let (g, base) = (sample(2 * n, n), padded(n));
        for arch in [Arch::PORTABLE, Arch::best()] {
            let (a, u) = both(arch, &g, n, right);
            let mut b = Panel::zeros(n, padded(right));
            (0..n).for_each(|i| b.row_mut(i)[..right].copy_from_slice(&a.row(i)[base..base + right]));
            substitute(arch, &u, n, &mut b, padded(right));
            let (mut lower, mut back) = (Lower::zeros(n), Panel::zeros(n, padded(right)));
            lower.transpose(arch, &u, n);
            substitute_back(arch, &lower, (&a, base), &mut back, padded(right));
            for (i, j) in (0..n).flat_map(|i| (0..right).map(move |j| (i, j))) {
                assert!((b.at(i, j) - u.at(i, base + j)).abs() < ROUNDING, "{n}: {i} {j}");
                let product: f64 = (i..n).map(|k| u.at(i, k) * back.at(k, j)).sum();
                assert!((product - a.at(i, base + j)).abs() < ROUNDING, "{n}: {i} {j}");
            }
        }
    }
}

#[test]
fn what_is_not_positive_is_refused_by_row() {
    let mut a = Panel::zeros(6, 8);
    (0..6).for_each(|i| a.row_mut(i)[i] = if i == 5 { f64::NAN } else { 2.0 });
    let sweep = Sweep { n: 6, width: 8, starts: &[0, 0] };
    assert_eq!(factor(Arch::PORTABLE, &mut a, sweep).unwrap_err().row, 5);
}
