"""Lines of files and functions, and names that say nothing."""

import ast
from collections.abc import Iterator

from checks.project_files import ROOT, code_files, name_of, text_of

MOST_LINES_OF_A_FILE = 900
# Of the body: a signature and a docstring are declarations. Clippy counts the functions of the engine (clippy.toml).
MOST_LINES_OF_A_FUNCTION = 60
VAGUE_NAMES = {"base", "common", "factory", "helper", "helpers", "manager", "misc", "types", "util", "utils"}

# Functions that are still longer, with their lines: none may be added, none may grow.
STILL_LONG: dict[str, int] = {}


def long_files() -> list[str]:
    """Files of code with more lines than a reader keeps in mind."""
    lines = {name_of(path): len(text_of(path).splitlines()) for path in code_files()}
    return [
        f"{name}: {count} lines, at most {MOST_LINES_OF_A_FILE}"
        for name, count in lines.items()
        if count > MOST_LINES_OF_A_FILE
    ]


def functions(text: str) -> Iterator[tuple[str, int]]:
    """Name and number of lines of each function's body."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            yield node.name, (node.end_lineno or 0) - body[0].lineno + 1 if body else 0


def long_functions() -> list[str]:
    """Python functions that should be split, and those in `STILL_LONG` that have become shorter."""
    found = []
    now: dict[str, int] = {}
    for path in (path for path in code_files() if path.suffix == ".py"):
        for name, lines in functions(text_of(path)):
            if lines > MOST_LINES_OF_A_FUNCTION:
                now[f"{name_of(path)}: {name}"] = lines
    for name, lines in now.items():
        most = STILL_LONG.get(name, MOST_LINES_OF_A_FUNCTION)
        if lines > most:
            found.append(f"{name}: {lines} lines, at most {most}")
    shorter = [name for name, lines in STILL_LONG.items() if now.get(name, 0) < lines]
    return found + [
        f"{name}: is shorter now; correct or remove its line in checks/sizes.py" for name in shorter
    ]


def vague_names() -> list[str]:
    """Files and folders whose names do not say what they contain."""
    return [
        f"{name_of(path)}: say what is in it"
        for path in code_files()
        if {part.split(".")[0].lower().strip("_") for part in path.relative_to(ROOT).parts} & VAGUE_NAMES
    ]
