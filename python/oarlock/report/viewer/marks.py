"""Marks of the viewer: instants and intervals of a track to jump to, repeat or overlay."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from oarlock.storage.errors import DataError

Mark = tuple[float, str] | tuple[float, float, str]


def marks_and_spans(marks: Sequence[Mark]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Instants `(time_s, label)` and spans `(start_s, end_s, label)` as plain data, sorted by time.

    Without spans, the intervals between instants of the same label are used: for example from catch to catch.

    Raises:
        DataError: neither an instant nor a span, or a span that ends before it begins.
    """
    instants: list[dict[str, Any]] = []
    spans: list[dict[str, Any]] = []
    for mark in marks:
        match mark:
            case (float() | int() as time_s, str() as label):
                instants.append({"time_s": float(time_s), "label": label})
            case (float() | int() as start_s, float() | int() as end_s, str() as label) if start_s < end_s:
                spans.append({"start_s": float(start_s), "end_s": float(end_s), "label": label})
            case _:
                raise DataError(
                    f"scene: mark {mark!r} is neither (time_s, label) nor (start_s, end_s, label) with start before end"
                )
    instants.sort(key=lambda instant: instant["time_s"])
    spans = spans or _between(instants)
    return instants, sorted(spans, key=lambda span: span["start_s"])


def _between(instants: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    spans: list[dict[str, Any]] = []
    for label in dict.fromkeys(instant["label"] for instant in instants):
        times = [instant["time_s"] for instant in instants if instant["label"] == label]
        spans += [
            {"start_s": start, "end_s": end, "label": f"{label} {k}"}
            for k, (start, end) in enumerate(itertools.pairwise(times), 1)
        ]
    return spans
