"""The stretch of a recording in which an estimate is worst, and the curves of all software in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.storage.arrays import Bools, Floats

from .estimate import OrientationEstimate
from .results import Panel, Plot, ResultCurve

Errors = Mapping[str, tuple[OrientationEstimate, Floats]]
"""Name of a software -> its estimate, and its errors over the reference's samples, deg."""


@dataclass(frozen=True)
class ErrorWindow:
    """A span of time in s, and the leading estimate's RMS error in it, deg."""

    start_s: float
    end_s: float
    rms_deg: float

    def of(self, time_s: Floats) -> Bools:
        """Which samples lie in it."""
        return (time_s >= self.start_s) & (time_s <= self.end_s)

    @property
    def text(self) -> str:
        """As titles name it."""
        return f"{self.start_s:.0f} to {self.end_s:.0f} s"


def leading(errors: Errors) -> Floats:
    """Errors of the estimate that matters most: Oarlock's first one, or the first of the others without it."""
    return sorted(errors.values(), key=lambda pair: not pair[0].ours)[0][1]


def worst_window(errors: Errors, time_s: Floats, rows: Bools, length_s: float) -> ErrorWindow:
    """The stretch of this length in which the leading estimate's errors are largest, root mean square."""
    squares = np.where(rows, np.nan_to_num(leading(errors)), 0.0) ** 2
    count = min(len(time_s) - 1, max(1, round(length_s / float(np.median(np.diff(time_s))))))
    sums = np.concatenate([[0.0], np.cumsum(squares)])
    first = int(np.argmax(sums[count:-1] - sums[: -count - 1]))
    mean = (sums[first + count] - sums[first]) / count
    return ErrorWindow(float(time_s[first]), float(time_s[first + count]), float(np.sqrt(mean)))


def curves(errors: Errors, time_s: Floats, window: ErrorWindow) -> tuple[ResultCurve, ...]:
    """One curve an estimate, cut to the stretch."""
    inside = window.of(time_s)
    return tuple(
        ResultCurve(name, time_s[inside], values[inside], "ours" if estimate.ours else "other")
        for name, (estimate, values) in errors.items()
    )


def worst_plot(
    name: str,
    caption: str,
    errors: Errors,
    time_s: Floats,
    rows: Bools,
    length_s: float,
    truth: Sequence[tuple[str, Floats]] = (),
) -> tuple[float, Plot | None]:
    """Errors of all software in the leading one's worst stretch, above curves of what was really there.

    Args:
        name: the plot's.
        caption: the trial, as the title names it.
        errors: by software.
        time_s: (T,) the reference's stamps.
        rows: (T,) samples that are scored.
        length_s: of the stretch.
        truth: (label with unit, (T,) values) of the reference.

    Returns:
        The RMS error in the stretch, by which the worst of several trials is chosen, and the plot; None if
        nothing ran.
    """
    if not errors:
        return 0.0, None
    window = worst_window(errors, time_s, rows, length_s)
    title = f"Worst {length_s:.0f} s: {caption}, {window.text}"
    return window.rms_deg, window_plot(name, title, errors, time_s, window, truth)


def window_plot(
    name: str,
    title: str,
    errors: Errors,
    time_s: Floats,
    window: ErrorWindow,
    truth: Sequence[tuple[str, Floats]] = (),
) -> Plot:
    """Errors of all software in a stretch, above curves of what was really there; arguments as `worst_plot`."""
    inside = window.of(time_s)
    panels: list[Panel] = [("error, deg", curves(errors, time_s, window))]
    panels += [
        (label, (ResultCurve("reference", time_s[inside], v[inside], "reference"),)) for label, v in truth
    ]
    return Plot(name, title, tuple(panels))


def worst_of(plots: Sequence[tuple[float, Plot | None]]) -> tuple[Plot, ...]:
    """The plot of the largest error; empty if nothing ran."""
    drawn = [(severity, plot) for severity, plot in plots if plot is not None]
    return (max(drawn, key=lambda pair: pair[0])[1],) if drawn else ()
