//! P <- F P F' for the blocks of F: rows first, then columns, of four neighbouring blocks at once.

use super::Block;
use crate::kernels::arch::{madd, Arch, Kernel};
use crate::kernels::dense::Square;
use crate::kernels::registers::VECTOR;

/// P <- B P B' for one block without noise (P3), exactly symmetric.
pub fn congruence(arch: Arch, block: &Block, p: &mut Square) {
    turn(arch, std::slice::from_ref(block), p);
    p.mirror_upper();
}

/// P <- F P F', symmetric up to rounding.
pub(super) fn turn(arch: Arch, blocks: &[Block], p: &mut Square) {
    arch.run(Turn { blocks, p });
}

/// A <- F A of a matrix whose rows of this width are laid end to end.
pub fn apply_to_rows(arch: Arch, blocks: &[Block], a: &mut [f64], width: usize) {
    arch.run(TurnRows { blocks, a, width });
}

struct TurnRows<'a> {
    blocks: &'a [Block],
    a: &'a mut [f64],
    width: usize,
}

impl Kernel for TurnRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let TurnRows { blocks, a, width } = self;
        let row = |i: usize| i * width..(i + 1) * width;
        for b in blocks.iter().filter(|b| !b.stays()) {
            match b.len {
                1 => a[row(b.index[0])].iter_mut().for_each(|x| *x *= b.factor[0][0]),
                2 => rows_of::<FUSED, 2>(b, disjoint(a, [0, 1].map(|r| row(b.index[r])))),
                _ => rows_of::<FUSED, 3>(b, disjoint(a, b.index.map(row))),
            }
        }
    }
}

#[inline(always)]
fn disjoint<const LEN: usize>(a: &mut [f64], rows: [std::ops::Range<usize>; LEN]) -> [&mut [f64]; LEN] {
    a.get_disjoint_mut(rows).expect("different rows")
}

struct Turn<'a> {
    blocks: &'a [Block],
    p: &'a mut Square,
}

impl Kernel for Turn<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Turn { mut blocks, p } = self;
        // A loop, because a closure may be compiled outside the kernel, without its instructions.
        for block in blocks {
            rows::<FUSED>(block, p);
        }
        while let [first, rest @ ..] = blocks {
            let count = neighbours(blocks, p.n());
            if count > 1 {
                columns_of_some::<FUSED>(&blocks[..count], p);
                blocks = &blocks[count..];
            } else {
                columns(first, p);
                blocks = rest;
            }
        }
    }
}

/// Number of blocks, up to a vector, whose coordinates are neighbours: each one next to the same coordinate of the block before, first,
/// second and third coordinates in separate ranges, with space for a whole vector behind them.
#[inline(always)]
fn neighbours(blocks: &[Block], n: usize) -> usize {
    let [a, b, c] = blocks[0].index;
    if blocks[0].len < 3 || c + VECTOR > n {
        return 1;
    }
    let next = |(k, block): &(usize, &Block)| block.len == 3 && block.index == [a + k, b + k, c + k];
    let count = blocks.iter().take(VECTOR).enumerate().take_while(next).count();
    if a + count <= b && b + count <= c {
        count
    } else {
        1
    }
}

#[inline(always)]
fn rows<const FUSED: bool>(b: &Block, p: &mut Square) {
    if b.stays() {
        return;
    }
    match b.len {
        1 => p.row_mut(b.index[0]).iter_mut().for_each(|x| *x *= b.factor[0][0]),
        2 => rows_of::<FUSED, 2>(b, p.rows_mut([0, 1].map(|r| b.index[r]))),
        _ => rows_of::<FUSED, 3>(b, p.rows_mut(b.index)),
    }
}

#[inline(always)]
fn rows_of<const FUSED: bool, const LEN: usize>(b: &Block, mut rows: [&mut [f64]; LEN]) {
    let f = &b.factor;
    for j in 0..rows[0].len() {
        let old: [f64; LEN] = std::array::from_fn(|r| rows[r][j]);
        for (r, row) in rows.iter_mut().enumerate() {
            let last = f[r][LEN - 1] * old[LEN - 1];
            row[j] = (0..LEN - 1).rev().fold(last, |sum, c| madd::<FUSED>(f[r][c], old[c], sum));
        }
    }
}

#[inline(always)]
fn columns(b: &Block, p: &mut Square) {
    if b.stays() {
        return;
    }
    match b.len {
        1 => (0..p.n()).for_each(|i| p.row_mut(i)[b.index[0]] *= b.factor[0][0]),
        2 => columns_of::<2>(b, p),
        _ => columns_of::<3>(b, p),
    }
}

#[inline(always)]
fn columns_of<const LEN: usize>(b: &Block, p: &mut Square) {
    for i in 0..p.n() {
        let row = p.row_mut(i);
        let old: [f64; LEN] = std::array::from_fn(|c| row[b.index[c]]);
        for r in 0..LEN {
            row[b.index[r]] = (0..LEN).map(|c| b.factor[r][c] * old[c]).sum();
        }
    }
}

/// Columns of neighbouring blocks together; numbers behind an incomplete vector do not change.
#[inline(always)]
fn columns_of_some<const FUSED: bool>(blocks: &[Block], p: &mut Square) {
    let index = blocks[0].index;
    let entry = |r: usize, c: usize, k: usize| blocks.get(k).map_or(f64::from(r == c), |b| b.factor[r][c]);
    let f: [[[f64; VECTOR]; 3]; 3] =
        std::array::from_fn(|r| std::array::from_fn(|c| std::array::from_fn(|k| entry(r, c, k))));
    for i in 0..p.n() {
        let row = p.row_mut(i);
        let old: [[f64; VECTOR]; 3] = index.map(|at| *row[at..].first_chunk().expect("there is room"));
        for (&at, f) in index.iter().zip(&f) {
            let mut new = [0.0; VECTOR];
            for k in 0..VECTOR {
                new[k] = madd::<FUSED>(f[0][k], old[0][k], madd::<FUSED>(f[1][k], old[1][k], f[2][k] * old[2][k]));
            }
            // The order matters: vectors of an earlier coordinate may overlap those of a later one.
            row[at..at + VECTOR].copy_from_slice(&new);
        }
    }
}
