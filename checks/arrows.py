"""Modules of the package use each other in one direction only, as ARCHITECTURE.md draws it."""

import ast
import re
from collections.abc import Collection, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from checks.project_files import ROOT, hits, name_of, text_of

PACKAGE = ROOT / "python/oarlock"
LAB = ROOT / "lab/oarlock_lab"

# A room may use those before it, never one behind it. "" is the public face, `oarlock/__init__.py`. Modules of plain
# data that the engine takes, returns or raises stand before it, apart from their room.
LAYERS = (
    "storage.arrays",
    "storage.errors",
    "storage.suggest",
    "model.description",
    "model.jacobians",
    "tracking.settings",
    "tracking.joint_state",
    "_core",
    "storage",
    "model",
    "recording",
    "tracking",
    "calibration",
    "simulation",
    "evaluation",
    "formats",
    "report",
    "pipeline",
    "markers",
    "studies",
    "",
    "live",
    "movement",
    "rowing",
    "season",
    "cli",
    "__main__",
)
# Rooms whose names are public, too.
PUBLIC_ROOMS = (
    "calibration",
    "evaluation",
    "markers",
    "model",
    "recording",
    "simulation",
    "studies",
    "tracking",
)
IMPORTS_LAB = re.compile(r"^\s*(?:from|import) oarlock_lab\b")
# What rowing uses beside the public names.
ROWING_OWN = (
    "oarlock.rowing",
    "oarlock.storage",
    "oarlock.live",
    "oarlock.simulation.motion",
    "oarlock.model.edit",
    "oarlock.model.jacobians",
    "oarlock.model.shapes",
)


def findings() -> list[str]:
    """Imports that the layers do not allow. Imports inside functions and under TYPE_CHECKING count like any other."""
    uses = imports_of(PACKAGE)
    lab = [line for path in python_files() for line in hits(IMPORTS_LAB, path)]
    return [
        *upward(uses),
        *circles(uses),
        *circles(imports_of(LAB)),
        *rowing_beyond_the_public_names(),
        *(f"{line}: oarlock-lab uses the package, not the other way round" for line in lab),
    ]


def imports_of(package: Path) -> dict[str, set[str]]:
    """The modules of a package that each of its modules imports, by dotted names."""
    names: dict[str, set[str]] = {}
    for path in python_files(package):  # a module and its stub are one
        names.setdefault(".".join(python_module(path, package)), set()).update(imported(path, package))
    return {module: {owner(name, names) for name in used} - {module} for module, used in names.items()}


def owner(name: str, modules: Collection[str]) -> str:
    """The module that an imported name stands in: the longest beginning of it that is a module."""
    while name not in modules and "." in name:
        name = name.rpartition(".")[0]
    return name


def upward(uses: Mapping[str, set[str]]) -> list[str]:
    """Imports of a room by one that stands before it, and rooms that no layer names."""
    rooms = {module: layer_of(module) for module in uses}
    unknown = sorted({room for room in rooms.values() if room not in LAYERS})
    without_place = [f"give the room '{room}' its place in LAYERS of checks/arrows.py" for room in unknown]
    place = {module: LAYERS.index(room) for module, room in rooms.items() if room in LAYERS}
    return without_place + [
        f"{module} must not import {used}: {rooms[used] or 'oarlock'} stands above {rooms[module]}"
        for module in sorted(place)
        for used in sorted(uses[module])
        if place.get(used, 0) > place[module]
    ]


def layer_of(module: str) -> str:
    """The layer that names the module itself, or else its room."""
    inside = module.partition(".")[2]
    return inside if inside in LAYERS else inside.partition(".")[0]


def circles(uses: Mapping[str, set[str]]) -> list[str]:
    """The first circle of imports, if there is one."""
    try:
        TopologicalSorter(uses).prepare()
    except CycleError as error:
        return ["circle of imports: " + " <- ".join(error.args[1])]
    return []


def rowing_beyond_the_public_names() -> list[str]:
    """Imports by rowing of names that are not public."""
    lines = []
    public = {f"oarlock.{name}" for name in public_names()} | {"oarlock", *public_of(*PUBLIC_ROOMS)}
    for path in sorted((PACKAGE / "rowing").rglob("*.py")):
        allowed = public | (public_of("report", "report.viewer") if part_of(path) == "report" else set())
        for name in sorted(imported(path)):
            if name not in allowed and not any(within(name, part) for part in ROWING_OWN):
                lines.append(f"{name_of(path)} imports {name}, which is not public")
    return lines


def python_files(package: Path = PACKAGE) -> list[Path]:
    """Modules and stubs of the package."""
    return sorted([*package.rglob("*.pyi"), *package.rglob("*.py")])


def python_module(path: Path, package: Path = PACKAGE) -> tuple[str, ...]:
    """Dotted name of a file, in parts."""
    parts = (package.name, *path.relative_to(package).with_suffix("").parts)
    return parts[:-1] if parts[-1] == "__init__" else parts


def imported(path: Path, root: Path = PACKAGE) -> set[str]:
    """Dotted names that a file imports from the package; `from a import b` counts as `a.b`."""
    module, found = python_module(path, root), set()
    package = module if path.stem == "__init__" else module[:-1]
    for node in ast.walk(ast.parse(text_of(path))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            source = [*above, *([node.module] if node.module else [])]
            found |= {".".join([*source, alias.name]) for alias in node.names}
    return {name for name in found if name.split(".")[0] == root.name}


def within(name: str, module: str) -> bool:
    """Whether `name` is the module or lies in it."""
    return name == module or name.startswith(module + ".")


def public_names(file: Path = PACKAGE / "__init__.pyi") -> set[str]:
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
    offered = set()
    for package in packages:
        place = PACKAGE.joinpath(*package.split("."))
        files = (place / "__init__.pyi", place / "__init__.py", place.with_suffix(".py"))
        names = public_names(next(file for file in files if file.is_file()))
        offered |= {f"oarlock.{package}", *(f"oarlock.{package}.{name}" for name in names)}
    return offered
