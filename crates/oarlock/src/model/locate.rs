//! Collects the mistakes of a model file with their line numbers.

use std::cell::RefCell;

/// Collects every mistake of one file.
pub(crate) struct Mistakes<'a> {
    file: &'a str,
    text: &'a str,
    found: RefCell<Vec<(usize, String)>>,
}

impl<'a> Mistakes<'a> {
    pub(crate) fn of(file: &'a str, text: &'a str) -> Self {
        Mistakes { file, text, found: RefCell::new(Vec::new()) }
    }

    /// Adds a mistake at a byte offset of the text.
    pub(crate) fn add(&self, at: usize, text: impl Into<String>) {
        self.found.borrow_mut().push((at, text.into()));
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.found.borrow().is_empty()
    }

    /// Line number, from 1, of a byte offset.
    pub(crate) fn line(&self, at: usize) -> usize {
        1 + self.text.bytes().take(at).filter(|b| *b == b'\n').count()
    }

    /// All mistakes as `file:line: text`, in the order of the file.
    pub(crate) fn finish(self) -> Vec<String> {
        let mut found = self.found.take();
        found.sort_by_key(|(at, _)| *at);
        let mut lines: Vec<String> =
            found.iter().map(|(at, text)| format!("{}:{}: {text}", self.file, self.line(*at))).collect();
        lines.dedup();
        lines
    }
}
