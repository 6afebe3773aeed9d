//! Arithmetic expressions of the parameters, such as `-l_ua/2` or `90*pi/180`.

use super::suggest;

/// An expression, ready to be evaluated with a parameter vector.
#[derive(Debug, Clone, PartialEq)]
pub struct Expr(Form);

#[derive(Debug, Clone, PartialEq)]
enum Form {
    Constant(f64),
    /// In postfix order.
    Program(Box<[Op]>),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Op {
    Constant(f64),
    Parameter(usize),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
}

/// Largest number of intermediate values of an expression.
const DEPTH: usize = 32;

impl Expr {
    /// A constant.
    pub const fn constant(value: f64) -> Self {
        Expr(Form::Constant(value))
    }

    /// A number plus the value of a parameter.
    pub fn constant_plus(value: f64, parameter: usize) -> Self {
        let program = [Op::Constant(value), Op::Parameter(parameter), Op::Add];
        Expr(Form::Program(Box::new(program)))
    }

    /// Reads `+ - * /`, parentheses, numbers, `pi` and the given names.
    ///
    /// # Errors
    /// A text with the column (from one), what was found and what to write instead.
    pub fn parse<S: AsRef<str>>(text: &str, names: &[S]) -> Result<Self, String> {
        let names = names.iter().map(AsRef::as_ref).collect();
        let mut parser = Parser { rest: text, column: 1, names, program: Vec::new(), open: 0 };
        parser.sum()?;
        parser.end()?;
        Ok(match parser.program[..] {
            [Op::Constant(value)] => Expr::constant(value),
            _ => Expr(Form::Program(parser.program.into_boxed_slice())),
        })
    }

    /// The value at these parameters; NaN if one is missing.
    pub fn eval(&self, parameters: &[f64]) -> f64 {
        let program = match &self.0 {
            Form::Constant(value) => return *value,
            Form::Program(program) => program,
        };
        let mut stack = [f64::NAN; DEPTH];
        let mut top = 0;
        for op in program.iter() {
            match *op {
                Op::Constant(value) => {
                    stack[top] = value;
                    top += 1;
                }
                Op::Parameter(index) => {
                    stack[top] = parameters.get(index).copied().unwrap_or(f64::NAN);
                    top += 1;
                }
                Op::Negate => stack[top - 1] = -stack[top - 1],
                binary => {
                    top -= 1;
                    stack[top - 1] = combine(binary, stack[top - 1], stack[top]);
                }
            }
        }
        stack[0]
    }

    /// Indices of the parameters that it uses.
    pub fn parameters(&self) -> impl Iterator<Item = usize> + '_ {
        let program: &[Op] = match &self.0 {
            Form::Constant(_) => &[],
            Form::Program(program) => program,
        };
        program.iter().filter_map(|op| match op {
            Op::Parameter(index) => Some(*index),
            _ => None,
        })
    }
}

fn combine(op: Op, a: f64, b: f64) -> f64 {
    match op {
        Op::Add => a + b,
        Op::Subtract => a - b,
        Op::Multiply => a * b,
        Op::Divide => a / b,
        Op::Constant(_) | Op::Parameter(_) | Op::Negate => f64::NAN,
    }
}

struct Parser<'a> {
    rest: &'a str,
    column: usize,
    names: Vec<&'a str>,
    program: Vec<Op>,
    /// Values on the stack at this point of the text.
    open: usize,
}

impl<'a> Parser<'a> {
    fn sum(&mut self) -> Result<(), String> {
        self.chain(Self::product, &[('+', Op::Add), ('-', Op::Subtract)])
    }

    fn product(&mut self) -> Result<(), String> {
        self.chain(Self::signed, &[('*', Op::Multiply), ('/', Op::Divide)])
    }

    fn chain(&mut self, part: fn(&mut Self) -> Result<(), String>, ops: &[(char, Op)]) -> Result<(), String> {
        part(self)?;
        loop {
            let next = self.peek();
            let Some((sign, op)) = ops.iter().find(|(sign, _)| Some(*sign) == next) else {
                return Ok(());
            };
            self.take(sign.len_utf8());
            if *sign == '*' && self.peek() == Some('*') {
                return Err(self.at("powers are not supported; write `a*a`"));
            }
            self.open += 1;
            part(self)?;
            self.open -= 1;
            self.push_binary(*op);
        }
    }

    fn signed(&mut self) -> Result<(), String> {
        let mut negative = false;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            negative ^= sign == '-';
            self.take(1);
        }
        self.atom()?;
        match self.program.last_mut() {
            Some(Op::Constant(value)) if negative => *value = -*value,
            _ if negative => self.program.push(Op::Negate),
            _ => {}
        }
        Ok(())
    }

    fn atom(&mut self) -> Result<(), String> {
        match self.peek() {
            Some('(') => self.group(),
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.name(),
            Some(c) => Err(self.at(&format!("found `{c}`, expected a number, a parameter or `(`"))),
            None => Err(self.at("the expression ends early, expected a number, a parameter or `(`")),
        }
    }

    fn group(&mut self) -> Result<(), String> {
        if self.open >= DEPTH - 2 {
            return Err(self.at("too many nested parentheses; split the expression"));
        }
        self.take(1);
        self.open += 1;
        self.sum()?;
        self.open -= 1;
        if self.peek() != Some(')') {
            return Err(self.at("expected `)` or an operator (+ - * /)"));
        }
        self.take(1);
        Ok(())
    }

    fn number(&mut self) -> Result<(), String> {
        let length = number_length(self.rest.as_bytes());
        let text = &self.rest[..length];
        let value = match text.parse::<f64>() {
            Ok(value) if value.is_finite() => value,
            Ok(_) => return Err(self.at(&format!("`{text}` is too large"))),
            Err(_) => return Err(self.at(&format!("`{text}` is no number"))),
        };
        self.take(length);
        match self.peek() {
            Some(',') => Err(self.at("found `,`; decimals are written with a point")),
            Some('°') => Err(self.at("angles are in rad; write degrees as `90*pi/180`")),
            Some(c) if c.is_alphabetic() || c == '_' || c == '(' => {
                Err(self.at(&format!("`{text}` is followed by `{}`; {}", self.word(), unit_hint(self.word()))))
            }
            _ => self.push(Op::Constant(value)),
        }
    }

    fn name(&mut self) -> Result<(), String> {
        let word = self.word();
        let op = match self.names.iter().position(|name| *name == word) {
            _ if word == "pi" => Op::Constant(std::f64::consts::PI),
            Some(index) => Op::Parameter(index),
            None if self.rest[word.len()..].trim_start().starts_with('(') => {
                return Err(self.at(&format!("`{word}(`: there are no functions, only + - * / and parentheses")));
            }
            None => {
                let mut valid = self.names.clone();
                valid.push("pi");
                return Err(self.at(&format!("unknown name `{word}`; {}", suggest::hint(word, &valid))));
            }
        };
        self.take(word.len());
        self.push(op)
    }

    fn end(&mut self) -> Result<(), String> {
        match self.peek() {
            None => Ok(()),
            Some(')') => Err(self.at("`)` without `(`")),
            Some('^') => Err(self.at("powers are not supported; write `a*a`")),
            Some(',') => Err(self.at("found `,`; decimals are written with a point")),
            Some('°') => Err(self.at("angles are in rad; write degrees as `90*pi/180`")),
            Some(c) => Err(self.at(&format!("found `{c}`, expected an operator (+ - * /) or the end"))),
        }
    }

    fn push(&mut self, op: Op) -> Result<(), String> {
        if self.open + 1 > DEPTH {
            return Err(self.at("too deeply nested; split the expression"));
        }
        self.program.push(op);
        Ok(())
    }

    /// Two constants are combined at once, so that an expression without parameters is a constant.
    fn push_binary(&mut self, op: Op) {
        if let [.., Op::Constant(a), Op::Constant(b)] = self.program[..] {
            self.program.truncate(self.program.len() - 2);
            self.program.push(Op::Constant(combine(op, a, b)));
        } else {
            self.program.push(op);
        }
    }

    fn peek(&mut self) -> Option<char> {
        let trimmed = self.rest.trim_start();
        self.column += self.rest[..self.rest.len() - trimmed.len()].chars().count();
        self.rest = trimmed;
        trimmed.chars().next()
    }

    fn take(&mut self, bytes: usize) {
        self.column += self.rest[..bytes].chars().count();
        self.rest = &self.rest[bytes..];
    }

    fn word(&self) -> &'a str {
        let inside = |c: char| c.is_alphanumeric() || c == '_';
        let end = self.rest.find(|c| !inside(c)).unwrap_or(self.rest.len());
        &self.rest[..end]
    }

    fn at(&self, text: &str) -> String {
        format!("column {}: {text}", self.column)
    }
}

fn number_length(bytes: &[u8]) -> usize {
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
    let mantissa = digits(0);
    let signed = mantissa + 1 + usize::from(matches!(bytes.get(mantissa + 1), Some(b'+' | b'-')));
    let exponent =
        matches!(bytes.get(mantissa), Some(b'e' | b'E')) && bytes.get(signed).is_some_and(|b| b.is_ascii_digit());
    match exponent {
        true => signed + bytes[signed..].iter().take_while(|b| b.is_ascii_digit()).count(),
        false => mantissa,
    }
}

fn unit_hint(word: &str) -> &'static str {
    match word {
        "deg" | "degree" | "degrees" => "angles are in rad; write degrees as `90*pi/180`",
        "m" | "rad" | "s" => "units are not written: lengths are in m, angles in rad",
        "mm" | "cm" => "units are not written: lengths are in m",
        _ => "a product needs `*`, as in `2*pi`",
    }
}

#[cfg(test)]
mod tests;
