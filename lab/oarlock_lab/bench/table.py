"""One table in Markdown of everything that was measured."""

from __future__ import annotations

from typing import Any

from oarlock_lab.pages.record import made_text
from oarlock_lab.pages.sections import table

Row = dict[str, Any]


def write(figures: dict[str, Any]) -> str:
    """All tables, with the machine in the first line."""
    user = figures["user"]
    here = user["machine"]
    processor = f"{here['processor']}, {user['cores']} cores, {here['system']}"
    parts = [
        f"{made_text(figures)}, on {processor}, Python {here['python']};\nthe machine's load was "
        f"{figures['load']:.1f}. Times in µs, medians; in brackets: how many times faster than the textbook.",
        f"The textbook's filter takes about {user['usual_textbook_us']:.0f} µs at 41 states on one core of a 3.7 GHz\n"
        "Zen 4; where it is slower here, look at times and not at ratios.",
        _ratios(figures["ratios"]),
        _latency(figures["latency"], user),
        _rest(figures),
        _others(user),
    ]
    return "\n\n".join(parts) + "\n"


def _us(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}"


FILTERS = ("ukf", "ekf", "factorised", "ukf, portable instructions")


def _ratios(rows: list[Row]) -> str:
    """A line for each body: times, and how many times faster than the textbook's filter."""
    timed = {(row["body"], row["filter"]): row for row in rows}
    lines = []
    for body in dict.fromkeys(row["body"] for row in rows):
        cells = [timed[body, name] for name in FILTERS]
        times = [f"{_us(row['us'])} ({row['ratio']:.1f})" for row in cells]
        lines.append([body, cells[0]["n"], cells[0]["m"], *times, _us(cells[0]["textbook_us"])])
    return table(["body", "n", "m", *FILTERS, "textbook's UKF"], lines)


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
    rows += _whole(user)
    apart = figures["apart"]
    text = f"{apart['apart_ms']:.1f} ms ({apart['ratio']:.2f} times that of sensors that do)"
    rows.append(["tracking a second of sensors that do not tick together", text])
    started = figures["startup"]
    rows.append(
        [
            f"processor time of {', '.join(f'`{part}`' for part in started)}",
            f"{', '.join(f'{time_s:.2f}' for time_s in started.values())} s",
        ]
    )
    rows += _recordings(figures["recordings"])
    return table(["what", "figure"], rows)


def _whole(user: Row) -> list[list[object]]:
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
            f"{body['times_real_time']:.1f} times faster than real time; mean of the first 30 s "
            f"{body['start_times_real_time']:.1f}",
        ]
    )
    return rows


def _recordings(figures: Row) -> list[list[object]]:
    verb = "`oarlock track --smooth` with its report"
    smoothed_s = figures["smooth"]["hour"]["spent_s"] - figures["recording"]["hour"]["spent_s"]
    peaks = ", ".join(
        f"{figures[stage]['hour']['peak_mib']:.0f}" for stage in ("recording", "track", "smooth")
    )
    read = ", ".join(f"{figures[stage]['hour']['spent_s']:.1f}" for stage in ("recording", "csv"))
    spent_s = [figures["verb"][length]["spent_s"] for length in ("hour", "short")]
    rows: list[list[object]] = [
        ["peak memory, n = 72: recording, track, smooth", f"{peaks} MiB"],
        ["processor time: reading a folder, Parquet, CSV", f"{read} s"],
        ["processor time, n = 72: `track` and one pass of `smooth`", f"{smoothed_s:.0f} s"],
        [f"processor time: {verb}", f"{spent_s[0]:.0f} s; of {figures['short_s']:.0f} s {spent_s[1]:.1f} s"],
    ]
    minutes = figures["duration_s"] / 60
    hour = "an hour" if minutes == 60 else f"an hour (extrapolated from {minutes:.0f} min)"
    return [["of " + hour, ""], *rows]


def _others(user: Row) -> str:
    paper = user["paper"]
    rows = [(f"Oarlock, {name}", user[f"{name}_steps_s"], "") for name in ("ukf", "ekf", "factorised")]
    rows += [
        (f"{row['name']} ({row['package']} {row['version']})", row["steps_s"], row["problem"])
        for row in user["others"]
    ]
    problem = f"{paper['n']} states, {paper['m']} readings; {paper['machine']}"
    rows.append((f"the source, {paper['program']}", paper["steps_s"], problem))
    rows.sort(key=lambda row: -row[1])
    rates = table(
        ["software, n = 41", "steps/s", "problem"], [[name, f"{rate:.0f}", text] for name, rate, text in rows]
    )
    if user["missing"]:
        rates += f"\n\nNot installed where this was measured: {', '.join(user['missing'])}."
    return rates
