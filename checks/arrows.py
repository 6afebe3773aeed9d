"""Modules of the package use each other in one direction only, as ARCHITECTURE.md draws it."""

import ast
from pathlib import Path

from checks.project_files import ROOT, name_of, text_of

PACKAGE = ROOT / "python/oarlock"

# Who may use a part that stands at the rim of the package.
RIMS = {
    "oarlock.cli": {"cli", "__main__"},
    "oarlock.lab": {"cli", "lab", "report"},
    "oarlock.report": {"cli", "lab", "report"},
    "oarlock.rowing": {"cli", "lab", "report", "rowing"},
}
# What rowing uses beside the public names.
ROWING_OWN = ("oarlock.rowing", "oarlock.storage.errors", "oarlock.simulation.motion", "oarlock.model.shapes")


def findings() -> list[str]:
    """Imports that the layers do not allow."""
    return [*rims_crossed(), *rowing_beyond_the_public_names()]


def rims_crossed() -> list[str]:
    """Imports of a rim by parts that lie inside it."""
    found = []
    for path in python_files():
        for rim, users in RIMS.items():
            if part_of(path) not in users:
                used = sorted(name for name in imported(path) if within(name, rim))
                found += [f"{name_of(path)} must not import {name}" for name in used]
    return found


def rowing_beyond_the_public_names() -> list[str]:
    """Imports by rowing of names that are not public."""
    found = []
    public = {f"oarlock.{name}" for name in public_names()} | {"oarlock"}
    for path in sorted((PACKAGE / "rowing").rglob("*.py")):
        allowed = public | (public_of("report", "report.viewer") if part_of(path) == "report" else set())
        for name in sorted(imported(path)):
            if name not in allowed and not any(within(name, part) for part in ROWING_OWN):
                found.append(f"{name_of(path)} imports {name}, which is not public")
    return found


def python_files() -> list[Path]:
    """Modules and stubs of the package."""
    return sorted([*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.pyi")])


def python_module(path: Path) -> tuple[str, ...]:
    """Dotted name of a file, in parts."""
    parts = ("oarlock", *path.relative_to(PACKAGE).with_suffix("").parts)
    return parts[:-1] if parts[-1] == "__init__" else parts


def imported(path: Path) -> set[str]:
    """Dotted names that a file imports from the package; `from a import b` counts as `a.b`."""
    module, found = python_module(path), set()
    package = module if path.stem == "__init__" else module[:-1]
    for node in ast.walk(ast.parse(text_of(path))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            source = [*above, *([node.module] if node.module else [])]
            found |= {".".join([*source, alias.name]) for alias in node.names}
    return {name for name in found if name.split(".")[0] == "oarlock"}


def within(name: str, module: str) -> bool:
    """Whether `name` is the module or lies in it."""
    return name == module or name.startswith(module + ".")


def public_names(file: Path = PACKAGE / "__init__.py") -> set[str]:
    """`__all__` of a file."""
    tree = ast.parse(text_of(file))
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
        names = public_names(PACKAGE.joinpath(*package.split("."), "__init__.py"))
        found |= {f"oarlock.{package}", *(f"oarlock.{package}.{name}" for name in names)}
    return found
