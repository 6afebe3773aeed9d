"""Reference of model files: every key that the engine reads, with its meaning, and the models that ship."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import oarlock
from oarlock.model.shipped_files import model_names
from oarlock_lab.pages.tables import KEYS

from .stage import ROOT, linked, write

PAGE = ROOT / "docs/model-files.md"
TABLES: Mapping[str, str] = {
    "file": "no_key = 1\n",
    "links": "[links]\nno_key = 1\n",
    "world": "[world]\nno_key = 1\n",
    "parameters": "[parameters]\nlength = { no_key = 1 }\n",
    "joint": '[[joint]]\nname = "a"\nno_key = 1\n',
    "frame": '[[frame]]\nname = "a"\nno_key = 1\n',
    "sensor": '[[sensor]]\nname = "a"\nkind = "imu"\nno_key = 1\n',
    "closure": '[[closure]]\nname = "a"\nno_key = 1\n',
    "base_acceleration": '[[base_acceleration]]\nname = "a"\nno_key = 1\n',
}
"""A table, and a file with an unknown key in it: the engine answers with the keys that it knows."""
BEFORE = {"extends", "mirror", "part"}
"""Keys that are resolved before the engine reads a model."""
VALID_KEYS = re.compile(r"unknown key `no_key`; valid: (.*?)$", re.M)


def write_pages(docs: Path) -> None:
    """Write the page of keys and the page of shipped models.

    Raises:
        ValueError: the page and the engine disagree about the keys of a table.
    """
    check_keys()
    text = PAGE.read_text(encoding="utf-8").split("\n## Reference\n")[1]
    text = re.sub(r"^(#+)# ", r"\1 ", text, flags=re.M)
    text = re.sub(r"\]\(#(extend-a-model|numbers-and-expressions)", r"](model-files.md#\1", text)
    page = docs / "reference/model-file.md"
    text = linked(text, PAGE, page, docs)
    begin = "# Model file\n\nThe keys are those that the engine reads; the build of this page compares both. "
    write(page, f"{begin}Recipes: [Change a model](../model-files.md).\n{text}")
    write(docs / "reference/models.md", _models())


def check_keys() -> None:
    """Compare the keys of the tables with those that the engine knows.

    Raises:
        ValueError: they differ.
    """
    for table, probe in TABLES.items():
        engine_keys, count = _engine_keys(probe)
        written = keys_of(table)
        if not engine_keys <= written or count != len(written):
            raise ValueError(
                f"{table}: the table has {sorted(written)}; the engine knows {count}: {sorted(engine_keys)}"
            )


def keys_of(table: str) -> set[str]:
    """The keys of a table; those of the whole file are its keys and its tables."""
    keys = {key for row in KEYS[table] for key in row.split(", ")}
    return (keys - BEFORE) | (set(KEYS) - {"file", "cone"}) if table == "file" else keys


def _engine_keys(probe: str) -> tuple[set[str], int]:
    """Keys in the engine's answer, and how many there are; the answer shows twelve."""
    try:
        oarlock.Model.from_toml(probe, "probe.toml", {})
    except oarlock.ModelError as error:
        match = VALID_KEYS.search(str(error))
        if match is None:
            raise
        keys = set(re.findall(r"`(\w+)`", match[1]))
        more = re.search(r"\((\d+) in all\)", match[1])
        return keys, int(more[1]) if more else len(keys)
    raise ValueError("the engine accepted an unknown key")


def _models() -> str:
    """All shipped models: joints, sensors, parameters."""
    lines = [
        "# Models that ship\n",
        "`oarlock model show NAME` prints one in full, `oarlock model copy` makes a copy to change.",
    ]
    for name in model_names():
        description = oarlock.load_model(name).describe()
        lines += [f"\n## {name}\n", f"{description.description}\n", "| what | names |", "| --- | --- |"]
        for title, each in (
            ("joints", description.joints),
            ("sensors", description.sensors),
            ("parameters", description.parameters),
        ):
            names = ", ".join(f"`{part.name}`" for part in each)
            lines.append(f"| {len(each)} {title} | {names} |")
    return "\n".join(lines)
