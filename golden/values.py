"""Outputs of any kind as arrays and texts by key: objects, files, printed numbers. Used by the cases."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from typer.testing import CliRunner

import oarlock
from oarlock.cli import app
from oarlock.storage.arrays import Floats

Value = Floats | str
Outputs = Iterator[tuple[str, Value]]

NUMBER = r"(?<![\w.])-?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.]*\w)"
DATES = r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:Z|[-+]\d\d:\d\d)?)?"
DURATIONS = r"<dt>(?:computed|wall_<wbr>s|steps_<wbr>per_<wbr>s)</dt>\s*<dd>.*?</dd>"
"""How long a run took, which pages say."""
PARTS = r"\"[^\"\n]*\"|`[^`\n]*`|'[\w.-]+'|--[a-z][\w-]*|[\w.]+\.\w+:\d+|" + NUMBER
"""What programs can check in an error: quoted names, options, FILE:LINE, numbers."""
TEXT_SUFFIXES = (".csv", ".json", ".toml", ".html", ".mot", ".sto", ".trc", ".osim", ".bvh", ".svg")


def printed_numbers(text: str) -> Floats:
    """All numbers of a text in their order, without those in names, dates and versions."""
    return np.array([float(number) for number in re.findall(NUMBER, re.sub(DATES, "", text))])


def page_numbers(text: str) -> Floats:
    """Numbers of a page's text, pictures and data, without those of its programs and styles."""
    lasting = re.sub(DURATIONS, "", text)
    data = re.sub(r"<(script|style)(?![^>]*json)[^>]*>.*?</\1>", "", lasting, flags=re.DOTALL)
    paths = re.sub(r'(?<= d=")[^"]+', lambda path: re.sub(r"[A-Za-z]", " ", path[0]), data)
    return printed_numbers(paths)


def outputs_of(key: str, value: object) -> Outputs:
    """Arrays and texts in an object, below a key. A sentence counts by its numbers, because its words may improve."""
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, (str, Path)):
        text = str(value)
        yield key, printed_numbers(text) if " " in text else text
    elif isinstance(value, (bool, int, float, np.generic)):
        yield key, np.array([value], dtype=float)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        yield key, value.astype(float)
    elif isinstance(value, pa.Table):
        yield from _of_table(key, value)
    elif isinstance(value, Mapping):
        yield from _of_mapping(key, value)
    elif is_dataclass(value):
        for field in fields(value):
            yield from outputs_of(f"{key}/{field.name}", getattr(value, field.name))
    elif isinstance(value, (Sequence, np.ndarray)):
        yield from _of_sequence(key, list(value))


def _of_table(key: str, table: pa.Table) -> Outputs:
    """All columns of numbers as one array (columns, rows), and each of text."""
    numbers = [column for column in table.columns if not _is_text(column.type)]
    yield f"{key}/columns", "; ".join(table.column_names)
    yield key, np.array([np.ravel(column.to_pylist()) for column in numbers], dtype=float)
    for name, column in zip(table.column_names, table.columns, strict=True):
        if _is_text(column.type):
            yield f"{key}/{name}", "; ".join(map(str, column.to_pylist()))


def _is_text(kind: pa.DataType) -> bool:
    kinds_of_numbers = (pa.types.is_floating, pa.types.is_integer, pa.types.is_boolean, pa.types.is_nested)
    return not any(is_kind(kind) for is_kind in kinds_of_numbers)


def _of_mapping(key: str, entries: Mapping[Any, Any]) -> Outputs:
    if len(entries) > 1 and all(isinstance(e, Mapping) or is_dataclass(e) for e in entries.values()):
        yield f"{key}/names", "; ".join(map(str, entries))
        yield from _of_sequence(key, list(entries.values()))
    else:
        for name, entry in entries.items():
            yield from outputs_of(f"{key}/{name}", entry)


def _of_sequence(key: str, elements: list[Any]) -> Outputs:
    """Elements with fields become one array for each field."""
    if all(isinstance(element, (int, float, np.generic, type(None))) for element in elements):
        yield key, np.array(elements, dtype=float)
        return
    columns: dict[str, list[Value]] = {}
    for element in elements:
        for name, value in outputs_of(key, element):
            columns.setdefault(name, []).append(value)
    for name, values in columns.items():
        numbers = [np.ravel(value) for value in values if not isinstance(value, str)]
        texts = [value for value in values if isinstance(value, str)]
        if numbers:
            yield name, np.concatenate(numbers)
        if any(texts):
            yield f"{name}/texts" if numbers else name, "; ".join(texts)


def outputs_of_track(key: str, track: oarlock.Track) -> Outputs:
    """Times, joint values, derivatives, standard deviations, NIS and positions of frames."""
    for name in ("time_s", "q", "q_std", "qd", "qd_std", "qdd", "observed"):
        yield f"{key}/{name}", np.asarray(getattr(track, name), dtype=float)
    if track.info is not None:
        yield f"{key}/nis", np.asarray(track.info.inertial_nis, dtype=float)
    if track.model is not None:
        yield f"{key}/positions_m", track.positions_of(track.model.frame_names)


def outputs_of_recording(key: str, recording: oarlock.Recording) -> Outputs:
    """Times and readings of each stream."""
    for stream in recording:
        yield f"{key}/{stream.name}/time_s", stream.time_s
        for name, readings in stream.values.items():
            yield f"{key}/{stream.name}/{name}", np.asarray(readings, dtype=float)


def outputs_of_file(key: str, file: Path) -> Outputs:
    """Numbers of a text, columns of a Parquet table, else the digest of the bytes."""
    if file.suffix == ".parquet":
        yield from outputs_of(key, pq.read_table(file))
    elif file.suffix in TEXT_SUFFIXES:
        text = file.read_text(encoding="utf-8").replace(str(file.parent), "")
        yield key, page_numbers(text) if file.suffix == ".html" else printed_numbers(text)
    else:
        yield f"{key}/sha256", hashlib.sha256(file.read_bytes()).hexdigest()


def outputs_of_folder(key: str, folder: Path) -> Outputs:
    """All files of a folder and below."""
    for file in sorted(file for file in folder.rglob("*") if file.is_file()):
        yield from outputs_of_file(f"{key}/{file.relative_to(folder).as_posix()}", file)


def run_command(*words: object, status: int = 0) -> str:
    """What a command prints, which ends with this exit status.

    Raises:
        RuntimeError: another exit status.
    """
    ended = CliRunner().invoke(app, [str(word) for word in words], prog_name="oarlock")
    if ended.exit_code != status:
        raise RuntimeError(f"oarlock {' '.join(map(str, words))}: status {ended.exit_code}\n{ended.output}")
    return ended.output


def refusal(call: Callable[[], object], folder: Path) -> str:
    """Class, quoted names and numbers of the error that a call raises; its words may change."""
    try:
        call()
    except Exception as error:
        text = str(error).replace(f"{folder}/", "")
        parts = re.findall(PARTS, text)
        return " ".join([type(error).__name__, *parts])
    return "accepted"
