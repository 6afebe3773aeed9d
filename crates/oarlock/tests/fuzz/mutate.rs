//! Small harm to texts: what a hand, a bad disk or a bad merge does to a file.

use super::numbers::{index, one_in, pick};
use super::support::chance::Chance;

/// What a model file may hold and a careless one may hold in the wrong place.
const WORDS: [&str; 60] = [
    "0",
    "-1",
    "1e308",
    "1e-320",
    "-1e400",
    "nan",
    "inf",
    "-inf",
    "true",
    "false",
    "\"\"",
    "[]",
    "{}",
    "[[]]",
    "\"pi\"",
    "\"1/0\"",
    "\"0/0\"",
    "\"-pi\"",
    "\"((1))\"",
    "\"root\"",
    "\"azimuth\"",
    "\"hinge\"",
    "\"slide\"",
    "\"ball\"",
    "\"free\"",
    "\"fixed\"",
    "\"imu\"",
    "\"encoder\"",
    "\"position\"",
    "\"orientation\"",
    "\"walk\"",
    "\"singer\"",
    "\"jerk\"",
    "\"paper\"",
    "[0, 0, 0]",
    "[1e300, 0, 0]",
    "[0, 1, 0]",
    "[1, 2]",
    "1979-05-27T07:32:00Z",
    "0x7fffffffffffffff",
    "9223372036854775808",
    "[[joint]]",
    "[[frame]]",
    "[[sensor]]",
    "[[closure]]",
    "[world]",
    "[process]",
    "[parameters]",
    "input = true",
    "sign = -1",
    "sign = 0",
    "std = 0",
    "std = -1",
    "parent = \"root\"",
    "format = 1",
    "format = 2",
    "mount.std_rad = 0.1",
    "rest = 1e9",
    "limits = [1, -1]",
    "\u{feff}",
];

const CHARACTERS: [char; 24] = [
    '\0',
    '"',
    '\'',
    '\\',
    '[',
    ']',
    '{',
    '}',
    '(',
    ')',
    '=',
    '.',
    ',',
    '#',
    '\n',
    '\r',
    '-',
    '+',
    '*',
    '/',
    '°',
    'é',
    '\u{1F6A3}',
    '\u{202e}',
];

/// The text with one to several wounds; `others` lend their lines.
pub fn mutated(chance: &mut Chance, text: &str, others: &[&str]) -> String {
    let mut text = text.to_string();
    let most = if one_in(chance, 4) { 12 } else { 3 };
    let wounds = 1 + index(chance, most);
    for _ in 0..wounds {
        text = match index(chance, 10) {
            0 | 1 => with_number(chance, &text),
            2 => with_character(chance, &text),
            3 | 4 => with_lines(chance, &text, others),
            5 => with_word(chance, &text),
            6 | 7 => with_token_of(chance, &text),
            8 => with_section(chance, &text, others),
            _ => cut_or_blown_up(chance, &text),
        };
    }
    text
}

/// A place between two characters.
fn place(chance: &mut Chance, text: &str) -> usize {
    let mut at = index(chance, text.len() + 1);
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

fn replaced(text: &str, from: usize, to: usize, with: &str) -> String {
    [&text[..from], with, &text[to..]].concat()
}

/// Stretches of characters that belong together: names, numbers, or signs alone.
fn tokens(text: &str) -> Vec<(usize, usize)> {
    let inside = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '-' | '"');
    let mut found = Vec::new();
    let mut start = None;
    for (at, c) in text.char_indices() {
        match (inside(c), start) {
            (true, None) => start = Some(at),
            (false, Some(from)) => {
                found.push((from, at));
                start = None;
            }
            _ => {}
        }
    }
    found.extend(start.map(|from| (from, text.len())));
    found
}

fn with_number(chance: &mut Chance, text: &str) -> String {
    let numeric = |(from, to): &(usize, usize)| text[*from..*to].parse::<f64>().is_ok();
    let numbers: Vec<_> = tokens(text).into_iter().filter(numeric).collect();
    if numbers.is_empty() {
        return text.into();
    }
    let &(from, to) = pick(chance, &numbers);
    let value = super::numbers::finite(chance);
    let written = if one_in(chance, 2) { format!("{value:?}") } else { format!("{value:.3}") };
    replaced(text, from, to, &written)
}

fn with_character(chance: &mut Chance, text: &str) -> String {
    let from = place(chance, text);
    let next = text[from..].chars().next().map_or(0, char::len_utf8);
    let to = if one_in(chance, 2) { from + next } else { from };
    let mut with = String::new();
    if !one_in(chance, 3) {
        with.push(*pick(chance, &CHARACTERS));
    }
    replaced(text, from, to, &with)
}

/// One line goes, comes twice, changes places, or comes from another file.
fn with_lines(chance: &mut Chance, text: &str, others: &[&str]) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    if lines.is_empty() {
        return text.into();
    }
    let (a, b) = (index(chance, lines.len()), index(chance, lines.len()));
    match index(chance, 4) {
        0 => drop(lines.remove(a)),
        1 => lines.insert(b, lines[a]),
        2 => lines.swap(a, b),
        _ => {
            let other: Vec<&str> = pick(chance, others).lines().collect();
            lines.insert(a, *pick(chance, &other));
        }
    }
    lines.join("\n")
}

fn with_word(chance: &mut Chance, text: &str) -> String {
    let all = tokens(text);
    let word = *pick(chance, &WORDS);
    if all.is_empty() || one_in(chance, 4) {
        let at = place(chance, text);
        return replaced(text, at, at, word);
    }
    let &(from, to) = pick(chance, &all);
    replaced(text, from, to, word)
}

/// A name or number takes the place of another one of the file: references to the wrong thing.
fn with_token_of(chance: &mut Chance, text: &str) -> String {
    let all = tokens(text);
    if all.is_empty() {
        return text.into();
    }
    let (&(from, to), &(other, end)) = (pick(chance, &all), pick(chance, &all));
    replaced(text, from, to, &text[other..end])
}

/// A whole table goes, or comes from another file.
fn with_section(chance: &mut Chance, text: &str, others: &[&str]) -> String {
    let sections = |text: &str| -> Vec<String> { text.split("\n[").map(String::from).collect() };
    let mut own = sections(text);
    let at = index(chance, own.len());
    if one_in(chance, 2) {
        own.remove(at);
    } else {
        let other: &&str = pick(chance, others);
        let lent = sections(other);
        own.insert(at, pick(chance, &lent).clone());
    }
    own.join("\n[")
}

/// The file ends early, a stretch is missing, or one stands there very often.
fn cut_or_blown_up(chance: &mut Chance, text: &str) -> String {
    let (a, b) = (place(chance, text), place(chance, text));
    let (from, to) = (a.min(b), a.max(b));
    match index(chance, 5) {
        0 => text[..from].into(),
        1 => replaced(text, from, to, ""),
        2 => text[from..].into(),
        3 => {
            let short = text[from..].char_indices().nth(1 + index(chance, 3)).map_or(text.len(), |(i, _)| from + i);
            let often = [10, 100, 3000][index(chance, 3)];
            replaced(text, from, from, &text[from..short].repeat(often))
        }
        _ => {
            let sign = *pick(chance, &["[", "(", "-", "{a=", "a.", "\"", "[[", "1+(", "#"]);
            replaced(text, from, from, &sign.repeat([5, 60, 5000][index(chance, 3)]))
        }
    }
}
