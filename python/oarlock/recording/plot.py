"""Readings of a recording over time, drawn with matplotlib (`Recording.plot`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from oarlock.storage.extras import optional

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from oarlock.recording.streams import Stream

_LABELS: Final = {
    "gyro_rad_s": "angular velocity, rad/s",
    "accel_m_s2": "specific force, m/s²",
    "mag_ut": "magnetic field, µT",
    "quat_wxyz": "orientation, quaternion",
}
_COLOURS: Final = ("#2a78b8", "#d9601a", "#3d8f4a", "#8a5cb0")
_ROW_IN: Final = 1.7


def plot_streams(streams: Sequence[Stream]) -> list[Axes]:
    """One panel for each quantity of each stream; see `Recording.plot`."""
    panels = [(stream, name) for stream in streams for name in stream.values]
    plt = optional("matplotlib.pyplot", "plot", "plot")
    size = (7.5, max(2.4, len(panels) * _ROW_IN))
    _, grid = plt.subplots(len(panels), 1, figsize=size, sharex=True, squeeze=False, layout="constrained")
    axes: list[Axes] = list(grid.ravel())
    for ax, (stream, name) in zip(axes, panels, strict=True):
        _panel(ax, stream, name)
    axes[-1].set_xlabel("time, s")
    return axes


def _panel(ax: Axes, stream: Stream, name: str) -> None:
    values = stream.values[name].reshape(len(stream), -1)
    labels = {1: ("",), 3: tuple("xyz"), 4: tuple("wxyz")}[values.shape[1]]
    for k, label in enumerate(labels):
        ax.plot(stream.time_s, values[:, k], color=_COLOURS[k], linewidth=0.9, label=label or None)
    unit = getattr(stream, "unit", None)
    ax.set_title(
        f"{stream.name}: {_LABELS.get(name, name + (f', {unit}' if unit else ''))}", loc="left", fontsize=10
    )
    ax.margins(x=0)
    ax.grid(alpha=0.25, linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    if len(labels) > 1:
        place = (1.01, 0.97)
        ax.legend(
            loc="lower right", bbox_to_anchor=place, borderaxespad=0.1, fontsize=8, frameon=False, ncols=4
        )
