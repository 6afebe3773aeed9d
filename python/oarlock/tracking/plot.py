"""Curves of a track with their bands, drawn with matplotlib (`Track.plot`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from oarlock.model.angle_sequence import angle_labels
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError
from oarlock.storage.extras import optional
from oarlock.storage.statistics import NORMAL_95
from oarlock.tracking.estimates import Estimates
from oarlock.tracking.joint_series import BallSeries, FreeSeries, JointSeries

if TYPE_CHECKING:
    from matplotlib.axes import Axes


Panel: TypeAlias = str | Sequence[str]
"""A joint, or several joints in one panel."""

_MOST_PANELS: Final = 12
_PANEL_WIDTH_IN, _PANEL_HEIGHT_IN = 4.6, 1.9
_COLOURS: Final = ("#2a78b8", "#d9601a", "#3d8f4a", "#8a5cb0", "#a3781a", "#4a9aa8")
"""Right side blue, left side orange where two joints share a panel; contrast with white at least 3:1."""


def plot_track(
    track: Estimates,
    panels: Panel | Sequence[Panel] | None,
    truth: Estimates | None,
    axes: Sequence[Axes] | None,
) -> list[Axes]:
    """See `Track.plot`."""
    chosen = _chosen(track, panels)
    drawn = _new_axes(len(chosen)) if axes is None else list(np.ravel(np.asarray(axes, dtype=object)))
    if len(drawn) < len(chosen):
        raise DataError(f"plot: {len(drawn)} axes for {len(chosen)} panels; give one for each, or none")
    for ax, names in zip(drawn, chosen, strict=False):
        _panel(ax, track, names, truth)
    for ax in drawn[max(0, len(chosen) - _columns(len(chosen))) : len(chosen)]:
        ax.set_xlabel("time, s")
    return drawn[: len(chosen)]


def _chosen(track: Estimates, panels: Panel | Sequence[Panel] | None) -> list[tuple[str, ...]]:
    if panels is None:
        return _default_panels(track)
    given: Sequence[Panel] = [panels] if isinstance(panels, str) else panels
    chosen = [(panel,) if isinstance(panel, str) else tuple(panel) for panel in given]
    for names in chosen:
        units = {track[name].unit for name in names}
        if len(units) > 1:
            raise DataError(f"plot: {', '.join(names)} have different units; give each a panel of its own")
    return chosen


def _default_panels(track: Estimates) -> list[tuple[str, ...]]:
    """Observed joints, right and left in one panel."""
    names = [name for name in track.joint_names if track[name].observed.any()]
    panels: list[tuple[str, ...]] = []
    for name in names or list(track.joint_names):
        other = "l_" + name[2:] if name.startswith("r_") else name[:-2] + "_l" if name.endswith("_r") else ""
        both = other in names and not isinstance(track[name], BallSeries)
        if not any(name in panel for panel in panels):
            panels.append((name, other) if both else (name,))
    if len(panels) > _MOST_PANELS:
        panels = panels[:_MOST_PANELS]
    return panels


def _columns(panels: int) -> int:
    return 1 if panels == 1 else 2


def _new_axes(panels: int) -> list[Axes]:
    plt = optional("matplotlib.pyplot", "plot", "plot")
    columns = _columns(panels)
    rows = -(-panels // columns)
    size = (7.5 if columns == 1 else columns * _PANEL_WIDTH_IN, max(2.6, rows * _PANEL_HEIGHT_IN))
    _, grid = plt.subplots(rows, columns, figsize=size, sharex=True, squeeze=False, layout="constrained")
    axes = list(grid.ravel())
    for ax in axes[panels:]:
        ax.remove()
    if panels % columns:  # what stands above a removed panel has no labels of time below it
        axes[panels - columns].tick_params(labelbottom=True)
    return axes


def _panel(ax: Axes, track: Estimates, names: Sequence[str], truth: Estimates | None) -> None:
    curves = [curve for name in names for curve in _curves(track, name)]
    true = (
        []
        if truth is None
        else [c for name in names if name in truth.joint_names for c in _curves(truth, name)]
    )
    labels = ("right", "left") if _stem(names) else [curve[0] for curve in curves]
    for k, (_, value, std, observed) in enumerate(curves):
        label = labels[k] if len(curves) > 1 else ""
        _curve(ax, track.time_s, (value, std, observed), _COLOURS[k % len(_COLOURS)], label)
    for k, (_, value, _, _) in enumerate(true):
        label = "ground truth" if k == 0 else ""
        assert truth is not None
        ax.plot(truth.time_s, value, color="0.15", linewidth=0.8, linestyle="--", label=label or None)
    ax.set_title(_title(names), loc="left", fontsize=10)
    ax.set_ylabel(_unit_text(track, names[0]))
    ax.margins(x=0)
    ax.grid(alpha=0.25, linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    if len(curves) > 1 or true:
        place = (1.01, 0.97)
        ax.legend(
            loc="lower right",
            bbox_to_anchor=place,
            borderaxespad=0.1,
            fontsize=8,
            frameon=False,
            ncols=4,
            handlelength=1.2,
        )


def _curve(ax: Axes, time_s: Floats, series: tuple[Floats, Floats, Bools], colour: str, label: str) -> None:
    value, std, observed = series
    seen = np.where(observed, value, np.nan)
    ax.fill_between(
        time_s, seen - NORMAL_95 * std, seen + NORMAL_95 * std, color=colour, alpha=0.22, linewidth=0
    )
    ax.plot(time_s, np.where(observed, np.nan, value), color=colour, linewidth=0.7, alpha=0.45, linestyle=":")
    ax.plot(time_s, seen, color=colour, linewidth=1.3, label=label or None)


def _curves(track: Estimates, name: str) -> list[tuple[str, Floats, Floats, Bools]]:
    """Label, value, standard deviation and where observed, in deg or cm."""
    series: Any = track[name]
    if isinstance(series, JointSeries):
        factor = 100.0 if series.unit == "m" else float(np.degrees(1.0))
        return [(name, factor * series.value, factor * series.std, series.observed)]
    if isinstance(series, FreeSeries):
        stds, seen = 100.0 * series.std_m, series.position_observed
        places = 100.0 * series.position_m
        return [(f"{name} {axis}", places[:, k], stds[:, k], seen) for k, axis in enumerate("xyz")]
    values, stds = series.angles_deg(), np.degrees(series.angles_std_rad())
    clear = series.observed & ~series.near_singular()
    labels = angle_labels(series.angle_sequence)
    return [(label, values[:, k], stds[:, k], clear) for k, label in enumerate(labels)]


def _title(names: Sequence[str]) -> str:
    return (_stem(names) or ", ".join(names)).replace("_", " ")


def _stem(names: Sequence[str]) -> str:
    """What the names of a right and a left joint share; empty for others."""
    if len(names) == 2 and names[0].startswith("r_") and names[1] == "l_" + names[0][2:]:
        return names[0][2:]
    if len(names) == 2 and names[0].endswith("_r") and names[1] == names[0][:-2] + "_l":
        return names[0][:-2]
    return ""


def _unit_text(track: Estimates, name: str) -> str:
    return "cm" if track[name].unit.startswith("m") else "deg"
