"""CSV files of cheap sensors, and stroke tables of the club's devices. For club analysts."""

import marimo

__generated_with = "0.25.2"
app = marimo.App()


@app.cell
def _():
    import marimo as mo

    return (mo,)


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    # CSV files and a stroke table

    Your sensors write CSV files, each in its own way: a decimal comma, the time of day, g instead of m/s²,
    a unit mounted upside down. One small text file, the **mapping**, says what is what. You write it once
    for each kind of sensor.
    """)
    return


@app.cell
def _():
    from pathlib import Path

    import oarlock

    examples = Path(oarlock.__file__).resolve().parents[2] / "examples"  # your own folder instead
    mapping = examples / "club_csv" / "mapping.toml"
    print(mapping.read_text(encoding="utf-8"))
    return (
        Path,
        oarlock,
        examples,
        mapping,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    `import_recording` reads the files that the mapping names and puts both on one clock, in SI units.
    """)
    return


@app.cell
def _(mapping, oarlock):
    recording = oarlock.import_recording(mapping)
    recording
    return (recording,)


@app.cell
def _(recording):
    recording.plot(["back", "seat"])[0]
    return


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## From signals to angles

    Two sensors, a unit on the trunk and the seat's position, do not determine a whole rower. A tree tracks the
    model all the same; joints that no sensor determines are not "observed": do not use them.
    """)
    return


@app.cell
def _(oarlock, recording):
    model = oarlock.load_model("sculler").without(closures=["r_grip", "l_grip"])
    nominal = oarlock.smooth(oarlock.track(model, recording, structure="tree"))
    observed = [name for name in nominal.joint_names if nominal[name].observed.mean() > 0.5]
    print("determined by these sensors:", ", ".join(observed))
    print(*(note for note in nominal.notes if "not observed" not in note), sep="\n")
    return (
        model,
        nominal,
        observed,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    Read the notes before the curves. This one says that the trunk leans beyond what a person can, all the
    time: the unit is not mounted as the model file assumes. So find out how it is mounted. The rower sat
    upright during the first second, and then leaned to and fro: that suffices.
    """)
    return


@app.cell
def _(model, oarlock, observed, recording):
    calibration = oarlock.calibration.calibrate_sagittal(
        model, recording, {"trunk": 0.0}, (recording.start_s, 0.9), sensors=["back"]
    )
    track = oarlock.smooth(oarlock.track(model, recording, calibration, structure="tree"))
    track.plot(observed)[0]
    return (
        calibration,
        track,
    )


@app.cell
def _(track):
    import numpy as np

    trunk, seat = track.hinge("trunk"), track.slide("seat")
    print(f"trunk leans {trunk.angle_deg.min():.0f} to {trunk.angle_deg.max():.0f} deg")
    print(f"the seat moves {np.ptp(seat.position_cm):.0f} cm")
    return (
        np,
        trunk,
        seat,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## A table of the club's stroke coach

    Tables of NK, RP3, ErgStick, Quiske and others are read without a mapping.
    """)
    return


@app.cell
def _(examples):
    from oarlock import rowing

    strokes = rowing.load_stroke_export(examples / "strokes" / "speedcoach_empower.csv")
    table = strokes.to_pandas()
    table[
        ["time_s", "rate_per_min", "speed_m_s", "catch_angle_rad", "finish_angle_rad", "peak_force_n"]
    ].head()
    return (
        rowing,
        strokes,
        table,
    )


@app.cell
def _(np, table):
    import matplotlib.pyplot as plt

    _figure, _axes = plt.subplots(2, 1, sharex=True, figsize=(7.5, 4), layout="constrained")
    _axes[0].plot(table.index, table.rate_per_min, "o-", color="#2a78b8")[0]
    _axes[0].set_ylabel("strokes a minute")
    _axes[1].plot(table.index, np.degrees(table.catch_angle_rad), "o-", color="#d9601a")[0]
    _axes[1].set_ylabel("catch angle, deg")
    _axes[1].set_xlabel("stroke")
    _axes[0]
    return (plt,)


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    Next: [docs/import.md](../../docs/import.md) has all keys of a mapping and all formats. For a report
    with a moving figure you need at least units on trunk and upper arms: `oarlock run`.
    """)
    return


if __name__ == "__main__":
    app.run()
