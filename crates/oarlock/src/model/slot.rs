//! One value of the model file, converted to the type that its key needs.

use super::expr::Expr;
use super::locate::Mistakes;
use super::suggest;
use crate::rotation::Mat3;
use std::f64::consts::TAU;
use toml::de::DeValue;
use toml::Spanned;

/// Context of all keys while a file is read.
pub(crate) struct Reader<'a> {
    pub(crate) mistakes: &'a Mistakes<'a>,
    /// Names of the parameters, in the order of the file.
    pub(crate) parameters: Vec<String>,
    /// Their defaults; NaN for unusable ones.
    pub(crate) defaults: Vec<f64>,
}

/// A value with its place in the file and its name in messages.
pub(crate) struct Slot<'a> {
    pub(crate) reader: &'a Reader<'a>,
    /// For messages: "joint `seat`: limits".
    pub(crate) path: String,
    pub(crate) value: &'a Spanned<DeValue<'a>>,
}

/// A name and its place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Named {
    pub(crate) text: String,
    pub(crate) at: usize,
}

/// Longest name, in characters; the shipped models need 24.
pub(crate) const LONGEST_NAME: usize = 80;
/// Largest plausible length, m: a larger one was probably given in millimetres.
const LENGTH_BOUND_M: f64 = 100.0;
/// Tolerance of a unit vector or rotation matrix: seven digits.
const UNIT_TOLERANCE: f64 = 1e-6;

impl<'a> Slot<'a> {
    pub(crate) fn at(&self) -> usize {
        self.value.span().start
    }

    pub(crate) fn mistake(&self, text: impl AsRef<str>) {
        self.reader.mistakes.add(self.at(), format!("{}: {}", self.path, text.as_ref()));
    }

    pub(crate) fn expected(&self, wanted: &str) {
        self.mistake(format!("expected {wanted}, found {}", describe(self.value.get_ref())));
    }

    pub(crate) fn is_table(&self) -> bool {
        self.value.get_ref().as_table().is_some()
    }

    pub(crate) fn text(&self) -> Option<&'a str> {
        let text = self.value.get_ref().as_str();
        if text.is_none() {
            self.expected("a text in quotes");
        }
        text
    }

    pub(crate) fn flag(&self) -> Option<bool> {
        let flag = self.value.get_ref().as_bool();
        if flag.is_none() {
            self.expected("true or false (without quotes)");
        }
        flag
    }

    /// A name that other tables may refer to.
    pub(crate) fn name(&self) -> Option<Named> {
        let text = self.text()?;
        let mut letters = text.chars();
        let starts = letters.next().is_some_and(|c| c.is_alphabetic() || c == '_');
        if !starts || !letters.all(|c| c.is_alphanumeric() || c == '_') {
            self.mistake(format!(
                "`{}` is no name: expected letters, digits and `_`, a letter first (try `{}`)",
                shown_name(text),
                as_name(shown_name(text))
            ));
        }
        self.check_length(text);
        Some(Named { text: text.to_string(), at: self.at() })
    }

    /// Names become columns and labels of pages; nobody types one of 10,000 characters.
    pub(crate) fn check_length(&self, name: &str) {
        let count = name.chars().count();
        if count > LONGEST_NAME {
            self.mistake(format!("the name has {count} characters; at most {LONGEST_NAME} are allowed"));
        }
    }

    /// One of several words.
    pub(crate) fn choice<T: Copy>(&self, wanted: &[(&str, T)]) -> Option<T> {
        let text = self.text()?;
        let found = wanted.iter().find(|(word, _)| *word == text);
        if found.is_none() {
            let words: Vec<&str> = wanted.iter().map(|(word, _)| *word).collect();
            self.mistake(format!("unknown {} `{text}`; {}", last_key(&self.path), suggest::hint(text, &words)));
        }
        found.map(|(_, value)| *value)
    }

    /// A number or an expression of the parameters; finite at their defaults.
    pub(crate) fn expr(&self) -> Option<Expr> {
        let expr = match self.value.get_ref() {
            DeValue::Integer(i) => Expr::constant(integer(i.as_str(), i.radix())?),
            DeValue::Float(f) => Expr::constant(f.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::String(text) => match Expr::parse(text, &self.reader.parameters) {
                Ok(expr) => expr,
                Err(mistake) => {
                    self.mistake(format!("\"{text}\": {mistake}"));
                    return None;
                }
            },
            _ => {
                self.expected("a number or an expression in quotes");
                return None;
            }
        };
        self.check_finite(&expr).then_some(expr)
    }

    fn check_finite(&self, expr: &Expr) -> bool {
        let known = expr.parameters().all(|i| self.reader.defaults[i].is_finite());
        let value = expr.eval(&self.reader.defaults);
        if known && !value.is_finite() {
            let shown = describe(self.value.get_ref());
            self.mistake(format!("{shown} is {value} at the default parameters; expected a finite number"));
        }
        !known || value.is_finite()
    }

    /// A length, m.
    pub(crate) fn length(&self) -> Option<Expr> {
        self.bounded(LENGTH_BOUND_M, "m", "lengths are in m: 315 mm is 0.315")
    }

    /// An angle, rad.
    pub(crate) fn angle(&self) -> Option<Expr> {
        self.bounded(TAU + UNIT_TOLERANCE, "rad", "more than a full turn: write degrees as \"90*pi/180\"")
    }

    fn bounded(&self, bound: f64, unit: &str, hint: &str) -> Option<Expr> {
        let expr = self.expr()?;
        let value = expr.eval(&self.reader.defaults);
        if value.abs() > bound {
            self.mistake(format!("{value} {unit}; {hint}"));
            return None;
        }
        Some(expr)
    }

    /// A number that does not depend on parameters.
    pub(crate) fn number(&self) -> Option<f64> {
        let expr = self.expr()?;
        let parameter = expr.parameters().next();
        if let Some(index) = parameter {
            let name = &self.reader.parameters[index];
            self.mistake(format!("`{name}` is a parameter; this key takes plain numbers only"));
            return None;
        }
        Some(expr.eval(&[]))
    }

    /// A number above zero, such as a standard deviation.
    pub(crate) fn positive(&self, unit: &str) -> Option<f64> {
        let value = self.number()?;
        if value <= 0.0 {
            self.mistake(format!("{value} {unit}; expected more than 0 {unit}"));
        }
        Some(value)
    }

    /// A number that is zero or more.
    pub(crate) fn not_negative(&self, unit: &str) -> Option<f64> {
        let value = self.number()?;
        if value < 0.0 {
            self.mistake(format!("{value} {unit}; expected 0 or more"));
        }
        Some(value)
    }

    /// The `n` elements of a list.
    pub(crate) fn list(&self, n: usize, wanted: &str) -> Option<Vec<Slot<'a>>> {
        let list = self.value.get_ref().as_array().filter(|list| list.len() == n);
        let Some(list) = list else {
            self.expected(wanted);
            return None;
        };
        let member = |(i, value)| Slot { reader: self.reader, path: format!("{}[{}]", self.path, i + 1), value };
        Some(list.iter().enumerate().map(member).collect())
    }

    /// Three values of one type; `None` after a mistake in any.
    pub(crate) fn three<T>(&self, wanted: &str, read: fn(&Slot<'a>) -> Option<T>) -> Option<[T; 3]> {
        let found: Vec<Option<T>> = self.list(3, wanted)?.iter().map(read).collect();
        let found: Option<Vec<T>> = found.into_iter().collect();
        found?.try_into().ok()
    }

    pub(crate) fn point(&self) -> Option<[Expr; 3]> {
        self.three("three lengths [x, y, z] in m", Slot::length)
    }

    /// Three rows of three.
    pub(crate) fn matrix(&self) -> Option<[[Expr; 3]; 3]> {
        let wanted = "three rows of three numbers [[.., .., ..], [.., .., ..], [.., .., ..]]";
        let rows: Vec<_> = self.list(3, wanted)?.iter().map(|row| row.three("three numbers", Slot::expr)).collect();
        let rows: Option<Vec<[Expr; 3]>> = rows.into_iter().collect();
        rows?.try_into().ok()
    }

    /// Reports a matrix that is not a rotation.
    pub(crate) fn check_rotation(&self, m: &Mat3<f64>) {
        let (defect, det) = m.rotation_defect();
        let numbers = format!("largest entry of |R R' - 1| is {defect:.3e}, determinant {det:.6}");
        if defect > UNIT_TOLERANCE {
            self.mistake(format!(
                "no rotation: {numbers}; expected 0 and 1. Give at least seven digits, or use rpy = [roll, pitch, yaw]"
            ));
        } else if det < 0.0 {
            self.mistake(format!("mirrors: {numbers}; expected determinant 1. Turn the sign of one column"));
        }
    }

    /// A unit vector: three numbers, or `x`, `-z` and the like.
    pub(crate) fn axis(&self) -> Option<[f64; 3]> {
        if let Some(text) = self.value.get_ref().as_str() {
            return self.axis_by_letter(text);
        }
        let v = self.three("an axis such as \"z\", \"-x\" or [0, 0, 1]", Slot::number)?;
        let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        if norm == 0.0 {
            self.mistake("[0, 0, 0] has no direction; expected a unit vector such as [0, 0, 1]");
            return None;
        }
        let unit = v.map(|x| x / norm);
        if (norm - 1.0).abs() > UNIT_TOLERANCE {
            let [x, y, z] = unit;
            self.mistake(format!("length {norm:.6}, expected a unit vector: [{x:.9}, {y:.9}, {z:.9}]"));
        }
        Some(if norm == 1.0 { v } else { unit })
    }

    fn axis_by_letter(&self, text: &str) -> Option<[f64; 3]> {
        let (sign, letter) = match text.strip_prefix('-') {
            Some(letter) => (-1.0, letter),
            None => (1.0, text.strip_prefix('+').unwrap_or(text)),
        };
        match letter {
            "x" | "X" => Some([sign, 0.0, 0.0]),
            "y" | "Y" => Some([0.0, sign, 0.0]),
            "z" | "Z" => Some([0.0, 0.0, sign]),
            _ => {
                self.expected("an axis such as \"z\", \"-x\" or [0, 0, 1]");
                None
            }
        }
    }
}

fn integer(text: &str, radix: u32) -> Option<f64> {
    match radix {
        10 => text.parse().ok(),
        _ => i64::from_str_radix(text, radix).ok().map(|i| i as f64),
    }
}

/// The beginning of a name, for messages: all of one that is allowed.
pub(crate) fn shown_name(name: &str) -> &str {
    name.char_indices().nth(LONGEST_NAME).map_or(name, |(end, _)| &name[..end])
}

fn as_name(text: &str) -> String {
    let plain: String = text.trim().chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    match plain.chars().next() {
        Some(c) if c.is_alphabetic() || c == '_' => plain,
        _ => format!("n{plain}"),
    }
}

fn last_key(path: &str) -> &str {
    path.rsplit([' ', '.']).next().unwrap_or(path)
}

/// A value as the file's author wrote it.
pub(crate) fn describe(value: &DeValue) -> String {
    match value {
        DeValue::String(s) => format!("\"{}\"", s.chars().take(60).collect::<String>()),
        DeValue::Integer(i) => i.as_str().to_string(),
        DeValue::Float(f) => f.as_str().to_string(),
        DeValue::Boolean(b) => b.to_string(),
        DeValue::Datetime(d) => format!("the date {d}"),
        DeValue::Array(list) => format!("a list of {}", list.len()),
        DeValue::Table(_) => "a table of keys".to_string(),
    }
}
