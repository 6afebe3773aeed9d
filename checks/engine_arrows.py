"""Modules of the engine use each other in one direction only, as ARCHITECTURE.md draws it."""

import re
from pathlib import Path

from checks.project_files import ROOT, text_of

ENGINE = ROOT / "crates/oarlock/src"
ORACLE = ROOT / "crates/oarlock-oracle/src"

FOUNDATION = {"error", "kernels", "rotation"}
BODY = FOUNDATION | {"model", "kinematics"}
SETTINGS = BODY | {"config", "estimate"}

# What a module of the engine may name. A new module gets its row here.
# `estimate` owns the traits of a system; those who describe a body by them name it.
ENGINE_MAY_USE: dict[str, set[str]] = {
    "error": set(),
    "kernels": set(),
    "rotation": {"kernels"},
    # The structure of a model may be chosen in both.
    "config": {"error", "model"},
    "estimate": {"kernels"},
    # A model holds the kinds of its sensors, and each kind reads its own keys of the model file.
    "model": FOUNDATION | {"sensor"},
    "kinematics": FOUNDATION | {"model"},
    "state": SETTINGS | {"sensor"},
    "motion": SETTINGS | {"state", "sensor"},
    "sensor": SETTINGS,
    "body": SETTINGS | {"state", "motion", "sensor"},
    "jacobian": SETTINGS | {"sensor"},
    "describe": BODY | {"body", "sensor"},
    "corrections": FOUNDATION | {"sensor"},
    "recording": BODY | {"config", "corrections", "sensor"},
    "strapdown": SETTINGS | {"body", "sensor"},
    "track": SETTINGS | {"state", "motion", "sensor", "corrections", "body", "recording", "strapdown"},
    "simulate": BODY | {"state", "motion", "track"},
    "calibrate": BODY,
}

# The engine computes: files, printing and Python are the business of those who call it.
ENGINE_NEVER = re.compile(r"\b(?:std::fs|std::io|std::net|std::process|pyo3|e?print(?:ln)?!|dbg!)")
UNIT_TESTS = re.compile(r"#\[cfg\(test\)\]\s*mod \w+ \{")
# The independent filter may read descriptions of models and nothing that it is to judge.
ORACLE_FILES = ("body", "course", "so3", "ukf")
ORACLE_MAY_USE = {"model", "rotation"}


def findings() -> list[str]:
    """Arrows that the table does not allow, and what reaches outside the engine."""
    lines = []
    for path in engine_files():
        code, module = rust_code(path), module_path(path)
        name = "::".join(module)
        lines += [f"{name} must not use {other}" for other in sorted(forbidden(code, module))]
        lines += [f"{name} must not name {outside}" for outside in ENGINE_NEVER.findall(code)]
    for name in ORACLE_FILES:
        used = set(re.findall(r"\boarlock::(\w+)", rust_code(ORACLE / f"{name}.rs"))) - ORACLE_MAY_USE
        lines += [f"oarlock-oracle {name} must not use {other}" for other in sorted(used)]
    return lines


def forbidden(code: str, module: tuple[str, ...]) -> set[str]:
    """Top-level modules that the code of `module` names and must not; a module without a row may use none."""
    if module[0] not in ENGINE_MAY_USE:
        return {f"anything before it has a row in {Path(__file__).name}"}
    return set(ENGINE_MAY_USE) & named_from_root(code, module) - ENGINE_MAY_USE[module[0]] - {module[0]}


def rust_code(path: Path) -> str:
    """Source without comments and without the unit tests at its end."""
    text = re.sub(r"//[^\n]*", "", text_of(path))
    return UNIT_TESTS.split(text)[0]


def split_group(inside: str) -> list[str]:
    """`a::{b, c}, d` -> `["a::{b, c}", "d"]`."""
    parts, depth = [""], 0
    for letter in inside:
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def matching_brace(text: str, start: int) -> int:
    """Index of the brace that closes the one at `start`."""
    depth = 0
    for index in range(start, len(text)):
        depth += (text[index] == "{") - (text[index] == "}")
        if depth == 0:
            return index
    raise ValueError("unbalanced braces")


def named_from_root(code: str, module: tuple[str, ...]) -> set[str]:
    """Top-level modules of the crate that the code of `module` names through `crate::` or `super::`."""
    modules = set()
    for match in re.finditer(r"\b(crate|(?:super::)*super)::", code):
        ups = 0 if match[1] == "crate" else match[1].count("super")
        if ups and len(module) - ups != 0:
            continue  # stays inside its own top-level module
        if code[match.end() : match.end() + 1] == "{":
            names = split_group(code[match.end() + 1 : matching_brace(code, match.end())])
        else:
            names = [code[match.end() :]]
        modules |= {first[0] for name in names if (first := re.match(r"[a-z]\w*", name))}
    return modules


def engine_files() -> list[Path]:
    """Sources of the engine other than its root and its tests."""
    return sorted(path for path in ENGINE.rglob("*.rs") if path.stem not in {"lib", "tests"})


def module_path(path: Path) -> tuple[str, ...]:
    """`estimate/filter.rs` -> `("estimate", "filter")`."""
    parts = path.relative_to(ENGINE).with_suffix("").parts
    return parts[:-1] if parts[-1] == "mod" else parts
