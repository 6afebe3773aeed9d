"""`oarlock simulate`: a sculler's recording with its truth."""

from __future__ import annotations

from typing import Annotated

import typer

from oarlock.cli.options import Force, Json, ModelName, OutFolder, Settings, assignments, example
from oarlock.cli.simulate_field import Effect, Field, RateHz, Strength, asked_effects, simulate_in_the_field
from oarlock.cli.terminal import UsageError, new_folder, pairs, print_json, progress, say, steps, verb


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "simulate",
        short_help="Write a simulated sculler's recording and its truth.",
        epilog=example(
            "oarlock simulate --out trial",
            "oarlock simulate --out trial --duration-s 600 --rate-spm 20,34 --condition S-NB",
            "oarlock simulate --model my.toml --set l_ua_r=0.31 --seed 7 --out trial",
            "oarlock simulate --out trial --field careful --rate-spm 20,34",
            "oarlock simulate --out trial --field off --effect mount_error_rad=0.09 --effect packet_loss=0.05",
        ),
    )(simulate)


@verb
def simulate(
    out: OutFolder,
    model: ModelName = "sculler",
    duration_s: Annotated[float, typer.Option("--duration-s", metavar="S", help="Length, s.")] = 40.0,
    rate_spm: Annotated[
        str, typer.Option("--rate-spm", metavar="SPM", help="Strokes per minute; 20,34 goes from 20 to 34.")
    ] = "24",
    condition: Annotated[
        str,
        typer.Option(
            "--condition",
            metavar="S-NB|B-NB|S-B|B-B",
            help="S boat still, B surging; NB sensors without, B with constant biases.",
        ),
    ] = "B-B",
    seed: Annotated[int, typer.Option("--seed", help="Of the strokes' variation and the noise.")] = 0,
    field: Field = None,
    effect: Effect = None,
    strength: Strength = 1.0,
    rate_hz: RateHz = 125.0,
    settings: Settings = None,
    force: Force = False,
    json_output: Json = False,
) -> None:
    """Simulate a sculler: write a recording, and the truth into its folder truth/."""
    from oarlock import load_model
    from oarlock.rowing import CONDITIONS
    from oarlock.rowing.experiment import simulate_sculling

    if condition not in CONDITIONS:
        raise UsageError(f"--condition {condition}: choose one of {', '.join(CONDITIONS)}")
    rates = _rates(rate_spm)
    loaded = load_model(model, parameters=assignments(settings, "--set"))
    effects = asked_effects(field, effect, strength, rate_hz)
    new_folder(out, force)
    if effects is not None:
        simulate_in_the_field(
            loaded, effects, out, (condition, duration_s, rates, rate_hz, seed), model, json_output
        )
        return
    with progress("simulating"):
        truth, recording = simulate_sculling(loaded, condition, duration_s, rates, seed)
    recording.save(out)
    truth.save(out / "truth")
    if json_output:
        print_json({"recording": out, "truth": out / "truth", "streams": recording.names, "seed": seed})
        return
    say(f"Wrote {out}", style="bold")
    pairs(
        [
            ("recording", f"{out}  ({recording.start_s:.1f} to {recording.end_s:.1f} s)"),
            ("streams", ", ".join(recording.names)),
            ("truth", out / "truth"),
        ]
    )
    steps(
        f"oarlock track {out} --model {model} --out {out}-track",
        f"oarlock evaluate {out}-track {out}/truth",
    )


def _rates(text: str) -> float | tuple[float, ...]:
    try:
        rates = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--rate-spm {text}: expected a number, or two with a comma such as 20,34") from None
    return rates[0] if len(rates) == 1 else rates
