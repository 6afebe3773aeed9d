"""What must hold of a session that has ended: its events, its memory, and that its recording gives its estimates."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import oarlock
from oarlock.live.folder import RECORDING, LiveFolder
from oarlock_lab.soak.child import FIGURES, Digest
from oarlock_lab.soak.misbehaving import Planted

WITHIN_S = 20.0
"""An event belongs to what was planted so long before at most; the same is planted again after 100 s."""
WARM_UP = 0.2
"""Share of a run in which memory may grow: pools fill, histories reach their length."""


@dataclass(frozen=True)
class EventsOfPlan:
    """Which planted events were told.

    Args:
        planted: how many there were.
        missing: those that were not told.
        delay_s: the longest time until one was told.
        others: events that nothing planted explains.
    """

    planted: int
    missing: tuple[Planted, ...]
    delay_s: float
    others: tuple[str, ...]


def events_of_plan(
    plan: Sequence[Planted], events: Iterable[Mapping[str, Any]], offset_s: float = 0.0
) -> EventsOfPlan:
    """Compares events with the plan, which began `offset_s` after the session."""
    left, missing, delay_s = list(events), [], 0.0
    for fault in plan:
        at_s = fault.at_s + offset_s
        matching = [e for e in left if _tells(e["text"], fault) and -0.5 <= e["time_s"] - at_s <= WITHIN_S]
        if not matching:
            missing.append(fault)
            continue
        delay_s = max(delay_s, matching[0]["time_s"] - at_s)
        left.remove(matching[0])
    words = [words for planted in plan for words in [planted.words]]
    expected = {tuple(w) for w in words}
    others = [e["text"] for e in left if not any(all(w in e["text"] for w in each) for each in expected)]
    return EventsOfPlan(
        len(plan), tuple(missing), delay_s, tuple(text for text in others if text != "tracking")
    )


def _tells(text: str, fault: Planted) -> bool:
    return all(word in text for word in fault.words)


def growth_percent(memory: Sequence[tuple[float, int]]) -> float:
    """By how much the memory of the last fifth of a run is above that of the fifth behind the warm-up, medians."""
    kib = np.array([size for _, size in memory], dtype=float)
    fifth = max(int(WARM_UP * len(kib)), 1)
    first, last = np.median(kib[fifth : 2 * fifth]), np.median(kib[-fifth:])
    return float(100.0 * (last / first - 1.0))


def repeated(folder: Path) -> Digest:
    """The estimates that the recorded packets give."""
    place = LiveFolder.load(folder)
    session = place.session(oarlock.load_model(place.rig().model))
    digest = Digest()
    for packet in place.read():
        for estimate in session.take(packet):
            digest.put(estimate.time_s, estimate.belief)
    return digest


def tracked(folder: Path, from_s: float) -> oarlock.Belief | None:
    """The last estimate of the recording, reading by reading from where the session began to track.

    `oarlock.track` decides before its first row how units sit; a live tracker decides it on the way.
    """
    place = LiveFolder.load(folder)
    model = oarlock.load_model(place.rig().model)
    recording = oarlock.load_recording(folder / RECORDING)
    config = place.session(model).config
    tracker = oarlock.Tracker(model, config=config)
    streams = recording.slice(start_s=from_s).streams
    for time_s, k, row in sorted(
        (t, k, row) for k, s in enumerate(streams) for row, t in enumerate(s.time_s)
    ):
        readings: dict[str, Any] = {name: values[row] for name, values in streams[k].values.items()}
        tracker.push(streams[k].name, time_s, readings.get("value", readings))
    tracker.flush()
    return tracker.belief


def is_last_estimate(digest: Mapping[str, Any], last: oarlock.Belief | None) -> bool:
    """Whether this is the last live estimate, bit for bit: each estimate decides all later ones."""
    return (
        last is not None
        and last.time_s == digest["last_time_s"]
        and (last.mean.tobytes().hex(), last.std.tobytes().hex()) == (digest["last_mean"], digest["last_std"])
    )


def estimated(folder: Path) -> dict[str, Any]:
    """What the session's process wrote about its estimates."""
    figures: dict[str, Any] = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
    return figures
