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
    every = {one: importlib.import_module(one).__all__ for one in PACKAGES}
    return {one: sorted(name for name in names if name != "__version__") for one, names in every.items()}


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
            found, text = _found(tree, package, name)
            if not text:
                missing.append(f"{package}.{name}")
            write(folder / package / f"{name}.md", _page(package, name, found, text))
            index.append(f"| [`{name}`]({package}/{name}.md) | {_first_line(text)} |")
    if missing:
        raise ValueError(f"public names without a docstring: {', '.join(missing)}")
    write(folder / "index.md", "\n".join(index))


def _found(tree: Any, package: str, name: str) -> tuple[Any, str]:
    """What griffe knows of a name, and its docstring; that of compiled classes is known at run time only."""
    found = tree
    for part in [*package.split(".")[1:], name]:
        found = found[part]
    found = found.final_target if found.is_alias else found
    return found, _text(found, getattr(importlib.import_module(package), name))


def _text(found: Any, value: object) -> str:
    if found.docstring:
        return str(inspect.cleandoc(found.docstring.value))
    if inspect.ismodule(value) or callable(value) or inspect.isdatadescriptor(value):
        return inspect.getdoc(value) or ""
    return ""


def _first_line(text: str) -> str:
    """The first sentence or line, for a table."""
    return re.split(r"\n\n|(?<=\.)\s", text.strip())[0].replace("\n", " ").replace("|", "\\|")


def _page(package: str, name: str, found: Any, text: str) -> str:
    lines = [f"# {name}\n", f"`{package}.{name}`\n", *_signature(found, name), _sections(found, text)]
    if found.is_class:
        lines += _members(found, getattr(importlib.import_module(package), name))
    return "\n".join(lines)


def _signature(found: Any, name: str) -> list[str]:
    if found.is_module:
        return []
    if found.is_attribute:
        kind = f": {found.annotation}" if found.annotation else ""
        return ["```python", f"{name}{kind}", "```\n"]
    shown = re.sub(rf"^{found.name}", name, found.signature() if hasattr(found, "signature") else "")
    shown = shown or f"class {name}"
    if len(shown) > WIDTH and "(" in shown:
        shown = _by_lines(shown)
    return ["```python", shown, "```\n"]


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


def _sections(found: Any, text: str) -> str:
    """The docstring in Markdown: its parameters and errors as lists."""
    if not text:
        return ""
    lines: list[str] = []
    for section in griffe.Docstring(text, parent=found).parse("google", **PARSED):
        if section.kind.value == "text":
            lines.append(f"{_markdown(section.value)}\n")
        elif section.kind.value == "examples":
            lines += [f"```python\n{value}\n```\n" for _, value in section.value]
        elif isinstance(section.value, list):
            lines.append(f"**{section.kind.value.capitalize()}**\n")
            lines += [_item(one) for one in section.value]
            lines.append("")
        else:
            lines.append(
                f"**{(section.title or section.kind.value).capitalize()}**\n\n{section.value.contents}\n"
            )
    return "\n".join(lines)


def _item(one: Any) -> str:
    name = getattr(one, "name", "") or str(getattr(one, "annotation", "") or "")
    text = _markdown(getattr(one, "description", "")).replace("\n", " ")
    return f"- `{name}`: {text}" if name else f"- {text}"


def _markdown(text: str) -> str:
    """Docstring text as Markdown: marks of HTML are meant as they stand."""
    parts = re.split(r"(`[^`]*`)", text)
    parts[::2] = [part.replace("<", "&lt;").replace("*", "\\*") for part in parts[::2]]
    return "".join(parts)


def _members(found: Any, value: Any) -> list[str]:
    meaning = _meanings(found)
    rows, methods = [], []
    for name, member in found.all_members.items():
        member = member.final_target if member.is_alias else member
        if name.startswith("_") or not (member.is_function or member.is_attribute):
            continue
        text = _text(member, inspect.getattr_static(value, name, None))
        if member.is_function:
            methods += [f"\n## {name}\n", *_signature(member, name), _sections(member, text)]
        elif text or name not in _parameters(found):
            kind = f"`{member.annotation}`".replace("|", "\\|") if member.annotation else ""
            rows.append(f"| `{name}` | {kind} | {_cell(text) or meaning.get(name, '')} |")
    table = ["\n| attribute | type | meaning |", "| --- | --- | --- |", *rows] if rows else []
    return [*table, *methods]


def _parameters(found: Any) -> set[str]:
    """Names that the docstring of a class explains itself."""
    return set(_explained(found)) if found.docstring else set()


def _meanings(found: Any) -> dict[str, str]:
    """What the docstrings of a class and of those that it extends say about each attribute."""
    every = [found]
    with suppress(ValueError):  # a base from a compiled module
        every += found.mro()
    return {name: text for one in reversed(every) if one.docstring for name, text in _explained(one).items()}


def _explained(found: Any) -> dict[str, str]:
    sections = griffe.Docstring(inspect.cleandoc(found.docstring.value), parent=found).parse(
        "google", **PARSED
    )
    lists = [one.value for one in sections if one.kind.value in ("parameters", "attributes")]
    return {item.name: _cell(item.description) for one in lists for item in one}


def _cell(text: str) -> str:
    return _markdown(text).replace("\n", " ").replace("|", "\\|")
