"""One table in Markdown of everything that was measured."""

from __future__ import annotations

from typing import Any

from pages.record import made_text
from pages.sections import table

Row = dict[str, Any]


def write(figures: dict[str, Any]) -> str:
    """All tables, with the machine in the first line."""
    user = figures["user"]
    here = user["machine"]
    processor = f"{here['processor']}, {user['cores']} cores, {here['system']}"
    parts = [
        f"{made_text(figures)}, on {processor}, Python {here['python']};\nthe machine's load was "
        f"{figures['load']:.1f}. Times in µs, medians unless a column says otherwise.",
        f"The textbook's filter takes about {user['usual_textbook_us']:.0f} µs at 41 states on one core of a 3.7 GHz\n"
        "Zen 4; where it is slower here, look at times and not at ratios.",
        _ratios(figures["ratios"]),
        _parts(figures["criterion"]),
        _latency(figures["latency"], user),
        _rest(figures),
        _others(user),
    ]
    return "\n\n".join(parts) + "\n"


def _us(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}"


def _ratios(rows: list[Row]) -> str:
    def line(row: Row) -> list[object]:
        return [
            row["body"],
            row["n"],
            row["m"],
            row["filter"],
            f"{_us(row['us'])} ({_us(row['us_p10'])})",
            f"{_us(row['textbook_us'])} ({_us(row['textbook_us_p10'])})",
            f"{row['ratio']:.1f} ({row['ratio_p10']:.1f})",
        ]

    columns = ["body", "n", "m", "filter", "step (10 % quantile)", "textbook's UKF", "ratio"]
    return table(columns, [line(row) for row in rows])


def _parts(criterion: dict[str, dict[str, float]]) -> str:
    names = {
        "kinematics": "kinematics and readings of 8 sigma points",
        "update": "update",
        "step": "step",
        "track": "whole recording, a sample",
        "smooth": "smoothing, a sample: filtered again, and the way back",
    }
    sizes = sorted(criterion["step"], key=int)
    rows: list[list[object]] = [
        [text, *(_us(criterion[name][n]) if n in criterion[name] else "" for n in sizes)]
        for name, text in names.items()
    ]
    return table(["what, µs", *(f"n = {n}" for n in sizes)], rows)


def _latency(rows: list[Row], user: Row) -> str:
    def line(who: str, n: int, name: str, row: Row) -> list[object]:
        return [who, n, name, *(_us(row[key]) for key in ("p50_us", "p99_us", "p99_9_us"))]

    lines = [line("Rust", row["n"], row["filter"], row) for row in rows]
    lines += [line("Python", part["n"], "ukf", part) for part in (user, user["with_biases"])]
    return table(["`Tracker.step` from", "n", "filter", "p50", "p99", "p99.9"], lines)


def _rest(figures: dict[str, Any]) -> str:
    many = {row["threads"]: row for row in figures["many"]}
    user, rows = figures["user"], list[list[object]]()
    for threads, row in sorted(many.items()):
        rows.append(
            [
                f"samples/s on {threads} {'thread' if threads == 1 else 'threads'}, from Rust, n = 72",
                f"{row['steps_s']:.0f} ({row['ratio']:.2f} times one)",
            ]
        )
    two = f"{user['two_threads_steps_s']:.0f} ({user['two_threads_ratio']:.2f} times one)"
    rows.append(["samples/s on 2 threads, `track_many`, n = 72", two])
    rows.append(
        ["sensors at 125 Hz, n = 41, ukf", f"{user['times_real_time']:.0f} times faster than real time"]
    )
    rows += _whole(user, figures["instructions"])
    apart = figures["apart"]
    text = f"{apart['apart_ms']:.1f} ms ({apart['ratio']:.2f} times that of sensors that do)"
    rows.append(["tracking a second of sensors that do not tick together", text])
    rows += _recordings(figures["recordings"])
    rows += [
        [f"processor time of `{what}`", f"{time_s:.2f} s"] for what, time_s in figures["startup"].items()
    ]
    return table(["what", "figure"], rows)


def _whole(user: Row, instructions: Row) -> list[list[object]]:
    rows = list[list[object]]()
    for part in (user, user["with_biases"]):
        steps, passes = part["track_us"] / part["ukf_us_p10"], part["smooth_us"] / part["track_us"]
        rows.append(
            [
                f"`oarlock.track` of a sample, n = {part['n']}",
                f"{part['track_us']:.1f} µs ({steps:.2f} times a step)",
            ]
        )
        rows.append(
            [
                f"one pass of `oarlock.smooth` after that, a sample, n = {part['n']}",
                f"{part['smooth_us']:.1f} µs ({passes:.2f} times `track`)",
            ]
        )
    body = user["full_body"]
    rows.append(
        [
            f"a person with {body['units']} units at 100 Hz, n = {body['n']}, one hypothesis",
            f"{body['times_real_time']:.1f} times faster than real time",
        ]
    )
    rows.append(
        [
            "the same, mean of the first 30 s",
            f"{body['start_times_real_time']:.1f} times faster than real time",
        ]
    )
    rows += [
        [f"instructions of a step (callgrind), {name}", f"{each['median']:.0f}, p99 {each['p99']:.0f}"]
        for name, each in instructions.items()
    ]
    return rows


def _recordings(found: Row) -> list[list[object]]:
    minutes = found["duration_s"] / 60
    hour = "an hour" if minutes == 60 else f"an hour (extrapolated from {minutes:.0f} min)"
    time, verb = f"processor time, {hour}", "`oarlock track --smooth` with its report"
    smoothed_s = found["smooth"]["hour"]["spent_s"] - found["recording"]["hour"]["spent_s"]
    rows: list[list[object]] = [
        [f"peak memory, {hour}, n = 72: {what}", f"{found[what]['hour']['peak_mib']:.0f} MiB"]
        for what in ("recording", "track", "smooth")
    ]
    rows += [
        [f"{time}: reading a folder, Parquet", f"{found['recording']['hour']['spent_s']:.1f} s"],
        [f"{time}: reading a folder, CSV", f"{found['csv']['hour']['spent_s']:.1f} s"],
        [f"{time}, n = 72: `track` and one pass of `smooth`", f"{smoothed_s:.0f} s"],
        [f"{time}: {verb}", f"{found['verb']['hour']['spent_s']:.0f} s"],
        [f"the same for {found['short_s']:.0f} s", f"{found['verb']['short']['spent_s']:.1f} s"],
    ]
    return rows


def _others(user: Row) -> str:
    paper = user["paper"]
    rows = [(f"Oarlock, {name}", user[f"{name}_steps_s"], "") for name in ("ukf", "ekf", "factorised")]
    rows += [
        (f"{row['name']} ({row['package']} {row['version']})", row["steps_s"], row["problem"])
        for row in user["others"]
    ]
    asked = f"{paper['n']} states, {paper['m']} readings; {paper['machine']}"
    rows.append((f"the source, {paper['program']}", paper["steps_s"], asked))
    rows.sort(key=lambda row: -row[1])
    rates = table(
        ["software, n = 41", "steps/s", "problem"], [[name, f"{rate:.0f}", text] for name, rate, text in rows]
    )
    if user["missing"]:
        rates += f"\n\nNot installed where this was measured: {', '.join(user['missing'])}."
    return rates
