"""Charts of a fault study: all faults ranked by their error, and each fault from weak to strong."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from oarlock.evaluation.study.costs import Dose, middle
from oarlock.evaluation.study.sweeps import FaultSweep
from oarlock.report import markup, plot
from oarlock.report.plot import Panel
from oarlock.report.text import breakable, number, plural

SIZE = (400.0, 250.0)
PLACE = (40.0, 10.0, 352.0, 148.0)
STRIP_GAP, STRIP = 22.0, 30.0
ROW, TOP, SIDE = 31.0, 8.0, 6.0
LETTER = 6.2
"""Approximate width of a letter. Labels that would touch their neighbours use two lines."""
SHAPES = (
    "M-3.4 0a3.4 3.4 0 1 0 6.8 0a3.4 3.4 0 1 0 -6.8 0Z",
    "M-3 -3H3V3H-3Z",
    "M0 -4L3.6 2.6H-3.6Z",
    "M0 -4.2L4.2 0L0 4.2L-4.2 0Z",
)
"""A shape for each setting, in addition to its colour."""
CROSS = "M-3.6 -3.6L3.6 3.6M-3.6 3.6L3.6 -3.6"


class Scale:
    """The range of errors that all drawings share, deg, on a logarithmic axis."""

    def __init__(self, doses: Sequence[Dose]) -> None:
        errors = np.concatenate([dose.error_deg for dose in doses])
        there = errors[np.isfinite(errors) & (errors > 0.0)]
        least, most = (float(there.min()), float(there.max())) if len(there) else (0.01, 100.0)
        self.range = (10.0 ** math.floor(math.log10(least)), 10.0 ** math.ceil(math.log10(most) - 1e-9))
        if self.range[1] <= self.range[0]:
            self.range = (self.range[0], 10.0 * self.range[0])

    def shown(self, error_deg: float) -> float:
        """An error inside the axis; failed runs are at its end."""
        return min(max(error_deg, self.range[0]), self.range[1])


def fault_chart(fault: FaultSweep, doses: Mapping[str, Sequence[Dose]], scale: Scale, key: str) -> str:
    """Error over the strength of one fault: a line per setting, and the range over seeds of the first setting."""
    first, *_ = doses.values()
    usual = first[fault.usual_index]
    svg = plot.drawing(key, SIZE, fault.name, described(fault, first), panel_of(fault, doses, scale, PLACE))
    fact = f"{breakable(usual.label)}: {breakable(cost_text(usual, places=True))}"
    return markup.figure(fault.name, svg, fact=fact, key=f"{key}-figure")


def panel_of(
    fault: FaultSweep,
    doses: Mapping[str, Sequence[Dose]],
    scale: Scale,
    place: tuple[float, float, float, float],
) -> str:
    """The inside of such a drawing: errors at `place`, and below them the share inside the 95 % bands."""
    count = len(fault.strengths)
    panel = Panel(*place, (-0.45, count - 0.55), scale.range, log_y=True)
    first, *_ = doses.values()
    below = (place[0], place[1] + place[3] + STRIP_GAP, place[2], STRIP)
    strip = Panel(*below, panel.x_range, (0.0, 1.0))
    parts = [_frame(panel, strip, [fault.label(k) for k in range(count)])]
    parts.append(plot.level(panel, float(np.median(first[0].clean_deg)), "clean"))
    parts.append(_range(panel, first, scale))
    for k, (_, own) in reversed(list(enumerate(doses.items()))):
        heights = np.array([scale.shown(dose.median_deg) for dose in own])
        across = np.arange(count, dtype=np.float64)
        parts.append(plot.line(panel, across, heights, f"series s{k}") if fault.ordered else "")
        places = zip(panel.x(across), panel.y(heights), own, strict=True)
        parts += [symbol(float(x), float(y), k, dose.lost > 0) for x, y, dose in places]
        parts.append(_inside(strip, own, k, fault.ordered))
    return "".join(parts)


def _inside(strip: Panel, doses: Sequence[Dose], k: int, joined: bool) -> str:
    """Share of the angles inside their bands; marks instead of lines if strengths have no order."""
    across = np.arange(len(doses), dtype=np.float64)
    shares = np.array([middle(dose.coverage) for dose in doses])
    if joined and len(doses) > 1:
        return plot.line(strip, across, shares, f"series s{k}")
    places = zip(strip.x(across), strip.y(shares), shares, strict=True)
    return "".join(symbol(float(x), float(y), k) for x, y, share in places if math.isfinite(share))


def described(fault: FaultSweep, doses: Sequence[Dose]) -> str:
    """A text description of a drawing, for screen readers."""
    errors = "; ".join(
        f"{dose.label}: {number(dose.median_deg, 2) if math.isfinite(dose.median_deg) else 'lost'}"
        for dose in doses
    )
    return f"Median error of the angles in deg by strength. {errors}."


def cost_text(dose: Dose, places: bool = False) -> str:
    """The added error of one strength as text, with that of the scored positions."""
    if not math.isfinite(dose.cost_deg):
        return "lost"
    if not dose.noticed:
        return "no measurable change"
    text = f"+{number(dose.cost_deg, 2)} deg"
    if places and math.isfinite(dose.place_cost_mm):
        text += f", +{number(max(dose.place_cost_mm, 0.0), 2)} mm"
    return text + (f", {dose.lost} of {len(dose.error_deg)} lost" if dose.lost else "")


def _frame(panel: Panel, strip: Panel, labels: Sequence[str]) -> str:
    bottom = strip.top + strip.height
    parts = [plot.label(panel.left, strip.top - 6.0, "share in 95 % band", "small")]
    for share in (0.0, 0.95):
        y = float(strip.y(share))
        parts.append(f'<path class="grid" d="M{strip.left:.1f} {y:.1f}h{strip.width:.1f}"/>')
        parts.append(plot.label(strip.left - 5, y + 3.5, f"{100 * share:g} %", anchor="end"))
    for power in _powers(panel.y_range):
        y = float(panel.y(power))
        parts.append(f'<path class="grid" d="M{panel.left:.1f} {y:.1f}h{panel.width:.1f}"/>')
        parts.append(plot.label(panel.left - 5, y + 3.5, f"{power:g}", anchor="end"))
    for k, text in enumerate(labels):
        x = float(panel.x(float(k)))
        parts.append(f'<path class="tick" d="M{x:.1f} {bottom:.1f}v3"/>')
        for line, words in enumerate(_wrapped(text, strip.width / len(labels))):
            parts.append(plot.label(x, bottom + 15 + 12 * line, words, anchor="middle"))
    return "".join(parts)


def _powers(limits: tuple[float, float]) -> list[float]:
    low, high = (round(math.log10(value)) for value in limits)
    return [10.0**power for power in range(low, high + 1)]


def _wrapped(text: str, width: float) -> list[str]:
    if LETTER * (len(text) + 1) <= width or " " not in text:
        return [text]
    words = text.split()
    at = min(range(1, len(words)), key=lambda k: abs(len(" ".join(words[:k])) - len(" ".join(words[k:]))))
    return [" ".join(words[:at]), " ".join(words[at:])]


def _range(panel: Panel, doses: Sequence[Dose], scale: Scale) -> str:
    """Range from the best seed to the worst; vertical bars if strengths have no order or there is only one."""
    low, high = (
        np.array([scale.shown(dose.range_deg[end]) for dose in doses], dtype=np.float64) for end in (0, 1)
    )
    across = np.arange(len(doses), dtype=np.float64)
    fault = doses[0].fault
    if len(doses) > 1 and fault is not None and fault.ordered:
        return plot.band(panel, across, low, high, "series-band s0")
    bars = zip(panel.x(across), panel.y(low), panel.y(high), strict=True)
    return "".join(f'<path class="seeds" d="M{x:.1f} {a:.1f}V{b:.1f}"/>' for x, a, b in bars)


def symbol(x: float, y: float, k: int, lost: bool = False) -> str:
    """The mark of a setting; a cross where a seed was lost."""
    shape, style = (CROSS, "cross") if lost else (SHAPES[k % len(SHAPES)], "dot")
    return f'<path class="{style} s{k}" transform="translate({x:.1f} {y:.1f})" d="{shape}"/>'


# --- all faults in one order --------------------------------------------------------------------------


def ranking(
    rows: Sequence[Mapping[str, Dose]], scale: Scale, key: str, caption: str, clean_deg: float
) -> str:
    """One row per fault at its typical strength: median and range over the seeds, one mark per setting."""
    height = ROW * len(rows)
    low, high = (math.log10(value) for value in scale.range)
    panel = Panel(SIDE, TOP, SIZE[0] - 2 * SIDE, height, (low, high), (0.0, 1.0))
    parts = [_upright(panel, scale, clean_deg)]
    parts += [_row(panel, row, TOP + ROW * k + 23.0, scale) for k, row in enumerate(rows)]
    texts = "; ".join(f"{_sentence(row)}: {cost_text(next(iter(row.values())))}" for row in rows)
    svg = plot.drawing(key, (SIZE[0], TOP + height + 22.0), caption, texts, "".join(parts))
    return markup.figure(caption, svg, key=f"{key}-figure")


def _row(panel: Panel, row: Mapping[str, Dose], y: float, scale: Scale) -> str:
    first, *_ = row.values()

    def across(error_deg: float) -> float:
        return float(panel.x(math.log10(scale.shown(error_deg))))

    least, greatest = (across(end) for end in first.range_deg)
    parts = [
        plot.label(panel.left, y - 8.0, _sentence(row), "strip-name halo"),
        plot.label(panel.left + panel.width, y - 8.0, cost_text(first), "halo", "end"),
        f'<path class="interval" d="M{least:.1f} {y:.1f}H{max(greatest, least + 0.1):.1f}"/>',
    ]
    marks = list(enumerate(row.values()))
    parts += [symbol(across(dose.median_deg), y, k, dose.lost > 0) for k, dose in reversed(marks)]
    return "".join(parts)


def _sentence(row: Mapping[str, Dose]) -> str:
    first, *_ = row.values()
    return first.fault.sentence(first.index) if first.fault else ""


def _upright(panel: Panel, scale: Scale, clean_deg: float) -> str:
    bottom = panel.top + panel.height
    parts = []
    for power in _powers(scale.range):
        x = float(panel.x(math.log10(power)))
        parts.append(f'<path class="grid" d="M{x:.1f} {panel.top:.1f}V{bottom:.1f}"/>')
        anchor = "start" if power == scale.range[0] else "end" if power == scale.range[1] else "middle"
        unit = " deg" if power == scale.range[1] else ""
        parts.append(plot.label(x, bottom + 14, f"{power:g}{unit}", anchor=anchor))
    x = float(panel.x(math.log10(scale.shown(clean_deg))))
    return "".join(parts) + f'<path class="clean" d="M{x:.1f} {panel.top:.1f}V{bottom:.1f}"/>'


def legend_entries(settings: Sequence[str], seeds: int) -> list[tuple[str, str]]:
    """Marks, bands and lines, 28 wide and 12 high, with their names."""
    marks = enumerate(settings)
    return [
        *((f'<path class="series s{k}" d="M0 6H28"/>{symbol(14, 6, k)}', name) for k, name in marks),
        ('<rect class="series-band s0" width="28" height="12"/>', f"range over {plural(seeds, 'seed')}"),
        ('<path class="clean" d="M0 6H28"/>', "without a fault"),
        (f'<path class="cross s0" transform="translate(14 6)" d="{CROSS}"/>', "a seed was lost"),
    ]
