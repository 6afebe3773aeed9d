//! Copies the example recordings to where maturin takes them into the wheel, as `oarlock/data`.

use std::path::Path;
use std::{env, fs, io};

const EXAMPLES: &str = "../../examples";

fn main() -> io::Result<()> {
    println!("cargo:rerun-if-changed={EXAMPLES}");
    let out = env::var("OUT_DIR").map_err(io::Error::other)?;
    let data = Path::new(&out).join("data");
    // An example that was renamed or removed must not stay in the next wheel.
    if data.exists() {
        fs::remove_dir_all(&data)?;
    }
    copy(Path::new(EXAMPLES), &data)
}

fn copy(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default();
        let text = name.to_string_lossy();
        // Caches of tools that read the examples.
        if text.starts_with('.') || text == "__pycache__" {
            continue;
        }
        if path.is_dir() {
            copy(&path, &to.join(name))?;
        } else {
            fs::copy(&path, to.join(name))?;
        }
    }
    Ok(())
}
