//! Shipped models that extend the sculler, put together here as the package does it in `oarlock.model.edit`.

use std::path::Path;
use toml::{Table, Value};

/// Whole text of a model in the folder of the shipped ones, by its name.
pub fn shipped(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../python/oarlock/model/shipped");
    let text = std::fs::read_to_string(folder.join(name).with_extension("toml")).expect("a shipped model");
    match text.parse::<Table>().expect("valid TOML").get("extends").and_then(Value::as_str) {
        Some(base) => extended(&shipped(base), &text),
        None => text,
    }
}

/// The text of `changes`, a model file that extends the model of `base`.
pub fn extended(base: &str, changes: &str) -> String {
    let [mut whole, mut changes]: [Table; 2] = [base, changes].map(|text| text.parse().expect("valid TOML"));
    changes.remove("extends");
    if let Some(Value::Table(kinds)) = changes.remove("remove") {
        kinds.iter().for_each(|(kind, names)| remove(&mut whole[kind], names.as_array().expect("names")));
    }
    for (key, value) in changes {
        match (whole.get_mut(&key), value) {
            (Some(Value::Table(old)), Value::Table(new)) => old.extend(new),
            (Some(Value::Array(old)), Value::Array(new)) => new.into_iter().for_each(|table| put(old, table)),
            (_, value) => drop(whole.insert(key, value)),
        }
    }
    toml::to_string(&whole).expect("a model file")
}

fn remove(from: &mut Value, names: &[Value]) {
    match from {
        Value::Table(table) => names.iter().for_each(|name| drop(table.remove(text(name)))),
        Value::Array(tables) => tables.retain(|table| !names.contains(&table["name"])),
        other => panic!("nothing can be removed from {other}"),
    }
}

fn put(tables: &mut Vec<Value>, change: Value) {
    let Value::Table(mut change) = change else { panic!("{change} is no table") };
    let [replace, before, after] = ["replace", "before", "after"].map(|key| change.remove(key));
    let find = |tables: &[Value], name: &Value| tables.iter().position(|table| table["name"] == *name);
    let there = find(tables, &change["name"]);
    let mut own =
        there.filter(|_| replace.is_none()).map_or_else(Table::new, |i| tables[i].as_table().unwrap().clone());
    own.extend(change);
    if before.is_none() && after.is_none() {
        match there {
            Some(i) => tables[i] = own.into(),
            None => tables.push(own.into()),
        }
        return;
    }
    there.into_iter().for_each(|i| drop(tables.remove(i)));
    let ahead = before.map(|name| find(tables, &name).expect("a table to stand before"));
    let place = ahead.or_else(|| Some(find(tables, &after?).expect("a table to stand behind") + 1));
    tables.insert(place.expect("one of both"), own.into());
}

fn text(name: &Value) -> &str {
    name.as_str().expect("a name")
}
