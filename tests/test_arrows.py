"""The modules point at each other in one direction only, as ARCHITECTURE.md draws it."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ENGINE = ROOT / "crates/oarlock/src"
BINDING = ROOT / "crates/oarlock-py/src"
PACKAGE = ROOT / "python/oarlock"

FOUNDATION = {"error", "lane", "rotation", "pose"}
BODY = FOUNDATION | {"model", "kinematics"}
SETTINGS = BODY | {"config", "estimate"}

# What a module of the engine may name. A new module gets its row here and its line in ARCHITECTURE.md.
# `estimate` owns the traits of a system; those who describe a body by them name it.
ENGINE_MAY_USE: dict[str, set[str]] = {
    "error": set(),
    "lane": set(),
    "rotation": {"error", "lane"},
    "pose": {"error", "lane", "rotation"},
    "config": {"error"},
    "estimate": {"error", "lane", "rotation"},
    "model": FOUNDATION,
    "kinematics": FOUNDATION | {"model"},
    "state": SETTINGS,
    "motion": SETTINGS | {"state"},
    "sensor": SETTINGS | {"state"},
    "body": SETTINGS | {"state", "motion", "sensor"},
    "jacobian": SETTINGS | {"sensor"},
    "describe": BODY | {"body"},
    "recording": BODY | {"sensor"},
    "track": SETTINGS | {"state", "motion", "sensor", "body", "recording"},
    "simulate": BODY | {"state", "motion", "track"},
    "calibrate": BODY,
}

# The engine computes: files, printing and Python are the business of those who call it.
ENGINE_NEVER = re.compile(r"\b(?:std::fs|std::io|std::net|std::process|pyo3|e?print(?:ln)?!|dbg!)")

# Rowing is one use of the package. Only these parts of it may speak of oars.
MAY_SPEAK_OF_ROWING = {"bench", "cli", "demo", "models", "report", "rowing", "viewer"}
ROWING_WORD = re.compile(
    r"(?<![a-z])(?:boats?|coxswain|oars?|rigger|row(?:er|ers|ing)|scull(?:er|ers|ing|s)?|strokes?)(?![a-z])",
    re.I,
)
# Names, not talk: the shipped models, the package, the title of the cited source.
NAMES_THAT_LOOK_LIKE_TALK = re.compile(
    r"""["'`/]sculler\w*(?:\.toml)?\\?["'`]|oarlock[./]rowing|tracking applied in rowing"""
)
# Modules that draw: their strokes are lines.
DRAWS = {"pose_picture"}


def rust_code(path: Path) -> str:
    """Source without comments and without the unit tests at its end."""
    text = re.sub(r"//[^\n]*", "", path.read_text(encoding="utf-8"))
    return re.split(r"#\[cfg\(test\)\]\s*mod \w+ \{", text)[0]


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
    found = set()
    for match in re.finditer(r"\b(crate|(?:super::)*super)::", code):
        ups = 0 if match[1] == "crate" else match[1].count("super")
        if ups and len(module) - ups != 0:
            continue  # stays inside its own top-level module
        if code[match.end() : match.end() + 1] == "{":
            names = split_group(code[match.end() + 1 : matching_brace(code, match.end())])
        else:
            names = [code[match.end() :]]
        found |= {first[0] for name in names if (first := re.match(r"[a-z]\w*", name))}
    return found


def engine_files() -> list[Path]:
    return sorted(path for path in ENGINE.rglob("*.rs") if path.stem not in {"lib", "tests"})


def module_path(path: Path) -> tuple[str, ...]:
    parts = path.relative_to(ENGINE).with_suffix("").parts
    return parts[:-1] if parts[-1] == "mod" else parts


def test_the_engine_was_found():
    assert {"model", "estimate", "rotation"} <= {module_path(path)[0] for path in engine_files()}


@pytest.mark.parametrize("path", engine_files(), ids=lambda path: str(path.relative_to(ENGINE)))
def test_engine_arrow(path):
    module = module_path(path)
    assert module[0] in ENGINE_MAY_USE, f"{path.name}: give module `{module[0]}` a row in ENGINE_MAY_USE"
    modules = set(ENGINE_MAY_USE) & named_from_root(rust_code(path), module)
    forbidden = modules - ENGINE_MAY_USE[module[0]] - {module[0]}
    assert not forbidden, f"{'::'.join(module)} must not use {sorted(forbidden)}"


@pytest.mark.parametrize("path", engine_files(), ids=lambda path: str(path.relative_to(ENGINE)))
def test_engine_touches_nothing_outside(path):
    assert not ENGINE_NEVER.findall(rust_code(path))


@pytest.mark.parametrize("name", ["body", "course", "so3", "ukf"])
def test_the_oracle_knows_descriptions_of_models_and_nothing_of_the_engine(name):
    code = rust_code(ROOT / f"crates/oarlock-oracle/src/{name}.rs")
    assert set(re.findall(r"\boarlock::(\w+)", code)) <= {"model", "rotation"}


def test_arrow_reader_reads_every_way_to_write_an_arrow():
    code = "use crate::{error::Error, model::{Joint, Body}};\nuse super::sensor::Imu;\ncrate::lane::f()"
    assert named_from_root(code, ("track",)) == {"error", "model", "sensor", "lane"}
    assert named_from_root("use super::gate;", ("estimate", "filter")) == set()
    assert named_from_root("use super::super::model::Model;", ("estimate", "filter")) == {"model"}


def python_files() -> list[Path]:
    return sorted([*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.pyi")])


def python_module(path: Path) -> tuple[str, ...]:
    parts = ("oarlock", *path.relative_to(PACKAGE).with_suffix("").parts)
    return parts[:-1] if parts[-1] == "__init__" else parts


def imported(path: Path) -> set[str]:
    """Dotted names that a file imports from the package; `from a import b` counts as `a.b`."""
    module, found = python_module(path), set()
    package = module if path.stem == "__init__" else module[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            source = [*above, *([node.module] if node.module else [])]
            found |= {".".join([*source, alias.name]) for alias in node.names}
    return {name for name in found if name.split(".")[0] == "oarlock"}


def within(name: str, module: str) -> bool:
    return name == module or name.startswith(module + ".")


def public_names(file: Path = PACKAGE / "__init__.py") -> set[str]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if any(isinstance(target, ast.Name) and target.id == "__all__" for target in targets):
                return set(ast.literal_eval(node.value))
    raise AssertionError(f"{file} has no __all__")


def part_of(path: Path) -> str:
    """First name below the package: `python/oarlock/rowing/rig.py` -> `rowing`. Its report is one more report."""
    parts = path.relative_to(PACKAGE).parts
    return "report" if parts[:2] == ("rowing", "report") else parts[0].split(".")[0]


def public_of(*packages: str) -> set[str]:
    """Names that the packages offer to those who hand them something, with the packages themselves."""
    found = set()
    for package in packages:
        names = public_names(PACKAGE / package / "__init__.py")
        found |= {f"oarlock.{package}", *(f"oarlock.{package}.{name}" for name in names)}
    return found


def test_rowing_stands_on_the_public_face_only():
    public = {f"oarlock.{name}" for name in public_names()} | {"oarlock"}
    for path in sorted((PACKAGE / "rowing").rglob("*.py")):
        allowed = public | (public_of("report", "viewer") if part_of(path) == "report" else set())
        for name in imported(path):
            own = ("oarlock.rowing", "oarlock.storage.errors", "oarlock.motion", "oarlock.model.shapes")
            parts = any(within(name, part) for part in own)
            assert parts or name in allowed, f"{path.name} imports {name}, which is not public"


@pytest.mark.parametrize("path", python_files(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_package_arrow(path):
    rims = {
        "oarlock.cli": {"cli", "__main__"},
        "oarlock.lab.bench.measure": {"bench", "cli"},
        "oarlock.demo": {"cli", "demo"},
        "oarlock.report": {"cli", "demo", "report"},
        "oarlock.report.viewer": {"cli", "demo", "report", "viewer"},
        "oarlock.rowing": MAY_SPEAK_OF_ROWING,
    }
    for rim, users in rims.items():
        if part_of(path) not in users:
            used = [name for name in imported(path) if within(name, rim)]
            assert not used, f"{path.name} must not import {used}"


def silent_on_rowing() -> list[Path]:
    package = [path for path in python_files() if part_of(path) not in MAY_SPEAK_OF_ROWING]
    return [*package, *sorted(ENGINE.rglob("*.rs")), *sorted(BINDING.rglob("*.rs"))]


@pytest.mark.parametrize("path", silent_on_rowing(), ids=lambda path: str(path.relative_to(ROOT)))
def test_says_nothing_of_rowing(path):
    text = NAMES_THAT_LOOK_LIKE_TALK.sub("", path.read_text(encoding="utf-8"))
    if path.is_relative_to(PACKAGE) and part_of(path) in DRAWS:
        text = text.replace("stroke", "")
    if path.suffix == ".rs":
        text = re.split(r"#\[cfg\(test\)\]\s*mod \w+ \{", text)[0] if path.stem != "tests" else ""
    words = {f"line {text[: hit.start()].count(chr(10)) + 1}: {hit[0]}" for hit in ROWING_WORD.finditer(text)}
    assert not words, f"words that belong into oarlock.rowing or a model file: {sorted(words)}"
