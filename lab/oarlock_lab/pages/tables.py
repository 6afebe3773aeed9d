"""Tables of the pages that come from code: formats, devices, metrics, settings and model keys.

A table stands in a page of docs/ between `<!-- generated: NAME -->` and `<!-- end -->`; NAME is a key of `TABLES`.
`python -m oarlock_lab.pages tables` writes them.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import oarlock
from oarlock.formats.importers import FORMATS
from oarlock.live.decoders import DECODERS
from oarlock.rowing.analysis.features import CURVES, FEATURES, NUMBERS
from oarlock.tracking.settings import meanings

from .record import ROOT

KEYS: Mapping[str, Mapping[str, Sequence[str]]] = tomllib.loads(
    (ROOT / "lab/oarlock_lab/pages/model_keys.toml").read_text(encoding="utf-8")
)
"""Keys of each table of a model file: what they take, default, meaning."""
_BLOCK = re.compile(r"(<!-- generated: (.+?) -->\n).*?(<!-- end -->)", re.S)
_MOMENT = re.compile("catch|finish|drive|recovery", re.I)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Without blanks around the bars, which would count as words of the page."""
    return "\n".join(f"|{'|'.join(row)}|" for row in (columns, ["---"] * len(columns), *rows))


def formats() -> str:
    """What `oarlock import` reads."""

    def row(name: str, reads: str, options: Sequence[str]) -> list[str]:
        return [f"`{name}`", reads, ", ".join(f"`--{option.replace('_', '-')}`" for option in options)]

    rows = [row(each.name, each.reads, each.options) for each in FORMATS]
    return _table(("name", "reads", "options"), rows)


def devices() -> str:
    """What a live session decodes."""
    rows = [
        [f"`{each.name}`", ", ".join(f"`{name}`" for name in each.transports), each.about]
        for each in DECODERS.values()
    ]
    return _table(("format", "transports", "sends"), rows)


def metrics() -> str:
    """Numbers and curves of technique; both sides share a row, and moments that differ in their word alone."""
    rows: dict[tuple[str, ...], list[tuple[str, str]]] = {}
    for name in (*NUMBERS, *CURVES):
        feature, other = FEATURES[name], f"l_{name[2:]}"
        if name.startswith("l_") or (name.startswith("r_") and name[2:] in FEATURES):
            continue
        columns = f"`{name}`"
        if name.startswith("r_") and other in FEATURES:
            columns = f"`r_`, `l_{name[2:]}`"
        elif f"r_{name}" in FEATURES:
            columns += ", `r_`, `l_`"
        unit = "" if feature.shown_unit == "1" else feature.shown_unit
        source = "" if feature.source == "own" else feature.source
        text = feature.definition.replace(" Mean of two oars.", "").replace(" Mean of two hands.", "")
        moments = _MOMENT.findall(text)
        text = _MOMENT.sub("{}", text) if len(moments) == 1 else text
        rows.setdefault((unit, text, feature.sign, source), []).append((columns, "".join(moments)))
    cells: list[Sequence[str]] = []
    for (unit, definition, sign, source), models in rows.items():
        columns_of_row, moment_text = (", ".join(dict.fromkeys(parts)) for parts in zip(*models, strict=True))
        cells.append([columns_of_row, unit, definition.format(moment_text), sign, source])
    return _table(("column", "shown in", "definition", "positive", "source"), cells)


def settings() -> str:
    """Settings of the filter."""
    defaults = oarlock.Config().to_dict()

    def value_text(value: object) -> str:
        if isinstance(value, list):
            return ", ".join(value)
        return "" if value is None else str(value).lower()

    rows = [[f"`{name}`", value_text(defaults[name]), meaning] for name, meaning in meanings().items()]
    return _table(("setting", "default", "meaning"), rows)


def model_keys(table: str) -> str:
    """Keys of a table of model files."""
    rows = [[f"`{keys.replace(', ', '`, `')}`", *cells] for keys, cells in KEYS[table].items()]
    return _table(("key", "takes", "default", "meaning"), rows)


TABLES: Mapping[str, Callable[[], str]] = {
    "formats": formats,
    "devices": devices,
    "metrics": metrics,
    "settings": settings,
    **{f"keys of {table}": partial(model_keys, table) for table in KEYS},
}
"""Text of a block by its name."""


def with_tables(page: str) -> str:
    """The page with its tables as the code has them.

    Raises:
        KeyError: a block has a name that `TABLES` lacks.
    """
    return _BLOCK.sub(lambda block: f"{block[1]}\n{TABLES[block[2]]()}\n\n{block[3]}", page)


def write(root: Path = ROOT) -> list[Path]:
    """Write the tables into the pages, and return these."""
    files = []
    for file in sorted((root / "docs").rglob("*.md")):
        text = file.read_text(encoding="utf-8")
        if _BLOCK.search(text):
            file.write_text(with_tables(text), encoding="utf-8")
            files.append(file)
    return files
