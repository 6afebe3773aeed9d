//! P <- F P F' for the blocks of F: rows first, then columns, of four neighbouring blocks at once.

use super::Block;
use crate::estimate::dense::Square;
use crate::lane::arch::{madd, Arch, Kernel};
use crate::lane::four::VECTOR;

/// P <- B P B' for one block without noise, exactly symmetric.
pub fn carry(arch: Arch, block: &Block, p: &mut Square) {
    turn(arch, std::slice::from_ref(block), p);
    p.mirror_upper();
}

/// P <- F P F', symmetric up to rounding.
pub(super) fn turn(arch: Arch, blocks: &[Block], p: &mut Square) {
    arch.run(Turn { blocks, p });
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
        blocks.iter().for_each(|b| rows::<FUSED>(b, p));
        while let [first, rest @ ..] = blocks {
            match blocks.first_chunk() {
                Some(four) if are_neighbours(four) => {
                    columns_of_four::<FUSED>(four, p);
                    blocks = &blocks[VECTOR..];
                }
                _ => {
                    columns(first, p);
                    blocks = rest;
                }
            }
        }
    }
}

/// Whether each coordinate of a block stands next to the same one of the block before.
#[inline(always)]
fn are_neighbours(blocks: &[Block; VECTOR]) -> bool {
    let first = &blocks[0];
    blocks.iter().enumerate().all(|(k, b)| b.len == 3 && (0..3).all(|r| b.index[r] == first.index[r] + k))
}

#[inline(always)]
fn rows<const FUSED: bool>(b: &Block, p: &mut Square) {
    if b.stays() {
        return;
    }
    let f = &b.factor;
    if b.len == 1 {
        return p.row_mut(b.index[0]).iter_mut().for_each(|x| *x *= f[0][0]);
    }
    let [one, two, three] = p.three_rows_mut(b.index);
    for ((x, y), z) in one.iter_mut().zip(two).zip(three) {
        let old = [*x, *y, *z];
        let new = |r: usize| madd::<FUSED>(f[r][0], old[0], madd::<FUSED>(f[r][1], old[1], f[r][2] * old[2]));
        (*x, *y, *z) = (new(0), new(1), new(2));
    }
}

#[inline(always)]
fn columns(b: &Block, p: &mut Square) {
    if b.stays() {
        return;
    }
    for i in 0..p.n() {
        let row = p.row_mut(i);
        let old = b.index.map(|i| row[i]);
        for r in 0..b.len {
            row[b.index[r]] = (0..b.len).map(|c| b.factor[r][c] * old[c]).sum();
        }
    }
}

#[inline(always)]
fn columns_of_four<const FUSED: bool>(blocks: &[Block; VECTOR], p: &mut Square) {
    let index = blocks[0].index;
    let f: [[[f64; VECTOR]; 3]; 3] =
        std::array::from_fn(|r| std::array::from_fn(|c| std::array::from_fn(|k| blocks[k].factor[r][c])));
    for i in 0..p.n() {
        let row = p.row_mut(i);
        let old: [[f64; VECTOR]; 3] = index.map(|at| *row[at..].first_chunk().expect("within the row"));
        for (&at, f) in index.iter().zip(&f) {
            let mut new = [0.0; VECTOR];
            for k in 0..VECTOR {
                new[k] = madd::<FUSED>(f[0][k], old[0][k], madd::<FUSED>(f[1][k], old[1][k], f[2][k] * old[2][k]));
            }
            row[at..at + VECTOR].copy_from_slice(&new);
        }
    }
}
