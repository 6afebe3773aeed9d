//! Tables for people, and the same figures for the page that `make bench` writes.

use serde_json::Value;
use std::path::Path;

/// Names a folder: figures are written there, for `python -m oarlock_lab.bench` to put together.
pub const FOLDER: &str = "OARLOCK_BENCH_OUT";

/// Keeps a list of rows as `name`.json, if a folder is named.
pub fn keep(name: &str, rows: &[Value]) {
    let Ok(folder) = std::env::var(FOLDER) else {
        return;
    };
    let file = Path::new(&folder).join(format!("{name}.json"));
    let text = serde_json::to_string_pretty(rows).expect("plain numbers");
    std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(&file, text))
        .unwrap_or_else(|e| panic!("{}: {e}; {FOLDER} must name a folder that can be written", file.display()));
}
