//! A table of the model file: reads its keys and reports unknown ones.

use super::expr::Expr;
use super::slot::{shown_name, Named, Reader, Slot};
use super::suggest;
use toml::de::{DeTable, DeValue};
use toml::Spanned;

/// A table and its name in messages.
pub(crate) struct Section<'a> {
    pub(crate) reader: &'a Reader<'a>,
    /// For messages: "joint `seat`"; empty for the file as a whole.
    pub(crate) path: String,
    pub(crate) at: usize,
    table: &'a DeTable<'a>,
    known: Known,
}

/// The keys of a table.
pub(crate) type Known = &'static [&'static str];

impl<'a> Section<'a> {
    /// The file as a whole.
    pub(crate) fn whole(reader: &'a Reader<'a>, table: &'a DeTable<'a>, known: Known) -> Self {
        Section { reader, path: String::new(), at: 0, table, known }
    }

    /// A value that must be a table, whatever its keys.
    pub(crate) fn of_any(slot: Slot<'a>) -> Option<Self> {
        let Some(table) = slot.value.get_ref().as_table() else {
            slot.mistake(format!("expected one [{}] table (single brackets)", slot.path));
            return None;
        };
        let at = slot.value.span().start;
        Some(Section { reader: slot.reader, path: slot.path, at, table, known: &[] })
    }

    /// A value that must be a table with none but these keys.
    pub(crate) fn of(slot: Slot<'a>, known: Known) -> Option<Self> {
        let Some(table) = slot.value.get_ref().as_table() else {
            slot.expected(&format!("a table with {}", quoted(known)));
            return None;
        };
        let at = slot.value.span().start;
        let section = Section { reader: slot.reader, path: slot.path, at, table, known };
        section.refuse_unknown();
        Some(section)
    }

    /// Reports unknown keys.
    pub(crate) fn refuse_unknown(&self) {
        for (name, at) in self.unknown() {
            self.mistake(at, format!("unknown key `{name}`; {}", suggest::hint(name, self.known)));
        }
    }

    fn unknown(&self) -> impl Iterator<Item = (&'a str, usize)> + '_ {
        let keys = self.table.keys().map(|key| -> (&'a str, usize) { (key.get_ref(), key.span().start) });
        keys.filter(|(name, _)| !self.known.contains(name))
    }

    pub(crate) fn mistake(&self, at: usize, text: impl AsRef<str>) {
        let path = if self.path.is_empty() { String::new() } else { format!("{}: ", self.path) };
        self.reader.mistakes.add(at, format!("{path}{}", text.as_ref()));
    }

    pub(crate) fn get(&self, key: &str) -> Option<Slot<'a>> {
        let value = self.table.get(key)?;
        Some(Slot { reader: self.reader, path: self.path_of(key), value })
    }

    /// A required key.
    pub(crate) fn need(&self, key: &str, example: &str) -> Option<Slot<'a>> {
        let slot = self.get(key);
        let misspelt = || self.unknown().any(|(name, _)| suggest::nearest(name, self.known) == Some(key));
        if slot.is_none() && !misspelt() {
            self.mistake(self.at, format!("key `{key}` is missing, such as {key} = {example}"));
        }
        slot
    }

    fn path_of(&self, key: &str) -> String {
        match self.path.is_empty() {
            true => key.to_string(),
            false if self.path.contains(": ") => format!("{}.{key}", self.path),
            false => format!("{}: {key}", self.path),
        }
    }

    pub(crate) fn text_or_empty(&self, key: &str) -> String {
        self.get(key).and_then(|slot| slot.text()).unwrap_or("").to_string()
    }

    pub(crate) fn flag(&self, key: &str) -> bool {
        self.get(key).and_then(|slot| slot.flag()).unwrap_or(false)
    }

    /// A name that is defined elsewhere in the file.
    pub(crate) fn reference(&self, key: &str) -> Option<Named> {
        let slot = self.get(key)?;
        slot.text().map(|text| Named { text: text.to_string(), at: slot.at() })
    }

    pub(crate) fn need_reference(&self, key: &str, example: &str) -> Option<Named> {
        self.need(key, example)?;
        self.reference(key)
    }

    /// A required positive number; 1 after a mistake.
    pub(crate) fn need_positive(&self, key: &str, example: &str, unit: &str) -> f64 {
        self.need(key, example).and_then(|slot| slot.positive(unit)).unwrap_or(1.0)
    }

    /// Three lengths; the origin by default.
    pub(crate) fn point(&self, key: &str) -> [Expr; 3] {
        self.get(key).and_then(|slot| slot.point()).unwrap_or([0.0; 3].map(Expr::constant))
    }

    /// Place of a key's value, or of the table.
    pub(crate) fn at_key(&self, key: &str) -> usize {
        self.table.get(key).map_or(self.at, |value| value.span().start)
    }

    pub(crate) fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// Keys and values in the order of the file.
    pub(crate) fn entries(&self) -> Vec<(Named, Slot<'a>)> {
        let mut entries: Vec<_> = self.table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let entry = |(key, value): (&'a Spanned<_>, &'a Spanned<DeValue<'a>>)| {
            let name: &std::borrow::Cow<str> = key.get_ref();
            let named = Named { text: name.to_string(), at: key.span().start };
            (named, Slot { reader: self.reader, path: self.path_of(name), value })
        };
        entries.into_iter().map(entry).collect()
    }

    /// The tables of `[[key]]`, each with its own name in messages.
    pub(crate) fn tables(&self, key: &str, known: Known) -> Vec<Section<'a>> {
        let Some(slot) = self.get(key) else {
            return Vec::new();
        };
        let Some(list) = slot.value.get_ref().as_array() else {
            slot.mistake(format!("expected one [[{key}]] (double brackets) for each {key}"));
            return Vec::new();
        };
        let one = |(i, value): (usize, &'a Spanned<DeValue<'a>>)| {
            let path = called(key, i, value.get_ref());
            Section::of(Slot { reader: self.reader, path, value }, known)
        };
        list.iter().enumerate().filter_map(one).collect()
    }
}

fn called(key: &str, index: usize, value: &DeValue) -> String {
    match value.get("name").and_then(|name| name.get_ref().as_str()) {
        Some(name) => format!("{key} `{}`", shown_name(name)),
        None => format!("{key} number {}", index + 1),
    }
}

fn quoted(names: &[&str]) -> String {
    names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")
}
