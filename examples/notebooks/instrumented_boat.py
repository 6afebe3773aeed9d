"""An instrumented boat: from raw signals to calibrated angles and strokes. For biomechanists."""

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
    # An instrumented boat

    You measured a sculler with five inertial units, a seat encoder and oar encoders. You want joint angles
    with an honest uncertainty, and numbers of each stroke. This notebook takes about a minute. The
    recording is simulated with errors that the model does not have (soft tissue, a bending spine, units
    mounted off), so the truth is known. With your own data, replace the next cell by

        recording = oarlock.load_recording("my-recording")
    """)
    return


@app.cell
def _():
    import oarlock
    from oarlock import rowing

    model = oarlock.load_model("sculler")
    trial = rowing.simulate_field(model, duration_s=15.0, seed=3)
    recording, truth = trial.recording, trial.truth
    recording
    return (
        oarlock,
        rowing,
        model,
        trial,
        recording,
        truth,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    Look at raw signals first: a unit at the end of its range, a dropout or a wrong unit is seen at once.
    """)
    return


@app.cell
def _(recording):
    recording.plot("back")[0]
    return


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## Nominal mounts first

    `track` filters; `smooth` then uses later samples as well. Without a calibration the model's nominal
    mounts and lengths are assumed. Open **Notes**: they say what limits this result and what to do.
    """)
    return


@app.cell
def _(model, oarlock, recording):
    nominal = oarlock.smooth(oarlock.track(model, recording, progress=True), progress=True)
    nominal
    return (nominal,)


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## Calibrate from the movement itself

    The hands hold the handles, so ordinary rowing determines mounts, lengths and zeros of encoders. The
    last third of the recording is held out: a result is kept only if it explains that third better.
    `progress=True` shows how far it is; the stop button ends it within a second.
    """)
    return


@app.cell
def _(model, oarlock, recording):
    calibration = oarlock.calibration.calibrate_motion(model, recording, progress=True)
    calibration
    return (calibration,)


@app.cell
def _(calibration, model, oarlock, recording, truth):
    track = oarlock.smooth(oarlock.track(model, recording, calibration, progress=True), progress=True)
    track.plot(["trunk", ("r_elbow_flexion", "l_elbow_flexion")], truth=truth)[0]
    return (track,)


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    The shaded bands are 95 %; the dashed line is the truth, which you do not have for your own rower. Was
    it worth it?
    """)
    return


@app.cell
def _(nominal, oarlock, track, truth):
    errors = {
        name: oarlock.evaluate(estimate, truth).mean_rmse_deg()
        for name, estimate in (("nominal mounts", nominal), ("calibrated", track))
    }
    errors
    return (errors,)


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    Errors of a real rower are of this size: skin and spine move as no chain of rigid links does.
    Calibration removes what is constant, not what moves. Do not expect the 0.02 deg of an ideal simulation.

    ## Strokes

    Median, and 5th and 95th percentile, over the strokes. `strokes.to_pandas()` has a row for each stroke.
    """)
    return


@app.cell
def _(rowing, track):
    from dataclasses import asdict

    import pandas as pd

    strokes = rowing.technique(track).strokes
    pd.DataFrame([asdict(row) for row in rowing.summarise_strokes(strokes)]).drop(columns="name").round(
        1
    ).head(20)
    return (
        asdict,
        pd,
        strokes,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## On to your own statistics

    Every array has its unit in its name. `to_pandas`, `to_polars` and `to_xarray` give all of them; in an
    editor or notebook, `track.` and the tab key complete the names of joints.
    """)
    return


@app.cell
def _(track):
    elbow = track.hinge("r_elbow_flexion")
    _low, _high = elbow.angle_deg.min(), elbow.angle_deg.max()
    print(f"right elbow: {_low:.1f} to {_high:.1f} deg, band +- {1.96 * elbow.std_deg.mean():.2f} deg")
    track.to_pandas()[
        ["time_s", "r_elbow_flexion_rad", "r_elbow_flexion_std_rad", "r_elbow_flexion_velocity_rad_s"]
    ].head()
    return (elbow,)


if __name__ == "__main__":
    app.run()
