"""Plots as SVG text, drawn by matplotlib where it is installed."""

from __future__ import annotations

import io
import itertools
from typing import Any

from .results import Plot, ResultCurve

WIDTH_IN, PANEL_IN, HEAD_IN = 11.6, 2.3, 0.7

OUR_COLOURS = ("#b3261e", "#e0786f", "#7a1712", "#f0a8a2", "#c2571a", "#8a3d12", "#d98a5b", "#5c2a0c")
# Colours that people with a colour-vision deficiency tell apart (Okabe and Ito 2008), without the reds.
OTHER_COLOURS = (
    "#0072b2",
    "#009e73",
    "#56b4e9",
    "#cc79a7",
    "#e69f00",
    "#6a6a6a",
    "#332288",
    "#117733",
    "#999933",
)
REFERENCE_COLOUR = "#222222"


def svg(plot: Plot) -> str:
    """The plot as inline SVG.

    Raises:
        ImportError: matplotlib is not installed.
    """
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot

    # Ids are hashed with the plot's name, so that several plots live in one page and a run can be repeated.
    style: dict[str, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": plot.name,
        "font.family": "sans-serif",
        "font.size": 9,
    }
    with matplotlib.rc_context(style):  # type: ignore[arg-type,unused-ignore]
        height = HEAD_IN + PANEL_IN * len(plot.panels)
        figure, axes = pyplot.subplots(
            len(plot.panels), 1, sharex=True, squeeze=False, figsize=(WIDTH_IN, height), layout="constrained"
        )
        colours = _colours(plot)
        for panel, (label, curves) in zip(axes[:, 0], plot.panels, strict=True):
            for curve in curves:
                width = 1.8 if curve.kind == "ours" else 1.1
                panel.plot(
                    curve.time_s, curve.values, label=curve.name, color=colours[curve.name], linewidth=width
                )
            panel.set_ylabel(label)
            panel.grid(alpha=0.3)
            panel.margins(x=0)
        axes[-1, 0].set_xlabel("time, s")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", frameon=False)
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
        pyplot.close(figure)
    # What stands before the element itself is for files of their own.
    drawn = text.getvalue()
    return drawn[drawn.index("<svg") :]


def _colours(plot: Plot) -> dict[str, str]:
    """One colour a name, the same in all panels."""
    colours: dict[str, str] = {}
    series = {"ours": itertools.cycle(OUR_COLOURS), "other": itertools.cycle(OTHER_COLOURS)}
    for curve in _all(plot):
        if curve.name not in colours:
            colours[curve.name] = REFERENCE_COLOUR if curve.kind == "reference" else next(series[curve.kind])
    return colours


def _all(plot: Plot) -> list[ResultCurve]:
    return [curve for _, curves in plot.panels for curve in curves]
