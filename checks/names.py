"""Names of files that say nothing, class names that stand for several classes, and words that no name may contain."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from checks.arrows import LAB, PACKAGE, python_files
from checks.project_files import ROOT, code_files, name_of, text_files, text_of

VAGUE_NAMES = {"base", "common", "factory", "helper", "helpers", "manager", "misc", "types", "util", "utils"}
# Participles and private words that stood for a noun of the field. The thing has a name: stroke, mount, progress.
REFUSED_WORDS = frozenset(text_of(ROOT / "checks/refused_words.txt").split())
# Names of libraries.
OTHERS_NAMES = re.compile(
    r"^(FileNotFoundError|ModuleNotFoundError|CalledProcessError)$|least_squares|LeastSquares"
)
REFUSED_IN = ("python", "lab", "checks", "golden", "release", "crates")
WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
RUST_TALK = re.compile(r'//[^\n]*|r#"[\s\S]*?"#|b?"(?:\\[\s\S]|[^"\\])*"')
RUST_NAME = re.compile(r"(?<![\w.:'])(?!r#)[A-Za-z_]\w*(?!\w*!)")


def vague_names() -> list[str]:
    """Files and folders whose names do not say what they contain."""
    return [
        f"{name_of(path)}: say what is in it"
        for path in code_files()
        if {part.split(".")[0].lower().strip("_") for part in path.relative_to(ROOT).parts} & VAGUE_NAMES
    ]


def classes_with_the_same_name() -> list[str]:
    """Class names of the package and of oarlock-lab that are defined in more than one place."""
    places = defaultdict(list)
    for path in (path for package in (PACKAGE, LAB) for path in python_files(package)):
        for node in ast.walk(ast.parse(text_of(path))):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{name_of(path)}:{node.lineno}")
    return [
        f"{name}: {', '.join(at)}; a class name stands once" for name, at in places.items() if len(at) > 1
    ]


def refused_names(path: Path) -> dict[str, int]:
    """Names of a file of Python, Rust or the package's TOML that contain a refused word, with their first line."""
    if not any(path.is_relative_to(ROOT / folder) for folder in REFUSED_IN):
        return {}
    first = dict(reversed([*defined_names(path)]))
    return {
        name: line
        for name, line in sorted(first.items())
        if {word.lower() for word in WORD.findall(name)} & REFUSED_WORDS and not OTHERS_NAMES.search(name)
    }


def defined_names(path: Path) -> Iterator[tuple[str, int]]:
    """Names that a file defines, with their lines; in Rust names that are used without a path, too."""
    text = text_of(path)
    if path.suffix in (".py", ".pyi"):
        yield path.stem, 1
        for node in ast.walk(ast.parse(text)):
            match node:
                case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                    yield name, node.lineno
                case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                    yield name, node.lineno
                case ast.arg(arg=name):
                    yield name, node.lineno
    elif path.suffix == ".rs":
        yield path.stem, 1
        for k, line in enumerate(
            RUST_TALK.sub(lambda talk: "\n" * talk[0].count("\n"), text).splitlines(), 1
        ):
            yield from ((name[0], k) for name in RUST_NAME.finditer(line))
    elif path.suffix == ".toml" and path.is_relative_to(PACKAGE):
        for k, line in enumerate(text.splitlines(), 1):
            if key := re.match(r"\s*\[*([\w.]+)\]*\s*(?:=|$)", line):
                yield key[1], k


if __name__ == "__main__":
    for file in text_files():
        for refused, at in refused_names(file).items():
            print(f"{name_of(file)}:{at}: {refused}")
