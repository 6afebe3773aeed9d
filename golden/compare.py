"""Compares outputs with those of another run, to the bit, or with the committed ones, within tolerances."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from golden.cases import GROUPS
from golden.values import Value
from oarlock.storage.arrays import Floats, Ints

HERE = Path(__file__).parent
COMMITTED, RENAMES, TOLERANCES = (
    HERE / name for name in ("committed.json", "renames.toml", "tolerances.toml")
)

ROWS = 12
"""Rows of a track whose values are committed."""
PARTS_OF_STD = 1e-9
"""Tolerance of an angle, in its standard deviations: the last bits differ between processors, and the filter's bands
are the scale on which a difference could matter."""
PARTS_OF_RMS = 1e-9
"""Tolerance of any other number, in parts of its array's root mean square, for the same reason."""
DIGITS = 11
"""Significant digits of committed digests: two more than their tolerance needs."""
LONGEST_TEXT = 160
"""Characters of a text that is committed as it is."""
FEW = 5
"""An array with as many numbers is committed as it is."""
FEWEST = 16
"""A shared array with fewer numbers is committed as a hash, because its digest would show samples."""


@dataclass(frozen=True)
class Difference:
    """An output that differs, with how much or in what."""

    key: str
    text: str

    def __str__(self) -> str:
        return f"{self.key}: {self.text}"


# --- two runs, to the bit -------------------------------------------------------------------------------


def renamed(outputs: Mapping[str, Value]) -> dict[str, Value]:
    """Outputs of an earlier commit under the keys that they have now."""
    table = tomllib.loads(RENAMES.read_text(encoding="utf-8"))
    new = {entry["old"]: entry["new"] for entry in table.get("rename", ())}

    def key_now(key: str) -> str:
        old = max((o for o in new if key == o or key.startswith(f"{o}/")), key=len, default=None)
        return key if old is None else new[old] + key.removeprefix(old)

    return {key_now(key): value for key, value in outputs.items()}


def differences(before: Mapping[str, Value], after: Mapping[str, Value]) -> list[Difference]:
    """All outputs that are not the same to the bit."""
    unlike = [
        Difference(key, "only before" if key in before else "only after")
        for key in before.keys() ^ after.keys()
    ]
    for key in before.keys() & after.keys():
        value, other = before[key], after[key]
        if isinstance(value, str) or isinstance(other, str):
            if str(value) != str(other):
                unlike.append(Difference(key, f"{value!s:.200} -> {other!s:.200}"))
        elif value.shape != other.shape:
            unlike.append(Difference(key, f"shape {value.shape} -> {other.shape}"))
        elif value.tobytes() != other.tobytes():
            unlike.append(Difference(key, _largest(value, other, before.get(f"{key}_std"))))
    return sorted(unlike, key=lambda difference: difference.key)


def _largest(before: Floats, other: Floats, std: Value | None) -> str:
    apart = np.abs(other - before)
    holes = int(np.count_nonzero(np.isfinite(before) != np.isfinite(other)))
    text = f"largest difference {np.nanmax(apart, initial=0.0):.3g}, in {np.count_nonzero(apart > 0)} of {before.size}"
    if isinstance(std, np.ndarray) and std.shape == before.shape:
        with np.errstate(divide="ignore", invalid="ignore"):
            text += f", {np.nanmax(apart / std, initial=0.0):.3g} standard deviations"
    return text + (f"; {holes} became or were missing" if holes else "")


# --- the committed outputs ------------------------------------------------------------------------------


def committed_form(outputs: Mapping[str, Value]) -> dict[str, Any]:
    """What is committed of outputs: rows of tracks, digests of arrays, short texts."""
    return {key: _form(key, value) for key, value in outputs.items() if not key.endswith("/sha256")}


def _form(key: str, value: Value) -> Any:
    is_shared = GROUPS[key.partition("/")[0]].needs_data
    if isinstance(value, str):
        is_short = len(value) <= LONGEST_TEXT and (not is_shared or value.endswith("Error"))
        return value if is_short else _hash(value)
    shape = list(value.shape)
    if is_shared and value.size < FEWEST:
        return {"shape": shape, "hash": _hash(" ".join(f"{x:.9g}" for x in value.flat))}
    form: dict[str, Any] = {"shape": shape, "digest": digest(value, with_ends=not is_shared)}
    missing = int(np.count_nonzero(~np.isfinite(value)))
    if missing:
        form["missing"] = missing
    if _has_rows(key) and not is_shared:
        form["rows"] = [
            [None if np.isnan(x) else x for x in row] for row in value[_rows(len(value))].tolist()
        ]
    return form


def _hash(text: str) -> str:
    return "sha256 " + hashlib.sha256(text.encode()).hexdigest()[:16]


def _has_rows(key: str) -> bool:
    group, _, name = key.partition("/")
    return group == "track" and name.rpartition("/")[2] in ("q", "q_std")


def _rows(count: int) -> Ints:
    return np.linspace(0, count - 1, min(ROWS, count)).round().astype(np.int64)


def digest(value: Floats, with_ends: bool) -> list[float]:
    """Root mean square, then mean, that of first differences, a sum with uneven weights, first and last; or all of few.

    Missing numbers count as 0.
    """
    numbers = np.nan_to_num(value.ravel(), nan=0.0, posinf=0.0, neginf=0.0)
    if not len(numbers):
        return []
    figures = [np.sqrt(np.mean(numbers**2))]
    if with_ends and len(numbers) <= FEW:
        figures += list(numbers)
    else:
        weighted = numbers @ np.cos(np.arange(len(numbers))) / np.sqrt(len(numbers))
        steps = np.diff(numbers, append=numbers[-1])
        figures += [np.mean(numbers), np.sqrt(np.mean(steps**2)), weighted]
        figures += [numbers[0], numbers[-1]] if with_ends else []
    return [float(f"{x:.{DIGITS}g}") for x in figures]


def unlike_committed(outputs: Mapping[str, Value], committed: Mapping[str, Any]) -> list[Difference]:
    """Outputs of some groups that differ from the committed ones by more than the tolerances."""
    tolerances = tomllib.loads(TOLERANCES.read_text(encoding="utf-8")).get("tolerance", [])
    now = committed_form(outputs)
    unlike = [Difference(key, "is no longer computed") for key in committed.keys() - now.keys()]
    for key, form in now.items():
        looser = [t["parts_of_rms"] for t in tolerances if fnmatchcase(key, t["keys"])]
        std = now.get(f"{key}_std")
        text = _unlike(form, committed.get(key), std, max(looser, default=PARTS_OF_RMS))
        if text:
            unlike.append(Difference(key, text))
    return sorted(unlike, key=lambda difference: difference.key)


def _unlike(now: Any, before: Any, std: Any, parts_of_rms: float) -> str:
    if before is None:
        return "is not committed"
    if not (isinstance(now, dict) and isinstance(before, dict)):
        return "" if now == before else f"{before} -> {now}"
    exact = [name for name in ("shape", "missing", "hash") if now.get(name) != before.get(name)]
    if exact:
        return ", ".join(f"{name} {before.get(name)} -> {now.get(name)}" for name in exact)
    figures, figures_before = np.array(now.get("digest", [])), np.array(before.get("digest", []))
    if len(figures) and np.abs(figures - figures_before).max() > parts_of_rms * figures_before[0]:
        return f"digest {figures_before.tolist()} -> {figures.tolist()}"
    return _unlike_rows(now, before, std, parts_of_rms) if "rows" in now else ""


def _unlike_rows(now: Any, before: Any, std: Any, parts_of_rms: float) -> str:
    rows, rows_before = np.array(now["rows"], dtype=float), np.array(before["rows"], dtype=float)
    if (np.isnan(rows) != np.isnan(rows_before)).any():
        return "other values of the committed rows are missing"
    rms = before["digest"][0]
    allowed = np.full(rows.shape, parts_of_rms * rms)
    if std is not None:
        stds = np.array(std["rows"], dtype=float)
        allowed = np.where(np.isfinite(stds), PARTS_OF_STD * stds, allowed)
    excess = np.nanmax(np.abs(rows - rows_before) / np.maximum(allowed, 1e-300), initial=0.0)
    return f"committed rows differ by {excess:.3g} times the tolerance" if excess > 1.0 else ""


def load_committed(names: Mapping[str, object]) -> dict[str, Any]:
    """The committed outputs of some groups."""
    forms: dict[str, Any] = json.loads(COMMITTED.read_text(encoding="utf-8")) if COMMITTED.is_file() else {}
    return {key: form for key, form in forms.items() if key.partition("/")[0] in names}


def save_committed(forms: Mapping[str, Any]) -> None:
    """Writes a line for each key, so that a change is readable."""
    lines = [f"{json.dumps(key)}: {json.dumps(forms[key], separators=(',', ':'))}" for key in sorted(forms)]
    COMMITTED.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
