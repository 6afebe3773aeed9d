"""Every file of an engine test is a module of its binary: a file that nobody names would never be compiled."""

import re
from pathlib import Path

from checks.project_files import ROOT, name_of, text_of

TESTS = ROOT / "crates/oarlock/tests"


def findings(tests: Path = TESTS) -> list[str]:
    """Files below the folders of `tests` that their parent module does not declare. Cargo itself finds `tests/*.rs`."""
    undeclared = []
    for path in sorted(tests.glob("*/**/*.rs")):
        module = path.parent if path.stem in {"main", "mod"} else path.with_suffix("")
        if path.stem == "main":
            continue
        parents = [module.parent / name for name in ("main.rs", "mod.rs")]
        parents.append(module.parent.with_suffix(".rs"))
        declared = any(
            re.search(rf"^\s*(?:pub )?mod {module.name};", text_of(parent), re.M)
            for parent in parents
            if parent.is_file()
        )
        if not declared and module.parent != tests:
            undeclared.append(
                f"{name_of(path) if path.is_relative_to(ROOT) else path}: no `mod {module.name};` beside it"
            )
    return undeclared
