"""Reproduces every table and figure of the paper, with the printed value beside ours, for `oarlock lab reproduce`.

Source: E. Ruffaldi, L. Peppoloni, A. Filippeschi, "Sensor fusion for complex articulated body tracking applied in
rowing", Journal of Sports Engineering and Technology.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress, Told, share, shown
from oarlock_lab.reproduce.contents import PaperPart
from oarlock_lab.reproduce.cost import cost
from oarlock_lab.reproduce.discussion import discussion
from oarlock_lab.reproduce.figures import fig3, fig4, fig5
from oarlock_lab.reproduce.part_cache import PartCache
from oarlock_lab.reproduce.table5 import table5
from oarlock_lab.reproduce.table6 import TrackedTrial, field_trials, table6

PARTS = ("table5", "table6", "fig3", "fig4", "fig5", "discussion", "cost")
"""Names of the parts, in the order of the paper."""

# approximate relative durations for the progress bar
_WEIGHTS = {
    "table5": 5.0,
    "table6": 2.0,
    "fig3": 0.3,
    "fig4": 0.3,
    "fig5": 0.1,
    "discussion": 8.0,
    "cost": 3.0,
}


def reproduce(
    parts: Sequence[str] = PARTS,
    seeds: Sequence[int] = (0, 1, 2),
    *,
    duration_s: float = 40.0,
    jobs: int | None = None,
    progress: Progress = None,
    cache: PartCache | None = None,
    on_part: Callable[[str, bool], object] = lambda key, is_cached: None,
) -> list[PaperPart]:
    """Reproduce parts of the paper.

    Args:
        parts: names of `PARTS`.
        seeds: seeds of stroke variation and noise.
        duration_s: duration of each recording, s; the paper has 40.
        jobs: number of processes and threads; None uses all cores.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.
        cache: finished parts and runs, which are not made again; None keeps nothing.
        on_part: called with the name of each part when it is finished, and whether it was kept.

    Returns:
        The requested parts, in the order of the paper.

    Raises:
        DataError: an unknown part, no seed, or a recording too short to be scored.
    """
    for name in parts:
        if name not in PARTS:
            raise DataError(f"reproduce: there is no '{name}'; choose from {', '.join(PARTS)}")
    if not seeds or duration_s < 4.0:
        raise DataError(
            f"reproduce: {len(seeds)} seeds of {duration_s:g} s; give one seed or more, and at least 4 s"
        )
    selected = [name for name in PARTS if name in parts]
    cached = {name: part for name in selected if cache is not None and (part := cache.read(name)) is not None}
    for name in cached:
        on_part(name, True)
    missing = [name for name in selected if name not in cached]
    whole, done = sum(_WEIGHTS[name] for name in missing), 0.0
    trials: list[TrackedTrial] | None = None
    with shown(progress, "running the experiments") as callback:
        for name in missing:
            part_progress = share(callback, done / whole, (done + _WEIGHTS[name]) / whole)
            done += _WEIGHTS[name]
            if name in ("table6", "fig4", "fig5") and trials is None:
                # a figure without table 6 needs only one recording with one setting
                some = () if "table6" in missing else ("indoor",)
                trials = field_trials(
                    seeds if "table6" in missing else seeds[:1], duration_s, jobs, part_progress, some
                )
            runs = None if cache is None else cache.runs(name)
            cached[name] = _part(name, seeds, duration_s, jobs, part_progress, trials or [], runs)
            if cache is not None:
                cache.write(cached[name])
            on_part(name, False)
    return [cached[name] for name in selected]


def _part(
    name: str,
    seeds: Sequence[int],
    duration_s: float,
    jobs: int | None,
    progress: Told | None,
    trials: Sequence[TrackedTrial],
    runs: Path | None,
) -> PaperPart:
    if name == "table5":
        return table5(seeds, duration_s, jobs, progress, runs)
    if name == "table6":
        return table6(trials, duration_s)
    if name == "fig3":
        return fig3(seeds[0], duration_s)
    if name in ("fig4", "fig5"):
        return (fig4 if name == "fig4" else fig5)(trials, duration_s)
    return (
        discussion(seeds, duration_s, jobs, progress, runs) if name == "discussion" else cost(jobs, progress)
    )
