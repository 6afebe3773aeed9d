"""The size of each room of the project against its budget, and files that are too long to be one concept.

`python -m checks.budgets` lowers the budgets to what a room has now. It raises none: that is an edit of the table.
"""

import ast
import re
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path

from checks.names import refused_names
from checks.project_files import ROOT, code_files, name_of, text_files, text_of

TABLE = ROOT / "checks/budgets.toml"
MAX_LINES_OF_A_FILE = 900
PACKAGE = "python/oarlock"
SLACK = 0.01
"""A budget may exceed its room by this share and by two before it has to be lowered."""
RUST_NAMES = {"functions": re.compile(r"^\s*(?:pub(?:\([^)]*\))? )?(?:const |unsafe )*fn (\w+)", re.M)}
RUST_NAMES["classes"] = re.compile(r"^\s*(?:pub(?:\([^)]*\))? )?(?:struct|enum|trait|union) (\w+)", re.M)


def room_of(path: Path) -> str:
    """The folder that a budget counts: a part of the package, a crate's folder or a folder of the project."""
    parts = path.relative_to(ROOT).parts
    if name_of(path).startswith(PACKAGE):
        return "/".join(parts[:-1][:3])
    return "/".join(parts[:-1][: 3 if parts[0] == "crates" else 1]) or "."


def size_of(paths: list[Path]) -> dict[str, int]:
    """Lines, lines of code (neither blank, comment, docstring nor import), files, distinct functions and classes.

    `refused` counts names that contain one of `checks/refused_words.txt`; `python -m checks.names` lists them.
    """
    counts: Counter[str] = Counter(lines=0, code=0, files=0, refused=0)
    names: dict[str, set[str]] = {"functions": set(), "classes": set()}
    for path in paths:
        of_file, own_names = _of_file(path)
        counts.update(of_file)
        for kind, own in own_names.items():
            names[kind] |= own
    return {**counts, **{kind: len(own) for kind, own in names.items()}}


@cache
def _of_file(path: Path) -> tuple[dict[str, int], dict[str, set[str]]]:
    text = text_of(path)
    if path.suffix == ".rs":
        rows = (line.strip() for line in text.splitlines())
        code = sum(bool(row) and not row.startswith(("//", "use ")) for row in rows)
        names = {kind: set(pattern.findall(text)) for kind, pattern in RUST_NAMES.items()}
    else:
        tree = ast.parse(text)
        code = len(lines_of_code(text, tree))
        nodes = {"functions": (ast.FunctionDef, ast.AsyncFunctionDef), "classes": (ast.ClassDef,)}
        names = {
            kind: {node.name for node in ast.walk(tree) if isinstance(node, types)}
            for kind, types in nodes.items()
        }
    counts = {"lines": text.count("\n"), "code": code, "files": 1, "refused": len(refused_names(path))}
    return counts, names


def lines_of_code(text: str, tree: ast.Module) -> set[int]:
    """Numbers of the lines that are neither blank, comment, docstring nor import."""
    rows = text.splitlines()
    numbers = {k for k, row in enumerate(rows, 1) if row.strip() and not row.lstrip().startswith("#")}
    for node in ast.walk(tree):
        is_text = (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        )
        if isinstance(node, ast.Import | ast.ImportFrom) or is_text:
            numbers -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return numbers


def sizes() -> dict[str, dict[str, int]]:
    """Size of each room now, and the words of the documents."""
    rooms: dict[str, list[Path]] = {}
    for path in code_files():
        rooms.setdefault(room_of(path), []).append(path)
    rooms[PACKAGE + " as a whole"] = [path for path in code_files() if name_of(path).startswith(PACKAGE)]
    measured = {room: size_of(paths) for room, paths in sorted(rooms.items())}
    pages = [path for path in text_files() if path.suffix == ".md"]
    measured["documents"] = {"files": len(pages), "words": sum(len(text_of(path).split()) for path in pages)}
    return measured


def findings() -> list[str]:
    """Rooms beyond their budgets, budgets that have to be lowered, rooms without one."""
    budgets, measured, lines = tomllib.loads(text_of(TABLE)), sizes(), []
    for room, size in measured.items():
        if room not in budgets:
            lines.append(f"{room}: has no budget; add it to {name_of(TABLE)}, with a line that says what for")
        for key, value in size.items():
            budget = budgets.get(room, size).get(key, 0)
            if value > budget:
                lines.append(
                    f"{room}: {value} {key}, budget {budget}; delete, or raise it with a line that says what for"
                )
            elif value < (1.0 - SLACK) * budget - 2:
                lines.append(f"{room}: {value} {key}, budget {budget}; lower it: python -m checks.budgets")
    return lines + [f"{room}: has a budget and no file" for room in budgets if room not in measured]


def long_files() -> list[str]:
    """Files of code with more lines than a reader keeps in mind."""
    lines = {name_of(path): len(text_of(path).splitlines()) for path in code_files()}
    return [
        f"{name}: {count} lines, at most {MAX_LINES_OF_A_FILE}"
        for name, count in lines.items()
        if count > MAX_LINES_OF_A_FILE
    ]


def lowered(table: str, measured: dict[str, dict[str, int]]) -> str:
    """The text of the table with each number at most what was measured; other lines stay."""
    rows = []
    for row in table.splitlines():
        entry = re.match(r'"(.+)" = \{', row)
        if entry and entry[1] not in measured:
            continue
        if entry:
            for key, value in measured[entry[1]].items():
                row = re.sub(
                    rf"\b{key} = (\d+)", lambda hit, k=key, v=value: f"{k} = {min(int(hit[1]), v)}", row
                )
        rows.append(row)
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    TABLE.write_text(lowered(text_of(TABLE), sizes()), encoding="utf-8")
