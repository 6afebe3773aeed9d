"""`write_page`: writes the report of a track as one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from oarlock.evaluation.common_clock import on_clock_of
from oarlock.evaluation.evaluate import evaluate
from oarlock.evaluation.scores import Evaluation
from oarlock.report.front import Front
from oarlock.report.page import render
from oarlock.report.section import Section
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress, mark, share, shown
from oarlock.storage.write_file import write_file
from oarlock.tracking.track import Track


def write_page(
    track: Track,
    path: str | Path,
    evaluation: Evaluation | None = None,
    truth: Track | None = None,
    title: str | None = None,
    sections: Sequence[Section] = (),
    front: Front | None = None,
    *,
    progress: Progress = None,
) -> Path:
    """Write a report that works offline: no requests, only scripts of `sections`, readable on paper and telephone.

    Args:
        track: the result to report.
        path: the file to write, or an existing folder, which gets ``report.html``. Missing parents are made.
        evaluation: scores against truth; computed if only ``truth`` is given.
        truth: reference that is drawn beside the estimate.
        title: heading; default names the model.
        sections: sections of a field of application, before the general ones.
        front: what a field of application shows first.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Returns:
        Path: the file written.

    Raises:
        DataError: the track has no samples, or does not overlap with the truth, or two sections share a key.
    """
    if not len(track.time_s):
        raise DataError("nothing to report: the track has no samples. Was the recording empty?")
    truth = None if truth is None else on_clock_of(track, truth)
    with shown(progress, "writing the report") as told:
        if evaluation is None and truth is not None:
            # the default, or a tenth of a shorter recording
            start_s = min(2.0, 0.1 * float(track.time_s[-1] - track.time_s[0]))
            evaluation = evaluate(track, truth, start_s, progress=share(told, 0.0, 0.5))
        page = render(track, evaluation, truth, title, sections, front)
        mark(told, 1.0)
    target = Path(path)
    if target.is_dir():
        target = target / "report.html"
    target.parent.mkdir(parents=True, exist_ok=True)
    write_file(target, page)
    return target
