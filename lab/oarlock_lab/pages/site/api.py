"""Reference of the Python interface: a page for each public name, from its signature and docstring."""

from __future__ import annotations

import importlib
import inspect
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import griffe

from .stage import ROOT, write

ROOMS = ("evaluation", "recording", "simulation", "tracking", "rowing", "live", "season")
PACKAGES = ("oarlock", *(f"oarlock.{room}" for room in ROOMS))
PARSED = {"warnings": False, "returns_multiple_items": False, "returns_named_value": False}
WIDTH = 88
"""Signatures longer than this have a line for each parameter."""


def public_names() -> dict[str, list[str]]:
    """The public names of each package, without the version."""
    every = {package: importlib.import_module(package).__all__ for package in PACKAGES}
    return {
        package: sorted(name for name in names if name != "__version__") for package, names in every.items()
    }


def write_pages(docs: Path) -> None:
    """Write an index, and a page for each name.

    Raises:
        ValueError: a public name has no docstring.
    """
    tree = griffe.load("oarlock", search_paths=[str(ROOT / "python")], resolve_aliases=True)
    folder = docs / "reference/api"
    index = ["# Python\n", "`import oarlock` loads a module when a name of it is first used."]
    missing = []
    for package, names in public_names().items():
        index += [f"\n## {package}\n", "| name | what it is |", "| --- | --- |"]
        for name in names:
            member, text = _definition(tree, package, name)
            if not text:
                missing.append(f"{package}.{name}")
            write(folder / package / f"{name}.md", _page(package, name, member, text))
            index.append(f"| [`{name}`]({package}/{name}.md) | {_first_line(text)} |")
    if missing:
        raise ValueError(f"public names without a docstring: {', '.join(missing)}")
    write(folder / "index.md", "\n".join(index))


def _definition(tree: Any, package: str, name: str) -> tuple[Any, str]:
    """What griffe knows of a name, and its docstring; that of compiled classes is known at run time only."""
    node = tree
    for part in [*package.split(".")[1:], name]:
        node = node[part]
    node = node.final_target if node.is_alias else node
    return node, _text(node, getattr(importlib.import_module(package), name))


def _text(member: Any, value: object) -> str:
    if member.docstring:
        return str(inspect.cleandoc(member.docstring.value))
    if inspect.ismodule(value) or callable(value) or inspect.isdatadescriptor(value):
        return inspect.getdoc(value) or ""
    return ""


def _first_line(text: str) -> str:
    """The first sentence or line, for a table."""
    return re.split(r"\n\n|(?<=\.)\s", text.strip())[0].replace("\n", " ").replace("|", "\\|")


def _page(package: str, name: str, member: Any, text: str) -> str:
    lines = [f"# {name}\n", f"`{package}.{name}`\n", *_signature(member, name), _sections(member, text)]
    if member.is_class:
        lines += _members(member, getattr(importlib.import_module(package), name))
    return "\n".join(lines)


def _signature(function: Any, name: str) -> list[str]:
    if function.is_module:
        return []
    if function.is_attribute:
        kind = f": {function.annotation}" if function.annotation else ""
        return ["```python", f"{name}{kind}", "```\n"]
    text = re.sub(rf"^{function.name}", name, function.signature() if hasattr(function, "signature") else "")
    text = text or f"class {name}"
    if len(text) > WIDTH and "(" in text:
        text = _by_lines(text)
    return ["```python", text, "```\n"]


def _by_lines(signature: str) -> str:
    """The signature with a line for each parameter."""
    begin, depth, last, parts = signature.index("("), 0, signature.index("(") + 1, []
    for at in range(begin, len(signature)):
        depth += {"(": 1, "[": 1, "{": 1, ")": -1, "]": -1, "}": -1}.get(signature[at], 0)
        if depth == 0 or (depth == 1 and signature[at] == ","):
            parts.append(signature[last:at].strip())
            last = at + 1
        if depth == 0:
            break
    body = "".join(f"    {part},\n" for part in parts if part)
    return f"{signature[: begin + 1]}\n{body}{signature[last - 1 :]}"


def _sections(member: Any, text: str) -> str:
    """The docstring in Markdown: its parameters and errors as lists."""
    if not text:
        return ""
    lines: list[str] = []
    for section in griffe.Docstring(text, parent=member).parse("google", **PARSED):
        if section.kind.value == "text":
            lines.append(f"{_markdown(section.value)}\n")
        elif section.kind.value == "examples":
            lines += [f"```python\n{value}\n```\n" for _, value in section.value]
        elif isinstance(section.value, list):
            lines.append(f"**{section.kind.value.capitalize()}**\n")
            lines += [_item(package) for package in section.value]
            lines.append("")
        else:
            lines.append(
                f"**{(section.title or section.kind.value).capitalize()}**\n\n{section.value.contents}\n"
            )
    return "\n".join(lines)


def _item(member: Any) -> str:
    name = getattr(member, "name", "") or str(getattr(member, "annotation", "") or "")
    text = _markdown(getattr(member, "description", "")).replace("\n", " ")
    return f"- `{name}`: {text}" if name else f"- {text}"


def _markdown(text: str) -> str:
    """Docstring text as Markdown: marks of HTML are meant as they stand."""
    parts = re.split(r"(`[^`]*`)", text)
    parts[::2] = [part.replace("<", "&lt;").replace("*", "\\*") for part in parts[::2]]
    return "".join(parts)


def _members(owner: Any, value: Any) -> list[str]:
    meaning = _meanings(owner)
    rows, methods = [], []
    for name, member in owner.all_members.items():
        member = member.final_target if member.is_alias else member
        if name.startswith("_") or not (member.is_function or member.is_attribute):
            continue
        text = _text(member, inspect.getattr_static(value, name, None))
        if member.is_function:
            methods += [f"\n## {name}\n", *_signature(member, name), _sections(member, text)]
        elif text or name not in _parameters(owner):
            kind = f"`{member.annotation}`".replace("|", "\\|") if member.annotation else ""
            rows.append(f"| `{name}` | {kind} | {_cell(text) or meaning.get(name, '')} |")
    table = ["\n| attribute | type | meaning |", "| --- | --- | --- |", *rows] if rows else []
    return [*table, *methods]


def _parameters(member: Any) -> set[str]:
    """Names that the docstring of a class explains itself."""
    return set(_explained(member)) if member.docstring else set()


def _meanings(member: Any) -> dict[str, str]:
    """What the docstrings of a class and of those that it extends say about each attribute."""
    every = [member]
    with suppress(ValueError):  # a base from a compiled module
        every += member.mro()
    return {
        name: text
        for package in reversed(every)
        if package.docstring
        for name, text in _explained(package).items()
    }


def _explained(member: Any) -> dict[str, str]:
    sections = griffe.Docstring(inspect.cleandoc(member.docstring.value), parent=member).parse(
        "google", **PARSED
    )
    lists = [package.value for package in sections if package.kind.value in ("parameters", "attributes")]
    return {item.name: _cell(item.description) for package in lists for item in package}


def _cell(text: str) -> str:
    return _markdown(text).replace("\n", " ").replace("|", "\\|")
