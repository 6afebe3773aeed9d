"""`python -m golden`: writes golden outputs, compares two runs to the bit, or one with the committed outputs."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from golden.cases import GROUPS, ROOT, Group, collect, data_folder
from golden.compare import (
    Difference,
    committed_form,
    differences,
    load_committed,
    renamed,
    save_committed,
    unlike_committed,
)
from golden.values import Value

OUT = ROOT / "out/golden"
ENGINE = "python/oarlock/_core.abi3.so"
SOURCES_OF_ENGINE = ("crates", "Cargo.toml", "Cargo.lock")


def computable() -> dict[str, Group]:
    """Groups whose recordings are there; says which are not."""
    absent = [] if data_folder() else [name for name, group in GROUPS.items() if group.needs_data]
    if absent:
        print(f"NOT RUN: {', '.join(absent)}: OARLOCK_DATA names no folder with data/")
    return {name: group for name, group in GROUPS.items() if name not in absent}


def collect_all(names: Mapping[str, Group]) -> dict[str, Value]:
    """Outputs of groups, with their number and the time on stdout."""
    outputs: dict[str, Value] = {}
    for name in names:
        start_s = time.process_time()
        part = collect(name)
        print(
            f"{name:<28} {len(part):>5} outputs {time.process_time() - start_s:>6.1f} s of processor time",
            flush=True,
        )
        outputs |= part
    return outputs


def save(file: Path, outputs: Mapping[str, Value]) -> None:
    """Write all outputs in full."""
    file.parent.mkdir(parents=True, exist_ok=True)
    arrays = {key: np.array(value) for key, value in outputs.items()}
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def load(file: Path) -> dict[str, Value]:
    """Read what `save` wrote."""
    with np.load(file) as arrays:
        return {
            key: str(arrays[key]) if arrays[key].dtype.kind == "U" else arrays[key] for key in arrays.files
        }


def write_at(commit: str, file: Path) -> None:
    """Write the outputs of another commit, computed by its own package and engine."""
    tree = OUT / "tree"
    git = ["git", "-C", str(ROOT), "worktree"]
    subprocess.run([*git, "remove", "--force", str(tree)], check=False, capture_output=True)
    shutil.rmtree(tree, ignore_errors=True)
    subprocess.run([*git, "add", "--force", "--detach", str(tree), commit], check=True)
    try:
        place_engine(commit, tree)
        if not (tree / "golden").is_dir():
            shutil.copytree(ROOT / "golden", tree / "golden")
        paths = os.pathsep.join((str(tree / "python"), str(tree)))
        words = [sys.executable, "-m", "golden", "--write", str(file)]
        subprocess.run(words, check=True, cwd=tree, env=os.environ | {"PYTHONPATH": paths})
    finally:
        subprocess.run([*git, "remove", "--force", str(tree)], check=True)


def place_engine(commit: str, tree: Path) -> None:
    """Copy this engine into another tree if its sources are the same, else build that tree's own."""
    same = ["git", "-C", str(ROOT), "diff", "--quiet", commit, "--", *SOURCES_OF_ENGINE]
    if subprocess.run(same, check=False).returncode == 0:
        shutil.copy2(ROOT / ENGINE, tree / ENGINE)
        return
    target = OUT / "target"
    words = ["cargo", "build", "--release", "--locked", "--quiet", "--package", "oarlock-py"]
    environment = os.environ | {"PYO3_PYTHON": sys.executable}
    subprocess.run([*words, "--target-dir", str(target)], check=True, cwd=tree, env=environment)
    library = next(
        file for name in ("lib_core.so", "lib_core.dylib") if (file := target / "release" / name).is_file()
    )
    shutil.copy2(library, tree / ENGINE)


def conclusion(unlike: Sequence[Difference], count: int) -> int:
    """Prints all differences; the exit status."""
    for difference in unlike:
        print(difference)
    print(f"{len(unlike)} of {count} outputs differ")
    return int(bool(unlike))


def main() -> int:
    """Do what the options say; the exit status is 1 if outputs differ."""
    parser = argparse.ArgumentParser(prog="python -m golden", description=__doc__)
    parser.add_argument("--write", metavar="FILE", type=Path, help="write all outputs in full (.npz)")
    parser.add_argument(
        "--compare", metavar="FILE", nargs=2, type=Path, help="compare two such files to the bit"
    )
    parser.add_argument("--before", metavar="COMMIT", help="compare with another commit to the bit")
    parser.add_argument("--renew", action="store_true", help="replace the committed outputs")
    options = parser.parse_args()
    if options.compare:
        before, after = (load(file) for file in options.compare)
        return conclusion(differences(renamed(before), after), len(after))
    if options.before:
        write_at(options.before, OUT / "before.npz")
    names = computable()
    outputs = collect_all(names)
    if options.write or options.before:
        save(options.write or OUT / "after.npz", outputs)
    if options.before:
        return conclusion(differences(renamed(load(OUT / "before.npz")), outputs), len(outputs))
    if options.renew:
        others = {
            key: form for key, form in load_committed(GROUPS).items() if key.partition("/")[0] not in names
        }
        save_committed(others | committed_form(outputs))
    elif not options.write:
        return conclusion(unlike_committed(outputs, load_committed(names)), len(outputs))
    return 0


if __name__ == "__main__":
    sys.exit(main())
