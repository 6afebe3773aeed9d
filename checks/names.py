"""Names of files that say nothing, and class names that stand for several classes."""

import ast
from collections import defaultdict

from checks.arrows import LAB, PACKAGE, python_files
from checks.project_files import ROOT, code_files, name_of, text_of

VAGUE_NAMES = {"base", "common", "factory", "helper", "helpers", "manager", "misc", "types", "util", "utils"}


def vague_names() -> list[str]:
    """Files and folders whose names do not say what they contain."""
    return [
        f"{name_of(path)}: say what is in it"
        for path in code_files()
        if {part.split(".")[0].lower().strip("_") for part in path.relative_to(ROOT).parts} & VAGUE_NAMES
    ]


def classes_of_one_name() -> list[str]:
    """Class names of the package and of oarlock-lab that are defined in more than one place."""
    places = defaultdict(list)
    for path in (path for package in (PACKAGE, LAB) for path in python_files(package)):
        for node in ast.walk(ast.parse(text_of(path))):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{name_of(path)}:{node.lineno}")
    return [
        f"{name}: {', '.join(at)}; a class name stands once" for name, at in places.items() if len(at) > 1
    ]
