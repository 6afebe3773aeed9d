//! Texts that may be expressions.

use super::campaign::campaign;
use super::numbers::{finite, index, one_in, pick};
use super::support::chance::Chance;
use oarlock::model::Expr;

const PIECES: [&str; 30] = [
    "1", "0", "pi", "a", "b2", "_c", "(", ")", "+", "-", "*", "/", "**", "^", ",", ".", "1.5e3", "1e", "1e999", "0x1",
    "°", " ", "\t", "deg", "mm", "a(", "é", "((", "))", "-(",
];
const NAMES: [&str; 3] = ["a", "b2", "_c"];

/// A right expression, nested at random.
fn right(chance: &mut Chance, depth: usize) -> String {
    if depth == 0 || one_in(chance, 4) {
        return pick(chance, &["a", "b2", "_c", "pi", "2", "0.5", "1e-3", "0"]).to_string();
    }
    let (left, other) = (right(chance, depth - 1), right(chance, depth - 1));
    match index(chance, 6) {
        0 => format!("({left})"),
        1 => format!("-{left}"),
        2 => format!("{left}+({other})"),
        3 => format!("{left} - {other}"),
        4 => format!("({left}) * {other}"),
        _ => format!("({left})/({other})"),
    }
}

fn text(chance: &mut Chance) -> String {
    match index(chance, 4) {
        0 => right(chance, 6),
        1 => "(".repeat(index(chance, 3000)) + "1",
        2 => right(chance, 3) + &pick(chance, &["+(a", "*(b2", "-(-"]).repeat(index(chance, 80)),
        _ => (0..1 + index(chance, 40)).map(|_| *pick(chance, &PIECES)).collect(),
    }
}

#[test]
fn expressions_are_read_or_refused() {
    campaign("expressions", 3_000, |chance, fed| {
        *fed = text(chance);
        match Expr::parse(fed, &NAMES) {
            Ok(read) => {
                let values = [finite(chance), finite(chance), finite(chance)];
                let again = read.eval(&values);
                assert!(again.to_bits() == read.eval(&values).to_bits() || again.is_nan());
                assert!(read.parameters().all(|p| p < NAMES.len()));
                let _ = read.eval(&[]);
            }
            Err(why) => assert!(why.starts_with("column ") && why.len() > 12, "{why}"),
        }
    });
}
